//! The `worker` binary as scripts see it.

use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

/// It says where it listens once it does, and a SIGTERM ends it in good order.
#[test]
fn listens_until_told_to_stop() {
    let mut worker = Command::new(env!("CARGO_BIN_EXE_worker"))
        .args(["--listen", "127.0.0.1:0", "--threads", "1", "--name", "tested"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(worker.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let told = Command::new("kill").args(["-TERM", &worker.id().to_string()]).status().unwrap();
    let status = worker.wait().unwrap();
    assert!(told.success() && status.success(), "{status}");
    let address = line.strip_prefix("worker tested listens on ").and_then(|rest| rest.split(' ').next());
    let address: std::net::SocketAddr = address.unwrap_or_else(|| panic!("{line}")).parse().unwrap();
    assert_ne!(address.port(), 0);
    assert!(line.ends_with("with 1 threads\n"), "{line}");
}

#[test]
fn address_in_use() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let answer = Command::new(env!("CARGO_BIN_EXE_worker")).args(["--listen", &address]).output().unwrap();
    let said = String::from_utf8(answer.stderr).unwrap();
    assert!(!answer.status.success());
    assert!(said.contains(&address) && said.contains("choose another --listen address"), "{said}");
}
