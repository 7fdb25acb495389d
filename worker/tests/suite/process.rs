//! The `worker` binary as a script sees it.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::process::{Command, Stdio};

#[test]
fn it_tells_its_address_and_leaves_on_a_signal() {
    let mut process = Command::new(env!("CARGO_BIN_EXE_worker"))
        .args(["--listen", "127.0.0.1:0", "--name", "tested"])
        .env("WORKER_THREADS", "2")
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let told = line.trim_end().strip_prefix("worker tested listens on ").unwrap();
    let address = told.strip_suffix(" with 2 threads").unwrap();
    assert!(TcpStream::connect(address).is_ok(), "{line}");

    let kill = format!("kill -TERM {}", process.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    assert!(process.wait().unwrap().success());
}

/// The address that it listens on is the same in every container.
#[test]
fn without_a_name_it_is_called_by_its_machine() {
    let machine = Command::new("uname").arg("-n").output().unwrap().stdout;
    let machine = String::from_utf8(machine).unwrap();
    let mut process = Command::new(env!("CARGO_BIN_EXE_worker"))
        .args(["--listen", "0.0.0.0:0", "--plaintext"])
        // As compose files have it.
        .env("WORKER_NAME", "")
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
    process.kill().unwrap();
    process.wait().unwrap();
    let (name, rest) = line.strip_prefix("worker ").unwrap().split_once(" listens on 0.0.0.0:").unwrap();
    let port = rest.split(' ').next().unwrap();
    assert_eq!(name, format!("{}:{port}", machine.trim_end()), "{line}");
}

#[test]
fn an_address_in_use_is_named() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let output = Command::new(env!("CARGO_BIN_EXE_worker")).args(["--listen", &address]).output().unwrap();
    assert!(!output.status.success());
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(message.contains(&address) && message.contains("--listen"), "{message}");
}
