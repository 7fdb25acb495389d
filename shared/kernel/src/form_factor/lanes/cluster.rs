//! Polygons that lie and face together: from afar they count as one.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::{LANES, Lanes, Mask, ReceiverLanes, bits, keep, mask};
use crate::form_factor::PreparedPolygon;
use crate::form_factor::prepared::MEAN_POINT_RULE_ERROR;

/// Cosine of the angle that the normals of polygons which count as one may have to their axis: 15 degrees. The wider, the fewer
/// receivers have all of them before them.
const NARROW: f64 = 0.965_925_826_289;

/// Rounding of distances and of ways across, relative to them.
const ROUNDING: f64 = 1e-7;

/// Some polygons, each with weights in `N` channels, by what their form factors are together.
#[derive(Debug, Clone)]
pub struct PolygonCluster<const N: usize> {
    /// Centre of gravity of their areas times the sums of their weights, and how far corners are from it at most.
    centre: DVec3,
    reach: f64,
    /// Mean square of the distance from it.
    spread: f64,
    /// Around the normals; the sine and cosine of the largest angle to them, 1 and 0 where they differ by more than a right one.
    axis: DVec3,
    sine: f64,
    cosine: f64,
    whole: Area,
    weighted: [Area; N],
}

/// Polygons up to first order in their places.
#[derive(Debug, Clone, Copy)]
struct Area {
    /// Sum of the area vectors.
    vector: DVec3,
    /// Sum of the outer products of the ways from the centre to their centres of gravity with the area vectors, by columns: a
    /// column for each component of the area vector.
    moment: DMat3,
}

/// What [`LANES`] receivers see of a cluster when nothing is between.
#[derive(Debug, Clone, PartialEq)]
#[repr(align(64))]
pub struct ClusterLanes<const N: usize> {
    /// The sum of the form factors of its polygons; 0 where it does not count as one.
    pub factors: Lanes,
    /// The sum of them in each channel, each times the weight of its polygon.
    pub weighted: [Lanes; N],
    /// Mean error of each of `factors`.
    pub errors: Lanes,
    /// Receivers that it counts as one to, a bit each.
    pub as_one: u32,
    /// Receivers that it does not count as one to and that may see it, a bit each.
    pub open: u32,
}

impl<const N: usize> PolygonCluster<N> {
    /// The cluster of some polygons, at least one, with weights over 0 in one channel at least.
    #[must_use]
    pub fn new<'a>(polygons: impl Iterator<Item = (&'a PreparedPolygon, [f64; N])> + Clone) -> Self {
        let area =
            |polygon: &PreparedPolygon, weights: [f64; N]| polygon.area() * weights.iter().sum::<f64>();
        let shining: f64 = polygons.clone().map(|(polygon, weights)| area(polygon, weights)).sum();
        let pull = |(polygon, weights): (&PreparedPolygon, [f64; N])| {
            area(polygon, weights) / shining * polygon.centroid
        };
        let centre: DVec3 = polygons.clone().map(pull).sum();
        let corners = polygons.clone().flat_map(|(polygon, _)| polygon.corners());
        let reach = corners.map(|corner| corner.distance_squared(centre)).fold(0.0, f64::max).sqrt();
        let (mut whole, mut weighted, mut spread) = (Area::NONE, [Area::NONE; N], 0.0);
        for (polygon, weights) in polygons.clone() {
            let (vector, way) = (polygon.doubled_area / 2.0, polygon.centroid - centre);
            whole.add(vector, way);
            for (weighted, weight) in weighted.iter_mut().zip(weights) {
                weighted.add(weight * vector, way);
            }
            // A polygon's own mean square is largest of a needle.
            let square = way.length_squared() + polygon.squared_reach / 3.0;
            spread += area(polygon, weights) / shining * square;
        }
        let axis = whole.vector.normalize_or_zero();
        let cosine = polygons.map(|(polygon, _)| polygon.normal.dot(axis)).fold(1.0, f64::min);
        let cosine = if cosine > 0.0 { cosine } else { 0.0 };
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        Self { centre, reach, spread, axis, sine, cosine, whole, weighted }
    }

    /// Whether the polygons face together; else they never count as one.
    #[must_use]
    pub fn is_narrow(&self) -> bool {
        self.cosine >= NARROW
    }

    /// What each receiver that has a bit in `looking` sees of the cluster. It counts as one where all of its polygons face the receiver,
    /// wholly above its horizon, from so far that what is left out is within the relative error `tolerance` of the weighted sum.
    ///
    /// With c the way to the centre, d that from there to a place of a polygon with area vector a, and g(c) = n.c / |c|^4, the sum of
    /// -a.(c + d) g(c + d) / pi is expanded to first order in d; the second is bounded as for one polygon, but with the mean square of
    /// d itself. To be called under [`crate::simd::widest`].
    #[inline(always)]
    #[must_use]
    pub fn view_lanes(&self, receivers: &ReceiverLanes, tolerance: f64, looking: u32) -> ClusterLanes<N> {
        let narrow = mask(self.is_narrow());
        let (mut as_one, mut open): (Mask, Mask) = ([0; LANES], [0; LANES]);
        let (mut factors, mut errors) = ([0.0; LANES], [0.0; LANES]);
        let mut weighted = [[0.0; LANES]; N];
        for lane in 0..LANES {
            let (position, normal) = (receivers.position(lane), receivers.normal(lane));
            let to_centre = self.centre - position;
            let squared = to_centre.length_squared();
            let distance = squared.sqrt();
            let looks = mask(looking >> lane & 1 == 1);
            let margin = self.reach + ROUNDING * distance;
            // Height of the receiver over the planes through the centre that look as the polygons do.
            let along = -self.axis.dot(to_centre);
            let across = (squared - along * along).max(0.0).sqrt();
            let before = along * self.cosine - across * self.sine > margin;
            let behind = along * self.cosine + across * self.sine < -margin;
            let height = normal.dot(to_centre);
            let (above, below) = (height > margin, height < -margin);
            // The bound of a polygon's point rule, times height and squared distance.
            let bound = self.spread * (10.0 * height + 4.0 * distance);
            let far = bound <= tolerance * squared * height;
            let counts = mask(before & above & far) & narrow & looks;
            let reciprocal = 1.0 / squared;
            let scale = reciprocal * reciprocal * (1.0 / PI);
            let sum = |area: &Area| scale * area.seen(to_centre, normal, height, reciprocal);
            let factor = sum(&self.whole);
            factors[lane] = keep(counts, factor);
            for (weighted, own) in weighted.iter_mut().zip(&self.weighted) {
                weighted[lane] = keep(counts, sum(own));
            }
            errors[lane] = keep(counts, factor * (3.0 * MEAN_POINT_RULE_ERROR * self.spread * reciprocal));
            as_one[lane] = counts;
            open[lane] = looks & !(counts | mask(behind | below));
        }
        ClusterLanes { factors, weighted, errors, as_one: bits(&as_one), open: bits(&open) }
    }
}

impl Area {
    /// That of no polygon.
    const NONE: Self = Self { vector: DVec3::ZERO, moment: DMat3::ZERO };

    /// Adds a polygon with this way to it from the centre.
    fn add(&mut self, vector: DVec3, way: DVec3) {
        self.vector += vector;
        self.moment += DMat3::from_cols(way * vector.x, way * vector.y, way * vector.z);
    }

    /// The sum over the polygons of -a.c n.c / |c|^4, times |c|^4 of the centre: as a receiver with this normal sees them, to which
    /// the centre has this way, height and inverse squared distance.
    #[inline(always)]
    fn seen(&self, to_centre: DVec3, normal: DVec3, height: f64, reciprocal: f64) -> f64 {
        let DMat3 { x_axis, y_axis, z_axis } = self.moment;
        let trace = x_axis.x + y_axis.y + z_axis.z;
        let pull = to_centre.x * x_axis + to_centre.y * y_axis + to_centre.z * z_axis;
        let at_centre = (self.vector.dot(to_centre) + trace) * height;
        let along = pull.dot(normal) - 4.0 * height * reciprocal * pull.dot(to_centre);
        -(at_centre + along)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::geometry::{ConvexPolygon, PlaneId};

    /// A roof of two slopes of strips; only those at its ends are bright.
    fn roof() -> Vec<(PreparedPolygon, f64)> {
        let strip = |index: i32| {
            let corner = |(along, y): (i32, f64)| {
                let x = 0.01 * f64::from(along);
                DVec3::new(x, y, 1.0 - 0.26 * x.abs())
            };
            let corners = [(index, -0.02), (index + 1, -0.02), (index + 1, 0.02), (index, 0.02)].map(corner);
            let polygon = ConvexPolygon { plane: PlaneId(0), corners: corners.to_vec() };
            (PreparedPolygon::new(&polygon), if (-18..18).contains(&index) { 0.001 } else { 1.0 })
        };
        (-20..20).map(strip).collect()
    }

    /// A cap of a ball of radius 1, cut into rings of quadrilaterals; the weights rise along x.
    fn cap(angle: f64) -> Vec<(PreparedPolygon, f64)> {
        const RINGS: u32 = 8;
        const AROUND: u32 = 16;
        let corner = |(ring, step): (u32, u32)| {
            let (from_pole, around) =
                (angle * f64::from(ring) / f64::from(RINGS), TAU * f64::from(step) / f64::from(AROUND));
            let (sine, cosine) = from_pole.sin_cos();
            DVec3::new(sine * around.cos(), sine * around.sin(), cosine)
        };
        let tile = |index: u32| {
            let (ring, step) = (1 + index / AROUND, index % AROUND);
            let corners =
                [(ring, step), (ring + 1, step), (ring + 1, step + 1), (ring, step + 1)].map(corner);
            let polygon = ConvexPolygon { plane: PlaneId(index), corners: corners.to_vec() };
            (PreparedPolygon::new(&polygon), 0.6 + 0.4 * corners[0].x)
        };
        (0..AROUND * (RINGS - 1)).map(tile).collect()
    }

    fn cluster(polygons: &[(PreparedPolygon, f64)]) -> PolygonCluster<1> {
        PolygonCluster::new(polygons.iter().map(|(polygon, weight)| (polygon, [*weight])))
    }

    /// Receivers all around at some distances, looking all ways.
    fn receivers() -> Vec<(DVec3, DVec3)> {
        let direction = |z: f64, turn: f64| {
            let across = (1.0 - z * z).sqrt();
            DVec3::new(across * (turn * TAU).cos(), across * (turn * TAU).sin(), z)
        };
        let place = |index: u32| {
            let at = |step: f64| (f64::from(index) * step).fract();
            let way = direction(2.0 * at(0.618) - 1.0, at(0.755));
            let looking = direction(2.0 * at(0.570) - 1.0, at(0.324));
            let normal = if index.is_multiple_of(3) { -way } else { looking };
            (way * (1.2 + 60.0 * at(0.811).powi(3)), normal)
        };
        (0..20_000).map(place).collect()
    }

    /// What counts as one has the sums of its polygons; what sees nothing sees none of them; all else is left open.
    #[test]
    fn polygons_count_as_one_where_their_sum_is_that_of_all() {
        const TOLERANCE: f64 = 5e-3;
        for polygons in [cap(0.2), roof()] {
            sums_are_those_of_all(&polygons, TOLERANCE);
        }
    }

    fn sums_are_those_of_all(polygons: &[(PreparedPolygon, f64)], tolerance: f64) {
        let cluster = cluster(polygons);
        let (mut one, mut dark, mut open, mut squares) = (0, 0, 0, 0.0);
        for some in receivers().chunks(LANES) {
            let view = cluster.view_lanes(&ReceiverLanes::new(some.iter().copied()), tolerance, u32::MAX);
            for (lane, (position, normal)) in some.iter().enumerate() {
                let (mut sum, mut weighted) = (0.0, 0.0);
                for (polygon, weight) in polygons {
                    let factor = polygon.view(*position, *normal, 0.0).map_or(0.0, |view| view.factor);
                    sum += factor;
                    weighted += weight * factor;
                }
                let is = |bits: u32| bits >> lane & 1 == 1;
                assert!(!(is(view.as_one) && is(view.open)));
                if is(view.as_one) {
                    one += 1;
                    let error = view.weighted[0][lane] / weighted - 1.0;
                    assert!(error.abs() <= tolerance, "{position} {normal}: {error}");
                    squares += error * error;
                    // The tolerance is that of the bright ones; the error stated is of all, in the mean.
                    let error = view.factors[lane] / sum - 1.0;
                    assert!(error.abs() <= tolerance, "{position} {normal}: {error}");
                } else {
                    assert_eq!(
                        (view.factors[lane], view.weighted[0][lane], view.errors[lane]),
                        (0.0, 0.0, 0.0)
                    );
                    open += u32::from(is(view.open));
                    dark += u32::from(!is(view.open));
                    assert!(is(view.open) || sum == 0.0, "{position} {normal}: {sum}");
                }
            }
        }
        assert!(one > 1000 && open > 1000 && dark > 1000, "{one} as one, {open} open, {dark} dark");
        let mean = (squares / f64::from(one)).sqrt();
        assert!(mean <= tolerance / 4.0, "{mean}");
    }

    /// Three channels are three clusters with one centre.
    #[test]
    fn each_channel_has_the_sum_of_its_own_weights() {
        let polygons = roof();
        let weights = |index: usize| [0, 1, 2].map(|channel| ((index + channel) % 4) as f64 / 3.0);
        let coloured = || polygons.iter().enumerate().map(|(index, (polygon, _))| (polygon, weights(index)));
        let cluster = PolygonCluster::new(coloured());
        let receiver = (DVec3::new(1.0, 2.0, 9.0), DVec3::new(0.0, 0.6, -0.8));
        let view = cluster.view_lanes(&ReceiverLanes::new([receiver]), 5e-3, 1);
        assert_eq!(view.as_one, 1);
        for (channel, found) in view.weighted.iter().enumerate() {
            let own = |(polygon, weights): (&PreparedPolygon, [f64; 3])| {
                polygon.view(receiver.0, receiver.1, 0.0).map_or(0.0, |view| view.factor) * weights[channel]
            };
            let wanted: f64 = coloured().map(own).sum();
            assert!((found[0] / wanted - 1.0).abs() <= 5e-3, "{channel}: {} for {wanted}", found[0]);
        }
    }

    #[test]
    fn polygons_that_face_apart_never_count_as_one() {
        let far = ReceiverLanes::new([(DVec3::Z * 1e6, DVec3::NEG_Z), (DVec3::NEG_Z * 1e6, DVec3::Z)]);
        for (angle, is_narrow, dark) in [(0.25, true, 0b10), (0.4, false, 0b10), (3.1, false, 0)] {
            let cluster = cluster(&cap(angle));
            assert_eq!(cluster.is_narrow(), is_narrow, "{angle}");
            let view = cluster.view_lanes(&far, 1e-3, 0b11);
            assert_eq!(view.as_one, u32::from(is_narrow), "{angle}");
            assert_eq!(!view.open & !view.as_one & 0b11, dark, "{angle}");
        }
    }
}
