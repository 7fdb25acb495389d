use std::net::SocketAddr;
use std::path::PathBuf;

use super::tls::{Files, Own};
use super::{SecurityError, Tls};

/// Encryption between two processes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Transport {
    /// Plain text.
    Plain {
        /// Allowed beyond this machine, by an explicit option.
        anywhere: bool,
    },
    /// Encrypted: the server has proved who it is, and the caller too where the server demands that.
    Tls(Tls),
}

impl Default for Transport {
    /// Plain text that stays on this machine.
    fn default() -> Self {
        Self::Plain { anywhere: false }
    }
}

impl Transport {
    /// Transport of a caller, of the options `--tls-ca`, `--tls-cert`, `--tls-key` and `--plaintext`: the authority alone is enough to call
    /// servers that demand a token instead of a certificate. An empty path counts as not given, as compose files have it. Files are read
    /// here, and again for each connection.
    ///
    /// # Errors
    /// When some of the files are missing or wrong, or both encryption and plain text are asked for.
    pub fn of_caller(
        ca: Option<PathBuf>,
        certificate: Option<PathBuf>,
        key: Option<PathBuf>,
        plaintext: bool,
    ) -> Result<Self, SecurityError> {
        Self::new([ca, certificate, key], plaintext, [true, false])
    }

    /// The same for a server: its certificate and key alone are enough where callers show a token. See [`Self::check_callers`].
    ///
    /// # Errors
    /// As [`Self::of_caller`].
    pub fn of_server(
        ca: Option<PathBuf>,
        certificate: Option<PathBuf>,
        key: Option<PathBuf>,
        plaintext: bool,
    ) -> Result<Self, SecurityError> {
        Self::new([ca, certificate, key], plaintext, [false, true])
    }

    fn new(
        files: [Option<PathBuf>; 3],
        plaintext: bool,
        [needs_ca, needs_own]: [bool; 2],
    ) -> Result<Self, SecurityError> {
        let [ca, certificate, key] = files.map(|path| path.filter(|path| !path.as_os_str().is_empty()));
        if ca.is_none() && certificate.is_none() && key.is_none() {
            return Ok(Self::Plain { anywhere: plaintext });
        }
        let needs_own = needs_own || certificate.is_some() || key.is_some();
        let missing: Vec<&str> = [
            ("--tls-ca", needs_ca && ca.is_none()),
            ("--tls-cert", needs_own && certificate.is_none()),
            ("--tls-key", needs_own && key.is_none()),
        ]
        .into_iter()
        .filter_map(|(option, is_missing)| is_missing.then_some(option))
        .collect();
        if !missing.is_empty() {
            return Err(SecurityError::Incomplete { missing });
        }
        if plaintext {
            return Err(SecurityError::Contradiction);
        }
        let own = certificate.zip(key).map(|(certificate, key)| Own { certificate, key });
        Ok(Self::Tls(Tls::new(Files { ca, own }, vec![])?))
    }

    /// Checks that callers of a server prove who they are where it is encrypted: by a certificate, or by a token.
    ///
    /// # Errors
    /// When they do neither.
    pub fn check_callers(&self, demands_token: bool) -> Result<(), SecurityError> {
        match self {
            Self::Tls(tls) if !demands_token && !tls.demands_certificates() => Err(SecurityError::Anybody),
            _ => Ok(()),
        }
    }

    /// The same for a server that takes callers only whose certificate has one of these names; without names, all of the authority.
    ///
    /// # Errors
    /// When a certificate cannot have such a name, or there are none.
    pub fn accepting(self, names: &[String]) -> Result<Self, SecurityError> {
        match self {
            _ if names.is_empty() => Ok(self),
            Self::Tls(tls) => Ok(Self::Tls(tls.accepting(names)?)),
            Self::Plain { .. } => Err(SecurityError::CallersWithoutTls),
        }
    }

    /// Checks that this address may be listened on or dialled: plain text stays on this machine unless allowed explicitly. A token makes
    /// no difference: in plain text it can be read on the way.
    ///
    /// # Errors
    /// When plain text would go further than it was allowed to.
    pub fn allows(&self, address: SocketAddr) -> Result<(), SecurityError> {
        match self {
            Self::Plain { anywhere: false } if !address.ip().to_canonical().is_loopback() => {
                Err(SecurityError::Plaintext { address })
            }
            Self::Plain { .. } | Self::Tls(_) => Ok(()),
        }
    }

    /// The certificates, if any.
    #[must_use]
    pub fn tls(&self) -> Option<&Tls> {
        match self {
            Self::Plain { .. } => None,
            Self::Tls(tls) => Some(tls),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_text_stays_on_this_machine_unless_asked_for() {
        let (here, asked) = (Transport::default(), Transport::Plain { anywhere: true });
        for loopback in ["127.0.0.1:1", "127.9.9.9:1", "[::1]:1", "[::ffff:127.0.0.1]:1"] {
            assert!(here.allows(loopback.parse().unwrap()).is_ok(), "{loopback}");
        }
        for beyond in ["0.0.0.0:7070", "[::]:7070", "10.0.0.1:1", "[::ffff:10.0.0.1]:1", "[fe80::1]:1"] {
            let address = beyond.parse().unwrap();
            let refused = here.allows(address).unwrap_err().to_string();
            for word in [beyond, "--plaintext", "--tls-ca", "--tls-cert", "--tls-key"] {
                assert!(refused.contains(word), "{word} is missing in {refused}");
            }
            assert!(asked.allows(address).is_ok(), "{beyond}");
        }
    }

    #[test]
    fn some_files_without_the_others_are_refused() {
        let path = |name: &str| Some(PathBuf::from(name));
        let refused = Transport::of_server(path("ca"), path(""), None, false).unwrap_err().to_string();
        assert!(refused.contains("--tls-cert and --tls-key missing"), "{refused}");
        let nothing = Transport::of_server(path(""), path(""), path(""), true).unwrap();
        assert_eq!(nothing, Transport::Plain { anywhere: true });
        let both = Transport::of_server(path("ca"), path("cert"), path("key"), true);
        assert!(matches!(both, Err(SecurityError::Contradiction)));
        for (ca, certificate, key, missing) in [
            (None, path("cert"), None, "--tls-ca and --tls-key missing"),
            (None, path("cert"), path("key"), "--tls-ca missing"),
            (path("ca"), None, path("key"), "--tls-cert missing"),
        ] {
            let refused = Transport::of_caller(ca, certificate, key, false).unwrap_err().to_string();
            assert!(refused.contains(missing), "{missing} is not in: {refused}");
        }
    }
}
