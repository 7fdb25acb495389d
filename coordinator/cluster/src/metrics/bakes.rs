//! Progress of bakes, all of them together.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use bake::{Phase, Progress, TimeParts};
use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::registry::{Registry, Unit};

/// The values that are shown.
#[derive(Debug, Default)]
pub(super) struct BakeValues {
    phase: Family<PhaseLabel, Gauge>,
    unshot: Gauge<f64, AtomicU64>,
    vertices: Gauge,
    rows_needed: Gauge,
    time: Family<PartLabel, Counter<f64, AtomicU64>>,
    bakes: Mutex<Bakes>,
}

/// The bakes under way, and their progress.
#[derive(Debug, Default)]
struct Bakes {
    next: u64,
    progress: BTreeMap<u64, Progress>,
}

/// A part of the wall time of bakes.
#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct PartLabel {
    part: &'static str,
}

/// A step of a bake.
#[derive(Debug, Clone, PartialEq, Eq, Hash, EncodeLabelSet)]
struct PhaseLabel {
    phase: &'static str,
}

impl BakeValues {
    pub(super) fn register(&self, registry: &mut Registry) {
        let Self { phase, unshot, vertices, rows_needed, time, bakes: _ } = self;
        registry.register("phase", "Bakes in this step", phase.clone());
        registry.register(
            "unshot_flux_ratio",
            "Unshot flux over reflected flux, largest of the bakes",
            unshot.clone(),
        );
        registry.register("vertices", "Vertices of the meshes", vertices.clone());
        registry.register("rows_needed", "Rows known to be needed so far", rows_needed.clone());
        registry.register_with_unit("bake", "Wall time of bakes, by its parts", Unit::Seconds, time.clone());
    }

    fn bakes(&self) -> MutexGuard<'_, Bakes> {
        // No code that holds the lock leaves it half changed.
        self.bakes.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Shows all bakes together.
    fn show(&self, bakes: &Bakes) {
        let all = || bakes.progress.values();
        for phase in Phase::ALL {
            let count = all().filter(|progress| progress.phase == phase).count();
            self.phase.get_or_create(&PhaseLabel { phase: phase.name() }).set(count as i64);
        }
        self.unshot.set(all().map(|progress| progress.unshot).fold(0.0, f64::max));
        self.vertices.set(all().map(|progress| progress.vertices as i64).sum());
        let needed: u64 = all().map(|progress| progress.rows_needed).sum();
        self.rows_needed.set(needed.try_into().unwrap_or(i64::MAX));
    }
}

/// The parts, as they are shown.
fn parts(time: &TimeParts) -> [(&'static str, f64); 5] {
    let TimeParts { rows, other_rows, network, waiting, own } = *time;
    [("rows", rows), ("other rows", other_rows), ("network", network), ("waiting", waiting), ("own", own)]
}

/// Metrics of one bake; without it they do not count it any more.
#[derive(Debug)]
pub struct BakeMetrics {
    number: u64,
    values: Arc<BakeValues>,
    /// Seconds of each part that are counted.
    counted: Mutex<[f64; 5]>,
}

impl BakeMetrics {
    pub(super) fn new(values: &Arc<BakeValues>) -> Self {
        let mut bakes = values.bakes();
        bakes.next += 1;
        Self { number: bakes.next, values: Arc::clone(values), counted: Mutex::default() }
    }

    /// Sets its progress.
    pub fn progress(&self, progress: &Progress) {
        let mut bakes = self.values.bakes();
        bakes.progress.insert(self.number, *progress);
        self.values.show(&bakes);
        drop(bakes);
        self.count(&progress.time);
    }

    /// Counts the time since the last report. Where a part turns out to be smaller than it was thought to be, it rests meanwhile.
    fn count(&self, time: &TimeParts) {
        let mut counted = self.counted.lock().unwrap_or_else(PoisonError::into_inner);
        for (counted, (part, seconds)) in counted.iter_mut().zip(parts(time)) {
            if seconds > *counted {
                self.values.time.get_or_create(&PartLabel { part }).inc_by(seconds - *counted);
                *counted = seconds;
            }
        }
    }

    /// It is in no step of a bake any more, or not yet.
    pub fn clear(&self) {
        let mut bakes = self.values.bakes();
        bakes.progress.remove(&self.number);
        self.values.show(&bakes);
    }
}

impl Drop for BakeMetrics {
    fn drop(&mut self) {
        self.clear();
    }
}
