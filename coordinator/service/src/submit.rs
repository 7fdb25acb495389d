use std::collections::{HashSet, hash_map};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use bytes::{Bytes, BytesMut};
use protocol::api::submit_scene_header::Source;
use protocol::api::{Job, State, SubmitSceneHeader};
use tokio::time::{Instant, timeout, timeout_at};
use tokio_stream::{Stream, StreamExt};
use tokio_util::sync::CancellationToken;

use bake::{NewLight, listed};

use crate::job::{ClientName, JobId, Record, Relit, SceneDigest, Sequence, next_revision};
use crate::refusal::Refusal;
use crate::store::Upload;
use crate::sync::lock;
use crate::{Inner, Service, blocking};
use pipeline::options::{Violations, new_light, wanted};

/// Least bytes written at once: chunks may be as short as a byte.
const WRITE_BYTES: usize = 256 << 10;

/// How long an upload may take to get going, even where nobody waits for its place.
const PATIENCE: Duration = Duration::from_secs(2);

/// Seconds a kibibyte that an upload may take on the average, while others wait.
const LEAST_PACE: f64 = 1.0 / 32.0;

/// Most bytes of a header.
const HEADER_BYTES: usize = 256 << 10;

impl Service {
    /// Accepts a job: its header, then the bytes of the scene unless the service has them. The job is on disk when this returns.
    /// Chunks are pulled as fast as they can be written, up to the announced size.
    ///
    /// # Errors
    /// When the request is invalid, a limit is reached, or the scene's bytes are needed and do not arrive.
    pub async fn submit<S>(
        &self,
        client: &ClientName,
        header: SubmitSceneHeader,
        chunks: S,
    ) -> Result<Job, Refusal>
    where
        S: Stream<Item = Result<Bytes, Refusal>> + Send,
    {
        // A repeated submission first: what it refers to may be deleted by now.
        let known = self.inner.known(&lock(&self.inner.ledger), client, &header)?;
        if let Some(known) = known {
            return self.get(client, &known.to_string());
        }
        let (draft, size) = self.inner.draft(client, header)?;
        let id = self.inner.submit(draft, size, chunks).await?;
        self.get(client, &id.to_string())
    }
}

impl Inner {
    /// Checks a submission; returns its record and the size of its scene.
    fn draft(&self, client: &ClientName, header: SubmitSceneHeader) -> Result<(Record, u64), Refusal> {
        let mut wrong = Violations::default();
        let is_small = prost::Message::encoded_len(&header) <= HEADER_BYTES;
        wrong.demand(is_small, "header", format!("must have {HEADER_BYTES} bytes at most"));
        let wanted = wanted(&header, &mut wrong);
        let groups = wanted.bake.groups;
        let asked = header.bake.and_then(|bake| bake.max_vertices);
        wrong.demand(
            asked.is_none_or(|vertices| vertices <= self.limits.vertices),
            "bake.max_vertices",
            format!("must be {} at most: that is this service's limit", self.limits.vertices),
        );
        let mut source = None;
        match &header.source {
            Some(Source::File(scene)) => {
                let digest = <[u8; 32]>::try_from(&*scene.sha256).ok();
                wrong.demand(digest.is_some(), "file.sha256", "must have 32 bytes");
                wrong.demand(
                    scene.size > 0,
                    "file.size",
                    "must be the length of the file: there is no empty scene",
                );
                source = digest.map(|digest| (SceneDigest(digest), scene.size, None));
            }
            Some(Source::Relight(relight)) => {
                let light = new_light(relight, &mut wrong);
                wrong.demand(
                    wanted.lightmap.is_none(),
                    "output.lightmap",
                    "is not for relights: bake the scene again",
                );
                wrong.demand(
                    wanted.occlusion.is_none(),
                    "output.occlusion",
                    "is not for relights: bake the scene again",
                );
                wrong.demand(
                    wanted.probes.is_none(),
                    "output.probes",
                    "are not for relights: bake the scene again",
                );
                // Look up the job only for a valid request.
                wrong = wrong.check().map(|()| Violations::default())?;
                let light = NewLight { groups, ..light };
                let (scene, relit) = self.relit(client, &relight.job_id, &light, &mut wrong)?;
                source = Some((scene, 0, Some(relit)));
            }
            None => wrong.demand(false, "source", "must be a file or a job to relight"),
        }
        wrong.check()?;
        let (scene, size, relit) = source.ok_or_else(|| Refusal::invalid("source", "must be a file"))?;
        if size > self.limits.upload_bytes {
            return Err(Refusal::exhausted(
                "upload",
                format!(
                    "the scene has {size} bytes, and this service takes {} at most: make its textures smaller, or ask its operator",
                    self.limits.upload_bytes
                ),
            ));
        }
        let id = JobId::random().map_err(|error| Refusal::Failed(error.to_string()))?;
        let record = Record {
            id,
            client: client.clone(),
            sequence: Sequence::default(),
            header,
            scene,
            relit,
            state: State::Queued,
            failure: String::new(),
            submitted: SystemTime::now(),
            started: None,
            ended: None,
            outcome: None,
            revision: next_revision(0),
            crashes: 0,
        };
        Ok((record, size))
    }

    /// Returns what a relight needs of the baked job.
    fn relit(
        &self,
        client: &ClientName,
        job: &str,
        light: &NewLight,
        wrong: &mut Violations,
    ) -> Result<(SceneDigest, Relit), Refusal> {
        let record = lock(&self.ledger).of_client(client, job)?.record.clone();
        let outcome = record.outcome.as_ref().filter(|_| record.state == State::Done);
        let outcome = outcome.ok_or(Refusal::NotDone(record.id))?;
        if !outcome.can_be_relit {
            return Err(Refusal::NoLight(record.id));
        }
        let known: HashSet<&String> = outcome.lights.iter().collect();
        let changed = light.changes.iter().map(|change| ("relight.lights", &change.light));
        let grouped = light.groups.iter().flat_map(|group| &group.lights);
        let mut named = changed.chain(grouped.map(|light| ("output.groups", light)));
        if let Some((field, unknown)) = named.find(|(_, light)| !known.contains(light)) {
            let should = format!("must name the job's lights, not {unknown:?}: {}", listed(&outcome.lights));
            wrong.demand(false, field, should);
        }
        let options = match &record.relit {
            Some(relit) => relit.options.clone(),
            None => record.header.scene.clone().unwrap_or_default(),
        };
        Ok((record.scene, Relit { baked: record.light(), options }))
    }

    async fn submit<S>(self: &Arc<Self>, draft: Record, size: u64, chunks: S) -> Result<JobId, Refusal>
    where
        S: Stream<Item = Result<Bytes, Refusal>> + Send,
    {
        let was_sent = {
            let ledger = lock(&self.ledger);
            if let Some(known) = self.known(&ledger, &draft.client, &draft.header)? {
                return Ok(known);
            }
            ledger.has_scene(&draft.client, draft.scene)
        };
        self.check_room(size).await?;
        let (inner, scene) = (Arc::clone(self), draft.scene);
        // A relight cannot send it again: its job will say what is wrong.
        let known =
            draft.relit.is_some() || (was_sent && blocking(move || Ok(inner.store.has_scene(scene))).await?);
        let upload = if known {
            None
        } else {
            let counted = self.count_upload(&draft.client)?;
            let _shown = self.metrics.uploading();
            let took_too_long = Refusal::Broken("it took longer than this service allows".into());
            let receiving =
                timeout(self.limits.upload_time, self.receive(draft.scene, size, chunks, &counted));
            Some(tokio::select! {
                received = receiving => received.unwrap_or(Err(took_too_long))?,
                () = counted.pace.lost.cancelled() => {
                    return Err(Refusal::Broken("it came too slowly while others waited: send it again".into()));
                }
            })
        };
        let inner = Arc::clone(self);
        blocking(move || inner.accept(draft, upload.as_ref())).await
    }

    async fn check_room(self: &Arc<Self>, size: u64) -> Result<(), Refusal> {
        let inner = Arc::clone(self);
        let (free, is_reserved) = blocking(move || Ok((inner.store.free()?, inner.store.reserve()))).await?;
        if !is_reserved || free < self.limits.free_bytes.saturating_add(size) {
            return Err(Refusal::exhausted(
                "disk",
                "there is no room on the service's disk: delete jobs, or ask its operator",
            ));
        }
        Ok(())
    }

    /// Receives a scene's bytes.
    async fn receive<S>(
        self: &Arc<Self>,
        scene: SceneDigest,
        size: u64,
        chunks: S,
        counted: &Counted,
    ) -> Result<Upload, Refusal>
    where
        S: Stream<Item = Result<Bytes, Refusal>> + Send,
    {
        tokio::pin!(chunks);
        let silence = || Instant::now() + self.limits.upload_silence;
        let fell_silent = |_| Refusal::Broken("nothing came for longer than this service allows".into());
        // Creates no file before the first chunk.
        let mut next = timeout_at(silence(), chunks.next()).await.map_err(fell_silent)?;
        if next.is_none() {
            return Err(Refusal::SceneMissing(scene));
        }
        let inner = Arc::clone(self);
        let mut upload = blocking(move || Ok(inner.store.begin_upload()?)).await?;
        let mut gathered = BytesMut::new();
        loop {
            let chunk = next.transpose()?;
            let is_last = chunk.is_none();
            let chunk = chunk.unwrap_or_default();
            counted.pace.bytes.fetch_add(chunk.len() as u64, Ordering::Relaxed);
            gathered.extend_from_slice(&chunk);
            if upload.received() + gathered.len() as u64 > size {
                return Err(Refusal::invalid(
                    "file.size",
                    "is less than what came: it must be the length of the file",
                ));
            }
            if gathered.len() >= WRITE_BYTES || is_last {
                self.metrics.received(gathered.len());
                let bytes = gathered.split().freeze();
                upload = blocking(move || {
                    upload.write(&bytes)?;
                    Ok(upload)
                })
                .await?;
            }
            if is_last {
                break;
            }
            next = timeout_at(silence(), chunks.next()).await.map_err(fell_silent)?;
        }
        if upload.received() != size {
            let should =
                format!("is not what came, {} bytes: it must be the length of the file", upload.received());
            return Err(Refusal::invalid("file.size", should));
        }
        if upload.digest() != scene {
            return Err(Refusal::invalid(
                "file.sha256",
                "is not that of the bytes that came: send the file again",
            ));
        }
        Ok(upload)
    }

    /// Counts an upload of this client while the result is held. Where it has as many as it may have, the slowest gives way.
    fn count_upload(self: &Arc<Self>, client: &ClientName) -> Result<Counted, Refusal> {
        let mut uploads = lock(&self.uploads);
        let paces = uploads.entry(client.clone()).or_default();
        let count = paces.len();
        if count >= self.limits.uploads_of_a_client {
            let slow = paces.iter().enumerate().filter_map(|(index, pace)| Some((index, pace.slowness()?)));
            let Some((slowest, _)) = slow.max_by(|a, b| a.1.total_cmp(&b.1)) else {
                let description = format!(
                    "{count} uploads of this client are under way, and it may have no more at the same time: try again"
                );
                return Err(Refusal::exhausted(format!("client:{client}"), description));
            };
            paces.remove(slowest).lost.cancel();
        }
        let pace = Arc::new(Pace {
            began: Instant::now(),
            bytes: AtomicU64::new(0),
            lost: CancellationToken::new(),
        });
        paces.push(Arc::clone(&pace));
        Ok(Counted { inner: Arc::clone(self), client: client.clone(), pace })
    }
}

/// How an upload comes along.
#[derive(Debug)]
pub(super) struct Pace {
    began: Instant,
    bytes: AtomicU64,
    /// Cancelled when another upload has taken its place.
    lost: CancellationToken,
}

impl Pace {
    /// Seconds that a kibibyte takes, where that is so long that another upload may take its place.
    fn slowness(&self) -> Option<f64> {
        let (seconds, bytes) = (self.began.elapsed().as_secs_f64(), self.bytes.load(Ordering::Relaxed));
        let slowness = seconds * 1024.0 / bytes.max(1) as f64;
        (seconds >= PATIENCE.as_secs_f64() && slowness > LEAST_PACE).then_some(slowness)
    }
}

/// An upload in progress, counted until it is dropped.
struct Counted {
    inner: Arc<Inner>,
    client: ClientName,
    pace: Arc<Pace>,
}

impl Drop for Counted {
    fn drop(&mut self) {
        if let hash_map::Entry::Occupied(mut paces) = lock(&self.inner.uploads).entry(self.client.clone()) {
            paces.get_mut().retain(|pace| !Arc::ptr_eq(pace, &self.pace));
            if paces.get().is_empty() {
                paces.remove();
            }
        }
    }
}
