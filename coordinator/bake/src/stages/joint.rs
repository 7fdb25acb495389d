//! Joint light sources: the many polygons of a lamp, or of many small lamps, with a row for all of them.

use std::collections::BTreeMap;

use glam::DVec3;
use kernel::geometry::ConvexPolygon;
use kernel::row::{CHANNELS, Shape, Shooter};
use kernel::visibility::MANY_POLYGONS;

use super::colours::have_one_colour;
use super::emitters::{Emitter, MOST_JOINED, weighted, weighted_by_channel};
use super::light_source::{LightSource, Origin};

/// Emitters of a scene beyond which those of a surface are joined from [`FEW_POLYGONS`] on: an exact row for each takes too long.
pub const MANY_EMITTERS: usize = 256;
const FEW_POLYGONS: usize = 8;

/// Exact rows that take about as long as one of a joint light source.
const ROWS_OF_JOINT: usize = 32;

/// Lamps with exact rows that give this part of all light keep them: their shadows are looked at. The shadows of lamps that share a row with
/// others have no more noise, relative to all light, than those of one that is sampled alone.
const LARGE_PART: f64 = 1.0 / 32.0;

/// Lamps that together give no more than this part of all light, in errors asked for, are pooled where they are fewer, too: of their own
/// light the noise of few rays is about a tenth.
const FAINT_PART: f64 = 2.5;

/// The faintest emitters of a surface that together give no more than this part of its light have no colour of their own: a texture that was
/// compressed with loss has such at its edges.
const FAINT: f64 = 1e-4;

/// A shape that shines, its exitance and where it comes from.
pub type Shining = (Shape, DVec3, Origin);

/// An emitter by itself, exact.
pub fn alone(Emitter { surface, polygon, exitance }: Emitter) -> Shining {
    (Shape::Polygons(vec![polygon]), exitance, Origin::Surface(surface))
}

/// Joins the emitters of each surface where they are many enough to be sampled; the others stay by themselves, exact.
pub fn join(emitters: Vec<Emitter>) -> Vec<Shining> {
    let least = if emitters.len() > MANY_EMITTERS { FEW_POLYGONS } else { MANY_POLYGONS };
    let mut joined = vec![];
    for own in emitters.chunk_by(|a, b| a.surface == b.surface) {
        let mut others = vec![];
        for even in own.chunk_by(|a, b| a.exitance == b.exitance) {
            if even.len() < MANY_POLYGONS {
                others.extend_from_slice(even);
                continue;
            }
            joined.extend(parts_of(even).map(|part| {
                let polygons = part.iter().map(|emitter| emitter.polygon.clone()).collect();
                (Shape::Polygons(polygons), part[0].exitance, Origin::Surface(part[0].surface))
            }));
        }
        if others.len() < least {
            joined.extend(others.into_iter().map(alone));
        } else {
            let origin = Origin::Surface(others[0].surface);
            joined.extend(
                by_colour(&others, FAINT).into_iter().map(|(shape, strength)| (shape, strength, origin)),
            );
        }
    }
    joined
}

/// The light sources with lamps that are small or sampled taken together; `None` where rows for each lamp take no longer, or where they
/// are few and give much of the light. A lamp is all of a surface that emits and has rows; `others` is the flux that half of the scene
/// would make all of it receive from what had rows before, and `error` the one asked for.
pub fn pool(sources: &[LightSource], others: DVec3, error: f64) -> Option<Vec<LightSource>> {
    let cost = |source: &LightSource| match (source.origin, &source.shooter) {
        (Origin::Surface(_), Some(shooter)) if shooter.shape.polygons() > 1 => ROWS_OF_JOINT,
        (Origin::Surface(_), Some(_)) => 1,
        _ => 0,
    };
    let is_next = |before: &LightSource, next: &LightSource| match (&before.shooter, &next.shooter) {
        (Some(before), Some(next)) => next.is_next_channel_of(before),
        _ => false,
    };
    // The channels of a shape together.
    let lamps: Vec<(&[LightSource], Vec<Emitter>)> =
        sources.chunk_by(is_next).map(|channels| (channels, emitters_of(channels))).collect();
    let mut flux: BTreeMap<usize, DVec3> = BTreeMap::new();
    for emitter in lamps.iter().flat_map(|(_, own)| own) {
        *flux.entry(emitter.surface).or_default() += emitter.flux();
    }
    let all = flux.values().sum::<DVec3>() + others;
    let shares_row = |own: &Vec<Emitter>| match &own[..] {
        [] => false,
        [one] => flux[&one.surface].cmple(LARGE_PART * all).all(),
        _ => true,
    };
    let (sharing, kept): (Vec<_>, Vec<_>) = lamps.into_iter().partition(|(_, own)| shares_row(own));
    let cost_of = |some: &[(&[LightSource], Vec<Emitter>)]| {
        some.iter().flat_map(|(channels, _)| channels.first()).map(cost).sum::<usize>()
    };
    let (cost, cost_of_kept) = (cost_of(&sharing), cost_of(&kept));
    let emitters: Vec<Emitter> = sharing.into_iter().flat_map(|(_, own)| own).collect();
    let flux: DVec3 = emitters.iter().map(Emitter::flux).sum();
    if cost + cost_of_kept <= MANY_EMITTERS && flux.cmpgt(FAINT_PART * error * all).any() {
        return None;
    }
    // One that is faint beside the others may be the only one of its room.
    let pools = by_colour(&emitters, 0.0);
    if cost <= pools.iter().filter(|(shape, _)| shape.channel() == 0).count() * ROWS_OF_JOINT {
        return None;
    }
    let keys = sources.iter().filter_map(|source| Some(source.shooter.as_ref()?.key));
    let free = keys.max().map_or(0, |last| last + 1);
    let pooled = (free..).zip(pools).map(|(key, (shape, strength))| LightSource {
        shooter: Some(Shooter { key, shape }),
        strength,
        origin: Origin::Lamps,
        is_outside: false,
    });
    Some(kept.into_iter().flat_map(|(channels, _)| channels.to_vec()).chain(pooled).collect())
}

/// The polygons of light sources that have a row for each channel of one shape, with what they emit; also of one that has a row.
fn emitters_of(channels: &[LightSource]) -> Vec<Emitter> {
    let [LightSource { origin: Origin::Surface(surface), shooter: Some(shooter), .. }, ..] = channels else {
        return vec![];
    };
    let emitter = |(polygon, weights): (&ConvexPolygon, [f64; CHANNELS])| Emitter {
        surface: *surface,
        polygon: polygon.clone(),
        exitance: channels.iter().zip(weights).map(|(channel, weight)| weight * channel.strength).sum(),
    };
    let emitters = shooter.shape.polygons_of_channels().map(emitter);
    emitters.filter(|emitter| emitter.exitance != DVec3::ZERO).collect()
}

/// Parts of about one size, none too large for a job.
fn parts_of(emitters: &[Emitter]) -> impl Iterator<Item = &[Emitter]> {
    let parts = emitters.len().div_ceil(MOST_JOINED).max(1);
    emitters.chunks(emitters.len().div_ceil(parts).max(1))
}

/// Emitters as shapes with weights: of one colour where they have one, else for each channel.
fn by_colour(emitters: &[Emitter], faint: f64) -> Vec<(Shape, DVec3)> {
    if !have_one_colour(emitters, faint) {
        return parts_of(emitters).flat_map(|part| weighted_by_channel(polygons_of(part))).collect();
    }
    let in_one = |own: &[Emitter]| {
        let flux: DVec3 = own.iter().map(Emitter::flux).sum();
        let strongest: f64 = own.iter().map(|emitter| emitter.flux().max_element()).sum();
        // In parts of what the strongest channel would give: so that the flux is right in each.
        weighted(polygons_of(own)).map(|(shape, most)| (shape, flux / strongest * most))
    };
    parts_of(emitters).filter_map(in_one).collect()
}

/// The polygons of emitters, with their exitances.
fn polygons_of(emitters: &[Emitter]) -> impl Iterator<Item = (ConvexPolygon, DVec3)> {
    emitters.iter().map(|emitter| (emitter.polygon.clone(), emitter.exitance))
}

#[cfg(test)]
mod tests {
    use kernel::geometry::PlaneId;

    use super::*;

    fn emitter(index: u32, exitance: DVec3) -> Emitter {
        let low = f64::from(index);
        let edge = 0.2 + 0.01 * low;
        let corners =
            [(0.0, 0.0), (edge, 0.0), (edge, 0.5), (0.0, 0.5)].map(|(x, y)| DVec3::new(low + x, y, 0.0));
        Emitter {
            surface: 3,
            polygon: ConvexPolygon { plane: PlaneId(0), corners: corners.to_vec() },
            exitance,
        }
    }

    fn flux_of(emitters: &[Emitter]) -> DVec3 {
        emitters.iter().map(Emitter::flux).sum()
    }

    fn flux(shining: &[Shining]) -> DVec3 {
        let of_shape = |shape: &Shape| -> f64 {
            shape.weighted_polygons().map(|(polygon, weight)| polygon.area() * weight).sum()
        };
        shining.iter().map(|(shape, strength, _)| *strength * of_shape(shape)).sum::<DVec3>()
    }

    #[test]
    fn joined_emitters_keep_their_flux_in_each_channel() {
        // Of one colour, of nearly one, of many.
        let brightness = |index: u32| 1.0 + f64::from(index % 7);
        let colours: [fn(u32) -> DVec3; 3] = [
            |_| DVec3::new(1.0, 0.5, 0.25),
            |index| DVec3::new(1.0, 0.5 + 0.001 * f64::from(index % 5), 0.25),
            |index| DVec3::from_array([0, 1, 2].map(|channel| f64::from((index + channel) % 5))),
        ];
        for (colour, rows) in colours.into_iter().zip([1, 1, 3]) {
            let emitters: Vec<Emitter> =
                (0..40).map(|index| emitter(index, colour(index) * brightness(index))).collect();
            let joined = join(emitters.clone());
            assert_eq!(joined.len(), rows);
            assert!(joined.iter().all(|(_, _, origin)| *origin == Origin::Surface(3)));
            let wanted = flux_of(&emitters);
            assert!((flux(&joined) - wanted).abs().max_element() <= 1e-12 * wanted.max_element());
        }
    }

    #[test]
    fn all_channels_have_as_much_flux_in_weights() {
        // One faint blue lamp beside many red ones.
        let exitance = |index: u32| if index == 7 { DVec3::Z } else { DVec3::X * f64::from(1 + index % 7) };
        let emitters: Vec<Emitter> = (0..400).map(|index| emitter(index, exitance(index))).collect();
        let joined = join(emitters.clone());
        assert_eq!(joined.len(), 3);
        let in_weights = |(shape, ..): &Shining| -> f64 {
            shape.weighted_polygons().map(|(polygon, weight)| polygon.area() * weight).sum()
        };
        let [red, green, blue] = [0, 1, 2].map(|channel| in_weights(&joined[channel]));
        assert!((red / blue - 1.0).abs() < 1e-12 && green == 0.0, "{red}, {green}, {blue}");
        assert!((flux(&joined) - flux_of(&emitters)).abs().max_element() <= 1e-12 * flux_of(&emitters).x);
    }

    #[test]
    fn few_emitters_stay_exact_and_very_many_go_into_several_rows() {
        let few: Vec<Emitter> =
            (0..20).map(|index| emitter(index, DVec3::splat(f64::from(index + 1)))).collect();
        assert!(join(few).iter().all(|(shape, ..)| matches!(shape, Shape::Polygons(one) if one.len() == 1)));
        let many: Vec<Emitter> =
            (0..12_000).map(|index| emitter(index, DVec3::splat(f64::from(index % 9 + 1)))).collect();
        let joined = join(many.clone());
        assert_eq!(joined.len(), 3);
        assert!(joined.iter().all(|(shape, ..)| shape.polygons() <= MOST_JOINED));
        let wanted = flux_of(&many);
        assert!((flux(&joined) - wanted).abs().max_element() <= 1e-12 * wanted.max_element());
    }

    /// A lamp with a row of its own.
    fn source(surface: usize, (shape, strength, origin): Shining) -> LightSource {
        let shooter = Some(Shooter { key: surface as u64, shape });
        LightSource { shooter, strength, origin, is_outside: false }
    }

    /// A square lamp.
    fn lamp(surface: usize, exitance: DVec3) -> LightSource {
        source(surface, alone(Emitter { surface, ..emitter(surface as u32, exitance) }))
    }

    fn shining(sources: &[LightSource]) -> Vec<Shining> {
        let shape = |source: &LightSource| source.shooter.as_ref().unwrap().shape.clone();
        sources.iter().map(|source| (shape(source), source.strength, source.origin)).collect()
    }

    #[test]
    fn small_lamps_are_pooled_where_all_are_many_and_keep_their_flux() {
        assert!(pool(&[], DVec3::ONE, 0.05).is_none());
        let few: Vec<LightSource> = (0..MANY_EMITTERS).map(|index| lamp(index, DVec3::ONE)).collect();
        assert!(pool(&few, DVec3::ZERO, 0.05).is_none());
        // Unless they are faint beside other light.
        let others = flux(&shining(&few)) * (1.0 / (FAINT_PART * 0.05) - 1.0);
        assert!(pool(&few, 0.9 * others, 0.05).is_none());
        assert_eq!(pool(&few, 1.1 * others, 0.05).map(|pooled| pooled.len()), Some(1));
        assert!(pool(&few, 1.1 * others, 0.04).is_none());
        // No more than a shared row takes.
        assert!(pool(&few[..ROWS_OF_JOINT], 1.1 * others, 0.05).is_none());

        // No fewer are needed for lamps that are large enough to fill one each.
        let fine = |surface: usize| {
            let colour = DVec3::from_array([0, 1, 2].map(|channel| ((surface + channel) % 5) as f64 + 1.0));
            let own = (0..MOST_JOINED as u32).map(|index| Emitter { surface, ..emitter(index, colour) });
            source(surface, join(own.collect()).pop().unwrap())
        };
        let fine: Vec<LightSource> = (0..80).map(fine).collect();
        assert!(pool(&fine, DVec3::ZERO, 0.05).is_none());

        // A lamp that is sampled shares a row however bright it is.
        let mut lamps: Vec<LightSource> = (0..400).map(|index| lamp(index, DVec3::ONE)).collect();
        let even = (0..40).map(|index| Emitter { surface: 400, ..emitter(index, DVec3::splat(1e6)) });
        lamps.push(source(400, join(even.collect()).pop().unwrap()));
        let pooled = pool(&lamps, DVec3::ZERO, 0.05).unwrap();
        assert_eq!(pooled.iter().map(|source| source.origin).collect::<Vec<_>>(), [Origin::Lamps]);
        let wanted = flux(&shining(&lamps));
        assert!((flux(&shining(&pooled)) - wanted).abs().max_element() <= 1e-12 * wanted.max_element());

        // Surfaces of many colours have a source for each channel, and a polygon is one in all of them.
        let coloured = |surface: usize| {
            let colour = |index: u32| DVec3::new(1.0, f64::from(index % 3), f64::from(surface as u32 % 4));
            let own = (0..40).map(|index| Emitter { surface, ..emitter(index, colour(index)) });
            let channels = join(own.collect()).into_iter().enumerate();
            let source = |(channel, shining)| {
                let LightSource { shooter, strength, origin, is_outside } = source(surface, shining);
                let key = (3 * surface + channel) as u64;
                LightSource {
                    shooter: shooter.map(|own| Shooter { key, ..own }),
                    strength,
                    origin,
                    is_outside,
                }
            };
            channels.map(source).collect::<Vec<_>>()
        };
        let lamps: Vec<LightSource> = (0..20).flat_map(coloured).collect();
        assert_eq!(lamps.len(), 60);
        let pooled = pool(&lamps, DVec3::ZERO, 0.05).unwrap();
        assert_eq!(pooled.len(), 3);
        assert!(shining(&pooled).iter().all(|(shape, ..)| shape.polygons() == 20 * 40));
        let wanted = flux(&shining(&lamps));
        assert!((flux(&shining(&pooled)) - wanted).abs().max_element() <= 1e-12 * wanted.max_element());

        // One is large; the others are of one colour, of two or of many.
        let colours: [fn(usize) -> DVec3; 3] = [
            |_| DVec3::new(1.0, 0.5, 0.0),
            |index| if index % 2 == 0 { DVec3::ONE } else { DVec3::X },
            |index| DVec3::from_array([0, 1, 2].map(|channel| ((index + channel) % 5) as f64 + 1.0)),
        ];
        for (colour, rows) in colours.into_iter().zip([1, 3, 3]) {
            let mut lamps: Vec<LightSource> = (0..400).map(|index| lamp(index, colour(index))).collect();
            lamps[7].strength *= 1000.0;
            let pooled = pool(&lamps, DVec3::ZERO, 0.05).unwrap();
            let (joint, own): (Vec<_>, Vec<_>) =
                pooled.iter().partition(|source| source.origin == Origin::Lamps);
            assert_eq!((joint.len(), own.len()), (rows, 1));
            assert_eq!(own[0].origin, Origin::Surface(7));
            let mut keys: Vec<u64> = pooled.iter().map(|one| one.shooter.as_ref().unwrap().key).collect();
            keys.sort_unstable();
            keys.dedup();
            assert_eq!(keys.len(), rows + 1);
            let wanted = flux(&shining(&lamps));
            assert!((flux(&shining(&pooled)) - wanted).abs().max_element() <= 1e-12 * wanted.max_element());
        }
    }
}
