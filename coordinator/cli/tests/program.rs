//! The program as a shell starts it. Cargo builds it for these tests, and so for the end-to-end tests of the workspace too.

use std::process::{Command, Output};

fn coordinator(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_coordinator")).args(arguments).output().unwrap()
}

#[test]
fn without_arguments_it_prints_help() {
    let output = coordinator(&[]);
    let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert_eq!(output.status.code(), Some(2), "{said}");
    for command in ["solve", "serve", "relight", "render"] {
        assert!(said.contains(command), "{command} is missing in: {said}");
    }
}

#[test]
fn options_before_the_command_belong_to_it() {
    let output = coordinator(&["--workers", "a:1", "jobs"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success());
    assert!(said.contains("--workers") && said.contains("`jobs`"), "{said}");
}
