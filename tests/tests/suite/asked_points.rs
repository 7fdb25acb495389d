//! Light at points that are asked about beside the mesh.

use bake::{AskedPoints, BakeSettings, RowStrategy};
use glam::DVec3;
use kernel::replica::Receiver;
use lightmap::{Resolution, plan};
use scene::{ImportOptions, import};
use tests::baking::baked_with_points;
use tests::data;

/// Where vertices are few, each casts rays of its own. Many points take their light from gather points that are placed for them.
#[test]
fn many_points_have_the_light_that_few_have_with_fewer_rays() {
    let scene = import(&data("scenes/cornell.glb"), &ImportOptions::default()).unwrap();
    let plan = plan(&scene, Resolution::Texel(0.08), &|| false).unwrap();
    let (many, step) = (plan.points(), 8);
    let few: Vec<Receiver> = many.iter().step_by(step).copied().collect();
    assert!(many.len() > 1 << 14 && few.len() < 1 << 13, "{} and {} points", many.len(), few.len());
    let asked = 0.05;
    let settings = BakeSettings { rows: RowStrategy::Gather, ..BakeSettings::for_error(asked) };
    let [none, few_lit, many_lit] = [&[], few.as_slice(), many].map(|on_surfaces| {
        let points = AskedPoints { on_surfaces, ..AskedPoints::default() };
        let baked = baked_with_points(&scene, &settings, &points, 2);
        (baked.report.rays, baked.at_points.on_surfaces.into_iter().next().unwrap_or_default())
    });
    let rays = |lit: &(u64, Vec<DVec3>)| (lit.0 - none.0) as f64;
    let per_point = rays(&few_lit) / few.len() as f64;
    assert!(rays(&many_lit) < 0.6 * per_point * many.len() as f64, "{} rays", rays(&many_lit));
    let (mut error, mut all) = (0.0, 0.0);
    for (one, other) in few_lit.1.iter().zip(many_lit.1.iter().step_by(step)) {
        error += one.distance_squared(*other);
        all += one.length_squared();
    }
    let error = (error / all).sqrt();
    assert!(error > 0.0 && error <= 0.6 * asked, "{error} apart");

    // Whatever the threads, with the mesh and without, though it is then left as it was.
    let points = AskedPoints { on_surfaces: many, without_mesh: true, ..AskedPoints::default() };
    let without = baked_with_points(&scene, &settings, &points, 1);
    assert!(without.at_points.on_surfaces[0] == many_lit.1);
    let with = baked_with_points(&scene, &settings, &AskedPoints::default(), 2);
    assert!(with.lit.vertices.len() < without.lit.vertices.len(), "{}", with.lit.vertices.len());
}
