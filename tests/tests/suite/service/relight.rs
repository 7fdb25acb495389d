use std::fs;

use bake::KeptLight;
use protocol::api::submit_scene_header::Source;
use protocol::api::{
    Colour, GetJobRequest, Job, LightChange, LightGroup, OutputOptions, Relight, SubmitSceneHeader,
};
use tests::service::ServiceProcess;
use tonic::{Code, Status};
use tonic_types::StatusExt;

use super::bytes::ran;
use super::{Asker, ENDLESS, QUICK, Room, cornell, text};

/// What is changed, as `relight` and `submit --relight` are told.
const EVENING: [&str; 2] = ["--light", "lamp=0.5,0.4,0.3"];

/// What `relight` makes of cornell.
fn relit(room: &Room) -> Vec<u8> {
    let kept = room.folder.path().join("light");
    ran(
        room,
        "solved.glb",
        "solve",
        &[&QUICK[..], &["--threads", "2", "--keep-light", text(&kept)]].concat(),
    );
    ran(room, "relit.glb", "relight", &[&EVENING[..], &["--kept", text(&kept)]].concat())
}

fn relight(job: &str, light: &str) -> SubmitSceneHeader {
    let factor = Some(Colour { r: 0.5, g: 0.4, b: 0.3 });
    let lights = vec![LightChange { light: light.into(), factor }];
    let source = Some(Source::Relight(Relight { job_id: job.into(), lights, sky: None }));
    SubmitSceneHeader { source, ..SubmitSceneHeader::default() }
}

fn done(service: &ServiceProcess, asker: &mut Asker, job: &str) -> Job {
    let _ = service.result(job);
    let request = GetJobRequest { id: job.into() };
    asker.ask(request, async |client, request| client.get_job(request).await).unwrap()
}

fn missing(status: &Status) -> String {
    assert_eq!(status.code(), Code::FailedPrecondition, "{status}");
    status.get_error_details().precondition_failure().unwrap().violations[0].r#type.clone()
}

#[test]
fn a_job_that_is_done_is_lit_otherwise_with_the_bytes_of_the_command() {
    let room = Room::new();
    let expected = relit(&room);
    let service = room.start(&[]);
    let mut asker = Asker::new(&service, None);
    let baked = service.submit(&cornell(), &QUICK);
    let outcome = done(&service, &mut asker, &baked).outcome.unwrap();
    assert!(outcome.can_be_relit && outcome.lights.contains(&"lamp".to_owned()), "{:?}", outcome.lights);

    let output = room.folder.path().join("evening.glb");
    let relight_of = |job: &str| {
        let said = service.ask(&[&["submit", "--relight", job, "-o", text(&output)], &EVENING[..]].concat());
        assert!(said.success, "{}", said.errors);
        assert!(fs::read(&output).unwrap() == expected, "the lit file differs");
        said.text.lines().next().unwrap().to_owned()
    };
    let first = relight_of(&baked);
    // What was relit is no longer needed, and what it left behind is.
    assert!(service.ask(&["delete", &baked]).success);
    let second = relight_of(&first);
    let job = done(&service, &mut asker, &second);
    assert_eq!(job.relight_of, first);
    assert!(job.outcome.unwrap().report_json.contains("error_as_baked"));
    assert_eq!(room.names("light"), [baked]);
    for job in [&first, &second] {
        assert!(service.ask(&["delete", job]).success);
    }
    for folder in ["light", "scenes", "results", "jobs"] {
        assert_eq!(room.names(folder), Vec::<String>::new(), "{folder}");
    }
}

#[test]
fn a_relight_survives_a_killed_service() {
    let room = Room::new();
    let expected = relit(&room);
    let mut service = room.start(&["--jobs", "1"]);
    let baked = service.submit(&cornell(), &QUICK);
    let _ = service.result(&baked);
    let before_it = service.submit(&cornell(), &ENDLESS);
    let submit = [&["submit", "--relight", &baked, "--key", "evening"], &EVENING[..]].concat();
    let said = service.ask(&submit);
    assert!(said.success, "{}", said.errors);
    let job = said.text.trim().to_owned();
    assert!(service.ask(&["delete", &baked]).success);
    service.kill();
    let service = room.start(&["--jobs", "1"]);
    // The same key gives the same job, although nobody could relight that one any more.
    assert_eq!(service.ask(&submit).text.trim(), job);
    assert_eq!(service.ask(&["submit", "--relight", &baked, "--key", "morning"]).text, "");
    assert!(service.ask(&["cancel", &before_it]).success);
    assert!(service.result(&job) == expected, "the lit file differs");
}

#[test]
fn what_cannot_be_relit_is_refused() {
    let room = Room::new();
    let service = room.start(&["--jobs", "1"]);
    let mut asker = Asker::new(&service, None);
    let slow = service.submit(&cornell(), &ENDLESS);
    assert_eq!(missing(&asker.submit(relight(&slow, "lamp"), &[]).unwrap_err()), "FINISHED");
    assert!(service.ask(&["cancel", &slow]).success);
    let unknown = asker.submit(relight("0123456789abcdef0123456789abcdef", "lamp"), &[]).unwrap_err();
    assert_eq!(unknown.code(), Code::NotFound);
    let baked = service.submit(&cornell(), &QUICK);
    let _ = service.result(&baked);
    let wrong = asker.submit(relight(&baked, "lantern"), &[]).unwrap_err();
    assert_eq!(wrong.code(), Code::InvalidArgument);
    assert!(wrong.message().contains("lantern") && wrong.message().contains("lamp"), "{wrong}");
    let factor = Some(Colour { r: -1.0, g: 0.0, b: 0.0 });
    let mut negative = relight(&baked, "lamp");
    if let Some(Source::Relight(relight)) = &mut negative.source {
        relight.lights[0].factor = factor;
    }
    assert_eq!(asker.submit(negative, &[]).unwrap_err().code(), Code::InvalidArgument);

    let mut grouped = relight(&baked, "lamp");
    let group = LightGroup { name: "some".into(), lights: vec!["lantern".into()] };
    grouped.output = Some(OutputOptions { groups: vec![group], ..OutputOptions::default() });
    let wrong = asker.submit(grouped, &[]).unwrap_err();
    assert_eq!(wrong.get_error_details().bad_request().unwrap().field_violations[0].field, "output.groups");
    // However much is wrong, the answer has room for it.
    let mut many = relight(&baked, "lamp");
    if let Some(Source::Relight(relight)) = &mut many.source {
        relight.lights = (0..900).map(|_| LightChange { light: "x".repeat(201), factor: None }).collect();
    }
    assert_eq!(asker.submit(many, &[]).unwrap_err().code(), Code::InvalidArgument);

    // A sky where there was none is known only when the light is looked at.
    let said = service.ask(&["submit", "--relight", &baked, "--sky", "1,1,1", "--watch"]);
    assert!(!said.success && said.errors.contains("without a sky"), "{}", said.errors);
}

#[test]
fn light_that_takes_too_much_room_is_not_kept() {
    let room = Room::new();
    let service = room.start(&["--light-per-job", "0"]);
    let mut asker = Asker::new(&service, None);
    let baked = service.submit(&cornell(), &QUICK);
    assert!(!done(&service, &mut asker, &baked).outcome.unwrap().can_be_relit);
    assert_eq!(missing(&asker.submit(relight(&baked, "lamp"), &[]).unwrap_err()), "LIGHT");
    assert_eq!(room.names("light"), Vec::<String>::new());
}

#[test]
fn light_of_another_release_fails_the_relight_and_nothing_else() {
    let room = Room::new();
    let mut service = room.start(&["--jobs", "1"]);
    let baked = service.submit(&cornell(), &QUICK);
    let _ = service.result(&baked);
    service.kill();
    let kept = room.data().join("light").join(&baked);
    let length = fs::read(&kept).unwrap().len();
    assert!(KeptLight::from_bytes(&fs::read(&kept).unwrap()).is_ok());
    fs::write(&kept, [b"halflight light\n0.0.1 protocol 1\n".as_slice(), &vec![0; length]].concat()).unwrap();
    let service = room.start(&["--jobs", "1"]);
    let said = service.ask(&[&["submit", "--relight", &baked, "--watch"], &EVENING[..]].concat());
    assert!(!said.success && said.errors.contains("release 0.0.1"), "{}", said.errors);
    assert!(service.ask(&["jobs"]).success);
}
