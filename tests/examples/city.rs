//! Writes a city of boxes: `cargo run --release -p tests --example city -- FACETS OUT.glb`.

use std::process::ExitCode;

use tests::city::city;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [facets, output] = &arguments[..] else {
        eprintln!("usage: city FACETS OUT.glb");
        return ExitCode::FAILURE;
    };
    let Ok(facets) = facets.parse() else {
        eprintln!("error: {facets} is no number of facets");
        return ExitCode::FAILURE;
    };
    match std::fs::write(output, city(facets).glb()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {output} cannot be written: {error}");
            ExitCode::FAILURE
        }
    }
}
