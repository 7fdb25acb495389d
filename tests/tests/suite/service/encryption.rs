use std::io::{ErrorKind, Read, Write};
use std::net::TcpStream;
use std::process::Command;

use protocol::security::TlsFiles;
use tests::certificates::{Authority, arguments, of_caller, of_server};
use tests::programs::binary;
use tests::service::ServiceProcess;

use super::{HANGS, QUICK, Room, cornell, text};

/// A service that shows this certificate.
fn start(room: &Room, files: &TlsFiles) -> ServiceProcess {
    let [_, ca, _, certificate, _, key] = arguments(files);
    room.start(&["--listen-tls-ca", ca, "--listen-tls-cert", certificate, "--listen-tls-key", key])
}

#[test]
fn only_clients_with_a_certificate_of_the_authority_get_in() {
    let (room, authority, other) = (Room::new(), Authority::new(), Authority::new());
    let listening = authority.sign(&["127.0.0.1"]);
    let service = start(&room, &listening);
    let good = authority.sign(&["ann"]);
    let scene = cornell();
    let submission = ["submit", text(&scene)];
    let encrypted = service.ask(&[&submission, &QUICK[..], &arguments(&good)].concat());
    assert!(encrypted.success, "{}", encrypted.errors);
    let job = encrypted.text.trim();
    let lit = room.folder.path().join("lit.glb");
    for command in [&["watch", job][..], &["fetch", job, "-o", text(&lit)]] {
        let said = service.ask(&[command, &arguments(&good)].concat());
        assert!(said.success, "{}", said.errors);
    }
    assert!(std::fs::metadata(&lit).unwrap().len() > 0);

    let stranger = other.sign(&["ann"]);
    let smuggler = TlsFiles { ca: good.ca.clone(), ..stranger.clone() };
    let expired = authority.sign_expired(&["ann"]);
    for (files, words) in [
        (None, "--tls-ca, --tls-cert and --tls-key"),
        (Some(&stranger), "not of the authority in --tls-ca"),
        (Some(&smuggler), "does not accept this end's certificate"),
        (Some(&expired), "certificate has expired"),
    ] {
        let arguments = files.map(arguments);
        let arguments = arguments.as_ref().map_or(&[][..], |files| &files[..]);
        for command in [&["jobs"][..], &submission] {
            let refused = service.ask(&[command, arguments].concat());
            assert!(!refused.success && refused.text.is_empty(), "{words}: {}", refused.text);
            assert!(refused.errors.contains(words), "{words:?} is missing in: {}", refused.errors);
        }
    }
    assert_eq!(room.names("jobs"), [job]);
}

/// Clients with a token need no certificate, only the authority of the service's.
#[test]
fn tokens_take_the_place_of_the_clients_certificates() {
    let (room, authority) = (Room::new(), Authority::new());
    let listening = authority.sign(&["127.0.0.1"]);
    let [_, certificate, _, key] = of_server(&listening);
    let encrypted = ["--listen-tls-cert", certificate, "--listen-tls-key", key];
    let clients = room.file("clients", b"ann right-0123456789\n");
    let service = room.start(&[&encrypted[..], &["--clients", text(&clients)]].concat());
    let (right, wrong) = (room.file("right", b"right-0123456789"), room.file("wrong", b"wrong-0123456789"));
    let caller = of_caller(&listening);
    let ask = |arguments: &[&str]| service.ask(&[&["jobs"][..], arguments].concat());
    let asked = ask(&[&caller[..], &["--token-file", text(&right)]].concat());
    assert!(asked.success, "{}", asked.errors);
    for (arguments, words) in [
        (&[&caller[..], &["--token-file", text(&wrong)]].concat()[..], "token"),
        (&caller[..], "--token-file"),
        (&["--token-file", text(&right)][..], "--tls-ca"),
    ] {
        let refused = ask(arguments);
        assert!(!refused.success && refused.errors.contains(words), "{words}: {}", refused.errors);
    }
    let mut command = Command::new(binary("coordinator"));
    let folder = room.folder.path().join("other");
    let alone = command.args(["serve", "--listen", "127.0.0.1:0", "--data", text(&folder)]).args(encrypted);
    let refused = alone.output().unwrap();
    let said = String::from_utf8(refused.stderr).unwrap();
    assert!(!refused.status.success() && said.contains("give --clients or --listen-tls-ca"), "{said}");
}

/// Neither HTTP nor gRPC without encryption gets an answer of the service's.
#[test]
fn plain_text_is_not_answered_where_clients_show_certificates() {
    let (room, authority) = (Room::new(), Authority::new());
    let listening = authority.sign(&["127.0.0.1"]);
    let service = start(&room, &listening);
    for words in ["GET / HTTP/1.1\r\nHost: localhost\r\n\r\n", "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"] {
        let mut socket = TcpStream::connect(&service.address).unwrap();
        socket.set_read_timeout(Some(HANGS)).unwrap();
        socket.write_all(words.as_bytes()).unwrap();
        let mut answer = vec![];
        if let Err(error) = socket.read_to_end(&mut answer) {
            assert_eq!(error.kind(), ErrorKind::ConnectionReset);
        }
        // An alert of TLS at most.
        assert!(answer.len() < 16, "{}", String::from_utf8_lossy(&answer));
    }
}
