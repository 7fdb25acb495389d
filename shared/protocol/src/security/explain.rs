use std::error::Error;
use std::io;

use h2::Reason;
use rustls::{AlertDescription, CertificateError, Error as TlsError};

/// Explains a failed handshake, with the cure; `None` if the error is of another kind.
///
/// With TLS 1.3 a caller learns only with its first answer that its own certificate was refused: the error may come with any
/// call.
#[must_use]
pub fn explain(error: &(dyn Error + 'static)) -> Option<String> {
    let mut next = Some(error);
    while let Some(error) = next {
        // The source of an I/O error is that of the error in it, which itself would be passed over.
        let inner = error.downcast_ref::<io::Error>().and_then(io::Error::get_ref);
        if let Some(found) = inner.and_then(|inner| inner.downcast_ref::<TlsError>()) {
            return Some(words(found));
        }
        if let Some(found) = error.downcast_ref::<TlsError>() {
            return Some(words(found));
        }
        // HTTP/2 keeps only the text of an alert.
        if let Some(alert) = error.downcast_ref::<io::Error>().and_then(alert) {
            return Some(words(&alert));
        }
        if let Some(found) = error.downcast_ref::<h2::Error>() {
            return explain_http(found);
        }
        next = match inner {
            Some(inner) => Some(inner),
            None => error.source(),
        };
    }
    None
}

/// The alerts that a refused certificate brings.
const REFUSALS: [AlertDescription; 9] = [
    AlertDescription::CertificateRequired,
    AlertDescription::CertificateExpired,
    AlertDescription::CertificateRevoked,
    AlertDescription::CertificateUnknown,
    AlertDescription::UnsupportedCertificate,
    AlertDescription::BadCertificate,
    AlertDescription::UnknownCA,
    AlertDescription::AccessDenied,
    AlertDescription::DecryptError,
];

fn explain_http(error: &h2::Error) -> Option<String> {
    if error.reason() == Some(Reason::FRAME_SIZE_ERROR) {
        // An alert of TLS, read as a frame, is far too long.
        return Some(format!(
            "the other end does not speak HTTP/2 in plain text: a worker with certificates takes --tls-ca, --tls-cert and \
             --tls-key, or --tls-ca and a token ({error})"
        ));
    }
    error.get_io().and_then(alert).map(|alert| words(&alert))
}

/// Finds the alert that an error's text is about.
fn alert(error: &io::Error) -> Option<TlsError> {
    let told = error.to_string();
    REFUSALS.into_iter().map(TlsError::AlertReceived).find(|alert| told.contains(&alert.to_string()))
}

fn words(error: &TlsError) -> String {
    let cure = match error {
        TlsError::InvalidCertificate(reason) => match reason {
            CertificateError::Expired | CertificateError::ExpiredContext { .. } => {
                "the other end's certificate has expired: make a new one"
            }
            CertificateError::NotValidYet | CertificateError::NotValidYetContext { .. } => {
                "the other end's certificate is not valid yet: check the clocks of both machines"
            }
            CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. } => {
                "the other end's certificate is for another name: dial it by that name, or give the name with --tls-name"
            }
            CertificateError::UnknownIssuer | CertificateError::BadSignature => {
                "the other end's certificate is not of the authority in --tls-ca: both ends need certificates of one"
            }
            CertificateError::InvalidPurpose | CertificateError::InvalidPurposeContext { .. } => {
                "the other end's certificate is for another purpose: extendedKeyUsage is clientAuth at callers, serverAuth at servers"
            }
            CertificateError::ApplicationVerificationFailure => {
                "the other end's certificate has none of the names in --tls-callers or --listen-tls-callers"
            }
            _ => "the other end's certificate is not accepted",
        },
        TlsError::NoCertificatesPresented => {
            "the other end shows no certificate: give it --tls-ca, --tls-cert and --tls-key"
        }
        TlsError::AlertReceived(alert) => match alert {
            AlertDescription::CertificateRequired => {
                "the other end demands a certificate: give --tls-cert and --tls-key"
            }
            AlertDescription::UnknownCA | AlertDescription::DecryptError => {
                "the other end does not accept this end's certificate: both ends need certificates of one authority"
            }
            AlertDescription::AccessDenied => {
                "the other end does not accept callers with the names of this end's certificate: its --tls-callers or --listen-tls-callers says which"
            }
            AlertDescription::CertificateExpired => "this end's certificate has expired: make a new one",
            refusal if REFUSALS.contains(refusal) => "the other end does not accept this end's certificate",
            _ => "the other end refuses the connection",
        },
        TlsError::InvalidMessage(_) => {
            "the other end does not speak TLS: give it --tls-cert and --tls-key too"
        }
        _ => "no agreement on encryption",
    };
    format!("{cure} ({error})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, thiserror::Error)]
    #[error("outer")]
    struct Outer(#[source] io::Error);

    #[test]
    fn a_handshake_error_is_found_below_others() {
        let expired = TlsError::InvalidCertificate(CertificateError::Expired);
        let nested = Outer(io::Error::other(io::Error::new(io::ErrorKind::InvalidData, expired)));
        let told = explain(&nested).unwrap();
        assert!(told.contains("has expired: make a new one"), "{told}");
        assert!(explain(&Outer(io::Error::other("nothing"))).is_none());
    }

    #[test]
    fn an_alert_is_found_in_words_alone() {
        let refused = TlsError::AlertReceived(AlertDescription::UnknownCA).to_string();
        let told = explain(&Outer(io::Error::other(refused))).unwrap();
        assert!(told.contains("does not accept this end's certificate"), "{told}");
    }
}
