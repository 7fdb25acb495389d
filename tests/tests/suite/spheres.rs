//! Spheres of many facets. Inside a sphere every surface element lights all others alike, so the irradiance that reflection
//! makes is the same everywhere, and the answers are exact. What the facets change is known: their area, and that they are
//! tilted against the sphere.

use bake::BakeSettings;
use glam::DVec3;
use kernel::form_factor::point_to_polygon;
use kernel::geometry::area_vector;
use tests::baking::{baked, imported};
use tests::builder::{Material, SceneBuilder};
use tests::cases::case;
use tests::shapes::{self, Polygon};

fn area(polygons: &[Polygon]) -> f64 {
    polygons.iter().map(|polygon| area_vector(polygon).length()).sum()
}

/// Baked irradiance: the middle of each triangle with its normal, area and mean of the corners.
struct Irradiance(Vec<(DVec3, DVec3, f64, f64)>);

impl Irradiance {
    fn of(scene: &SceneBuilder, settings: &BakeSettings) -> Self {
        let scene = imported(&scene.glb());
        let lit = baked(&scene, settings).lit;
        let middle = |corners: [u32; 3]| {
            let [a, b, c] = corners.map(|corner| lit.vertices[corner as usize]);
            let across = (b.position - a.position).cross(c.position - a.position);
            let position = scene.frame.to_world((a.position + b.position + c.position) / 3.0);
            let irradiance = (a.irradiance + b.irradiance + c.irradiance).x / 3.0;
            (position, across.normalize(), across.length(), irradiance)
        };
        Self(lit.surfaces.iter().flatten().map(|triangle| middle(triangle.vertices)).collect())
    }

    /// Mean over the area, relative to this.
    fn mean(&self, expected: f64) -> f64 {
        let sum = |what: fn(f64) -> f64| self.0.iter().map(|(_, _, area, e)| area * what(*e)).sum::<f64>();
        sum(|irradiance| irradiance) / sum(|_| 1.0) / expected
    }

    /// Root of the mean square deviation from what is expected at a point with a normal, relative to it.
    fn deviation(&self, expected: impl Fn(DVec3, DVec3) -> f64) -> f64 {
        let (sum, area) = self.0.iter().fold((0.0, 0.0), |(sum, whole), (position, normal, area, found)| {
            let error = found / expected(*position, *normal) - 1.0;
            (sum + area * error * error, whole + area)
        });
        (sum / area).sqrt()
    }
}

/// Finer than default: the mesh is to have less error than the facets, and no more than is allowed for the mean.
fn settings() -> BakeSettings {
    BakeSettings { mesh_error: 0.001, ..BakeSettings::default() }
}

/// A cap of half angle 30 degrees emits. The irradiance is the mean of the emission over 1 - rho.
#[test]
fn emitting_cap() {
    let expected = case("D14").values()[0];
    let reflectance = 0.75;
    let bake = |rings: u32| {
        let height =
            |polygon: &Polygon| polygon.iter().map(|corner| corner.z).sum::<f64>() / polygon.len() as f64;
        let edge = std::f64::consts::FRAC_PI_6.cos();
        let (cap, rest): (Vec<Polygon>, Vec<Polygon>) =
            shapes::globe_facing_in(rings, 2 * rings).into_iter().partition(|polygon| height(polygon) > edge);
        let wall = Material::grey(reflectance);
        let scene = SceneBuilder::new().part("cap", &cap, wall.emitting(1.0)).part("rest", &rest, wall);
        let irradiance = Irradiance::of(&scene, &settings());
        // What is emitted is absorbed, by facets too.
        let mean = area(&cap) / (area(&cap) + area(&rest)) / (1.0 - reflectance);
        assert!(
            (irradiance.mean(mean) - 1.0).abs() <= 0.001,
            "{rings} rings: mean {}",
            irradiance.mean(mean)
        );
        // The direct light of facets is known at every point, and what is reflected hardly differs from its mean.
        let facetted = |position: DVec3, normal: DVec3| {
            let direct: f64 = cap.iter().map(|facet| point_to_polygon(position, normal, facet)).sum();
            direct + reflectance * mean
        };
        let deviation = irradiance.deviation(facetted);
        assert!(deviation <= 0.006, "{rings} rings: {deviation} from the facets' irradiance");
        (irradiance.mean(expected), irradiance.deviation(|_, _| expected))
    };
    // The cap loses more area to the facets than the sphere: a part that goes with the square of their size. Tilt changes the
    // direct light at each point in proportion to it.
    let [(coarse_mean, coarse), (mean, fine)] = [6, 12].map(bake);
    assert!((mean - 1.0).abs() <= 0.006, "mean {mean}");
    assert!((mean - 1.0).abs() <= (coarse_mean - 1.0).abs() / 3.5, "mean {mean} after {coarse_mean}");
    assert!(fine <= 0.03 && fine <= coarse / 2.0, "deviation {fine} after {coarse}");
}

/// A light of 1 W in the middle. The facets have the area of the sphere, so that the mean is the sphere's.
#[test]
fn light_in_the_middle() {
    let radiosity = case("D17").values()[0];
    let reflectance = 0.5;
    let bake = |level: u32| {
        let inward = |facet: [DVec3; 3]| facet.into_iter().rev().collect::<Polygon>();
        let facets: Vec<Polygon> = shapes::icosphere(level).into_iter().map(inward).collect();
        let scale = (4.0 * std::f64::consts::PI / area(&facets)).sqrt();
        let facets: Vec<Polygon> =
            facets.iter().map(|facet| facet.iter().map(|corner| *corner * scale).collect()).collect();
        let scene = SceneBuilder::new()
            .part("sphere", &facets, Material::grey(reflectance))
            .point_light(DVec3::ZERO, 0.25 / std::f64::consts::PI);
        // Reflection is the same everywhere, and coarse shares are enough for it.
        let irradiance = Irradiance::of(&scene, &BakeSettings { shooter_edge: 0.3, ..settings() });
        let expected = radiosity / reflectance;
        let mean = irradiance.mean(expected);
        assert!((mean - 1.0).abs() <= 0.002, "level {level}: mean {mean}");
        irradiance.deviation(|_, _| expected)
    };
    // Distance and tilt of a facet's points change with the square of its size.
    let [coarse, fine] = [0, 1].map(bake);
    assert!(fine <= 0.02 && fine <= coarse / 3.5, "deviation {fine} after {coarse}");
}
