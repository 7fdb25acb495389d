//! The API of a service from the shell.
//!
//! | module | command |
//! |---|---|
//! | `submit` | hand over a scene |
//! | `watch` | see how far a job is |
//! | `fetch` | take what came out |
//! | `jobs` | list, cancel and delete jobs |

mod fetch;
mod jobs;
mod submit;
mod watch;

use std::future::Future;

use anyhow::Context;
use clap::Args;
use shared::api::MAX_MESSAGE_BYTES;
use shared::api::radiosity_client::RadiosityClient;
use shared::security::{ClientSecurity, SecuredChannel, explain};
use tokio::net::lookup_host;
use tonic::Status;

pub use fetch::FetchArguments;
pub use jobs::{JobArguments, JobsArguments};
pub use submit::SubmitArguments;
pub use watch::WatchArguments;

pub use fetch::run as fetch;
pub use jobs::{cancel, delete, list};
pub use submit::run as submit;
pub use watch::run as watch;

/// Where the service is. Certificates and token are those of the options for workers.
#[derive(Args)]
pub struct ServerArgument {
    /// Service that is asked, as host:port.
    #[arg(long, env = "COORDINATOR_SERVER", value_name = "HOST:PORT", default_value = "127.0.0.1:7000")]
    server: String,
}

/// The service as it is asked.
type Client = RadiosityClient<SecuredChannel>;

impl ServerArgument {
    async fn connect(&self, security: &ClientSecurity) -> anyhow::Result<Client> {
        let unreachable = || {
            format!(
                "no service at {}: start one with `coordinator serve`, or choose another --server",
                self.server
            )
        };
        let mut found = lookup_host(&self.server).await.with_context(unreachable)?;
        let socket = found.next().with_context(unreachable)?;
        let channel = match security.endpoint(&self.server, socket)?.connect().await {
            Ok(channel) => channel,
            Err(error) => match explain(&error) {
                Some(reason) => anyhow::bail!("{reason}"),
                None => return Err(error).with_context(unreachable),
            },
        };
        Ok(RadiosityClient::with_interceptor(channel, security.credentials())
            .max_decoding_message_size(MAX_MESSAGE_BYTES)
            .max_encoding_message_size(MAX_MESSAGE_BYTES))
    }
}

/// Waits for a conversation with a service.
fn wait<T>(conversation: impl Future<Output = anyhow::Result<T>>) -> anyhow::Result<T> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .context("cannot start the network")?;
    runtime.block_on(conversation)
}

/// What a service says, in its own words.
fn refused(status: Status) -> anyhow::Error {
    match explain(&status) {
        Some(reason) => anyhow::anyhow!("{reason}"),
        None if status.message().is_empty() => anyhow::anyhow!("the service answers {}", status.code()),
        None => anyhow::anyhow!("{}", status.message()),
    }
}
