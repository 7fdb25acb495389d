//! Emitters by the colour of their light.

use glam::DVec3;

use super::emitters::Emitter;

/// Most colours: as many as there are channels, which emitters of more colours have rows for.
const MOST_COLOURS: usize = 3;

/// Colours are that of the brightest of their emitters where they differ from it by no more than this part of their strongest channel.
const ONE_COLOUR: f64 = 1.0 / 64.0;

/// Emitters parted by colour, each part in the order given; `None` where they have too many colours. None may be dark. The faintest, which
/// together give no more than the part `faint` of the light, take the most similar colour of the others.
pub fn colours_of(emitters: &[Emitter], faint: f64) -> Option<Vec<Vec<Emitter>>> {
    let flux = |index: &usize| emitters[*index].flux().max_element();
    let mut brightest: Vec<usize> = (0..emitters.len()).collect();
    brightest.sort_by(|a, b| flux(b).total_cmp(&flux(a)));
    let all: f64 = brightest.iter().map(flux).sum();
    let mut left = all;
    let mut colours: Vec<DVec3> = vec![];
    let mut chosen = vec![0; emitters.len()];
    for index in brightest {
        let exitance = emitters[index].exitance;
        let own = exitance / exitance.max_element();
        let off = |colour: &DVec3| (*colour - own).abs().max_element();
        let nearest = (0..colours.len()).min_by(|a, b| off(&colours[*a]).total_cmp(&off(&colours[*b])));
        // Rounding may leave less than the emitter's own.
        let is_faint = left.max(flux(&index)) <= faint * all;
        let alike = nearest.filter(|place| is_faint || off(&colours[*place]) <= ONE_COLOUR);
        if alike.is_none() && colours.len() == MOST_COLOURS {
            return None;
        }
        chosen[index] = alike.unwrap_or_else(|| {
            colours.push(own);
            colours.len() - 1
        });
        left -= flux(&index);
    }
    let mut parts = vec![vec![]; colours.len()];
    emitters.iter().zip(chosen).for_each(|(emitter, colour)| parts[colour].push(emitter.clone()));
    Some(parts)
}

#[cfg(test)]
mod tests {
    use kernel::geometry::{ConvexPolygon, PlaneId};

    use super::*;

    /// Emitters of one square unit, with these exitances.
    fn emitters(exitances: &[[f64; 3]]) -> Vec<Emitter> {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::X + DVec3::Y, DVec3::Y];
        let polygon = ConvexPolygon { plane: PlaneId(0), corners };
        let emitter = |exitance: &[f64; 3]| Emitter {
            surface: 0,
            polygon: polygon.clone(),
            exitance: (*exitance).into(),
        };
        exitances.iter().map(emitter).collect()
    }

    fn parts(exitances: &[[f64; 3]]) -> Option<Vec<Vec<[f64; 3]>>> {
        let own = |part: Vec<Emitter>| part.iter().map(|one| one.exitance.to_array()).collect();
        colours_of(&emitters(exitances), 1e-4).map(|parts| parts.into_iter().map(own).collect())
    }

    #[test]
    fn brightness_is_no_colour_and_the_brightest_comes_first() {
        let (white, red) = ([3.0, 3.0, 2.98], [1.0, 0.0, 0.0]);
        assert_eq!(parts(&[]), Some(vec![]));
        assert_eq!(parts(&[red, white, [0.5; 3]]), Some(vec![vec![white, [0.5; 3]], vec![red]]));
    }

    #[test]
    fn more_colours_than_channels_are_none_but_for_faint_ones() {
        let lit = |faint: f64| [[1.0; 3], [0.9, 0.0, 0.0], [0.0, 0.9, 0.0], [0.0, faint, faint / 2.0]];
        assert_eq!(parts(&lit(1e-3)), None);
        let [white, red, green, faint] = lit(1e-4);
        assert_eq!(
            parts(&[faint, white, red, green]),
            Some(vec![vec![white], vec![red], vec![faint, green]])
        );
    }

    #[test]
    fn a_faint_emitter_does_not_make_a_colour() {
        let faint = [1e-20, 0.0, 0.0];
        assert_eq!(parts(&[faint, [1.0; 3]]), Some(vec![vec![faint, [1.0; 3]]]));
        assert_eq!(parts(&[[1e-3, 0.0, 0.0], [1.0; 3]]).map(|parts| parts.len()), Some(2));
        assert_eq!(colours_of(&emitters(&[faint, [1.0; 3]]), 0.0).map(|parts| parts.len()), Some(2));
    }
}
