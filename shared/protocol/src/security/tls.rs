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

/// PEM files of one end, and the authority of the other: both ends prove who they are.
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
        let Self { ca, certificate, key } = self;
        Tls::new(Files { ca: Some(ca), own: Some(Own { certificate, key }) }, vec![])
    }
}

/// What one end has: without an authority it cannot tell who the other end is, without a certificate it cannot prove who it is itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Files {
    pub ca: Option<PathBuf>,
    pub own: Option<Own>,
}

/// A certificate and its private key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Own {
    pub certificate: PathBuf,
    pub key: PathBuf,
}

impl Files {
    fn read(&self) -> Result<Contents, SecurityError> {
        let ca = self.ca.as_ref().map(|ca| read("--tls-ca", ca)).transpose()?;
        let own = self
            .own
            .as_ref()
            .map(|own| Ok((read("--tls-cert", &own.certificate)?, read("--tls-key", &own.key)?)));
        Ok(Contents { ca, own: own.transpose()? })
    }

    fn check(&self, contents: Contents, callers: &[ServerName<'static>]) -> Result<Loaded, SecurityError> {
        let roots = match (&self.ca, &contents.ca) {
            (Some(path), Some(ca)) => Some(roots(path, ca)?),
            _ => None,
        };
        let server = match (&self.own, &contents.own) {
            (Some(own), Some((certificate, key))) => {
                Some(Arc::new(own.server(certificate, key, roots, callers)?))
            }
            _ => None,
        };
        Ok(Loaded { contents, server })
    }

    /// The files' names, for a log.
    fn names(&self) -> String {
        let own = self.own.as_ref().map(|own| &own.certificate);
        own.or(self.ca.as_ref()).map(|path| path.display().to_string()).unwrap_or_default()
    }
}

impl Own {
    /// Configuration of a server that demands a certificate of these roots, where there are some.
    fn server(
        &self,
        certificate: &[u8],
        key: &[u8],
        roots: Option<RootCertStore>,
        callers: &[ServerName<'static>],
    ) -> Result<ServerConfig, SecurityError> {
        let chain = certificates(certificate)
            .map_err(|reason| content("--tls-cert", &self.certificate, CERTIFICATE, reason))?;
        let private = PrivateKeyDer::from_pem_slice(key)
            .map_err(|error| content("--tls-key", &self.key, "a private key in PEM", pem(&error)))?;
        let provider = Arc::new(ring::default_provider());
        server(provider, (roots, callers), chain, private).map_err(|error| SecurityError::Mismatch {
            certificate: self.certificate.clone(),
            key: self.key.clone(),
            reason: error.to_string(),
        })
    }
}

const CERTIFICATE: &str = "a certificate in PEM";

fn content(option: &'static str, path: &Path, expected: &'static str, reason: String) -> SecurityError {
    SecurityError::Content { option, path: path.into(), expected, reason }
}

fn roots(path: &Path, pem: &[u8]) -> Result<RootCertStore, SecurityError> {
    let wrong = |reason| content("--tls-ca", path, CERTIFICATE, reason);
    let mut roots = RootCertStore::empty();
    for authority in certificates(pem).map_err(wrong)? {
        roots.add(authority).map_err(|error| wrong(error.to_string()))?;
    }
    Ok(roots)
}

/// What is in the files of one end.
#[derive(PartialEq, Eq)]
struct Contents {
    ca: Option<Vec<u8>>,
    /// Certificate and key.
    own: Option<(Vec<u8>, Vec<u8>)>,
}

/// Contents that fit each other.
struct Loaded {
    contents: Contents,
    server: Option<Arc<ServerConfig>>,
}

struct State {
    loaded: Arc<Loaded>,
    /// Why the present files are not taken, if so: it is logged once.
    refused: Option<String>,
}

/// Certificate of this end, or the authority of the other, or both. Every new connection takes the files as they are then; where those do not
/// fit each other, as while they are being replaced, it takes the last that did. Clones share what was read.
#[derive(Clone)]
pub struct Tls {
    files: Files,
    /// Names that callers must have one of, if any.
    callers: Vec<ServerName<'static>>,
    state: Arc<Mutex<State>>,
}

impl Tls {
    pub(super) fn new(files: Files, callers: Vec<ServerName<'static>>) -> Result<Self, SecurityError> {
        let loaded = Arc::new(files.check(files.read()?, &callers)?);
        Ok(Self { files, callers, state: Arc::new(Mutex::new(State { loaded, refused: None })) })
    }

    /// The same for a server that takes callers only whose certificate has one of these names.
    pub(super) fn accepting(self, names: &[String]) -> Result<Self, SecurityError> {
        if !self.demands_certificates() {
            return Err(SecurityError::CallersWithoutTls);
        }
        let name = |name: &String| {
            ServerName::try_from(name.clone()).map_err(|_| SecurityError::Name { name: name.clone() })
        };
        Self::new(self.files, names.iter().map(name).collect::<Result<_, _>>()?)
    }

    /// Whether a server with these files demands certificates: else callers prove nothing by encryption.
    #[must_use]
    pub fn demands_certificates(&self) -> bool {
        self.files.ca.is_some()
    }

    /// Configuration of a server for its next connection: it demands a certificate of the authority, if there is one. Reads the files.
    ///
    /// # Errors
    /// When there is no certificate to show.
    pub fn server(&self) -> Result<Arc<ServerConfig>, SecurityError> {
        self.newest()
            .server
            .clone()
            .ok_or(SecurityError::Incomplete { missing: vec!["--tls-cert", "--tls-key"] })
    }

    /// Configuration of a client for its next connection: the other end's certificate must be of the authority and have this name (a
    /// DNS name or an IP address). It shows this end's certificate, if there is one. Reads the files.
    ///
    /// # Errors
    /// When no certificate can have that name, or there is no authority.
    pub fn client(&self, name: &str) -> Result<ClientTlsConfig, SecurityError> {
        ServerName::try_from(name).map_err(|_| SecurityError::Name { name: name.into() })?;
        let newest = self.newest();
        let ca =
            newest.contents.ca.as_ref().ok_or(SecurityError::Incomplete { missing: vec!["--tls-ca"] })?;
        let config = ClientTlsConfig::new().domain_name(name).ca_certificate(Certificate::from_pem(ca));
        Ok(match &newest.contents.own {
            Some((certificate, key)) => config.identity(Identity::from_pem(certificate, key)),
            None => config,
        })
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
                    tracing::info!(certificate = self.files.names(), "read changed certificates");
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
    (roots, callers): (Option<RootCertStore>, &[ServerName<'static>]),
    chain: Vec<CertificateDer<'static>>,
    key: PrivateKeyDer<'static>,
) -> Result<ServerConfig, Box<dyn std::error::Error>> {
    let mut verifier = match roots {
        Some(roots) => {
            WebPkiClientVerifier::builder_with_provider(roots.into(), Arc::clone(&provider)).build()?
        }
        None => WebPkiClientVerifier::no_client_auth(),
    };
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
        let server = |tls: &Tls| tls.server().unwrap();
        let (first, shared) = (server(&tls), tls.clone());
        assert!(Arc::ptr_eq(&first, &server(&tls)), "nothing has changed");

        std::fs::copy(&others.key, &files.key).unwrap();
        assert!(Arc::ptr_eq(&first, &server(&tls)), "the key does not fit");
        std::fs::remove_file(&files.ca).unwrap();
        assert!(Arc::ptr_eq(&first, &server(&tls)), "a file is missing");
        std::fs::copy(&others.ca, &files.ca).unwrap();
        std::fs::copy(&others.certificate, &files.certificate).unwrap();
        let second = server(&tls);
        assert!(!Arc::ptr_eq(&first, &second), "the files have changed");
        assert!(Arc::ptr_eq(&second, &server(&shared)), "clones differ");
    }

    #[test]
    fn an_end_has_what_its_part_needs() {
        let (_folder, TlsFiles { ca, certificate, key }) = files();
        let caller = Tls::new(Files { ca: Some(ca), own: None }, vec![]).unwrap();
        assert!(caller.client("worker").is_ok());
        assert!(caller.server().unwrap_err().to_string().contains("--tls-cert and --tls-key missing"));
        let server = Tls::new(Files { ca: None, own: Some(Own { certificate, key }) }, vec![]).unwrap();
        assert!(server.server().is_ok() && !server.demands_certificates());
        assert!(server.client("worker").unwrap_err().to_string().contains("--tls-ca missing"));
        let named = server.accepting(&["coordinator".to_owned()]).unwrap_err().to_string();
        assert!(named.contains("--tls-ca"), "{named}");
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
