//! Pairs that are partly hidden: the visible form factor is computed exactly at points of one element, and the points are
//! random.

use kernel::geometry::uniform_point;
use kernel::messages::RowStatistics;
use kernel::replica::Receiver;
use kernel::visibility::{ReceiverGroups, VisibilityKernel, pair_seed};
use sobol_burley::sample_4d;

use super::element::Element;
use super::exchange::{Exchange, part_in_front};

/// Independent estimates of every pair: their spread gives the standard error.
const REPLICATES: usize = 4;

/// Least points of a replicate. With one each, the factors of an eighth of all partly hidden pairs of a city are not found, and
/// the errors of the others are known badly; with four, a thirtieth, all small.
const LEAST_POINTS: u32 = 4;

/// Most points of a pair.
const MOST_POINTS: u32 = 1 << 20;

/// How partly hidden pairs are estimated.
#[derive(Debug, Clone, Copy)]
pub struct Sampling {
    /// Points for a form factor of 1; pairs get their part of it, and 16 or more.
    pub points: u32,
    /// Seed of the points.
    pub seed: u64,
}

/// Estimates pairs; keeps its buffers.
pub struct Sampler<'a> {
    kernel: VisibilityKernel<'a>,
    sampling: Sampling,
    receivers: Vec<Receiver>,
    whole: Vec<f64>,
    visible: Vec<f64>,
    statistics: RowStatistics,
}

impl<'a> Sampler<'a> {
    /// With this kernel.
    #[must_use]
    pub fn new(kernel: VisibilityKernel<'a>, sampling: Sampling) -> Self {
        Self {
            kernel,
            sampling,
            receivers: vec![],
            whole: vec![],
            visible: vec![],
            statistics: RowStatistics::default(),
        }
    }

    /// Exchange area of two elements, and its variance, given what it would be if nothing stood between.
    ///
    /// The points lie on the smaller one. The visible part of the exchange area is that of the sums of the points' form
    /// factors, visible over whole: the exact whole takes out what varies from point to point without occlusion.
    pub fn estimate(&mut self, a: (u32, &Element), b: (u32, &Element), whole: Exchange) -> (f64, f64) {
        let (near, far) = if a.1.area <= b.1.area { (a, b) } else { (b, a) };
        let factor = whole.area / near.1.area;
        let wanted = (factor * f64::from(self.sampling.points)).ceil().min(f64::from(MOST_POINTS)) as u32;
        let each = wanted.div_ceil(REPLICATES as u32).next_power_of_two().max(LEAST_POINTS);
        let seed = pair_seed(self.sampling.seed, u64::from(a.0), u64::from(b.0));
        self.place(near.1, far.1, each, seed);
        self.visible.clear();
        self.visible.resize(self.receivers.len(), 0.0);
        let polygon = &far.1.prepared;
        let ray_seed = |index: usize| pair_seed(u64::from(seed), index as u64, 0);
        self.kernel.add_form_factors(
            &ReceiverGroups::new(self.receivers.clone()),
            polygon,
            &ray_seed,
            &mut self.visible,
            &mut self.statistics,
        );
        self.whole.clear();
        let view = |receiver: &Receiver| {
            polygon.view(receiver.position, receiver.normal, 0.0).map_or(0.0, |view| view.factor)
        };
        self.whole.extend(self.receivers.iter().map(view));
        let (fraction, variance) = ratio(&self.visible, &self.whole, each as usize);
        // What the points can overlook: a hidden corner over the cell of one of them.
        let overlooked = 0.5 / (self.receivers.len() as f64).powf(1.5);
        let deviation = whole.area * variance.sqrt().max(overlooked);
        (whole.area * fraction, deviation * deviation + whole.error * whole.error)
    }

    /// Points on the part of an element that lies before another, each replicate a net of its own.
    fn place(&mut self, element: &Element, front: &Element, each: u32, seed: u32) {
        let corners = part_in_front(front, element);
        self.receivers.clear();
        if corners.is_empty() {
            return;
        }
        for replicate in 0..REPLICATES as u64 {
            let seed = pair_seed(u64::from(seed), replicate, 1);
            self.receivers.extend((0..each).map(|index| {
                let [x, y, ..] = sample_4d(index, 0, seed);
                Receiver {
                    position: uniform_point(&corners, f64::from(x), f64::from(y)),
                    normal: element.normal,
                    plane: element.plane(),
                }
            }));
        }
    }
}

/// Ratio of two sums, and its variance, from replicates of `each` terms: the jackknife, which takes out the bias that a ratio has
/// in proportion to the inverse number of terms (Quenouille 1956).
fn ratio(parts: &[f64], wholes: &[f64], each: usize) -> (f64, f64) {
    let sums = |terms: &[f64]| -> Vec<f64> { terms.chunks(each).map(|chunk| chunk.iter().sum()).collect() };
    let (parts, wholes) = (sums(parts), sums(wholes));
    let (part, whole): (f64, f64) = (parts.iter().sum(), wholes.iter().sum());
    let count = parts.len() as f64;
    if whole <= 0.0 || part <= 0.0 {
        return (0.0, 0.0);
    }
    let without = |(own_part, own_whole): (&f64, &f64)| {
        let rest = whole - own_whole;
        if rest > 0.0 { (part - own_part) / rest } else { part / whole }
    };
    let without: Vec<f64> = parts.iter().zip(&wholes).map(without).collect();
    let mean = without.iter().sum::<f64>() / count;
    let spread: f64 = without.iter().map(|value| (value - mean) * (value - mean)).sum();
    let unbiased = count * part / whole - (count - 1.0) * mean;
    (unbiased.clamp(0.0, 1.0), spread * (count - 1.0) / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_in_proportion_leave_no_error() {
        let wholes = [1.0, 2.0, 0.5, 0.25, 3.0, 1.0, 0.0, 0.125];
        let parts = wholes.map(|whole| 0.375 * whole);
        assert_eq!(ratio(&parts, &wholes, 2), (0.375, 0.0));
        assert_eq!(ratio(&wholes, &wholes, 2), (1.0, 0.0));
        assert_eq!(ratio(&[0.0; 8], &wholes, 2), (0.0, 0.0));
    }

    /// Equal wholes make a plain mean of four: 1/4 with a standard error of 1/4 if one of them counts, by the textbook.
    #[test]
    fn equal_wholes_give_the_mean_and_its_standard_error() {
        let (fraction, variance) = ratio(&[1.0, 0.0, 0.0, 0.0], &[1.0; 4], 1);
        assert!(
            (fraction - 0.25).abs() < 1e-15 && (variance - 0.0625).abs() < 1e-15,
            "{fraction} {variance}"
        );
    }

    /// Wholes 1 and 3, of which the parts are their squares over 4: the mean over all draws of four is that of the sums, 5/8. The plain
    /// ratio is lower in the mean.
    #[test]
    fn bias_of_the_ratio_is_taken_out() {
        let (mut plain, mut corrected) = (0.0, 0.0);
        for draw in 0..16_u32 {
            let wholes: Vec<f64> = (0..4).map(|i| if draw >> i & 1 == 1 { 3.0 } else { 1.0 }).collect();
            let parts: Vec<f64> = wholes.iter().map(|whole| whole * whole / 4.0).collect();
            plain += parts.iter().sum::<f64>() / wholes.iter().sum::<f64>() / 16.0;
            corrected += ratio(&parts, &wholes, 1).0 / 16.0;
        }
        assert!(plain < 0.625 - 0.01, "{plain}");
        assert!((corrected - 0.625).abs() < 0.3 * (0.625 - plain), "{plain} {corrected}");
    }
}
