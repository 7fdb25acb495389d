//! Writes a room of about so many textured triangles: `cargo run --release -p tests --example fine -- 100000 fine.glb`.

use std::error::Error;
use std::{env, fs};

use tests::scenes::fine_room;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let [triangles, path] = arguments.as_slice() else {
        return Err("usage: fine TRIANGLES FILE.glb".into());
    };
    fs::write(path, fine_room(triangles.parse()?))?;
    Ok(())
}
