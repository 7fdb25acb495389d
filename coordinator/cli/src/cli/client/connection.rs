use std::sync::Arc;
use std::time::Duration;

use anyhow::anyhow;
use clap::Args;
use protocol::api::MAX_MESSAGE_BYTES;
use protocol::api::radiosity_client::RadiosityClient;
use protocol::network::{self, Sockets};
use protocol::security::{SecuredChannel, explain};
use tokio::net::lookup_host;
use tokio::time::sleep;
use tonic::{Code, Status};

use super::super::console::say;
use super::super::workers::SecurityArguments;
use super::refused;

/// Time limit for connecting.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// Interval and timeout of keep-alive pings: a machine that lost its power does not close its connections.
const KEEP_ALIVE: Duration = Duration::from_secs(20);

/// First and longest pause before connecting again.
const FIRST_PAUSE: Duration = Duration::from_millis(500);
const LONGEST_PAUSE: Duration = Duration::from_secs(10);

/// Where the service is, and how to connect to it.
#[derive(Args)]
#[command(next_help_heading = "Service")]
pub struct ServerArgument {
    /// Address of the service
    #[arg(long, env = "COORDINATOR_SERVER", value_name = "HOST:PORT", default_value = "127.0.0.1:7000")]
    pub(super) server: String,
    #[command(flatten)]
    pub(super) security: SecurityArguments,
}

/// Client of the API.
pub(super) type Client = RadiosityClient<SecuredChannel>;

/// Why there is no answer.
#[derive(Debug)]
pub(super) enum Trouble {
    /// The service is not there now: connecting again may help.
    Passing(String),
    /// Connecting again does not help.
    Lasting(anyhow::Error),
}

impl From<Status> for Trouble {
    fn from(status: Status) -> Self {
        // Only a broken connection has a source.
        let is_broken = std::error::Error::source(&status).is_some() && explain(&status).is_none();
        if is_broken || status.code() == Code::Unavailable {
            Self::Passing(status.message().to_owned())
        } else {
            Self::Lasting(refused(status))
        }
    }
}

impl From<anyhow::Error> for Trouble {
    fn from(error: anyhow::Error) -> Self {
        Self::Lasting(error)
    }
}

impl ServerArgument {
    /// Connects to the service once.
    pub(super) async fn connect(&self) -> anyhow::Result<Client> {
        self.dial().await.map_err(|trouble| match trouble {
            Trouble::Passing(reason) => anyhow!(
                "no service at {}: start one with `coordinator serve`, or choose another --server ({reason})",
                self.server
            ),
            Trouble::Lasting(error) => error,
        })
    }

    async fn dial(&self) -> Result<Client, Trouble> {
        let passing = |error: &dyn std::error::Error| Trouble::Passing(error.to_string());
        let security = self.security.security()?;
        let mut found = lookup_host(&self.server).await.map_err(|error| passing(&error))?;
        let socket = found.next().ok_or_else(|| Trouble::Passing("the name stands for no address".into()))?;
        let endpoint = security.endpoint(&self.server, socket).map_err(anyhow::Error::from)?;
        let endpoint = endpoint
            .connect_timeout(CONNECT_TIMEOUT)
            .http2_keep_alive_interval(KEEP_ALIVE)
            .keep_alive_timeout(KEEP_ALIVE);
        let way = network::way(Arc::new(Sockets), socket);
        let channel = network::connect(&endpoint, way).await.map_err(|error| match explain(&error) {
            Some(reason) => Trouble::Lasting(anyhow!(reason)),
            None => passing(&error),
        })?;
        Ok(RadiosityClient::with_interceptor(channel, security.credentials())
            .max_decoding_message_size(MAX_MESSAGE_BYTES)
            .max_encoding_message_size(MAX_MESSAGE_BYTES))
    }
}

/// A connection to a service that is renewed when it breaks.
pub(super) struct Connection<'a> {
    server: &'a ServerArgument,
    /// The latest connection.
    pub client: Client,
    /// Pause before the next attempt.
    pause: Duration,
}

impl<'a> Connection<'a> {
    /// Connects for the first time; does not wait for a service that is not there.
    ///
    /// # Errors
    /// When the service is not there, or refuses.
    pub(super) async fn open(server: &'a ServerArgument) -> anyhow::Result<Self> {
        let client = server.connect().await?;
        Ok(Self { server, client, pause: FIRST_PAUSE })
    }

    /// Notes an answer of the service: the next interruption is a new one.
    pub(super) fn heard(&mut self) {
        if self.pause > FIRST_PAUSE {
            self.pause = FIRST_PAUSE;
            say(format_args!("the service at {} is there again", self.server.server));
        }
    }

    /// Connects again after an interruption, and retries until the service is there.
    ///
    /// # Errors
    /// When connecting again does not help.
    pub(super) async fn renew(&mut self, trouble: Trouble) -> anyhow::Result<()> {
        let mut trouble = trouble;
        loop {
            match trouble {
                Trouble::Lasting(error) => return Err(error),
                Trouble::Passing(reason) if self.pause == FIRST_PAUSE => {
                    say(format_args!(
                        "the service at {} is gone ({reason}): waiting for it",
                        self.server.server
                    ));
                }
                Trouble::Passing(_) => {}
            }
            sleep(self.pause).await;
            self.pause = (self.pause * 2).min(LONGEST_PAUSE);
            match self.server.dial().await {
                Ok(client) => {
                    self.client = client;
                    return Ok(());
                }
                Err(next) => trouble = next,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use protocol::network::CallError;

    use super::*;

    #[test]
    fn what_a_service_says_lasts_but_for_its_absence() {
        for code in [Code::NotFound, Code::Unauthenticated, Code::FailedPrecondition, Code::Internal] {
            let status = Status::new(code, "no");
            assert!(matches!(Trouble::from(status), Trouble::Lasting(_)), "{code:?}");
        }
        assert!(matches!(Trouble::from(Status::unavailable("it ends")), Trouble::Passing(_)));
    }

    #[test]
    fn a_connection_that_broke_passes() {
        let broken = std::io::Error::from(std::io::ErrorKind::ConnectionReset);
        assert!(matches!(Trouble::from(Status::from_error(broken.into())), Trouble::Passing(_)));
        assert!(matches!(Trouble::from(Status::from_error(CallError::Lost.into())), Trouble::Passing(_)));
    }
}
