//! Texels without light of their own, filled from their neighbours.

use glam::DVec3;

/// Rounds in which charts grow over the texels around them.
pub const DILATION: u32 = 4;

/// What a texel is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Outside of all charts.
    Empty,
    /// Covered by a surface whose light there is not known.
    Unknown,
    /// Its light is known.
    Known,
}

/// Fills the unknown texels of a page, then lets charts grow by [`DILATION`] texels. Returns which texels have light then. `width`: of
/// the page, in texels.
pub fn fill(light: &mut [DVec3], states: &[State], width: usize) -> Vec<bool> {
    let mut is_known: Vec<bool> = states.iter().map(|state| *state == State::Known).collect();
    let pick =
        |wanted: State| (0..states.len()).filter(|index| states[*index] == wanted).collect::<Vec<usize>>();
    grow(light, &mut is_known, pick(State::Unknown), width, u32::MAX);
    grow(light, &mut is_known, pick(State::Empty), width, DILATION);
    is_known
}

/// Gives texels next to known ones the mean of these, round by round.
fn grow(light: &mut [DVec3], is_known: &mut [bool], candidates: Vec<usize>, width: usize, rounds: u32) {
    let mut left = candidates;
    for _ in 0..rounds {
        let mut found = vec![];
        left.retain(|&index| {
            let (mut sum, mut count) = (DVec3::ZERO, 0);
            for other in neighbours(index, width, is_known.len()) {
                if is_known[other] {
                    sum += light[other];
                    count += 1;
                }
            }
            if count > 0 {
                found.push((index, sum / f64::from(count)));
            }
            count == 0
        });
        if found.is_empty() {
            return;
        }
        for (index, value) in found {
            light[index] = value;
            is_known[index] = true;
        }
    }
}

/// The up to eight texels around one.
fn neighbours(index: usize, width: usize, count: usize) -> impl Iterator<Item = usize> {
    let (x, y, height) = (index % width, index / width, count / width);
    let rows = y.saturating_sub(1)..(y + 2).min(height);
    rows.flat_map(move |row| {
        (x.saturating_sub(1)..(x + 2).min(width)).map(move |column| row * width + column)
    })
    .filter(move |other| *other != index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_texels_are_filled_first_and_charts_grow_by_four() {
        let mut states = vec![State::Empty; 12];
        states[..3].copy_from_slice(&[State::Known, State::Unknown, State::Unknown]);
        let mut light = vec![DVec3::ZERO; 12];
        light[0] = DVec3::splat(2.0);
        let known = fill(&mut light, &states, 12);
        assert_eq!(known.iter().filter(|known| **known).count(), 7);
        assert!(light[..7].iter().all(|light| *light == DVec3::splat(2.0)), "{light:?}");
        assert!(light[7..].iter().all(|light| *light == DVec3::ZERO));
    }

    #[test]
    fn a_chart_without_any_light_stays_black() {
        let mut light = vec![DVec3::ZERO; 9];
        let known = fill(&mut light, &[State::Unknown; 9], 3);
        assert!(known.iter().all(|known| !known));
    }
}
