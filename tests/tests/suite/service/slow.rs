use std::net::TcpListener;

use protocol::api::fetch_result_response::Body;
use protocol::api::{FetchResultRequest, FetchResultResponse, Job, State, WatchJobRequest};
use tests::builder::{Material, SceneBuilder};
use tests::painting::Painting;
use tests::shapes;
use tonic::Streaming;

use super::{Asker, Room, header};
use crate::telemetry::figures;

/// Clients that do not read.
const SLOW: usize = 8;

/// Bytes that may be on their way to a client which does not read: those in the sockets of both ends and in the windows of
/// HTTP/2. Much less than the lit file has.
const UNDER_WAY: u64 = 4 << 20;

/// A scene that is quick to bake, with a picture of noise, which no coding makes smaller.
fn heavy_scene() -> Vec<u8> {
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    let texels: Vec<[u8; 4]> = (0..2048 * 2048).map(|_| [noise(), noise(), noise(), noise()]).collect();
    let walls = SceneBuilder::new().part("walls", &shapes::unit_room(), Material::grey(0.5).emitting(1.0));
    Painting::new(&walls)
        .coordinates(0, |position| [position.x, position.y])
        .texture(0, &texels, |material, texture| material["normalTexture"] = texture)
        .glb()
}

fn watch(asker: &mut Asker, id: &str) -> Streaming<Job> {
    let watch = WatchJobRequest { id: id.into() };
    asker.ask(watch, async |client, request| client.watch_job(request).await).unwrap()
}

fn fetch(asker: &mut Asker, id: &str) -> Streaming<FetchResultResponse> {
    let fetch = FetchResultRequest { id: id.into(), ..FetchResultRequest::default() };
    asker.ask(fetch, async |client, request| client.fetch_result(request).await).unwrap()
}

/// Size of the lit file of a job that is watched until it is done.
fn watch_to_the_end(asker: &mut Asker, id: &str) -> u64 {
    let mut jobs = watch(asker, id);
    let mut last = None;
    while let Some(job) = asker.runtime.block_on(jobs.message()).unwrap() {
        last = Some(job);
    }
    let last = last.unwrap();
    assert_eq!(last.state(), State::Done, "{}", last.failure);
    last.outcome.unwrap().size
}

/// The next message has so many bytes of the file; `None` after the last one.
fn take(asker: &Asker, parts: &mut Streaming<FetchResultResponse>) -> Option<u64> {
    let part = asker.runtime.block_on(parts.message()).unwrap()?;
    Some(match part.body {
        Some(Body::Chunk(chunk)) => chunk.len() as u64,
        _ => 0,
    })
}

#[test]
fn those_who_do_not_read_hold_up_nobody_and_cost_little() {
    let room = Room::new();
    let metrics = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let service = room.start(&["--metrics", &metrics]);
    let shown = |name: &str| figures(&metrics).unwrap()[&format!("halflight_service_{name}")] as u64;
    let scene = heavy_scene();
    let mut quick = Asker::new(&service, None);
    let mut slow: Vec<Asker> = (0..SLOW).map(|_| Asker::new(&service, None)).collect();

    let id = quick.submit(header(&scene), &scene.chunks(1 << 20).collect::<Vec<_>>()).unwrap().id;
    let _watchers: Vec<_> = slow.iter_mut().map(|asker| watch(asker, &id)).collect();
    let size = watch_to_the_end(&mut quick, &id);
    assert!(size > 2 * UNDER_WAY, "the lit file is too small to tell anything");

    // Each takes the header and a chunk, and stops.
    let mut stopped: Vec<_> = slow.iter_mut().map(|asker| fetch(asker, &id)).collect();
    for (asker, parts) in slow.iter().zip(&mut stopped) {
        assert_eq!(take(asker, parts), Some(0));
        assert!(take(asker, parts).is_some_and(|bytes| bytes > 0));
    }
    let mut parts = fetch(&mut quick, &id);
    let mut taken = 0;
    while let Some(bytes) = take(&quick, &mut parts) {
        taken += bytes;
    }
    assert_eq!(taken, size);
    let read = shown("results_sent_bytes_total") - size;
    assert!(
        read <= SLOW as u64 * UNDER_WAY,
        "{read} bytes are read for {SLOW} clients that do not take them"
    );
    // Another job ends as well, watched and not.
    let again = quick.submit(header(&scene), &[]).unwrap().id;
    let _more: Vec<_> = slow.iter_mut().map(|asker| watch(asker, &again)).collect();
    assert_eq!(watch_to_the_end(&mut quick, &again), size);
}
