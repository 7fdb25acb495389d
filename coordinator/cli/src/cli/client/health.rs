use protocol::api::radiosity_server::SERVICE_NAME;
use worker::health::check;

use super::{ServerArgument, wait};

/// Checks that a service serves; needs no token.
pub fn run(server: &ServerArgument) -> anyhow::Result<()> {
    wait(async { Ok(check(&server.server, SERVICE_NAME, &server.security.security()?).await?) })
}
