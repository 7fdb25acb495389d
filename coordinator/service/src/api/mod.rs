//! The service in gRPC: translates messages to calls of [`Service`].
//!
//! | module | what lives there |
//! |---|---|
//! | `errors` | refusals as statuses, with details |

pub mod errors;

use std::pin::Pin;
use std::time::Duration;

use bytes::Bytes;
use protocol::api::fetch_result_response::Body as Sent;
use protocol::api::radiosity_server::Radiosity;
use protocol::api::submit_scene_request::Body as Received;
use protocol::api::{
    CancelJobRequest, DeleteJobRequest, DeleteJobResponse, FetchResultRequest, FetchResultResponse,
    GetJobRequest, Job, ListJobsRequest, ListJobsResponse, SubmitSceneRequest, WatchJobRequest,
};
use protocol::security::Caller;
use tokio::time::timeout;
use tokio_stream::{Stream, StreamExt};
use tonic::{Request, Response, Status, Streaming};

use super::clients::Clients;
use super::job::ClientName;
use super::refusal::Refusal;
use super::{Fetched, Service};

/// Time limit for the header of a submission.
const HEADER: Duration = Duration::from_secs(30);

/// The service as tonic calls it.
pub struct Api {
    service: Service,
    clients: Clients,
}

impl Api {
    /// Serves these clients.
    #[must_use]
    pub fn new(service: Service, clients: Clients) -> Self {
        Self { service, clients }
    }

    /// Identifies the caller.
    fn client<T>(&self, request: &Request<T>) -> Result<ClientName, Refusal> {
        let header = request.metadata().get("authorization");
        let client = self.clients.identify(header.map(|header| header.as_bytes()))?;
        if let Some(caller) = request.extensions().get::<Caller>() {
            caller.trust();
        }
        Ok(client)
    }
}

type Answer<T> = Result<Response<T>, Status>;

type Told<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

#[tonic::async_trait]
impl Radiosity for Api {
    type WatchJobStream = Told<Job>;
    type FetchResultStream = Told<FetchResultResponse>;

    async fn submit_scene(&self, request: Request<Streaming<SubmitSceneRequest>>) -> Answer<Job> {
        let client = self.client(&request)?;
        let mut messages = request.into_inner();
        let first = timeout(HEADER, messages.message()).await;
        let first = first.map_err(|_| Refusal::Broken("no header came".into()))??;
        let Some(Received::Header(header)) = first.and_then(|message| message.body) else {
            return Err(Refusal::invalid("header", "must come first").into());
        };
        let chunks = messages.map(chunk);
        Ok(Response::new(self.service.submit(&client, header, chunks).await?))
    }

    async fn get_job(&self, request: Request<GetJobRequest>) -> Answer<Job> {
        let client = self.client(&request)?;
        Ok(Response::new(self.service.get(&client, &request.get_ref().id)?))
    }

    async fn list_jobs(&self, request: Request<ListJobsRequest>) -> Answer<ListJobsResponse> {
        let client = self.client(&request)?;
        Ok(Response::new(self.service.list(&client, request.get_ref())?))
    }

    async fn watch_job(&self, request: Request<WatchJobRequest>) -> Answer<Self::WatchJobStream> {
        let client = self.client(&request)?;
        let jobs = self.service.watch(&client, &request.get_ref().id)?;
        Ok(Response::new(Box::pin(jobs.map(|job| job.map_err(Status::from)))))
    }

    async fn fetch_result(&self, request: Request<FetchResultRequest>) -> Answer<Self::FetchResultStream> {
        let client = self.client(&request)?;
        let Fetched { header, bytes } = self.service.fetch(&client, request.get_ref()).await?;
        let header = FetchResultResponse { body: Some(Sent::Header(header)) };
        let chunks = bytes.map(|bytes| {
            let chunk = |bytes| FetchResultResponse { body: Some(Sent::Chunk(bytes)) };
            bytes.map(chunk).map_err(Status::from)
        });
        Ok(Response::new(Box::pin(tokio_stream::once(Ok(header)).chain(chunks))))
    }

    async fn cancel_job(&self, request: Request<CancelJobRequest>) -> Answer<Job> {
        let client = self.client(&request)?;
        Ok(Response::new(self.service.cancel(&client, &request.get_ref().id).await?))
    }

    async fn delete_job(&self, request: Request<DeleteJobRequest>) -> Answer<DeleteJobResponse> {
        let client = self.client(&request)?;
        self.service.delete(&client, &request.get_ref().id).await?;
        Ok(Response::new(DeleteJobResponse {}))
    }
}

/// Returns the bytes of an upload message.
fn chunk(message: Result<SubmitSceneRequest, Status>) -> Result<Bytes, Refusal> {
    match message {
        Ok(SubmitSceneRequest { body: Some(Received::Chunk(bytes)) }) => Ok(bytes),
        Ok(_) => Err(Refusal::invalid("chunk", "must follow the header, and nothing else")),
        Err(status) => Err(Refusal::Broken(status.message().into())),
    }
}
