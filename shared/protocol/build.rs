//! Compiles `proto/` with protox, so that a build needs nothing but cargo (no protoc).

use std::error::Error;
use std::path::Path;

use prost::Message;

/// Each protocol, and where its descriptors go: for those who ask a running program what it speaks.
const PROTOCOLS: [(&str, &str); 2] = [
    ("radiosity/worker/v1/worker.proto", "worker-descriptors.bin"),
    ("radiosity/v1/radiosity.proto", "api-descriptors.bin"),
];

fn main() -> Result<(), Box<dyn Error>> {
    let root = "../../proto";
    println!("cargo:rerun-if-changed={root}");
    let folder = std::env::var("OUT_DIR")?;
    for (protocol, described) in PROTOCOLS {
        let descriptors = protox::compile([protocol], [root])?;
        std::fs::write(Path::new(&folder).join(described), descriptors.encode_to_vec())?;
        // The messages of the workers' protocol are the kernel's: here only their services are added.
        tonic_prost_build::configure()
            .bytes(".")
            .extern_path(".radiosity.worker.v1", "::kernel::messages")
            .compile_fds(descriptors)?;
    }
    Ok(())
}
