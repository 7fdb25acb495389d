use std::process::Command;

use super::{Room, cornell};

/// A Python client that has nothing but the address: it learns the API from the service.
#[test]
fn a_client_in_python_knows_only_what_reflection_tells() {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
    let has_grpc = Command::new(&python).args(["-c", "import grpc, grpc_reflection, google.rpc"]).output();
    if !has_grpc.is_ok_and(|output| output.status.success()) {
        println!("skipped: pip install grpcio grpcio-reflection googleapis-common-protos");
        return;
    }
    let room = Room::new();
    let service = room.start(&[]);
    let script = tests::data("service/client.py");
    let output = Command::new(python).arg(script).arg(&service.address).arg(cornell()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    assert!(said.trim_end().ends_with("all is well"), "{said}");
}
