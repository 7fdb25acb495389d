//! Compiles `proto/` with protox, so that a build needs nothing but cargo (no protoc).

use std::error::Error;
use std::path::Path;

use prost::Message;

fn main() -> Result<(), Box<dyn Error>> {
    let root = "../proto";
    println!("cargo:rerun-if-changed={root}");
    let descriptors = protox::compile(["radiosity/worker/v1/worker.proto"], [root])?;
    // For those who ask a running worker what it speaks.
    let folder = std::env::var("OUT_DIR")?;
    std::fs::write(Path::new(&folder).join("descriptors.bin"), descriptors.encode_to_vec())?;
    tonic_prost_build::configure().bytes(".").compile_fds(descriptors)?;
    Ok(())
}
