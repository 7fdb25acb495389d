//! The `worker` binary as scripts see it.

use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};

/// Standard error is no terminal here, as under a service manager or in a container.
#[test]
fn logs_in_files_have_no_colours() {
    let mut worker = Command::new(env!("CARGO_BIN_EXE_worker"))
        .args(["--listen", "127.0.0.1:0", "--threads", "1"])
        .env("RUST_LOG", "info")
        .env_remove("NO_COLOR")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    BufReader::new(worker.stdout.take().unwrap()).read_line(&mut String::new()).unwrap();
    assert!(Command::new("kill").args(["-TERM", &worker.id().to_string()]).status().unwrap().success());
    let mut said = String::new();
    worker.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert!(worker.wait().unwrap().success());
    assert!(said.contains("INFO") && said.contains("leaving"), "{said}");
    assert!(!said.contains('\x1b'), "{said:?}");
}

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
