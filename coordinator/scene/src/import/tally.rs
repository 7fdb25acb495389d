//! Counts for the import report.

use std::collections::BTreeMap;

use crate::model::Scene;
use crate::report::ImportReport;

/// Counts kinds of things, in the order of their first appearance.
#[derive(Default)]
pub(super) struct Tally {
    modelled: Vec<(String, usize)>,
    ignored: Vec<(String, usize)>,
}

impl Tally {
    /// Counts a thing that the bake models. The kind is in the singular.
    pub(super) fn modelled(&mut self, kind: &str) {
        count(&mut self.modelled, kind);
    }

    /// Counts a thing that the bake ignores.
    pub(super) fn ignored(&mut self, kind: &str) {
        count(&mut self.ignored, kind);
    }

    /// The report, with the light sources of the finished scene.
    pub(super) fn report(&self, scene: &Scene) -> ImportReport {
        let mut modelled: Vec<String> = self.modelled.iter().map(in_words).collect();
        let emissive = scene.surfaces.iter().filter(|s| s.exitance != glam::DVec3::ZERO).count();
        let mut lights: BTreeMap<(u8, &str), usize> = BTreeMap::new();
        scene.lights.iter().for_each(|light| *lights.entry(light.kind.noun()).or_default() += 1);
        let lights = lights.into_iter().map(|((_, kind), count)| (kind, count));
        let sources = [("emissive surface", emissive)].into_iter().filter(|(_, count)| *count > 0);
        modelled.extend(sources.chain(lights).map(|(kind, count)| in_words(&(kind.to_owned(), count))));
        if scene.sky != glam::DVec3::ZERO {
            modelled
                .push(if scene.sky_pattern.is_some() { "a sky image" } else { "a uniform sky" }.to_owned());
        }
        let sealed =
            scene.surfaces.iter().flat_map(|surface| &surface.facets).filter(|facet| facet.is_sealed);
        let mut ignored: Vec<String> = self.ignored.iter().map(in_words).collect();
        match sealed.map(|facet| facet.triangles.len()).sum() {
            0 => {}
            count => ignored.push(in_words(&("back, in dark insides of closed bodies".to_owned(), count))),
        }
        ImportReport { modelled, ignored }
    }
}

fn count(kinds: &mut Vec<(String, usize)>, kind: &str) {
    match kinds.iter_mut().find(|(known, _)| known == kind) {
        Some((_, count)) => *count += 1,
        None => kinds.push((kind.to_owned(), 1)),
    }
}

/// The number and the kind; what is counted, without what is said of it, takes the plural.
fn in_words((kind, count): &(String, usize)) -> String {
    let end = [",", " (", " with "].iter().filter_map(|said| kind.find(said)).min();
    let (noun, rest) = kind.split_at(end.unwrap_or(kind.len()));
    match count {
        1 => format!("1 {kind}"),
        _ => format!("{count} {noun}s{rest}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_counted_in_their_order() {
        let mut tally = Tally::default();
        [
            "emissive texture",
            "texture (its blue channel)",
            "emissive texture",
            "texture (its blue channel)",
            "mask",
            "material with an alpha mask",
            "material with an alpha mask",
        ]
        .into_iter()
        .for_each(|kind| tally.modelled(kind));
        let words: Vec<String> = tally.modelled.iter().map(in_words).collect();
        assert_eq!(
            words,
            [
                "2 emissive textures",
                "2 textures (its blue channel)",
                "1 mask",
                "2 materials with an alpha mask"
            ]
        );
    }
}
