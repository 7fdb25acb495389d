//! Compiles the messages of the workers' protocol with protox, so that a build needs nothing but cargo (no protoc).

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let root = "../../proto";
    println!("cargo:rerun-if-changed={root}/radiosity/worker/v1");
    let descriptors = protox::compile(["radiosity/worker/v1/worker.proto"], [root])?;
    prost_build::Config::new().bytes(["."]).compile_fds(descriptors)?;
    Ok(())
}
