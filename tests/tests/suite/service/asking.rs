use std::fs;

use protocol::api::fetch_result_response::Body as Part;
use protocol::api::submit_scene_request::Body;
use protocol::api::{
    BakeOptions, CancelJobRequest, DeleteJobRequest, FetchResultRequest, GetJobRequest, ListJobsRequest,
    State, SubmitSceneRequest, WatchJobRequest,
};
use sha2::{Digest, Sha256};
use tokio::task::JoinSet;
use tonic::Code;
use tonic_types::StatusExt;

use super::{Asker, ENDLESS, HANGS, Room, cornell, header, wait_for};
use crate::telemetry::assert_parts_sum_up;

#[test]
fn the_same_key_gives_the_same_job() {
    let room = Room::new();
    let service = room.start(&[]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    let mut header = header(&scene);
    header.idempotency_key = "monday".into();
    let first = asker.submit(header.clone(), &[&scene]).unwrap();
    assert_eq!(asker.submit(header.clone(), &[&scene]).unwrap().id, first.id);
    assert_eq!(asker.submit(header.clone(), &[]).unwrap().id, first.id);
    drop((asker, service));
    // A restart does not forget it.
    let service = room.start(&[]);
    let mut asker = Asker::new(&service, None);
    assert_eq!(asker.submit(header.clone(), &[]).unwrap().id, first.id);
    header.priority = 3;
    let refused = asker.submit(header.clone(), &[]).unwrap_err();
    assert_eq!(refused.code(), Code::AlreadyExists);
    assert_eq!(refused.get_error_details().resource_info().unwrap().resource_name, first.id);
    header.idempotency_key = "tuesday".into();
    assert_ne!(asker.submit(header, &[]).unwrap().id, first.id);
}

/// However close to each other the submissions are: while one is on its way to the disk, the others wait for it.
#[test]
fn the_same_key_at_the_same_time_gives_one_job() {
    let room = Room::new();
    let service = room.start(&["--uploads-per-client", "100"]);
    let asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    for round in 0..5 {
        let mut header = header(&scene);
        header.idempotency_key = format!("round {round}");
        let header = SubmitSceneRequest { body: Some(Body::Header(header)) };
        let chunk = SubmitSceneRequest { body: Some(Body::Chunk(scene.clone().into())) };
        let ids = asker.runtime.block_on(async {
            let mut submissions = JoinSet::new();
            for _ in 0..20 {
                let (mut client, messages) = (asker.client.clone(), [header.clone(), chunk.clone()]);
                submissions.spawn(async move {
                    client.submit_scene(tokio_stream::iter(messages)).await.unwrap().into_inner().id
                });
            }
            submissions.join_all().await
        });
        assert!(ids.iter().all(|id| *id == ids[0]), "{ids:?}");
        assert_eq!(room.names("jobs").len(), round + 1);
    }
}

#[test]
fn a_scene_is_sent_once() {
    let room = Room::new();
    let service = room.start(&[]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    let refused = asker.submit(header(&scene), &[]).unwrap_err();
    assert_eq!(refused.code(), Code::FailedPrecondition);
    let details = refused.get_error_details();
    assert_eq!(details.precondition_failure().unwrap().violations[0].r#type, "SCENE");
    let (half, rest) = scene.split_at(scene.len() / 2);
    let first = asker.submit(header(&scene), &[half, rest]).unwrap();
    let second = asker.submit(header(&scene), &[]).unwrap();
    assert_ne!(first.id, second.id);
    assert_eq!(room.names("scenes").len(), 1);
    // It stays for as long as a job is of it.
    let delete = |asker: &mut Asker, id: String| {
        asker.ask(DeleteJobRequest { id }, async |client, request| client.delete_job(request).await)
    };
    delete(&mut asker, first.id).unwrap();
    asker.submit(header(&scene), &[]).unwrap();
    let list = ListJobsRequest::default();
    let jobs = asker.ask(list, async |client, request| client.list_jobs(request).await).unwrap().jobs;
    assert_eq!(jobs.len(), 2);
    for job in jobs {
        delete(&mut asker, job.id).unwrap();
    }
    wait_for("all files are gone", || {
        ["jobs", "scenes", "results", "checkpoints", "passing"]
            .iter()
            .all(|folder| room.names(folder).is_empty())
    });
    assert_eq!(asker.submit(header(&scene), &[]).unwrap_err().code(), Code::FailedPrecondition);
}

#[test]
fn jobs_are_listed_by_pages_newest_first() {
    let room = Room::new();
    let service = room.start(&["--jobs", "1"]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    let mut submitted: Vec<String> = (0..7)
        .map(|index| {
            let mut header = header(&scene);
            header.name = format!("room {index}");
            let chunks: &[&[u8]] = &[&scene];
            asker.submit(header, if index == 0 { chunks } else { &[] }).unwrap().id
        })
        .collect();
    submitted.reverse();
    let (mut listed, mut page_token, mut pages) = (vec![], String::new(), 0);
    loop {
        let list = ListJobsRequest { page_size: 3, page_token, states: vec![] };
        let page = asker.ask(list, async |client, request| client.list_jobs(request).await).unwrap();
        listed.extend(page.jobs.into_iter().map(|job| job.id));
        page_token = page.next_page_token;
        pages += 1;
        if page_token.is_empty() {
            break;
        }
    }
    assert_eq!((listed, pages), (submitted.clone(), 3));
    let last = submitted.first().unwrap().clone();
    asker.ask(CancelJobRequest { id: last.clone() }, async |c, r| c.cancel_job(r).await).unwrap();
    let list = ListJobsRequest { states: vec![State::Cancelled.into()], ..ListJobsRequest::default() };
    let page = asker.ask(list, async |client, request| client.list_jobs(request).await).unwrap();
    assert_eq!(page.jobs.into_iter().map(|job| job.id).collect::<Vec<_>>(), [last]);
}

#[test]
fn priority_decides_who_begins() {
    let room = Room::new();
    let service = room.start(&["--jobs", "1"]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    let mut submit = |priority: i32, chunks: &[&[u8]]| {
        let mut header = header(&scene);
        // It does not end while it is looked at.
        header.bake = Some(BakeOptions {
            mesh_error: Some(0.0001),
            max_vertices: Some(2_000_000),
            ..BakeOptions::default()
        });
        header.priority = priority;
        asker.submit(header, chunks).unwrap()
    };
    submit(0, &[&scene]);
    let low = submit(-1, &[]);
    let usual = submit(0, &[]);
    let high = submit(1, &[]);
    let ahead = |id: String, asker: &mut Asker| {
        asker.ask(GetJobRequest { id }, async |client, request| client.get_job(request).await).unwrap().ahead
    };
    let found = [high, usual, low].map(|job| ahead(job.id, &mut asker));
    assert_eq!(found, [0, 1, 2]);
}

#[test]
fn a_job_is_watched_to_its_end() {
    let room = Room::new();
    let service = room.start(&[]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    let mut header = header(&scene);
    header.bake.as_mut().unwrap().mesh_error = Some(0.005);
    let id = asker.submit(header, &[&scene]).unwrap().id;
    let watch = WatchJobRequest { id: id.clone() };
    let mut jobs = asker.ask(watch, async |client, request| client.watch_job(request).await).unwrap();
    let mut seen = vec![];
    asker.runtime.block_on(async {
        while let Some(job) = tokio::time::timeout(HANGS, jobs.message()).await.unwrap().unwrap() {
            seen.push(job);
        }
    });
    assert!(seen.windows(2).all(|pair| pair[0].revision < pair[1].revision), "revisions grow");
    assert!(seen.iter().any(|job| job.progress.as_ref().is_some_and(|progress| progress.rows > 0)));
    let last = seen.last().unwrap();
    assert_eq!(last.state(), State::Done);
    let outcome = last.outcome.as_ref().unwrap();
    let report: serde_json::Value = serde_json::from_str(&outcome.report_json).unwrap();
    assert_parts_sum_up(&report);
    let rows = report["bake"]["rows"].as_u64().unwrap();
    // All of them from the one worker that there is, but those that were asked for again and were on the disk.
    let read = report["checkpoint"]["rows_read"].as_u64().unwrap();
    let [worker] = &report["workers"].as_array().unwrap()[..] else { panic!("{}", report["workers"]) };
    assert!(rows > 0 && worker["rows"].as_u64() == Some(rows - read), "{rows} rows, {read} read, {worker}");
    assert_eq!(worker["threads"], 2);
    assert_eq!(fs::metadata(room.data().join(format!("results/{id}.glb"))).unwrap().len(), outcome.size);
}

#[test]
fn a_cancelled_job_ends_and_stays_cancelled() {
    let room = Room::new();
    let mut service = room.start(&["--jobs", "1"]);
    let running = service.submit(&cornell(), &ENDLESS);
    let queued = service.submit(&cornell(), &["--mesh-error", "0.05"]);
    let checkpoint = room.data().join("checkpoints").join(&running);
    wait_for("it runs", || checkpoint.exists());
    assert!(service.ask(&["cancel", &running]).text.contains("is cancelled"));
    let watched = service.ask(&["watch", &running]);
    assert!(!watched.success && watched.errors.contains("was cancelled"), "{}", watched.errors);
    // Its place goes to the next one, and its rows go.
    assert!(!service.result(&queued).is_empty());
    wait_for("its rows are gone", || !checkpoint.exists());
    // Of one that has ended, it changes nothing.
    assert!(service.ask(&["cancel", &queued]).text.contains("is done"));
    service.kill();
    let service = room.start(&[]);
    assert!(service.ask(&["jobs"]).text.contains("cancelled"));
    assert!(service.ask(&["delete", &running]).success);
    let gone = service.ask(&["watch", &running]);
    assert!(!gone.success && gone.errors.contains("there is no job"), "{}", gone.errors);
}

/// What a job knows while it runs is a lit file too; newer ones come.
#[test]
fn the_present_state_of_a_job_can_be_fetched() {
    let room = Room::new();
    let service = room.start(&["--jobs", "1"]);
    let mut asker = Asker::new(&service, None);
    let scene = fs::read(cornell()).unwrap();
    let mut header = header(&scene);
    header.bake.as_mut().unwrap().mesh_error = Some(0.0005);
    let id = asker.submit(header, &[&scene]).unwrap().id;
    let present = |asker: &mut Asker| {
        let fetch = FetchResultRequest { id: id.clone(), present: true, offset: 0 };
        let mut parts = asker.ask(fetch, async |c, r| c.fetch_result(r).await).unwrap();
        asker.runtime.block_on(async {
            let Some(Part::Header(header)) = parts.message().await.unwrap().unwrap().body else {
                panic!("no header")
            };
            let mut bytes = vec![];
            while let Some(part) = parts.message().await.unwrap() {
                if let Some(Part::Chunk(chunk)) = part.body {
                    bytes.extend_from_slice(&chunk);
                }
            }
            (header, bytes)
        })
    };
    wait_for("it runs", || {
        let get = GetJobRequest { id: id.clone() };
        asker.ask(get, async |c, r| c.get_job(r).await).unwrap().state() == State::Running
    });
    let (header, bytes) = present(&mut asker);
    assert!(header.present > 0, "it was done too soon");
    assert_eq!((bytes.len() as u64, &bytes[..4]), (header.size, &b"glTF"[..]));
    assert_eq!(*header.sha256, *Sha256::digest(&bytes));
    assert!(gltf::Gltf::from_slice(&bytes).is_ok());
    wait_for("there is a newer one", || present(&mut asker).0.present != header.present);
    assert_eq!(room.names("passing"), <[&str; 0]>::default());
    let cancel = CancelJobRequest { id: id.clone() };
    asker.ask(cancel, async |c, r| c.cancel_job(r).await).unwrap();
}
