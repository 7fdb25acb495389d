use std::fmt;
use std::path::Path;

use tonic::metadata::{Ascii, MetadataValue};

use super::SecurityError;

/// Shortest secret in bytes; shorter ones can be guessed.
const LEAST_CHARACTERS: usize = 16;

/// Longest file in bytes.
const MOST_CHARACTERS: usize = 4096;

/// A secret that both ends know, sent with every call. Never shown: it has no `Display`, and its `Debug` hides it.
#[derive(Clone)]
pub struct Token {
    /// `Bearer ...`, marked as a secret to the HTTP library.
    header: MetadataValue<Ascii>,
    hash: blake3::Hash,
}

impl Token {
    /// Reads a token from a file. White space around it is not part of it.
    ///
    /// # Errors
    /// When the file cannot be read or its token is too short, too long or not of printable ASCII characters.
    pub fn read(path: &Path) -> Result<Self, SecurityError> {
        let read = |error| SecurityError::Read { option: "--token-file", path: path.into(), error };
        let text = std::fs::read_to_string(path).map_err(read)?;
        Self::new(text.trim()).map_err(|reason| SecurityError::Token { path: path.into(), reason })
    }

    /// Reads the token of the option `--token-file`. An empty path counts as not given, as compose files have it.
    ///
    /// # Errors
    /// As for [`Self::read`].
    pub fn from_option(path: Option<&Path>) -> Result<Option<Self>, SecurityError> {
        path.filter(|path| !path.as_os_str().is_empty()).map(Self::read).transpose()
    }

    /// Makes a token from a secret.
    ///
    /// # Errors
    /// When it is too short, too long or not of printable ASCII characters.
    pub fn new(secret: &str) -> Result<Self, &'static str> {
        if secret.len() < LEAST_CHARACTERS {
            return Err("a token has 16 characters or more: `openssl rand -hex 32` makes one");
        }
        if secret.len() > MOST_CHARACTERS {
            return Err("a token has 4096 characters at most");
        }
        if !secret.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err("a token is one word of printable ASCII characters");
        }
        let mut header = MetadataValue::try_from(format!("Bearer {secret}"))
            .map_err(|_| "a token is one word of printable ASCII characters")?;
        header.set_sensitive(true);
        let hash = blake3::hash(header.as_bytes());
        Ok(Self { header, hash })
    }

    /// The value of the header `authorization`.
    #[must_use]
    pub fn header(&self) -> MetadataValue<Ascii> {
        self.header.clone()
    }

    /// Whether a header `authorization` has this token. The time taken tells nothing about how much of it is right: hashes
    /// are compared, in constant time.
    #[must_use]
    pub fn is_in(&self, header: &[u8]) -> bool {
        blake3::hash(header) == self.hash
    }
}

impl PartialEq for Token {
    fn eq(&self, other: &Self) -> bool {
        self.hash == other.hash
    }
}

impl Eq for Token {}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(hidden)")
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    const SECRET: &str = "0123456789abcdef";

    #[test]
    fn a_token_is_recognised_and_never_shown() {
        let token = Token::new(SECRET).unwrap();
        assert!(token.is_in(token.header().as_bytes()));
        assert!(token.is_in(b"Bearer 0123456789abcdef"));
        for wrong in ["", "Bearer", "0123456789abcdef", "Bearer 0123456789abcdeg", "Bearer 0123456789abcdef0"]
        {
            assert!(!token.is_in(wrong.as_bytes()), "{wrong}");
        }
        let shown = format!("{token:?} {:?}", token.header());
        assert!(!shown.contains(SECRET), "{shown}");
        assert_ne!(token, Token::new("another-secret-word").unwrap());
    }

    #[test]
    fn a_file_has_one_word_of_sixteen_characters_or_more() {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        writeln!(file, " {SECRET}\r").unwrap();
        assert_eq!(Token::read(file.path()).unwrap(), Token::new(SECRET).unwrap());
        for wrong in ["short", "two words of sixteen", "umlaut-äöü-äöü-äöü", "line\nline\nline\nline"]
        {
            std::fs::write(file.path(), wrong).unwrap();
            let refused = Token::read(file.path()).unwrap_err().to_string();
            assert!(refused.contains(&file.path().display().to_string()), "{refused}");
            assert!(!refused.contains(wrong), "{refused}");
        }
        let missing = Token::read(Path::new("/no/such/token")).unwrap_err().to_string();
        assert!(missing.contains("--token-file /no/such/token cannot be read"), "{missing}");
        assert!(Token::from_option(Some(Path::new(""))).unwrap().is_none());
    }
}
