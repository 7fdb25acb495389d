use std::net::SocketAddr;

use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::Endpoint;
use tonic::{Request, Status};

use crate::network::Line;

use super::{SecurityError, Token, Transport};

/// Settings of a coordinator to dial workers. The default is plain text on this machine, without a token.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ClientSecurity {
    /// Encryption of connections.
    pub transport: Transport,
    /// Name in the workers' certificates, if it is not the one that they are dialled by.
    pub server_name: Option<String>,
    /// Token that the workers demand.
    pub token: Option<Token>,
}

/// A channel whose calls carry the token.
pub type SecuredChannel = InterceptedService<Line, Credentials>;

impl ClientSecurity {
    /// Endpoint of a worker that was given as `host:port` and has this socket address.
    ///
    /// The worker's certificate must have the name *as given*, or [`Self::server_name`]: a name may stand for many machines,
    /// each of which then has a certificate of that name, and an address found by the name server proves nothing.
    ///
    /// # Errors
    /// When plain text would go further than it was allowed to, or the host cannot be the name of a certificate.
    pub fn endpoint(&self, given: &str, socket: SocketAddr) -> Result<Endpoint, SecurityError> {
        self.transport.allows(socket)?;
        let failed = |error: tonic::transport::Error| SecurityError::Endpoint {
            address: socket,
            reason: error.to_string(),
        };
        let scheme = if self.transport.tls().is_some() { "https" } else { "http" };
        let endpoint = Endpoint::from_shared(format!("{scheme}://{socket}")).map_err(failed)?;
        let Some(tls) = self.transport.tls() else { return Ok(endpoint) };
        let name = self.server_name.as_deref().unwrap_or_else(|| host(given));
        endpoint.tls_config(tls.client(name)?).map_err(failed)
    }

    /// Credentials of every call: `WorkerClient::with_interceptor(channel, security.credentials())`.
    #[must_use]
    pub fn credentials(&self) -> Credentials {
        Credentials { header: self.token.as_ref().map(Token::header) }
    }
}

/// The host of `host:port`, without the brackets of an IPv6 address.
fn host(given: &str) -> &str {
    let host = given.rsplit_once(':').map_or(given, |(host, _)| host);
    host.strip_prefix('[').and_then(|host| host.strip_suffix(']')).unwrap_or(host)
}

/// Puts the token, if any, into the header `authorization` of every call.
#[derive(Debug, Clone, Default)]
pub struct Credentials {
    header: Option<MetadataValue<Ascii>>,
}

impl Interceptor for Credentials {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(header) = &self.header {
            request.metadata_mut().insert("authorization", header.clone());
        }
        Ok(request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_host_as_given_is_the_name_of_the_certificate() {
        for (given, name) in [
            ("worker:7070", "worker"),
            ("10.0.0.1:7070", "10.0.0.1"),
            ("[::1]:7070", "::1"),
            ("worker", "worker"),
        ] {
            assert_eq!(host(given), name);
        }
    }

    #[test]
    fn a_dialled_address_obeys_the_rule_for_plain_text() {
        let beyond = "10.0.0.1:7070".parse().unwrap();
        let refused = ClientSecurity::default().endpoint("worker:7070", beyond).unwrap_err();
        assert!(matches!(refused, SecurityError::Plaintext { address } if address == beyond));
        let asked =
            ClientSecurity { transport: Transport::Plain { anywhere: true }, ..ClientSecurity::default() };
        assert_eq!(asked.endpoint("worker:7070", beyond).unwrap().uri(), "http://10.0.0.1:7070/");
    }

    #[test]
    fn calls_carry_the_token_as_a_secret() {
        let token = Token::new("0123456789abcdef").unwrap();
        let security = ClientSecurity { token: Some(token.clone()), ..ClientSecurity::default() };
        let request = security.credentials().call(Request::new(())).unwrap();
        let header = request.metadata().get("authorization").unwrap();
        assert!(header.is_sensitive() && token.is_in(header.as_bytes()));
        let without = ClientSecurity::default().credentials().call(Request::new(())).unwrap();
        assert!(without.metadata().is_empty());
    }
}
