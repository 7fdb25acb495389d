//! Certificates of an authority of the test's own.

use std::fs;
use std::path::{Path, PathBuf};

use protocol::security::TlsFiles;
pub use rcgen::ExtendedKeyUsagePurpose;
use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, IsCa, KeyPair, date_time_ymd};
use tempfile::TempDir;

/// An authority, and a folder for what it signs.
pub struct Authority {
    issuer: CertifiedIssuer<'static, KeyPair>,
    folder: TempDir,
}

impl Authority {
    /// A new authority, which nobody knows yet.
    ///
    /// # Panics
    /// When there is no room for its files.
    #[must_use]
    pub fn new() -> Self {
        let mut parameters = CertificateParams::default();
        parameters.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        let key = KeyPair::generate().expect("keys can be made");
        let issuer = CertifiedIssuer::self_signed(parameters, key).expect("an authority signs itself");
        Self { issuer, folder: tempfile::tempdir().expect("there is room for a folder") }
    }

    /// Files of an end that has these names.
    ///
    /// # Panics
    /// When a name is none, or there is no room for the files.
    #[must_use]
    pub fn sign(&self, names: &[&str]) -> TlsFiles {
        self.sign_as(names, |_| {})
    }

    /// The same, but the certificate was good for one day of 2020.
    ///
    /// # Panics
    /// As for [`Self::sign`].
    #[must_use]
    pub fn sign_expired(&self, names: &[&str]) -> TlsFiles {
        self.sign_as(names, |parameters| {
            parameters.not_before = date_time_ymd(2020, 1, 1);
            parameters.not_after = date_time_ymd(2020, 1, 2);
        })
    }

    /// The same for servers only, or for callers only.
    ///
    /// # Panics
    /// As for [`Self::sign`].
    #[must_use]
    pub fn sign_for(&self, names: &[&str], purpose: ExtendedKeyUsagePurpose) -> TlsFiles {
        self.sign_as(names, |parameters| parameters.extended_key_usages = vec![purpose])
    }

    fn sign_as(&self, names: &[&str], change: impl FnOnce(&mut CertificateParams)) -> TlsFiles {
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        let mut parameters = CertificateParams::new(names).expect("names that certificates can have");
        change(&mut parameters);
        let key = KeyPair::generate().expect("keys can be made");
        let certificate = parameters.signed_by(&key, &self.issuer).expect("an authority signs");
        TlsFiles {
            ca: self.write("ca", &self.issuer.pem()),
            certificate: self.write("certificate", &certificate.pem()),
            key: self.write("key", &key.serialize_pem()),
        }
    }

    /// Writes a file of its own.
    fn write(&self, name: &str, text: &str) -> PathBuf {
        let number = fs::read_dir(self.folder.path()).expect("the folder is there").count();
        let path = self.folder.path().join(format!("{name}-{number}.pem"));
        fs::write(&path, text).expect("there is room for a file");
        path
    }
}

impl Default for Authority {
    fn default() -> Self {
        Self::new()
    }
}

/// The files as arguments of either program.
///
/// # Panics
/// When a path is not text.
#[must_use]
pub fn arguments(files: &TlsFiles) -> [&str; 6] {
    ["--tls-ca", path(&files.ca), "--tls-cert", path(&files.certificate), "--tls-key", path(&files.key)]
}

/// What a server needs of the files where its callers show a token.
///
/// # Panics
/// As [`arguments`].
#[must_use]
pub fn of_server(files: &TlsFiles) -> [&str; 4] {
    let [_, _, rest @ ..] = arguments(files);
    rest
}

/// What their callers need.
///
/// # Panics
/// As [`arguments`].
#[must_use]
pub fn of_caller(files: &TlsFiles) -> [&str; 2] {
    let [option, ca, ..] = arguments(files);
    [option, ca]
}

fn path(file: &Path) -> &str {
    file.to_str().expect("temporary paths are text")
}
