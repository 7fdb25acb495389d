//! Clients and their tokens.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use protocol::security::Token;

use crate::job::ClientName;
use crate::refusal::Refusal;

/// Longest name of a client.
const LONGEST_NAME: usize = 64;

/// The known clients.
#[derive(Debug, Clone, Default)]
pub struct Clients {
    /// `None`: no tokens, and all callers are one client.
    known: Option<Vec<(ClientName, Token)>>,
}

/// Why a file of clients cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ClientsError {
    /// It cannot be read.
    #[error("--clients {} cannot be read: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        error: std::io::Error,
    },
    /// A line is invalid. Its token is not shown.
    #[error("--clients {} line {line}: {reason}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// What it should be.
        reason: &'static str,
    },
    /// It has no line.
    #[error("--clients {} names nobody: each line is NAME TOKEN", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

impl Clients {
    /// Reads a file with a line `NAME TOKEN` for each client; empty lines and those that begin with `#` are ignored.
    ///
    /// # Errors
    /// When it cannot be read, a line is invalid, or a name or token is repeated.
    pub fn read(path: &Path) -> Result<Self, ClientsError> {
        let text = std::fs::read_to_string(path)
            .map_err(|error| ClientsError::Read { path: path.to_owned(), error })?;
        let (mut known, mut names) = (Vec::<(ClientName, Token)>::new(), BTreeSet::new());
        for (index, line) in text.lines().enumerate() {
            let wrong = |reason| ClientsError::Line { path: path.to_owned(), line: index + 1, reason };
            let line = line.trim();
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let (name, secret) = line.split_once(char::is_whitespace).ok_or(wrong("a line is NAME TOKEN"))?;
            let is_of_name = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.');
            if name.len() > LONGEST_NAME || !name.bytes().all(is_of_name) {
                return Err(wrong("a name has letters, digits, dots and dashes, 64 at most"));
            }
            if !names.insert(name.to_owned()) {
                return Err(wrong("the name stands in an earlier line"));
            }
            let token = Token::new(secret.trim()).map_err(wrong)?;
            if known.iter().any(|(_, other)| *other == token) {
                return Err(wrong("the token stands in an earlier line: each client has one of its own"));
            }
            known.push((ClientName(name.into()), token));
        }
        if known.is_empty() {
            return Err(ClientsError::Empty { path: path.to_owned() });
        }
        Ok(Self { known: Some(known) })
    }

    /// Whether each client has a token.
    #[must_use]
    pub fn are_named(&self) -> bool {
        self.known.is_some()
    }

    /// Identifies the caller by the header `authorization`.
    ///
    /// # Errors
    /// When it has no known token.
    pub fn identify(&self, authorization: Option<&[u8]>) -> Result<ClientName, Refusal> {
        let Some(known) = &self.known else { return Ok(ClientName::everybody()) };
        let header = authorization.ok_or(Refusal::Unauthenticated(
            "this service demands a token: give yours with --token-file, or as `authorization: Bearer TOKEN`",
        ))?;
        // Compared with every token, so that the time taken reveals nothing.
        let found = known.iter().filter(|(_, token)| token.is_in(header)).last();
        found
            .map(|(name, _)| name.clone())
            .ok_or(Refusal::Unauthenticated("the service does not know this token: ask its operator for one"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Clients, ClientsError> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Clients::read(file.path())
    }

    #[test]
    fn a_token_says_whose_call_it_is() {
        let clients = read("# who\n\nann 0123456789abcdef\nbob\tfedcba9876543210\n").unwrap();
        let name = |header: &str| clients.identify(Some(header.as_bytes())).map(|name| name.0);
        assert_eq!(name("Bearer 0123456789abcdef").unwrap(), "ann");
        assert_eq!(name("Bearer fedcba9876543210").unwrap(), "bob");
        assert!(matches!(name("Bearer fedcba987654321"), Err(Refusal::Unauthenticated(_))));
        assert!(matches!(clients.identify(None), Err(Refusal::Unauthenticated(_))));
        assert_eq!(Clients::default().identify(None).unwrap(), ClientName::everybody());
    }

    #[test]
    fn wrong_files_are_refused_without_showing_tokens() {
        for (text, word) in [
            ("", "names nobody"),
            ("ann", "line 1: a line is NAME TOKEN"),
            ("ann short", "line 1: a token has 16"),
            ("a/b 0123456789abcdef", "line 1: a name has"),
            ("ann 0123456789abcdef\nann fedcba9876543210", "line 2: the name"),
            ("ann 0123456789abcdef\nbob 0123456789abcdef", "line 2: the token"),
        ] {
            let refused = read(text).unwrap_err().to_string();
            assert!(refused.contains(word), "{refused}");
            assert!(!refused.contains("0123456789abcdef"), "{refused}");
        }
    }
}
