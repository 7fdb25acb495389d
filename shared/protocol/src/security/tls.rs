use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use rustls::crypto::{CryptoProvider, ring};
use rustls::pki_types::pem::{Error as PemError, PemObject};
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::server::WebPkiClientVerifier;
use rustls::{RootCertStore, ServerConfig};
use tonic::transport::{Certificate, ClientTlsConfig, Identity};

use super::SecurityError;
use super::callers::NamedCallers;

/// Name of HTTP/2 in a handshake.
const HTTP2: &[u8] = b"h2";

/// PEM files of one end, and the authority of the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TlsFiles {
    /// Certificate of the authority that the other end's certificate must be signed by.
    pub ca: PathBuf,
    /// This end's certificate, and those between it and the authority where there are any.
    pub certificate: PathBuf,
    /// The certificate's private key.
    pub key: PathBuf,
}

impl TlsFiles {
    /// Reads the files and checks that they are what they should be and fit each other.
    ///
    /// # Errors
    /// When a file cannot be read, is not the PEM that it should be, or the key is another certificate's.
    pub fn load(self) -> Result<Tls, SecurityError> {
        Tls::new(self, vec![])
    }

    fn read(&self) -> Result<Contents, SecurityError> {
        let ca = read("--tls-ca", &self.ca)?;
        let certificate = read("--tls-cert", &self.certificate)?;
        let key = read("--tls-key", &self.key)?;
        Ok(Contents { ca, certificate, key })
    }

    fn check(&self, contents: Contents, callers: &[ServerName<'static>]) -> Result<Loaded, SecurityError> {
        let content = |option, path: &Path, expected, reason: String| SecurityError::Content {
            option,
            path: path.into(),
            expected,
            reason,
        };
        const CERTIFICATE: &str = "a certificate in PEM";
        let not_authority = |reason| content("--tls-ca", &self.ca, CERTIFICATE, reason);
        let not_certificate = |reason| content("--tls-cert", &self.certificate, CERTIFICATE, reason);
        let not_key = |reason| content("--tls-key", &self.key, "a private key in PEM", reason);

        let mut roots = RootCertStore::empty();
        for authority in certificates(&contents.ca).map_err(not_authority)? {
            roots.add(authority).map_err(|error| not_authority(error.to_string()))?;
        }
        let chain = certificates(&contents.certificate).map_err(not_certificate)?;
        let private = PrivateKeyDer::from_pem_slice(&contents.key).map_err(|error| not_key(pem(&error)))?;
        let provider = Arc::new(ring::default_provider());
        let server =
            server(provider, (roots, callers), chain, private).map_err(|error| SecurityError::Mismatch {
                certificate: self.certificate.clone(),
                key: self.key.clone(),
                reason: error.to_string(),
            })?;
        Ok(Loaded { contents, server: Arc::new(server) })
    }
}

/// What is in the files of one end.
#[derive(PartialEq, Eq)]
struct Contents {
    ca: Vec<u8>,
    certificate: Vec<u8>,
    key: Vec<u8>,
}

/// Contents that fit each other.
struct Loaded {
    contents: Contents,
    server: Arc<ServerConfig>,
}

struct State {
    loaded: Arc<Loaded>,
    /// Why the present files are not taken, if so: it is logged once.
    refused: Option<String>,
}

/// Certificates of this end and the authority of the other. Every new connection takes the files as they are then; where those do not
/// fit each other, as while they are being replaced, it takes the last that did. Clones share what was read.
#[derive(Clone)]
pub struct Tls {
    files: TlsFiles,
    /// Names that callers must have one of, if any.
    callers: Vec<ServerName<'static>>,
    state: Arc<Mutex<State>>,
}

impl Tls {
    fn new(files: TlsFiles, callers: Vec<ServerName<'static>>) -> Result<Self, SecurityError> {
        let loaded = Arc::new(files.check(files.read()?, &callers)?);
        Ok(Self { files, callers, state: Arc::new(Mutex::new(State { loaded, refused: None })) })
    }

    /// The same for a server that takes callers only whose certificate has one of these names.
    pub(super) fn accepting(self, names: &[String]) -> Result<Self, SecurityError> {
        let name = |name: &String| {
            ServerName::try_from(name.clone()).map_err(|_| SecurityError::Name { name: name.clone() })
        };
        Self::new(self.files, names.iter().map(name).collect::<Result<_, _>>()?)
    }

    /// Configuration of a server for its next connection: it demands a certificate of the authority. Reads the files.
    #[must_use]
    pub fn server(&self) -> Arc<ServerConfig> {
        Arc::clone(&self.newest().server)
    }

    /// Configuration of a client for its next connection: the other end's certificate must be of the authority and have this name (a
    /// DNS name or an IP address). Reads the files.
    ///
    /// # Errors
    /// When no certificate can have that name.
    pub fn client(&self, name: &str) -> Result<ClientTlsConfig, SecurityError> {
        ServerName::try_from(name).map_err(|_| SecurityError::Name { name: name.into() })?;
        let Contents { ca, certificate, key } = &self.newest().contents;
        Ok(ClientTlsConfig::new()
            .domain_name(name)
            .ca_certificate(Certificate::from_pem(ca))
            .identity(Identity::from_pem(certificate, key)))
    }

    /// The files as they are now, or the last that fitted each other.
    fn newest(&self) -> Arc<Loaded> {
        // No code that holds the lock leaves it half changed.
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        // Compared by what is in them: times of files are coarse, and those of mounted secrets are links.
        let read = self.files.read();
        if read.as_ref().is_ok_and(|contents| *contents == state.loaded.contents) {
            state.refused = None;
        } else {
            match read.and_then(|contents| self.files.check(contents, &self.callers)) {
                Ok(loaded) => {
                    tracing::info!(certificate = %self.files.certificate.display(), "read changed certificates");
                    *state = State { loaded: Arc::new(loaded), refused: None };
                }
                Err(error) => {
                    let reason = error.to_string();
                    if state.refused.as_ref() != Some(&reason) {
                        tracing::warn!(reason, "changed certificates are not used: the former ones are");
                        state.refused = Some(reason);
                    }
                }
            }
        }
        Arc::clone(&state.loaded)
    }
}

impl PartialEq for Tls {
    fn eq(&self, other: &Self) -> bool {
        self.files == other.files && self.callers == other.callers
    }
}

impl Eq for Tls {}

impl fmt::Debug for Tls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Tls(hidden)")
    }
}

/// Versions of a server: TLS 1.3 alone, since both ends are of one release.
fn server(
    provider: Arc<CryptoProvider>,
    (roots, callers): (RootCertStore, &[ServerName<'static>]),
    chain: Vec<CertificateDer<'static>>,
    key: PrivateKeyDer<'static>,
) -> Result<ServerConfig, Box<dyn std::error::Error>> {
    let mut verifier =
        WebPkiClientVerifier::builder_with_provider(roots.into(), Arc::clone(&provider)).build()?;
    if !callers.is_empty() {
        verifier = Arc::new(NamedCallers { inner: verifier, names: callers.to_vec() });
    }
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_protocol_versions(&[&rustls::version::TLS13])?
        .with_client_cert_verifier(verifier)
        .with_single_cert(chain, key)?;
    config.alpn_protocols = vec![HTTP2.into()];
    Ok(config)
}

fn read(option: &'static str, path: &Path) -> Result<Vec<u8>, SecurityError> {
    std::fs::read(path).map_err(|error| SecurityError::Read { option, path: path.into(), error })
}

/// All certificates of a PEM, at least one.
fn certificates(bytes: &[u8]) -> Result<Vec<CertificateDer<'static>>, String> {
    let all: Vec<_> =
        CertificateDer::pem_slice_iter(bytes).collect::<Result<_, _>>().map_err(|error| pem(&error))?;
    if all.is_empty() { Err(pem(&PemError::NoItemsFound)) } else { Ok(all) }
}

fn pem(error: &PemError) -> String {
    match error {
        PemError::NoItemsFound => "the file has none".into(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair};
    use tempfile::TempDir;

    use super::*;

    /// Files of an end called `worker`.
    fn files() -> (TempDir, TlsFiles) {
        let folder = tempfile::tempdir().unwrap();
        let mut authority = CertificateParams::new([]).unwrap();
        authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let authority = CertifiedIssuer::self_signed(authority, KeyPair::generate().unwrap()).unwrap();
        let key = KeyPair::generate().unwrap();
        let end = CertificateParams::new(["worker".into()]).unwrap().signed_by(&key, &authority).unwrap();
        let write = |name: &str, text: String| {
            let path = folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let ca = write("ca.pem", authority.pem());
        let certificate = write("worker.pem", end.pem());
        let key = write("worker.key", key.serialize_pem());
        (folder, TlsFiles { ca, certificate, key })
    }

    fn refusal(files: &TlsFiles, words: &[&str]) {
        let refused = files.clone().load().unwrap_err().to_string();
        for word in words {
            assert!(refused.contains(word), "{word:?} is missing in: {refused}");
        }
    }

    #[test]
    fn files_that_fit_are_taken_for_names_that_can_be() {
        let (folder, gone) = files();
        drop(folder);
        refusal(&gone, &["--tls-ca", "ca.pem cannot be read"]);

        let (_folder, given) = files();
        let tls = given.load().unwrap();
        for name in ["worker", "127.0.0.1", "::1", "worker.example.org"] {
            assert!(tls.client(name).is_ok(), "{name}");
        }
        let refused = tls.client("no name").unwrap_err().to_string();
        assert!(refused.contains("\"no name\"") && refused.contains("--tls-name"), "{refused}");
        assert_eq!(format!("{tls:?}"), "Tls(hidden)");
    }

    #[test]
    fn a_connection_takes_the_files_as_they_are_then() {
        let ((_folder, files), (_other, others)) = (files(), files());
        let tls = files.clone().load().unwrap();
        let (first, shared) = (tls.server(), tls.clone());
        assert!(Arc::ptr_eq(&first, &tls.server()), "nothing has changed");

        std::fs::copy(&others.key, &files.key).unwrap();
        assert!(Arc::ptr_eq(&first, &tls.server()), "the key does not fit");
        std::fs::remove_file(&files.ca).unwrap();
        assert!(Arc::ptr_eq(&first, &tls.server()), "a file is missing");
        std::fs::copy(&others.ca, &files.ca).unwrap();
        std::fs::copy(&others.certificate, &files.certificate).unwrap();
        let second = tls.server();
        assert!(!Arc::ptr_eq(&first, &second), "the files have changed");
        assert!(Arc::ptr_eq(&second, &shared.server()), "clones differ");
    }

    #[test]
    fn a_wrong_file_is_named() {
        let (folder, files) = files();
        let other = KeyPair::generate().unwrap().serialize_pem();
        let text = folder.path().join("text");
        std::fs::write(&text, "no PEM at all").unwrap();
        let stranger = folder.path().join("stranger.key");
        std::fs::write(&stranger, other).unwrap();

        refusal(&TlsFiles { ca: text.clone(), ..files.clone() }, &["--tls-ca", "text is not a certificate"]);
        refusal(&TlsFiles { certificate: text.clone(), ..files.clone() }, &["--tls-cert", "text is not"]);
        refusal(&TlsFiles { key: text, ..files.clone() }, &["--tls-key", "text is not a private key"]);
        let swapped =
            TlsFiles { certificate: files.key.clone(), key: files.certificate.clone(), ..files.clone() };
        refusal(&swapped, &["--tls-cert", "worker.key is not a certificate in PEM: the file has none"]);
        refusal(
            &TlsFiles { key: stranger, ..files.clone() },
            &["stranger.key does not fit the certificate", "worker.pem"],
        );
        refusal(
            &TlsFiles { key: folder.path().join("none"), ..files },
            &["--tls-key", "none cannot be read"],
        );
    }
}
