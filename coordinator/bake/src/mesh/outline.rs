use glam::DVec3;
use kernel::geometry::area_vector;
use smallvec::SmallVec;

/// Makes an outline simple where it passes through a corner more than once: of the two parts that the corner divides it into, the
/// larger one is kept. Welding makes such outlines where a corner is sharp: a vertex close to it lies on both edges, and what is
/// beyond it is a spike, thinner than the welding distance.
pub fn make_simple<Id: Copy + Ord>(outline: &mut Vec<Id>, position: impl Fn(Id) -> DVec3) {
    let area = |part: &[Id]| {
        let positions: SmallVec<[DVec3; 8]> = part.iter().map(|id| position(*id)).collect();
        area_vector(&positions).length()
    };
    while let Some((first, second)) = repeated(outline) {
        let inner: Vec<Id> = outline.drain(first..second).collect();
        if area(&inner) > area(outline) {
            *outline = inner;
        }
    }
}

/// Places of the first corner that comes twice.
fn repeated<Id: Copy + Ord>(outline: &[Id]) -> Option<(usize, usize)> {
    let mut sorted: SmallVec<[(Id, usize); 8]> =
        outline.iter().enumerate().map(|(place, id)| (*id, place)).collect();
    sorted.sort_unstable();
    let pairs = sorted.windows(2).filter(|pair| pair[0].0 == pair[1].0);
    pairs.map(|pair| (pair[0].1, pair[1].1)).min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Mesh, WELD};
    use crate::test_scenes::{facet, scene};

    /// A line that ends next to the sharp corner of a triangle: its end lies on both edges there.
    #[test]
    fn a_line_that_ends_at_a_sharp_corner_leaves_the_facet_whole() {
        let triangle = facet(0, &[[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [8.0, 4.0, 0.0]]);
        let area = triangle.polygon().area();
        let scene = scene(vec![vec![triangle]], vec![]);
        let line = [DVec3::X * 1.5 * WELD, DVec3::new(9.0, 2.0, 0.0)];
        let mesh = Mesh::new(&scene, 10.0, 100.0, 0, &[vec![vec![line]]]);
        let covered: f64 = mesh.leaves().map(|(_, leaf)| leaf.area).sum();
        assert!((covered - area).abs() < 1e-3 * area, "{covered} of {area}");
    }

    fn simple(outline: &[usize], places: &[[f64; 2]]) -> Vec<usize> {
        let mut outline = outline.to_vec();
        make_simple(&mut outline, |id| DVec3::new(places[id][0], places[id][1], 0.0));
        outline
    }

    #[test]
    fn spikes_and_small_loops_are_cut_off() {
        let places = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.1, 0.1], [0.0, 0.2], [5.0, 5.0]];
        assert_eq!(simple(&[0, 1, 2], &places), [0, 1, 2]);
        // A spike at the start, in the middle, and over the end.
        assert_eq!(simple(&[3, 0, 3, 1, 2], &places), [3, 1, 2]);
        assert_eq!(simple(&[0, 1, 2, 5, 2], &places), [0, 1, 2]);
        assert_eq!(simple(&[0, 3, 1, 2, 3], &places), [3, 1, 2]);
        // A loop with an area of its own, and two spikes.
        assert_eq!(simple(&[3, 4, 0, 3, 1, 2], &places), [3, 1, 2]);
        assert_eq!(simple(&[3, 0, 3, 1, 2, 5, 2], &places), [3, 1, 2]);
        // There and back: nothing is left that has an area.
        assert!(simple(&[0, 1, 2, 1], &places).len() < 3);
    }
}
