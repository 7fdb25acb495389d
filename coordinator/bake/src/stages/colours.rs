//! Emitters by the colour of their light.

use super::emitters::Emitter;

/// A colour is that of the brightest emitter where it differs from it by no more than this part of its strongest channel.
const ONE_COLOUR: f64 = 1.0 / 64.0;

/// Whether emitters have one colour, whatever that of the faintest, which together give no more than the part `faint` of the light. None
/// may be dark.
pub fn have_one_colour(emitters: &[Emitter], faint: f64) -> bool {
    let flux = |emitter: &Emitter| emitter.flux().max_element();
    let mut brightest: Vec<&Emitter> = emitters.iter().collect();
    brightest.sort_by(|a, b| flux(b).total_cmp(&flux(a)));
    let colour = |emitter: &Emitter| emitter.exitance / emitter.exitance.max_element();
    let Some(first) = brightest.first().map(|emitter| colour(emitter)) else { return true };
    let all: f64 = emitters.iter().map(flux).sum();
    let mut left = all;
    for emitter in brightest {
        // Rounding may leave less than the emitter's own.
        if left.max(flux(emitter)) <= faint * all {
            break;
        }
        if (colour(emitter) - first).abs().max_element() > ONE_COLOUR {
            return false;
        }
        left -= flux(emitter);
    }
    true
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
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

    fn have_one(exitances: &[[f64; 3]]) -> bool {
        have_one_colour(&emitters(exitances), 1e-4)
    }

    #[test]
    fn brightness_is_no_colour() {
        let (white, red) = ([3.0, 3.0, 2.98], [1.0, 0.0, 0.0]);
        assert!(have_one(&[]) && have_one(&[white, [0.5; 3]]));
        assert!(!have_one(&[red, white]) && !have_one(&[white, red]));
    }

    #[test]
    fn faint_emitters_have_no_colour_together() {
        let red = |exitance: f64| [exitance, 0.0, 0.0];
        assert!(have_one(&[red(1e-20), [1.0; 3]]) && have_one(&[red(5e-5), [1.0; 3], red(4e-5)]));
        assert!(!have_one(&[red(1e-3), [1.0; 3]]) && !have_one(&[red(9e-5), [1.0; 3], red(9e-5)]));
        assert!(!have_one_colour(&emitters(&[red(1e-20), [1.0; 3]]), 0.0));
    }
}
