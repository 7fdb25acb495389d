//! Writes a building of so many rooms as a GLB: `cargo run --release -p tests --example building -- ROOMS OUT.glb`.

use std::error::Error;
use std::fs;

use tests::building::building;

/// Edge of the shooting patches that is suggested, in metres: the same in every building.
const EDGE: f64 = 0.6;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rooms, output] = arguments.as_slice() else {
        return Err("give the number of rooms and the file to write: building 20 building.glb".into());
    };
    let rooms = rooms.parse().map_err(|_| format!("{rooms:?} is not a number of rooms"))?;
    let building = building(rooms);
    fs::write(output, building.scene.glb())?;
    println!("{:.1} m long: --shooter-edge {:.5} is {EDGE} m", building.extent, EDGE / building.extent);
    Ok(())
}
