use super::prediction::{Measure, MeshError};
use crate::error_budget::without_noise;
use crate::mesh::{Mesh, PatchId};

/// Effect of the noise of sampled visibility on the prediction: three vertices of half the variance each, on every level.
const NOISE_SEEN: f64 = 1.1;

/// Part of a leaf's square error that dividing it takes away, at least where light is smooth.
const GAIN: f64 = 0.75;

/// Least part of the square error whose leaves are divided in a round: rounds cost, too.
const LEAST_PER_ROUND: f64 = 0.25;

/// Most of it: the new vertices then tell better where to go on.
const MOST_PER_ROUND: f64 = 0.8;

/// Most new vertices of a divided patch. It may make its neighbours divide as well.
const NEW_VERTICES: usize = 5;

/// How far to refine.
#[derive(Debug, Clone, Copy)]
pub struct Plan {
    /// Expected interpolation error at which refinement ends.
    pub limit: f64,
    /// Expected contrast of errors at which refinement ends as well ([`MeshError::contrast`]); infinite where it does not count.
    pub contrast: f64,
    /// Measured interpolation error over the predicted one.
    pub found_per_predicted: f64,
    /// Patches of this size are not divided.
    pub shortest_edge: f64,
    /// Most vertices.
    pub max_vertices: usize,
}

/// What to do next.
pub enum Step {
    /// The limit is met.
    Done,
    /// It cannot be met.
    Stop(Obstacle),
    /// Divide these patches.
    Divide(Vec<PatchId>),
}

/// Why refinement ended before its limit was met.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Obstacle {
    /// More vertices would only follow the noise of sampled visibility.
    Noise,
    /// There are as many vertices as there may be.
    MaxVertices,
    /// All patches are as small as they may be.
    SmallPatches,
}

impl Obstacle {
    /// What the user can do, if anything.
    #[must_use]
    pub fn cure(self) -> Option<&'static str> {
        match self {
            Self::Noise => Some("raise --rays or --exact-occluders"),
            Self::MaxVertices => Some("raise --max-vertices"),
            Self::SmallPatches => None,
        }
    }

    /// Its description for the user, with the cure.
    #[must_use]
    pub fn describe(self) -> String {
        let cause = match self {
            Self::Noise => Some("noise of sampled visibility hides it"),
            Self::MaxVertices => None,
            Self::SmallPatches => Some("no patch is left that may be divided"),
        };
        cause.into_iter().chain(self.cure()).collect::<Vec<_>>().join(": ")
    }
}

impl Plan {
    /// Decides what to do where the error is predicted like this, and light has this relative noise. Only leaves that
    /// `may_divide` allows are divided.
    #[must_use]
    pub fn next(
        &self,
        mesh: &Mesh,
        prediction: &MeshError,
        noise: f64,
        may_divide: impl Fn(PatchId) -> bool + Sync,
    ) -> Step {
        let found = |predicted| self.found_per_predicted * without_noise(predicted, NOISE_SEEN * noise);
        let (error, contrast) = (found(prediction.relative()), found(prediction.contrast()));
        // Contrast alone is no reason to say that the error asked for cannot be met.
        let stop = |obstacle| if error <= self.limit { Step::Done } else { Step::Stop(obstacle) };
        let is_over = |found: f64, limit: f64| found > limit.max(noise);
        // Contrast comes second: what it adds takes nothing from what the error needs.
        let (measure, over) = if is_over(error, self.limit) {
            (Measure::Error, error / self.limit)
        } else if is_over(contrast, self.contrast) {
            (Measure::Contrast, contrast / self.contrast)
        } else {
            return stop(Obstacle::Noise);
        };
        // Where contrast has its turn, nothing but noise is in the error's way.
        let stop = |obstacle| stop(if measure == Measure::Contrast { Obstacle::Noise } else { obstacle });
        let room = room(mesh, self.max_vertices);
        if room == 0 {
            return stop(Obstacle::MaxVertices);
        }
        let may_divide = |id: PatchId| mesh.size(id) > self.shortest_edge && may_divide(id);
        let worst = prediction.worst_leaves(measure, part_to_divide(over), room, may_divide);
        if worst.is_empty() { stop(Obstacle::SmallPatches) } else { Step::Divide(worst) }
    }
}

/// Leaves that are longer than this, as many as may be divided.
#[must_use]
pub fn long_patches(mesh: &Mesh, longest: f64, max_vertices: usize) -> Vec<PatchId> {
    let leaves = mesh.leaves().map(|(id, _)| id);
    leaves.filter(|id| mesh.size(*id) > longest).take(room(mesh, max_vertices)).collect()
}

/// How many patches may be divided.
#[must_use]
pub fn room(mesh: &Mesh, max_vertices: usize) -> usize {
    max_vertices.saturating_sub(mesh.vertices.len()) / NEW_VERTICES
}

/// Part of the square error whose leaves are divided in one round, where the error is over its limit so many times. No more than
/// brings it under the limit, if dividing takes three quarters of a leaf's square error away; the last rounds then do not go past it.
fn part_to_divide(over: f64) -> f64 {
    let excess = 1.0 - over.powi(-2);
    (excess / GAIN).clamp(LEAST_PER_ROUND, MOST_PER_ROUND)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::refinement::RevealedErrors;
    use crate::test_scenes::squares;

    const PLAN: Plan = Plan {
        limit: 0.01,
        contrast: f64::INFINITY,
        found_per_predicted: 1.0,
        shortest_edge: 0.5,
        max_vertices: 1000,
    };

    /// Even light of 1 in which these errors were found, one in each patch.
    fn found(mesh: &Mesh, errors: &[f64]) -> MeshError {
        let found: Vec<_> = (0..).map(PatchId).zip(errors.iter().map(|error| DVec3::splat(*error))).collect();
        predicted(mesh, &vec![DVec3::ONE; mesh.vertices.len()], &found)
    }

    /// On white surfaces.
    fn predicted(mesh: &Mesh, light: &[DVec3], found: &[(PatchId, DVec3)]) -> MeshError {
        let revealed = RevealedErrors::new(mesh, light);
        MeshError::predict(mesh, light, &[DVec3::ONE], &revealed, found, f64::INFINITY)
    }

    fn ids(ids: &[u32]) -> Vec<PatchId> {
        ids.iter().copied().map(PatchId).collect()
    }

    fn divided(step: Step) -> Vec<PatchId> {
        match step {
            Step::Divide(patches) => patches,
            Step::Done => panic!("done"),
            Step::Stop(obstacle) => panic!("{obstacle:?}"),
        }
    }

    #[test]
    fn refinement_ends_at_the_limit_or_an_obstacle() {
        let mesh = squares(&[1.0; 4]);
        let error = found(&mesh, &[0.1; 4]);
        let is_done = |plan: Plan| matches!(plan.next(&mesh, &error, 0.0, |_| true), Step::Done);
        assert!(is_done(Plan { limit: 0.11, ..PLAN }));
        assert!(!is_done(Plan { limit: 0.11, found_per_predicted: 1.2, ..PLAN }), "measured errors count");
        for (obstacle, plan, noise) in [
            (Obstacle::Noise, PLAN, 0.08),
            (Obstacle::MaxVertices, Plan { max_vertices: 16 + NEW_VERTICES - 1, ..PLAN }, 0.0),
            (Obstacle::SmallPatches, Plan { shortest_edge: 1.5, ..PLAN }, 0.0),
        ] {
            assert!(
                matches!(plan.next(&mesh, &error, noise, |_| true), Step::Stop(found) if found == obstacle),
                "{obstacle:?}"
            );
        }
    }

    #[test]
    fn the_worst_patches_are_divided_first_and_equals_in_the_order_of_their_ids() {
        let mesh = squares(&[1.0; 5]);
        let error = found(&mesh, &[0.1, 0.3, 0.2, 0.3, 0.0]);
        assert_eq!(
            divided(PLAN.next(&mesh, &error, 0.0, |_| true)),
            ids(&[1, 3, 2]),
            "four fifths of the square error"
        );
        let two = Plan { max_vertices: 20 + 2 * NEW_VERTICES, ..PLAN };
        assert_eq!(divided(two.next(&mesh, &error, 0.0, |_| true)), ids(&[1, 3]));
        let near = Plan { limit: 0.99 * error.relative(), ..PLAN };
        assert_eq!(
            divided(near.next(&mesh, &error, 0.0, |_| true)),
            ids(&[1]),
            "no more than brings it under the limit"
        );
    }

    /// Else the legs of a table, dim above and below, stay dim between. What is black promises nothing, whatever its size.
    #[test]
    fn leaves_that_were_never_divided_are_not_known() {
        let mesh = squares(&[1.0, 0.4, 1.0]);
        let light = [1.0, 1.0, 0.0].map(|light| [DVec3::splat(light); 4]).concat();
        let revealed = RevealedErrors::new(&mesh, &light);
        let predicted = |unknown| MeshError::predict(&mesh, &light, &[DVec3::ONE], &revealed, &[], unknown);
        assert_eq!(divided(PLAN.next(&mesh, &predicted(0.5), 0.0, |_| true)), ids(&[0]));
        assert!(matches!(PLAN.next(&mesh, &predicted(f64::INFINITY), 0.0, |_| true), Step::Done));
    }

    /// An error that no one sees in bright light shows in the dark.
    #[test]
    fn contrast_divides_what_is_dark() {
        let mesh = squares(&[1.0; 3]);
        let errors = [0.1, 0.01, 0.01].map(DVec3::splat);
        let found: Vec<_> = (0..).map(PatchId).zip(errors).collect();
        let light = [10.0, 10.0, 1.0].map(|light| [DVec3::splat(light); 4]).concat();
        let error = predicted(&mesh, &light, &found);
        let plan = |limit, contrast| Plan { limit, contrast, ..PLAN };
        let (relative, contrast) = (error.relative(), error.contrast());
        let bright = plan(0.5 * relative, f64::INFINITY).next(&mesh, &error, 0.0, |_| true);
        assert_eq!(divided(bright), ids(&[0]));
        let dark = plan(2.0 * relative, 0.9 * contrast).next(&mesh, &error, 0.0, |id| id != PatchId(0));
        assert_eq!(divided(dark), ids(&[2]));
        let met = plan(2.0 * relative, 2.0 * contrast).next(&mesh, &error, 0.0, |_| true);
        assert!(matches!(met, Step::Done));
        let small = plan(2.0 * relative, 0.5 * contrast).next(&mesh, &error, 0.0, |_| false);
        assert!(matches!(small, Step::Done), "contrast is no obstacle to the error");
    }

    /// The housing of a lamp may hold nearly all of the square of the radiosity.
    #[test]
    fn what_is_bright_and_small_hides_no_error() {
        let mesh = squares(&[1.0, 1.0, 0.04]);
        let light = [1.0, 1.0, 1000.0].map(|light| [DVec3::splat(light); 4]).concat();
        let predicted = |errors: [f64; 3]| {
            let found: Vec<_> = (0..).map(PatchId).zip(errors.map(DVec3::splat)).collect();
            predicted(&mesh, &light, &found)
        };
        let of_room = predicted([0.2, 0.1, 0.0]);
        assert!((of_room.relative() - 0.158).abs() < 0.001, "{}", of_room.relative());
        assert_eq!(divided(PLAN.next(&mesh, &of_room, 0.0, |_| true)), ids(&[0]));
        let of_housing = predicted([0.0, 0.0, 200.0]);
        assert!((of_housing.relative() - 0.2).abs() < 0.001, "{}", of_housing.relative());
        let parts = predicted([0.1, 0.1, 100.0]).parts().iter().map(|part| part.1).collect::<Vec<_>>();
        assert!(parts.iter().all(|part| *part > 0.4), "both are drawn: {parts:?}");
    }

    /// Where noise hides the error, contrast has what vertices are left, and is not said to be in its way.
    #[test]
    fn contrast_hides_no_noise() {
        let mesh = squares(&[1.0; 2]);
        let found: Vec<_> = (0..).map(PatchId).zip([0.1, 0.1].map(DVec3::splat)).collect();
        let light = [10.0, 0.1].map(|light| [DVec3::splat(light); 4]).concat();
        let error = predicted(&mesh, &light, &found);
        let next = |max_vertices| {
            let plan = Plan { limit: 0.3 * error.relative(), contrast: 0.0, max_vertices, ..PLAN };
            plan.next(&mesh, &error, error.relative(), |_| true)
        };
        assert_eq!(divided(next(1000)), ids(&[1]));
        assert!(matches!(next(8), Step::Stop(Obstacle::Noise)));
    }

    #[test]
    fn patches_that_are_too_small_are_passed_over() {
        let mesh = squares(&[1.0, 0.4, 2.0]);
        let error = found(&mesh, &[0.1, 0.9, 0.1]);
        assert_eq!(divided(PLAN.next(&mesh, &error, 0.0, |_| true)), ids(&[2]));
    }

    #[test]
    fn long_patches_are_divided_as_far_as_there_are_vertices() {
        let mesh = squares(&[3.0, 1.0, 2.5, 4.0]);
        assert_eq!(long_patches(&mesh, 2.0, 1000), ids(&[0, 2, 3]));
        assert_eq!(long_patches(&mesh, 2.0, 16 + 2 * NEW_VERTICES), ids(&[0, 2]));
        assert!(long_patches(&mesh, 2.0, 16).is_empty());
    }
}
