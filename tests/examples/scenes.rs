//! Writes the scenes that the repository makes itself: `cargo run --release -p tests --example scenes [-- FOLDER]`, into
//! `tests/scenes` unless it is told another folder.

use std::path::PathBuf;
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let folder = env::args_os().nth(1).map_or_else(|| tests::data("scenes"), PathBuf::from);
    for scene in tests::scenes::all() {
        let path = folder.join(format!("{}.glb", scene.name));
        fs::write(&path, &scene.glb)?;
        println!("{}: {} bytes", path.display(), scene.glb.len());
    }
    Ok(())
}
