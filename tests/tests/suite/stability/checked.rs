//! A bake that is held to what is true of every bake.

use std::collections::{BTreeMap, HashMap};
use std::time::Duration;

use bake::{BakeError, BakeSettings, Baked, RowService, Unobserved, bake};
use cluster::{Cluster, FinishedJob, Handle, JobId, Workers};
use glam::DVec3;
use kernel::form_factor::point_to_polygon;
use kernel::replica::{Digest, EncodedReplica, Receivers, decode_receivers, decode_scene};
use kernel::row::{RowRequest, Shape, Shooter};
use protocol::worker::ReplicaKind;
use scene::Scene;
use tests::baking::{area_and_flux, imported};
use tests::builder::SceneBuilder;

/// Rows are stored in f32: a sum of some thousand factors may be off by this.
pub const ROW_SUM: f64 = 1e-5;

/// Part of the emitted flux from which on a bake says that it is missing, or too much.
const TOLD: f64 = 0.02;

/// Relative error of a single factor stored in f32, with that of the centred form, 1e-9, beside it.
const FACTOR: f64 = 1e-7;

/// Factors below this are rounding where polygons are cut.
const NOTHING: f64 = 1e-12;

/// One factor in so many is held against the unoccluded one, which is computed another way; a prime, so that all receivers get
/// their turn.
const STRIDE: usize = 13;

/// What every bake but the finest here is made with: a mesh that a test can afford.
pub fn coarse() -> BakeSettings {
    BakeSettings {
        shooter_edge: 0.25,
        mesh_error: 0.015,
        validation_samples: 0,
        factor_rounding: 0.0,
        // The values of the solver itself.
        simplify: false,
        ..BakeSettings::default()
    }
}

/// Without refinement: what remains is transport alone.
pub fn unrefined() -> BakeSettings {
    BakeSettings { mesh_error: 1e3, ..coarse() }
}

/// What is true of one scene beyond what is true of all.
#[derive(Debug, Clone, Copy)]
pub struct Expectation {
    /// Whether every vertex sees surfaces in all directions, but for those that see nothing at all: they lie between surfaces.
    pub closed: bool,
    /// Where a closed scene has room inside its solids: vertices there do see back faces. In the file's units.
    pub covered: fn(DVec3) -> bool,
    /// Most imbalance, relative to the emitted flux: the error of the mesh.
    pub imbalance: f64,
    /// Whether the bake warns of something, where that is known.
    pub warns: Option<bool>,
}

/// A closed scene whose mesh loses up to 2 % of the light: what coarse settings give.
pub const CLOSED: Expectation =
    Expectation { closed: true, covered: |_| false, imbalance: 0.02, warns: Some(false) };

/// A closed scene on a mesh as coarse as it can be.
pub const UNREFINED: Expectation = Expectation { imbalance: 0.2, ..CLOSED };

/// An open one.
pub const OPEN: Expectation = Expectation { closed: false, ..CLOSED };

/// A bake that passed.
pub struct Checked {
    pub scene: Scene,
    pub baked: Baked,
}

/// Bakes a scene, and asserts of it: factors are finite and from 0 to 1; no visible factor is over the unoccluded one, and each
/// equals it where nothing can block; no vertex sees more than its hemisphere, and in a closed scene each sees all of it;
/// irradiance is finite and not negative; the energy balance adds up, has no negative part and closes.
pub fn checked(builder: &SceneBuilder, settings: &BakeSettings, expected: Expectation) -> Checked {
    let scene = imported(&builder.glb());
    let baked = checked_scene(&scene, settings, expected);
    Checked { scene, baked }
}

/// [`checked`], for a scene that was imported elsewhere.
pub fn checked_scene(scene: &Scene, settings: &BakeSettings, expected: Expectation) -> Baked {
    let cluster = Cluster::start(&Workers::Embedded { threads: 2 }.into()).unwrap();
    let mut service = CheckedRows::new(cluster.handle(0));
    let baked =
        bake(scene, settings, &mut service, &mut Unobserved).unwrap_or_else(|error| panic!("{error}"));
    service.check_sums(scene, &baked, expected);
    cluster.shutdown();
    for vertex in &baked.lit.vertices {
        let irradiance = vertex.irradiance;
        assert!(irradiance.is_finite() && irradiance.min_element() >= 0.0, "irradiance {irradiance}");
    }
    let report = &baked.report;
    let sums = &report.row_sums;
    assert!(sums.least >= 0.0 && sums.largest <= 1.0 + ROW_SUM, "{sums:?}");
    assert!(report.unshot_bound <= 1e-6, "unshot {:e}", report.unshot_bound);
    let balance = &report.balance;
    for channel in 0..3 {
        let parts =
            [balance.absorbed, balance.unshot, balance.escaped, balance.imbalance].map(|part| part[channel]);
        let emitted = balance.emitted[channel];
        assert!((parts.iter().sum::<f64>() - emitted).abs() <= 1e-12 * emitted, "{balance:?}");
        assert!(balance.absorbed[channel] >= 0.0, "{balance:?}");
        // Rows that sum to more than 1 by rounding let nothing escape.
        assert!(balance.escaped[channel] >= -ROW_SUM * emitted, "{balance:?}");
    }
    assert!(balance.relative_imbalance().abs() <= expected.imbalance, "{balance:?}");
    let (of_balance, others): (Vec<_>, Vec<_>) =
        report.warnings.iter().partition(|warning| warning.contains("of the emitted light"));
    assert_eq!(of_balance.len(), usize::from(balance.relative_imbalance().abs() > TOLD), "{of_balance:?}");
    assert_ne!(expected.warns, Some(others.is_empty()), "{others:?}");
    baked
}

impl Checked {
    /// Mean irradiance of each part, by its name.
    pub fn means(&self) -> BTreeMap<String, DVec3> {
        let surfaces = self.scene.surfaces.iter().enumerate();
        let mean = |surface| {
            let (area, flux) = area_and_flux(&self.baked.lit, surface, |_| true);
            flux / area
        };
        surfaces
            .map(|(index, surface)| (format!("{} {:?}", surface.name, surface.side), mean(index)))
            .collect()
    }

    /// Mean irradiance of the whole scene.
    pub fn mean(&self) -> DVec3 {
        let (area, flux) = self.area_and_flux(|_| true);
        flux / area
    }

    /// Area and flux, in the file's units, where `counts` says so of a triangle's middle, in the file's units too.
    pub fn area_and_flux(&self, counts: impl Fn(DVec3) -> bool) -> (f64, DVec3) {
        let frame = self.scene.frame;
        let unit = frame.scale * frame.scale;
        (0..self.scene.surfaces.len()).fold((0.0, DVec3::ZERO), |(area, flux), surface| {
            let own = area_and_flux(&self.baked.lit, surface, |middle| counts(frame.to_world(middle)));
            (area + own.0 * unit, flux + own.1 * unit)
        })
    }

    /// Least and largest irradiance, over all channels, at the corners of the triangles of which `counts` says so, given their
    /// middle in the file's units. Slivers along a contact line lie on neither side of it and do not count.
    pub fn range(&self, counts: impl Fn(DVec3) -> bool) -> (f64, f64) {
        let vertex = |index: u32| self.baked.lit.vertices[index as usize];
        let triangles =
            self.baked.lit.surfaces.iter().flatten().map(|triangle| triangle.vertices.map(vertex));
        let chosen = triangles.filter(|corners| {
            let [a, b, c] = corners.map(|corner| corner.position);
            let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
            let middle = (a + b + c) / 3.0;
            let is_sliver = (b - a).cross(c - a).length() <= 1e-6 * longest * longest;
            !is_sliver && counts(self.scene.frame.to_world(middle))
        });
        let range = chosen.flatten().fold((f64::INFINITY, 0.0_f64), |(least, largest), corner| {
            (least.min(corner.irradiance.min_element()), largest.max(corner.irradiance.max_element()))
        });
        assert!(range.0 <= range.1, "no triangle counts");
        range
    }

    /// Asserts a furnace: where `counts` says so, irradiance is `expected` but for the rounding of rows to f32.
    pub fn assert_level(&self, expected: f64, tolerance: f64, counts: impl Fn(DVec3) -> bool) {
        let (least, largest) = self.range(counts);
        let worst = (least / expected - 1.0).abs().max((largest / expected - 1.0).abs());
        assert!(worst <= tolerance, "from {least} to {largest}, not {expected}: off by {worst:e}");
    }
}

/// Asserts that two bakes give every part the same mean irradiance, relative to the brighter one, in each channel.
pub fn assert_same_means(a: &Checked, b: &Checked, tolerance: f64) {
    let (a, b) = (a.means(), b.means());
    assert_eq!(a.keys().collect::<Vec<_>>(), b.keys().collect::<Vec<_>>());
    for (name, x) in &a {
        let y = b[name];
        let relative = ((*x - y).abs() / x.max(y).max(DVec3::splat(f64::MIN_POSITIVE))).max_element();
        assert!(relative <= tolerance, "{name}: {x} and {y} differ by {relative:e}");
    }
}

/// Asserts that two bakes are the same, bit for bit, when all irradiance of the second is multiplied by a power of two.
pub fn assert_same_bits(a: &Checked, b: &Checked, factor: f64) {
    let (a, b) = (&a.baked.lit, &b.baked.lit);
    assert_eq!(a.surfaces, b.surfaces);
    assert_eq!(a.vertices.len(), b.vertices.len());
    for (a, b) in a.vertices.iter().zip(&b.vertices) {
        assert_eq!((a.position, a.normal, a.irradiance), (b.position, b.normal, b.irradiance * factor));
    }
}

/// A row service that looks at every factor on its way through.
struct CheckedRows {
    handle: Handle,
    receivers: HashMap<Digest, Receivers>,
    /// Whether each scene has anything that can block.
    has_occluders: HashMap<Digest, bool>,
    requests: HashMap<JobId, RowRequest>,
    /// Rows of polygons, or parts of them: receivers, the first of them, key of the shooter, factors.
    rows: Vec<(Digest, usize, u64, Vec<f32>)>,
}

impl CheckedRows {
    fn new(handle: Handle) -> Self {
        Self {
            handle,
            receivers: HashMap::new(),
            has_occluders: HashMap::new(),
            requests: HashMap::new(),
            rows: vec![],
        }
    }

    fn check_row(&self, request: &RowRequest, shooter: &Shooter, row: &[f32]) {
        assert!(
            row.iter().all(|factor| factor.is_finite() && *factor >= 0.0),
            "row {}: {row:?}",
            shooter.key
        );
        if matches!(shooter.shape, Shape::Sky(_)) {
            assert!(row.iter().all(|factor| *factor <= 1.0 + FACTOR as f32), "row {}: {row:?}", shooter.key);
        }
        let Shape::Polygons(polygons) = &shooter.shape else { return };
        // A row may be over a part of the set.
        let receivers = &self.receivers[&request.receivers].receivers[request.first_receiver as usize..];
        for (index, (factor, receiver)) in row.iter().zip(receivers).enumerate() {
            let factor = f64::from(*factor);
            assert!(factor <= 1.0 + FACTOR, "row {}, receiver {index}: factor {factor}", shooter.key);
            if !(index + shooter.key as usize).is_multiple_of(STRIDE) {
                continue;
            }
            let others = polygons.iter().filter(|polygon| polygon.plane != receiver.plane);
            let unoccluded: f64 = others
                .map(|polygon| point_to_polygon(receiver.position, receiver.normal, &polygon.corners))
                .sum();
            let free = !self.has_occluders[&request.scene];
            let over = factor - unoccluded;
            let tolerance = (FACTOR + request.precision.form_factor_error) * unoccluded + NOTHING;
            assert!(
                over <= tolerance && (!free || -over <= tolerance),
                "row {}, receiver {index} at {}: {factor:e} of {unoccluded:e}",
                shooter.key,
                receiver.position
            );
        }
    }

    /// Row sums of every receiver, those of the refined mesh too. Keys below `shares` are those of shares.
    fn check_sums(&self, scene: &Scene, baked: &Baked, expected: Expectation) {
        let (shares, vertices) = (baked.report.shooting_vertices as u64, baked.lit.vertices.len() as u64);
        // Points on backs have keys beyond those of all vertices, and may see anything.
        let of_vertices = self.receivers.iter().filter(|(_, set)| set.first_key < vertices);
        for (digest, Receivers { receivers, .. }) in of_vertices {
            let mut sums = vec![0.0; receivers.len()];
            let own = self.rows.iter().filter(|(of, _, key, _)| of == digest && *key < shares);
            for (_, first, _, row) in own {
                sums[*first..].iter_mut().zip(row).for_each(|(sum, factor)| *sum += f64::from(*factor));
            }
            for (sum, receiver) in sums.iter().zip(receivers) {
                let closed = expected.closed && !(expected.covered)(scene.frame.to_world(receiver.position));
                let enough = !closed || *sum >= 1.0 - ROW_SUM || *sum <= ROW_SUM;
                assert!(
                    *sum <= 1.0 + ROW_SUM && enough,
                    "the row of the receiver at {} facing {} sums to {sum}",
                    receiver.position,
                    receiver.normal
                );
            }
        }
    }
}

impl RowService for CheckedRows {
    fn publish(&mut self, replica: EncodedReplica) {
        match replica.kind {
            ReplicaKind::Receivers => {
                let receivers = decode_receivers(&replica.bytes).unwrap();
                self.receivers.insert(replica.digest, receivers);
            }
            _ => {
                let polygons = decode_scene(&replica.bytes).unwrap().polygons;
                self.has_occluders.insert(replica.digest, !polygons.is_empty());
            }
        }
        self.handle.publish(replica);
    }

    fn release(&mut self, digest: Digest) {
        self.handle.release(digest);
    }

    fn submit(&mut self, requests: Vec<(JobId, RowRequest)>) {
        self.requests.extend(requests.iter().cloned());
        self.handle.submit(requests);
    }

    fn withdraw(&mut self) {
        self.handle.withdraw();
    }

    fn next(&mut self, patience: Duration) -> Result<Option<FinishedJob>, BakeError> {
        let finished = RowService::next(&mut self.handle, patience)?;
        if let Some(finished) = &finished
            && let Some(request) = self.requests.remove(&finished.job)
        {
            assert_eq!(request.shooters.len(), finished.rows.len());
            for (shooter, row) in request.shooters.iter().zip(&finished.rows) {
                let row = row.to_dense();
                self.check_row(&request, shooter, &row);
                if matches!(shooter.shape, Shape::Polygons(_)) {
                    let first = request.first_receiver as usize;
                    self.rows.push((request.receivers, first, shooter.key, row));
                }
            }
        }
        Ok(finished)
    }
}
