//! Shooting as rows arrive.

use std::collections::{HashMap, HashSet, VecDeque};

use glam::DVec3;
use kernel::row::Row;

use super::share_mesh::ShareMesh;
use super::table::RowTable;
use super::vertices::COARSE;
use crate::context::Context;
use crate::error::Result;
use crate::jobs::RowClient;
use crate::solver::shooting::Shooting;
use crate::solver::{Light, ShareEnergy, ShareId};

/// The first solution ends here at the latest: it must only show where the mesh is to be refined.
pub const FIRST_TOLERANCE: f64 = 1e-3;

/// The rows under way while shooting are cut into this many jobs at least,
const JOBS_IN_WINDOW: usize = 16;

/// and into this many per thread: one that is computed, one that waits, one on its way.
const JOBS_PER_THREAD: usize = 3;

/// Shoots until little is left. Returns the radiosity that each share has shot.
///
/// The window bounds how many rows shooting waits for, and a row that is late holds it up. Sweeps will need all rows, so
/// threads that would idle meanwhile make those that shooting did not ask for yet, as long as there is memory to keep
/// them.
pub fn shoot<L: Light>(
    cx: &mut Context,
    mesh: &ShareMesh,
    table: &mut RowTable,
    direct: &[DVec3],
    colour: DVec3,
) -> Result<Vec<DVec3>> {
    cx.client.monitor.expect_rows(mesh.shares.len() as u64);
    let energies = mesh.energies.iter().map(ShareEnergy::seen_as).collect();
    let light = direct.iter().map(|light| L::from_rgb(*light, colour)).collect();
    let threshold = cx.settings.threshold.max(FIRST_TOLERANCE);
    let mut shooting = Shooting::<L>::new(energies, light, COARSE, cx.settings.window, threshold);
    let mut unasked = shooting.by_unshot();
    let mut wanted = shooting.start(table.cache());
    let mut jobs: HashMap<u64, Vec<ShareId>> = HashMap::new();
    let mut under_way: HashSet<ShareId> = HashSet::new();
    loop {
        wanted.retain(|share| !under_way.contains(share));
        let threads = cx.client.threads();
        // A job of several rows costs less than as many jobs, but every thread must find some in the window.
        let jobs_in_window = JOBS_IN_WINDOW.max(JOBS_PER_THREAD * threads);
        let most = (cx.settings.window / jobs_in_window).max(1);
        let per_job = cx.client.most_rows(table.set(COARSE)).min(most);
        let mut next: Vec<Vec<ShareId>> = wanted.chunks(per_job).map(<[ShareId]>::to_vec).collect();
        wanted.clear();
        loop {
            for shares in next.drain(..) {
                under_way.extend(&shares);
                let tag = u64::from(shares[0].0);
                cx.client.submit(tag, table.batch(COARSE, &shares));
                jobs.insert(tag, shares);
            }
            if jobs.len() >= cx.client.jobs_ahead() {
                break;
            }
            let ahead = ahead(cx.client, table, &mut unasked, &under_way, |share| shooting.wants(share));
            if ahead.is_empty() {
                break;
            }
            next.push(ahead);
        }
        if jobs.is_empty() {
            break;
        }
        let (tag, finished) = cx.client.next()?;
        let shares = jobs.remove(&tag).unwrap_or_default();
        for ((share, row), statistics) in shares.into_iter().zip(finished.rows).zip(finished.statistics) {
            under_way.remove(&share);
            // A row of the same job may have had it chosen a moment ago.
            wanted.retain(|wanted| *wanted != share);
            table.made(COARSE, share, statistics.sampling_variance);
            if shooting.wants(share) {
                wanted.extend(shooting.row_arrived(share, row, table.cache()));
            } else {
                table.cache().keep(COARSE, share, row);
            }
        }
        cx.client.monitor.set_unshot(shooting.progress().unshot);
        let seen = |lights: &[L]| lights.iter().map(|light| light.to_rgb(colour)).collect::<Vec<_>>();
        mesh.preview(cx, direct, || (seen(shooting.irradiance()), seen(&shooting.unshot_of_shares())));
    }
    cx.work.shots += shooting.progress().shots;
    Ok(shooting.into_shot().into_iter().map(|light| light.to_rgb(colour)).collect())
}

/// The next shares whose rows are made ahead of time, taken from those not asked for yet: none where all were, or where their
/// rows might not be kept. What shooting wants it has, or has asked for.
fn ahead(
    client: &RowClient,
    table: &mut RowTable,
    unasked: &mut VecDeque<ShareId>,
    under_way: &HashSet<ShareId>,
    is_wanted: impl Fn(ShareId) -> bool,
) -> Vec<ShareId> {
    let set = table.set(COARSE);
    let count = client.rows_of_next_job(set, unasked.len());
    let room = table.cache().room() / Row::most_bytes(set.count());
    let count = count.min(room.saturating_sub(under_way.len()));
    let mut ahead = vec![];
    while ahead.len() < count
        && let Some(share) = unasked.pop_front()
    {
        let is_there = is_wanted(share) || table.cache().row(COARSE, share).is_some();
        if !is_there && !under_way.contains(&share) {
            ahead.push(share);
        }
    }
    ahead
}
