//! The `coordinator` binary.

#![deny(clippy::print_stdout, clippy::print_stderr)]

mod cli;

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    let arguments = cli::parse(std::env::args_os()).unwrap_or_else(|error| error.exit());
    match cli::run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            cli::console::say(format_args!("error: {error:#}"));
            ExitCode::FAILURE
        }
    }
}
