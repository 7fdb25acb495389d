//! Computes rows: pure, the same bits for the same request on every machine.

use glam::DVec3;
use std::sync::OnceLock;

use kernel::form_factor::PreparedPolygon;
use kernel::geometry::ConvexPolygon;
use kernel::hemisphere::{SeenPolygons, seen_from};
use kernel::occluder::Occluder;
use kernel::replica::{Receiver, Receivers, ScenePolygons};
use kernel::row::{Hemisphere, Precision, Rounding, Row, Shape, Shooter};
use kernel::visibility::{
    FactorsOfMany, MANY_POLYGONS, ReceiverGroups, Stop, TransparentOccluders, VisibilityKernel,
    factors_of_many, pair_seed, sky_factor,
};
use protocol::worker::RowStatistics;

/// A prepared scene replica. Each part is built by the first job that needs it.
pub struct Scene {
    replica: ScenePolygons,
    occluder: OnceLock<Occluder>,
    transparent: OnceLock<Option<TransparentOccluders>>,
    seen: OnceLock<SeenPolygons>,
}

impl Scene {
    /// A scene of opaque polygons. The same polygons give the same bits everywhere.
    #[must_use]
    pub fn new(polygons: &[ConvexPolygon]) -> Self {
        ScenePolygons { polygons: polygons.to_vec(), opacities: vec![] }.into()
    }

    /// Number of polygons.
    #[must_use]
    pub fn polygons(&self) -> usize {
        self.replica.polygons.len()
    }

    /// The opaque occluders.
    fn occluder(&self) -> &Occluder {
        self.occluder.get_or_init(|| {
            let ScenePolygons { polygons, opacities } = &self.replica;
            if opacities.is_empty() {
                return Occluder::new(polygons);
            }
            let opaque = polygons.iter().zip(opacities).filter(|(_, opacity)| **opacity >= 1.0);
            Occluder::new(&opaque.map(|(polygon, _)| polygon.clone()).collect::<Vec<_>>())
        })
    }

    /// The transparent occluders, if any.
    fn transparent(&self) -> Option<&TransparentOccluders> {
        let transparent = self.transparent.get_or_init(|| {
            let ScenePolygons { polygons, opacities } = &self.replica;
            let some = polygons.iter().zip(opacities).filter(|(_, opacity)| (0.0..1.0).contains(*opacity));
            let (polygons, opacities): (Vec<_>, Vec<_>) =
                some.map(|(polygon, opacity)| (polygon.clone(), *opacity)).unzip();
            (!polygons.is_empty()).then(|| TransparentOccluders::new(&polygons, &opacities))
        });
        transparent.as_ref()
    }

    /// The polygons for hemisphere rows.
    fn seen(&self) -> &SeenPolygons {
        self.seen.get_or_init(|| SeenPolygons::new(&self.replica.polygons, &self.replica.opacities))
    }
}

impl From<ScenePolygons> for Scene {
    fn from(replica: ScenePolygons) -> Self {
        Self { replica, occluder: OnceLock::new(), transparent: OnceLock::new(), seen: OnceLock::new() }
    }
}

/// The row of a receiver over all polygons of a scene, with its sky view factor after them.
#[must_use]
pub fn compute_hemisphere(
    scene: &Scene,
    hemisphere: &Hemisphere,
    key: u64,
    precision: &Precision,
) -> (Row, RowStatistics) {
    let seed = pair_seed(precision.seed, key, 0);
    let mut seen = seen_from(scene.seen(), &hemisphere.receiver, hemisphere.rays, seed);
    let statistics = RowStatistics {
        rays: seen.rays,
        pairs: scene.polygons() as u64,
        factors: seen.factors.len() as u64,
        factor_sum: seen.factors.iter().map(|(_, factor)| f64::from(*factor)).sum(),
        ..RowStatistics::default()
    };
    seen.factors.push((scene.polygons(), seen.sky));
    (Row::of_some(scene.polygons() + 1, &seen.factors), statistics)
}

/// A prepared receiver replica.
pub struct ReceiverSet {
    /// Key of the first receiver.
    pub first_key: u64,
    /// The receivers.
    pub groups: ReceiverGroups,
}

impl ReceiverSet {
    /// Groups the receivers.
    #[must_use]
    pub fn new(receivers: Receivers) -> Self {
        Self { first_key: receivers.first_key, groups: ReceiverGroups::new(receivers.receivers) }
    }
}

/// Computes the row of one shooter over these receivers, rounded as `precision` says; `first_key` is the key of the first of them.
#[must_use]
pub fn compute_row(
    scene: &Scene,
    groups: &ReceiverGroups,
    first_key: u64,
    shooter: &Shooter,
    precision: &Precision,
) -> (Vec<f32>, RowStatistics) {
    let rows =
        compute_rows_until(scene, groups, first_key, std::slice::from_ref(shooter), precision, &|| false);
    rows.and_then(|mut rows| rows.pop()).unwrap_or_default()
}

/// The same of consecutive channels of one shape, or of one shooter, asking `stop` every few milliseconds; nothing where it says so. Work
/// that the rows of all channels share counts for the first, whichever of them are asked for.
#[must_use]
pub fn compute_rows_until(
    scene: &Scene,
    groups: &ReceiverGroups,
    first_key: u64,
    shooters: &[Shooter],
    precision: &Precision,
    stop: Stop,
) -> Option<Vec<(Vec<f32>, RowStatistics)>> {
    let [first, ..] = shooters else { return Some(vec![]) };
    debug_assert!(shooters.is_sorted_by(|before, next| next.is_next_channel_of(before)));
    if !is_of_many(&first.shape) {
        let (row, statistics) = factors_of(scene, groups, first_key, first, precision, stop);
        return (!stop()).then(|| vec![(rounded(row.into_iter(), first, first_key, precision), statistics)]);
    }
    let seed = |index: usize| pair_seed(precision.seed, first.key_of_rays(), first_key + index as u64);
    let among = (scene.occluder(), scene.transparent());
    let mut shared = RowStatistics::default();
    let many = (&first.shape, groups);
    let FactorsOfMany { factors, variances } =
        factors_of_many(many, among, precision, &seed, stop, &mut shared);
    if stop() {
        return None;
    }
    let row = |shooter: &Shooter| {
        let channel = shooter.shape.channel();
        let row = rounded(factors.iter().map(|factors| factors[channel]), shooter, first_key, precision);
        let statistics = if channel == 0 { shared } else { RowStatistics::default() };
        (row, RowStatistics { sampling_variance: variances[channel], ..statistics })
    };
    Some(shooters.iter().map(row).collect())
}

/// The row of a shooter, rounded as `precision` says.
fn rounded(
    row: impl Iterator<Item = f64>,
    shooter: &Shooter,
    first_key: u64,
    precision: &Precision,
) -> Vec<f32> {
    let rounding = Rounding::new(precision.factor_rounding);
    let seed = |index: usize| pair_seed(precision.seed, shooter.key, first_key + index as u64);
    let rounded = |(index, factor)| if factor == 0.0 { 0.0 } else { rounding.apply(factor, seed(index)) };
    row.enumerate().map(rounded).collect()
}

/// Whether all polygons of a shape are looked at as a whole.
fn is_of_many(shape: &Shape) -> bool {
    match shape {
        Shape::Polygons(polygons) => polygons.len() >= MANY_POLYGONS,
        Shape::Weighted(..) => true,
        _ => false,
    }
}

/// The row of one shooter that is not of many polygons, before rounding.
fn factors_of(
    scene: &Scene,
    groups: &ReceiverGroups,
    first_key: u64,
    shooter: &Shooter,
    precision: &Precision,
    stop: Stop,
) -> (Vec<f64>, RowStatistics) {
    let mut statistics = RowStatistics::default();
    let receivers = groups.receivers();
    let seed = |index: usize| pair_seed(precision.seed, shooter.key, first_key + index as u64);
    let wanted = || receivers.iter().enumerate().take_while(|_| !stop());
    let row: Vec<f64> = match &shooter.shape {
        Shape::Polygons(polygons) => {
            let mut kernel = VisibilityKernel::new(scene.occluder(), precision).until(stop);
            let mut factors = vec![0.0; receivers.len()];
            for polygon in polygons.iter().map(PreparedPolygon::new) {
                match scene.transparent() {
                    None => kernel.add_form_factors(groups, &polygon, &seed, &mut factors, &mut statistics),
                    Some(transparent) => {
                        let mut own = vec![0.0; receivers.len()];
                        kernel.add_form_factors(groups, &polygon, &seed, &mut own, &mut statistics);
                        for (index, (factor, own)) in factors.iter_mut().zip(own).enumerate() {
                            if own > 0.0 && !stop() {
                                let receiver = &receivers[index];
                                let passed =
                                    transparent.before(receiver, &polygon, scene.occluder(), seed(index));
                                statistics.rays += u64::from(passed.rays);
                                statistics.sampling_variance += own * own * passed.variance;
                                *factor += own * passed.fraction;
                            }
                        }
                    }
                }
            }
            factors
        }
        Shape::Point(light) => {
            let weight = |_| 1.0;
            let factor = |(_, r)| point_light_factor(scene, r, *light, weight, &mut statistics);
            wanted().map(factor).collect()
        }
        Shape::PlanarPoint(light) => {
            let weight = |direction: DVec3| 2.0 * direction.y.abs();
            let factor = |(_, r)| point_light_factor(scene, r, *light, weight, &mut statistics);
            wanted().map(factor).collect()
        }
        Shape::Spot(spot) => {
            let weight = |direction: DVec3| spot.attenuation(-direction.dot(spot.direction));
            let factor = |(_, r)| point_light_factor(scene, r, spot.position, weight, &mut statistics);
            wanted().map(factor).collect()
        }
        Shape::Directional(along) => {
            wanted().map(|(_, r)| directional_factor(scene, r, *along, &mut statistics)).collect()
        }
        Shape::Sky(rays) => {
            let (occluder, transparent) = (scene.occluder(), scene.transparent());
            let factor = |(index, receiver)| {
                sky_factor(receiver, occluder, transparent, *rays, seed(index), &mut statistics)
            };
            wanted().map(factor).collect()
        }
        // Weighted polygons are always many. A hemisphere's row is over polygons, not over receivers: a job that mixes both is refused.
        Shape::Weighted(..) | Shape::Hemisphere(_) => vec![0.0; receivers.len()],
    };
    (row, statistics)
}

/// V w cos / r^2: what a point light of unit intensity, times `weight` of the direction to it, gives a receiver.
fn point_light_factor(
    scene: &Scene,
    receiver: &Receiver,
    light: DVec3,
    weight: impl Fn(DVec3) -> f64,
    statistics: &mut RowStatistics,
) -> f64 {
    statistics.pairs += 1;
    let to_light = light - receiver.position;
    let squared = to_light.length_squared();
    let cosine = receiver.normal.dot(to_light) / squared.sqrt();
    // A light in the receiver's plane, or at the very point, gives nothing.
    if cosine.is_nan() || cosine <= 0.0 {
        return 0.0;
    }
    let weight = weight(to_light / squared.sqrt());
    if weight <= 0.0 {
        return 0.0;
    }
    statistics.factors += 1;
    if scene.polygons() > 0 {
        statistics.rays += 1;
        if scene.occluder().blocks(receiver.position, light, [receiver.plane; 2]) {
            statistics.occluded_pairs += 1;
            return 0.0;
        }
    }
    let through = scene.transparent().map_or(1.0, |transparent| {
        statistics.rays += 1;
        transparent.between(receiver.position, light, [receiver.plane; 2])
    });
    weight * cosine / squared * through
}

/// V cos: what light that travels along a unit vector, 1 on a surface across it, gives a receiver.
fn directional_factor(
    scene: &Scene,
    receiver: &Receiver,
    along: DVec3,
    statistics: &mut RowStatistics,
) -> f64 {
    statistics.pairs += 1;
    let cosine = -receiver.normal.dot(along);
    if cosine.is_nan() || cosine <= 0.0 {
        return 0.0;
    }
    statistics.factors += 1;
    if scene.polygons() > 0 {
        statistics.rays += 1;
        if scene.occluder().blocks_from_far(receiver.position, along, receiver.plane) {
            statistics.occluded_pairs += 1;
            return 0.0;
        }
    }
    let through = scene.transparent().map_or(1.0, |transparent| {
        statistics.rays += 1;
        transparent.from_far(receiver.position, along, receiver.plane)
    });
    cosine * through
}
