use tonic::service::Interceptor;
use tonic::{Request, Status};

use super::{Caller, Token};

/// Refuses calls without the token, if one is demanded, before anything of them is read.
#[derive(Debug, Clone, Default)]
pub struct Guard {
    token: Option<Token>,
}

impl Guard {
    /// Demands this token, if any.
    #[must_use]
    pub fn new(token: Option<Token>) -> Self {
        Self { token }
    }
}

impl Interceptor for Guard {
    fn call(&mut self, request: Request<()>) -> Result<Request<()>, Status> {
        let Some(token) = &self.token else { return Ok(request) };
        match request.metadata().get("authorization") {
            Some(header) if token.is_in(header.as_bytes()) => {
                if let Some(caller) = request.extensions().get::<Caller>() {
                    caller.trust();
                }
                Ok(request)
            }
            Some(_) => Err(Status::unauthenticated(
                "the token is not this worker's: give --token-file with the same token on both sides",
            )),
            None => {
                Err(Status::unauthenticated("this worker demands a token: give its token with --token-file"))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tonic::Code;

    use super::*;
    use crate::security::ClientSecurity;

    #[test]
    fn only_calls_with_the_token_pass() {
        let token = |secret: &str| Token::new(secret).ok();
        let mut guard = Guard::new(token("0123456789abcdef"));
        let call = |secret: Option<&str>| {
            let security = ClientSecurity { token: secret.and_then(token), ..ClientSecurity::default() };
            security.credentials().call(Request::new(())).unwrap()
        };
        assert!(guard.call(call(Some("0123456789abcdef"))).is_ok());
        for wrong in [None, Some("0123456789abcdeF")] {
            let refused = guard.call(call(wrong)).unwrap_err();
            assert_eq!(refused.code(), Code::Unauthenticated);
            assert!(refused.message().contains("--token-file"), "{}", refused.message());
        }
        assert!(Guard::default().call(call(None)).is_ok());
    }
}
