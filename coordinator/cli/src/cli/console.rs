//! Lines for the user. A reader that has gone away ends none of them, and neither does a full device: results are kept.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use anyhow::Context;

/// Tells the user a line on standard error, if that can be written.
pub fn say(line: impl Display) {
    // There is no other place to say that it cannot.
    let _ = writeln!(io::stderr(), "{line}");
}

/// Prints lines on standard output. A reader that has seen enough is no error.
///
/// # Errors
/// When it cannot be written.
pub fn print(lines: impl Display) -> anyhow::Result<()> {
    let mut out = io::stdout();
    match writeln!(out, "{lines}").and_then(|()| out.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written.context("standard output cannot be written"),
    }
}
