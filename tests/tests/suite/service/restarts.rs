use std::fs;
use std::io::{Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::thread;

use tests::programs::{Running, Signal};
use tests::service::asking;

use super::bytes::{SLOW, slowly_solved, solved};
use super::{QUICK, Room, cornell, text, wait_for};

#[test]
fn those_who_wait_wait_on_when_a_killed_service_comes_again() {
    waits_over(Signal::KILL);
}

#[test]
fn those_who_wait_wait_on_when_a_service_is_started_anew() {
    waits_over(Signal::TERM);
}

/// Two commands that wait while the service ends by this signal and comes again.
fn waits_over(signal: Signal) {
    let room = Room::new();
    let mut service = room.start(&["--jobs", "1"]);
    let address = service.address.clone();
    let job = service.submit(&cornell(), &SLOW);
    let output = room.folder.path().join("lit.glb");
    let mut watching = Running::start(&mut asking(&address, &["watch", &job]));
    let scene = cornell();
    // It waits for the slow one first.
    let submit = [&["submit", text(&scene), "-o", text(&output)], &QUICK[..]].concat();
    let mut submitting = Running::start(&mut asking(&address, &submit));
    // Any line of progress: they are being told.
    watching.wait_for(": ");
    submitting.wait_for(": ");
    let checkpoint = room.data().join("checkpoints").join(&job);
    wait_for("the job runs", || fs::metadata(&checkpoint).is_ok_and(|file| file.len() > 1 << 20));
    service.signal(signal);
    let _ = service.wait();
    watching.wait_for("is gone");
    submitting.wait_for("is gone");
    let service = room.start(&["--jobs", "1", "--listen", &address]);
    for (running, name) in [(watching, "watch"), (submitting, "submit")] {
        let (success, said) = running.finish();
        assert!(success, "{name}: {said}");
        assert_eq!(said.matches("is gone").count(), 1, "{name}: {said}");
        assert_eq!(said.matches("is there again").count(), 1, "{name}: {said}");
    }
    assert!(fs::read(output).unwrap() == solved(&room, "quick.glb", &QUICK), "the lit file differs");
    assert!(service.result(&job) == slowly_solved(), "the lit file differs");
}

#[test]
fn what_does_not_pass_is_not_waited_for() {
    let room = Room::new();
    let clients = room.file("clients", b"ann 0123456789abcdef\n");
    let service = room.start(&["--clients", text(&clients)]);
    let output = room.folder.path().join("lit.glb");
    for command in [&["watch", "1"][..], &["fetch", "1", "-o", text(&output)]] {
        let refused = service.ask(command);
        assert!(!refused.success && refused.errors.contains("--token-file"), "{}", refused.errors);
        assert!(!refused.errors.contains("is gone"), "{}", refused.errors);
    }
    let address = service.address.clone();
    drop(service);
    let (success, said) = Running::start(&mut asking(&address, &["watch", "1"])).finish();
    assert!(!success && said.contains("no service at"), "{said}");
}

/// A broken connection costs what had not come yet, not what had.
#[test]
fn a_file_goes_on_where_it_stopped() {
    let room = Room::new();
    let service = room.start(&[]);
    let scene = room.file("long.glb", &long());
    let job = service.submit(&scene, &QUICK);
    fs::remove_file(scene).unwrap();
    let expected = service.result(&job);
    let part = expected.len() / 2;
    let (front, passed) = breaking(&service.address, part);
    let output = room.folder.path().join("lit.glb");
    let fetched = Running::start(&mut asking(&front.to_string(), &["fetch", &job, "-o", text(&output)]));
    let (success, said) = fetched.finish();
    assert!(success && said.matches("is gone").count() == 1, "{said}");
    assert!(fs::read(&output).unwrap() == expected, "the file differs");
    // What was under way when it broke, and the frames, come on top.
    let [first, second] = passed.each_ref().map(|bytes| bytes.load(SeqCst));
    assert!(first >= part && second < expected.len() * 3 / 4, "{first} and {second} of {}", expected.len());
    // Nothing else is left beside it.
    let names = fs::read_dir(room.folder.path()).unwrap().map(|file| file.unwrap().file_name());
    assert!(names.into_iter().all(|name| name == "data" || name == "lit.glb"));
}

/// Cornell with so much beside it, which the lit file has as well, that it comes in many pieces.
fn long() -> Vec<u8> {
    let file = fs::read(cornell()).unwrap();
    let mut glb = gltf::Glb::from_slice(&file).unwrap();
    let mut document: serde_json::Value = serde_json::from_slice(&glb.json).unwrap();
    document["nodes"][0]["extras"] = serde_json::json!({ "ballast": "-".repeat(4 << 20) });
    glb.json = document.to_string().into_bytes().into();
    glb.to_vec().unwrap()
}

/// An address in front of a service, whose first connection breaks after so many bytes for the client; and how many came on the first
/// one and on the second.
fn breaking(service: &str, after: usize) -> (SocketAddr, Arc<[AtomicUsize; 2]>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let (passed, service) = (Arc::new([AtomicUsize::new(0), AtomicUsize::new(0)]), service.to_owned());
    let counts = Arc::clone(&passed);
    thread::spawn(move || {
        for (count, limit) in counts.iter().zip([after, usize::MAX]) {
            let (mut near, _) = listener.accept().unwrap();
            let mut far = TcpStream::connect(&service).unwrap();
            let (mut to, mut from) = (far.try_clone().unwrap(), near.try_clone().unwrap());
            let asking = thread::spawn(move || std::io::copy(&mut from, &mut to));
            let mut buffer = [0; 16 << 10];
            while count.load(SeqCst) < limit {
                let Ok(length @ 1..) = far.read(&mut buffer) else { break };
                if near.write_all(&buffer[..length]).is_err() {
                    break;
                }
                count.fetch_add(length, SeqCst);
            }
            // What has been passed on arrives.
            let _ = (near.shutdown(Shutdown::Write), far.shutdown(Shutdown::Both));
            let _ = asking.join();
        }
    });
    (address, passed)
}
