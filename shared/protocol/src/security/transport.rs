use std::net::SocketAddr;
use std::path::PathBuf;

use super::{SecurityError, Tls, TlsFiles};

/// Encryption between two processes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Transport {
    /// Plain text.
    Plain {
        /// Allowed beyond this machine, by an explicit option.
        anywhere: bool,
    },
    /// Encrypted, and both ends have proved who they are.
    Tls(Tls),
}

impl Default for Transport {
    /// Plain text that stays on this machine.
    fn default() -> Self {
        Self::Plain { anywhere: false }
    }
}

impl Transport {
    /// Transport of the options `--tls-ca`, `--tls-cert`, `--tls-key` and `--plaintext`. An empty path counts as not given, as compose
    /// files have it. Files are read here, and again for each connection.
    ///
    /// # Errors
    /// When some of the files are missing or wrong, or both encryption and plain text are asked for.
    pub fn from_options(
        ca: Option<PathBuf>,
        certificate: Option<PathBuf>,
        key: Option<PathBuf>,
        plaintext: bool,
    ) -> Result<Self, SecurityError> {
        let given = |path: Option<PathBuf>| path.filter(|path| !path.as_os_str().is_empty());
        match (given(ca), given(certificate), given(key)) {
            (None, None, None) => Ok(Self::Plain { anywhere: plaintext }),
            (Some(_), Some(_), Some(_)) if plaintext => Err(SecurityError::Contradiction),
            (Some(ca), Some(certificate), Some(key)) => {
                Ok(Self::Tls(TlsFiles { ca, certificate, key }.load()?))
            }
            (ca, certificate, key) => {
                let all = [("--tls-ca", ca), ("--tls-cert", certificate), ("--tls-key", key)];
                let missing =
                    all.into_iter().filter(|(_, path)| path.is_none()).map(|(option, _)| option).collect();
                Err(SecurityError::Incomplete { missing })
            }
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
        let refused = Transport::from_options(path("ca"), path(""), None, false).unwrap_err().to_string();
        assert!(refused.contains("--tls-cert and --tls-key missing"), "{refused}");
        let nothing = Transport::from_options(path(""), path(""), path(""), true).unwrap();
        assert_eq!(nothing, Transport::Plain { anywhere: true });
        let both = Transport::from_options(path("ca"), path("cert"), path("key"), true);
        assert!(matches!(both, Err(SecurityError::Contradiction)));
    }
}
