use std::fs;

use protocol::api::submit_scene_header::Source;
use protocol::api::submit_scene_request::Body;
use protocol::api::{FetchResultRequest, GetJobRequest, SubmitSceneHeader};
use tonic::{Code, Status};
use tonic_types::StatusExt;

use super::{Asker, Room, cornell, header, text};

/// The fields that a status says are wrong.
fn fields(status: &Status) -> Vec<String> {
    assert_eq!(status.code(), Code::InvalidArgument, "{status}");
    let details = status.get_error_details();
    let wrong = &details.bad_request().unwrap().field_violations;
    wrong.iter().map(|violation| violation.field.clone()).collect()
}

#[test]
fn wrong_submissions_are_refused_by_the_field() {
    let room = Room::new();
    let service = room.start(&["--upload-size", "1", "--vertices-per-job", "1000000"]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    let changed = |change: &dyn Fn(&mut SubmitSceneHeader)| {
        let mut header = header(&scene);
        change(&mut header);
        header
    };
    let file = |header: &mut SubmitSceneHeader, change: &dyn Fn(&mut protocol::api::SceneFile)| {
        if let Some(Source::File(file)) = &mut header.source {
            change(file);
        }
    };
    for (field, wrong) in [
        ("name", changed(&|header| header.name = "x".repeat(201))),
        ("name", changed(&|header| header.name = "a\nb".into())),
        ("idempotency_key", changed(&|header| header.idempotency_key = "x".repeat(201))),
        ("priority", changed(&|header| header.priority = 101)),
        ("bake.error", changed(&|header| header.bake.as_mut().unwrap().error = Some(0.02))),
        ("bake.max_vertices", changed(&|header| header.bake.as_mut().unwrap().max_vertices = Some(u64::MAX))),
        ("source", changed(&|header| header.source = None)),
        ("file.sha256", changed(&|header| file(header, &|file| file.sha256 = vec![1; 31].into()))),
        ("file.sha256", changed(&|header| file(header, &|file| file.sha256 = vec![1; 32].into()))),
        ("file.size", changed(&|header| file(header, &|file| file.size = 0))),
        ("file.size", changed(&|header| file(header, &|file| file.size -= 1))),
        ("file.size", changed(&|header| file(header, &|file| file.size += 1))),
    ] {
        let refused = asker.submit(wrong, &[&scene]).unwrap_err();
        assert!(fields(&refused).iter().any(|name| name == field), "{field}: {refused}");
    }
    let refused = asker.submit_bodies(vec![Body::Chunk(scene.clone().into())]).unwrap_err();
    assert_eq!(fields(&refused), ["header"]);
    let twice = vec![Body::Header(header(&scene)), Body::Header(header(&scene))];
    assert_eq!(fields(&asker.submit_bodies(twice).unwrap_err()), ["chunk"]);
    let large = changed(&|header| file(header, &|file| file.size = (1 << 20) + 1));
    let refused = asker.submit(large, &[&scene]).unwrap_err();
    assert_eq!(refused.code(), Code::ResourceExhausted);
    assert_eq!(refused.get_error_details().quota_failure().unwrap().violations[0].subject, "upload");
    // Nothing of all that is left.
    for folder in ["jobs", "scenes", "passing"] {
        assert_eq!(room.names(folder), <[&str; 0]>::default(), "{folder}");
    }
}

#[test]
fn jobs_that_are_none_and_files_that_are_not_there() {
    let room = Room::new();
    let service = room.start(&["--jobs", "1"]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    for id in ["", "x", "../../../etc/passwd", "00000000000000000000000000000000"] {
        let get = GetJobRequest { id: id.into() };
        let refused = asker.ask(get, async |client, request| client.get_job(request).await).unwrap_err();
        assert_eq!(refused.code(), Code::NotFound);
        assert_eq!(refused.get_error_details().resource_info().unwrap().resource_name, id);
    }
    let mut slow = header(&scene);
    slow.bake.as_mut().unwrap().mesh_error = Some(0.001);
    asker.submit(slow.clone(), &[&scene]).unwrap();
    let queued = asker.submit(slow, &[]).unwrap().id;
    for (present, kind) in [(false, "FINISHED"), (true, "RUNNING")] {
        let fetch = FetchResultRequest { id: queued.clone(), present, offset: 0 };
        let refused = asker.ask(fetch, async |client, request| client.fetch_result(request).await);
        let refused = refused.unwrap_err();
        assert_eq!(refused.code(), Code::FailedPrecondition);
        let details = refused.get_error_details();
        assert_eq!(details.precondition_failure().unwrap().violations[0].r#type, kind);
    }
}

/// The job fails, with the importer's words; the service lives on.
#[test]
fn files_that_are_no_scenes_fail_and_read_nothing_beside_them() {
    let room = Room::new();
    let service = room.start(&[]);
    let external = |uri: &str| {
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":8,"uri":"{uri}"}}],"scenes":[{{"nodes":[]}}]}}"#
        )
    };
    for (name, content, word) in [
        ("noise.glb", "this is no glTF".to_owned(), "glTF"),
        ("empty.gltf", r#"{"asset":{"version":"2.0"}}"#.to_owned(), "scene"),
        ("beside.gltf", external("layout"), "may not refer to files"),
        ("above.gltf", external("../layout"), "may not refer to files"),
        ("absolute.gltf", external("/etc/passwd"), "may not refer to files"),
    ] {
        let path = room.file(name, content.as_bytes());
        let watched = service.ask(&["submit", text(&path), "--watch"]);
        assert!(!watched.success, "{name}");
        assert!(watched.errors.contains("failed: ") && watched.errors.contains(word), "{}", watched.errors);
        assert!(!watched.errors.contains(text(room.folder.path())), "{}", watched.errors);
    }
    let fine = service.submit(&cornell(), &["--mesh-error", "0.05"]);
    assert!(!service.result(&fine).is_empty());
    let unknown = service.ask(&["submit", text(&cornell()), "--watch", "--group", "x=nobody"]);
    assert!(
        !unknown.success && unknown.errors.contains("the scene has no light nobody"),
        "{}",
        unknown.errors
    );
}

#[test]
fn a_client_has_so_many_jobs_and_no_more() {
    let room = Room::new();
    let service = room.start(&["--jobs", "1", "--queue-per-client", "2"]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    let mut slow = header(&scene);
    slow.bake.as_mut().unwrap().mesh_error = Some(0.001);
    asker.submit(slow.clone(), &[&scene]).unwrap();
    asker.submit(slow.clone(), &[]).unwrap();
    let refused = asker.submit(slow, &[]).unwrap_err();
    assert_eq!(refused.code(), Code::ResourceExhausted);
    let details = refused.get_error_details();
    assert_eq!(details.quota_failure().unwrap().violations[0].subject, "client:everybody");
}
