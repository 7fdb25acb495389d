//! Compiles `proto/` with protox, so that a build needs nothing but cargo (no protoc).

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let root = "../proto";
    println!("cargo:rerun-if-changed={root}");
    let descriptors = protox::compile(["radiosity/worker/v1/worker.proto"], [root])?;
    tonic_prost_build::configure().bytes(".").compile_fds(descriptors)?;
    Ok(())
}
