use protocol::api::radiosity_server::SERVICE_NAME;
use protocol::security::ClientSecurity;
use worker::health::check;

use super::{ServerArgument, wait};

/// Asks a service whether it serves. It takes no token for that.
pub fn run(server: &ServerArgument, security: &ClientSecurity) -> anyhow::Result<()> {
    wait(async { Ok(check(&server.server, SERVICE_NAME, security).await?) })
}
