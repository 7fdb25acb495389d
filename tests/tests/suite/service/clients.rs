use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;

use protocol::api::{
    CancelJobRequest, DeleteJobRequest, FetchResultRequest, GetJobRequest, ListJobsRequest, WatchJobRequest,
};
use tests::service::ServiceProcess;
use tonic::Code;
use tonic_types::StatusExt;

use super::{Asker, Room, cornell, header, text};

const ANN: &str = "0123456789abcdef";
const BOB: &str = "fedcba9876543210";

fn start(room: &Room) -> ServiceProcess {
    let clients = room.file("clients", format!("ann {ANN}\nbob {BOB}\n").as_bytes());
    room.start(&["--clients", text(&clients)])
}

#[test]
fn clients_see_nothing_of_each_other() {
    let room = Room::new();
    let service = start(&room);
    let (mut ann, mut bob) = (Asker::new(&service, Some(ANN)), Asker::new(&service, Some(BOB)));
    let scene = fs::read(cornell()).unwrap();
    let mut keyed = header(&scene);
    keyed.idempotency_key = "monday".into();
    let id = ann.submit(keyed.clone(), &[&scene]).unwrap().id;
    // To know a scene's digest, or another's key, is not to have it.
    assert_eq!(bob.submit(keyed.clone(), &[]).unwrap_err().code(), Code::FailedPrecondition);
    let list = ListJobsRequest::default();
    let seen = bob.ask(list.clone(), async |client, request| client.list_jobs(request).await).unwrap();
    assert!(seen.jobs.is_empty());
    let missing = |code: Code| assert_eq!(code, Code::NotFound);
    let of = id.clone();
    missing(bob.ask(GetJobRequest { id: of }, async |c, r| c.get_job(r).await).unwrap_err().code());
    let of = id.clone();
    missing(bob.ask(WatchJobRequest { id: of }, async |c, r| c.watch_job(r).await).unwrap_err().code());
    let of = FetchResultRequest { id: id.clone(), ..FetchResultRequest::default() };
    missing(bob.ask(of, async |c, r| c.fetch_result(r).await).unwrap_err().code());
    let of = id.clone();
    missing(bob.ask(CancelJobRequest { id: of }, async |c, r| c.cancel_job(r).await).unwrap_err().code());
    let of = id.clone();
    missing(bob.ask(DeleteJobRequest { id: of }, async |c, r| c.delete_job(r).await).unwrap_err().code());
    // The same key is another client's own, and the scene is kept once.
    let other = bob.submit(keyed, &[&scene]).unwrap().id;
    assert_ne!(other, id);
    assert_eq!(room.names("scenes").len(), 1);
    bob.ask(DeleteJobRequest { id: other }, async |c, r| c.delete_job(r).await).unwrap();
    let seen = ann.ask(list, async |client, request| client.list_jobs(request).await).unwrap();
    assert_eq!(seen.jobs.into_iter().map(|job| job.id).collect::<Vec<_>>(), [id]);
}

#[test]
fn nobody_asks_without_a_token() {
    let room = Room::new();
    let service = start(&room);
    for token in [None, Some("0123456789abcdeX")] {
        let mut nobody = Asker::new(&service, token);
        let refused = nobody.ask(ListJobsRequest::default(), async |c, r| c.list_jobs(r).await).unwrap_err();
        assert_eq!(refused.code(), Code::Unauthenticated);
        assert_eq!(refused.get_error_details().error_info().unwrap().reason, "TOKEN");
        let scene = fs::read(cornell()).unwrap();
        assert_eq!(nobody.submit(header(&scene), &[&scene]).unwrap_err().code(), Code::Unauthenticated);
    }
    let token = room.file("token", ANN.as_bytes());
    assert!(service.ask(&["jobs", "--token-file", text(&token)]).success);
    let refused = service.ask(&["jobs"]);
    assert!(!refused.success && refused.errors.contains("--token-file"), "{}", refused.errors);
}

#[test]
fn plain_text_stays_on_this_machine_unless_asked_for() {
    let room = Room::new();
    let beyond = ["--listen", "0.0.0.0:0"];
    let start = |more: &[&str]| ServiceProcess::try_start(&room.data(), &[&beyond, more].concat());
    assert!(start(&[]).is_err());
    assert!(start(&["--listen-plaintext"]).is_ok());
}

#[test]
fn no_site_leads_a_browser_to_it_by_a_name_of_its_own() {
    let answers_to = |service: &ServiceProcess, name: &str| {
        let port = service.address.rsplit_once(':').unwrap().1;
        let mut socket = TcpStream::connect(format!("127.0.0.1:{port}")).unwrap();
        write!(socket, "GET / HTTP/1.1\r\nHost: {name}:{port}\r\nConnection: close\r\n\r\n").unwrap();
        let mut answer = String::new();
        BufReader::new(socket).read_line(&mut answer).unwrap();
        assert!(answer.contains(" 200 ") || answer.contains(" 421 "), "{answer}");
        answer.contains(" 200 ")
    };
    let room = Room::new();
    let clients = room.file("clients", format!("ann {ANN}\n").as_bytes());
    let beyond = ["--listen", "0.0.0.0:0", "--listen-plaintext"];
    for (arguments, own, foreign) in [
        (&[][..], false, false),
        (&["--listen-names", "bake,oven"], true, false),
        (&[&beyond[..], &["--listen-names", "bake"]].concat(), true, false),
        (&beyond, true, true),
        (&["--clients", text(&clients)], true, true),
    ] {
        let service = room.start(arguments);
        assert!(answers_to(&service, "localhost") && answers_to(&service, "127.0.0.1"), "{arguments:?}");
        let found = (answers_to(&service, "bake"), answers_to(&service, "evil.example"));
        assert_eq!(found, (own, foreign), "{arguments:?}");
    }
}
