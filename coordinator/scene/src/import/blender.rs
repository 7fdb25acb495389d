//! Files of Blender's exporter, which multiplies lamps by 683 lm/W or not, by a setting that the file does not state, and emission never.

use document::LightUnit;
use kernel::geometry::area_vector;

use crate::light::LightKind;
use crate::model::{Scene, Surface};

/// How `asset.generator` of such a file begins.
const EXPORTER: &str = "Khronos glTF Blender I/O";

/// Lamps and emission further apart than this were hardly meant so.
const APART: f64 = 100.0;

/// A warning where a file of Blender has lamps and emissive surfaces whose flux lies so far apart that the unit of the lamps must be
/// another one. What the sun sends is what falls on a convex body of the area of all surfaces: a quarter of it.
pub(super) fn check_units(scene: &Scene, unit: LightUnit) -> Option<String> {
    let generator = scene.source.root.asset.generator.as_deref()?;
    if !generator.starts_with(EXPORTER) {
        return None;
    }
    let scale = scene.frame.scale;
    let area = |surface: &Surface| -> f64 {
        let facets = surface.facets.iter();
        let area = facets.map(|facet| area_vector(&facet.positions().collect::<Vec<_>>()).length());
        area.sum::<f64>() * scale * scale
    };
    let whole: f64 = scene.fronts().map(area).sum();
    let emission: f64 = scene.surfaces.iter().map(|own| own.exitance.element_sum() * area(own)).sum();
    let lamps = scene.lights.iter().map(|light| match light.kind {
        LightKind::Directional { .. } => light.intensity.element_sum() * whole / 4.0,
        LightKind::Point { .. } | LightKind::Spot(_) => light.flux(&scene.frame).element_sum(),
        // Its numbers have the unit of emission.
        LightKind::Area(_) => 0.0,
    });
    let lamps: f64 = lamps.sum();
    if lamps == 0.0 || emission == 0.0 {
        return None;
    }
    let (times, other, mode) = match unit {
        LightUnit::Candela | LightUnit::Watt => (lamps / emission, "blender", "Standard"),
        LightUnit::Blender => (emission / lamps, "blender-unitless", "Unitless"),
        LightUnit::BlenderUnitless => return None,
    };
    let [more, less] = if unit == LightUnit::Blender {
        ["emissive surfaces", "lamps"]
    } else {
        ["lamps", "emissive surfaces"]
    };
    (times >= APART).then(|| {
        format!(
            "{more} send out {times:.0} times the light of {less}: if Blender's exporter wrote the file in its lighting mode \
             {mode}, give --light-unit {other}"
        )
    })
}
