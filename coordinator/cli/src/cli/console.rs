//! Lines for the user. A reader that has gone away ends none of them, and neither does a full device: results are kept.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

use anyhow::Context;

/// Most characters of a line: names in files may have millions.
const LONGEST: usize = 2000;

/// Tells the user a line on standard error, if that can be written.
pub fn say(line: impl Display) {
    // There is no other place to say that it cannot.
    let _ = writeln!(io::stderr(), "{}", tame(&line.to_string()));
}

/// A text with lines of a length to read, and without what terminals take for commands: files choose their names.
fn tame(text: &str) -> String {
    let line = |line: &str| {
        let (shown, rest) = match line.char_indices().nth(LONGEST) {
            Some((end, _)) => (&line[..end], " …"),
            None => (line, ""),
        };
        let plain = |character: char| match character {
            '\t' => character.to_string(),
            _ if character.is_control() => character.escape_default().to_string(),
            _ => character.to_string(),
        };
        shown.chars().map(plain).collect::<String>() + rest
    };
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_short_and_without_commands() {
        assert_eq!(tame("a — b\n\tc\n"), "a — b\n\tc\n");
        assert_eq!(tame("x\u{1b}[31mred\u{7}\r"), "x\\u{1b}[31mred\\u{7}\\r");
        let long = tame(&format!("short\n{}", "ä".repeat(10_000_000)));
        assert_eq!(long.chars().count(), "short\n".len() + LONGEST + 2);
        assert!(long.ends_with("ä …"));
    }
}
