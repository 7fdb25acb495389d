//! Texels and their points.

use glam::{DVec2, DVec3};

use super::{Part, planned, scene};
use crate::plan::plan;
use crate::seams::bilinear;
use crate::texels::NO_POINT;
use crate::{LightmapError, MOST_TEXELS, Resolution};

#[test]
fn texels_have_the_size_that_is_asked_for() {
    let plan = planned(&[Part::floor(2.0)], Resolution::Texel(0.1));
    let report = plan.report();
    assert!((400..=441).contains(&report.texels), "{report:?}");
    assert!((report.texel_size - 0.1).abs() < 1e-6, "{report:?}");
    assert_eq!((report.charts, report.pages, report.hidden_texels), (1, 1, 0));
    assert!(plan.points().iter().all(|point| point.normal.abs_diff_eq(DVec3::Y, 1e-12)));
}

#[test]
fn too_many_texels_are_refused_with_a_size_that_is_allowed() {
    let scene = scene(&[Part::floor(1000.0)]);
    let Err(LightmapError::TooManyTexels { texels, least, .. }) =
        plan(&scene, Resolution::Texel(0.03), &|| false)
    else {
        panic!("not refused")
    };
    assert!(texels > 1e9, "{texels}");
    assert!(1e6 / (least * least) < MOST_TEXELS as f64);
}

#[test]
fn a_plan_can_be_cancelled() {
    let cancelled = plan(&scene(&[Part::floor(2.0)]), Resolution::Texel(0.01), &|| true);
    assert_eq!(cancelled.err(), Some(LightmapError::Cancelled));
}

#[test]
fn texels_below_a_box_are_filled_from_their_neighbours() {
    // The box covers half of the columns from x = 1 on: texels there are cut in two.
    let parts = [Part::floor(2.0), Part::lid([0.45, 0.45], [1.55, 1.55], 1.0)];
    let scene = scene(&parts);
    let plan = plan(&scene, Resolution::Texel(0.1), &|| false).unwrap();
    let hidden = plan.report().hidden_texels;
    assert!((80..=125).contains(&hidden), "{:?}", plan.report());
    // No point lies below the box.
    let places = plan.points().iter().map(|point| (scene.frame.to_world(point.position), point.normal));
    for (place, normal) in places.filter(|(_, normal)| normal.y > 0.9) {
        let is_below = place.y < 0.5 && (place - DVec3::new(1.0, 0.0, 1.0)).abs().max_element() < 0.55;
        assert!(!is_below, "{place} {normal}");
    }
    let light = vec![vec![DVec3::splat(3.0); plan.points().len()]];
    let covered = plan.texels.texels.clone();
    let map = plan.lightmap(&light);
    assert!(covered.iter().all(|texel| map.images[0][0][*texel as usize] == [3.0; 3]));
}

/// Most of a floor and the sides of a box lie between other points of them, which come first and lie opposite each other.
#[test]
fn texels_lie_between_those_of_coarser_lattices() {
    let parts = [Part::floor(2.0), Part::lid([0.45, 0.45], [1.55, 1.55], 1.0)];
    let scene = scene(&parts);
    let plan = plan(&scene, Resolution::Texel(0.05), &|| false).unwrap();
    let (points, around) = (plan.points(), plan.around());
    let unit = |x: f64| scene.frame.to_frame(DVec3::X * x);
    let texel = unit(0.05).distance(unit(0.0));
    let mut between = 0;
    for (index, others) in around.iter().enumerate() {
        let Some(others) = others else { continue };
        between += 1;
        assert!(others.iter().all(|other| (*other as usize) < index), "{index} comes before {others:?}");
        let of = others.map(|other| points[other as usize]);
        for pair in of.chunks(2) {
            let middle = (pair[0].position + pair[1].position) / 2.0;
            let off = middle.distance(points[index].position);
            assert!(off <= 0.3 * texel, "{off} off, with texels of {texel}");
            assert!(pair.iter().all(|other| other.normal.dot(points[index].normal) > 0.99));
        }
    }
    assert!(between > points.len() * 4 / 5, "{between} of {}", points.len());
}

#[test]
fn both_sides_of_a_border_agree_on_a_curved_surface() {
    let scene = scene(&[Part::ball(12, 24)]);
    let plan = plan(&scene, Resolution::Texel(0.05), &|| false).unwrap();
    let borders = plan.borders.clone();
    assert!(plan.report().charts > 1 && borders.len() > 50, "{:?}, {} places", plan.report(), borders.len());
    assert_eq!(plan.texels.point_of.iter().filter(|point| **point == NO_POINT).count(), 0);
    // Light from above, up to 1.
    let light = |point: &kernel::replica::Receiver| DVec3::splat((point.normal.y + 1.0) / 2.0);
    let lights = vec![plan.points().iter().map(light).collect::<Vec<_>>()];
    let count = plan.report().size[0] * plan.report().size[1];
    let (texels, points) = (plan.texels.texels.clone(), plan.texels.point_of.clone());
    let map = plan.lightmap(&lights);
    let value = |texel: u32| map.images[0][(texel / count) as usize][(texel % count) as usize][0];
    let worst =
        borders.iter().map(|border| border.iter().map(|(texel, weight)| value(*texel) * weight).sum::<f32>());
    let worst = worst.map(f32::abs).fold(0.0, f32::max);
    assert!(worst < 1.0 / 255.0, "{worst}");
    // What light was is still there.
    for (texel, point) in texels.iter().zip(points) {
        let before = lights[0][point as usize].x as f32;
        assert!((value(*texel) - before).abs() < 0.05, "{} {before}", value(*texel));
    }
}

#[test]
fn filtering_reads_four_texels_whose_weights_sum_to_one() {
    for place in [glam::DVec2::new(0.0, 0.0), glam::DVec2::new(3.7, 1.2), glam::DVec2::new(4.0, 4.0)] {
        let read = bilinear(place, [4, 4]);
        assert!((read.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(read.iter().all(|(texel, _)| *texel < 16));
    }
}

/// Viewers find light on all of them, though most cover next to nothing of a texel.
#[test]
fn small_things_are_lit() {
    let size = 0.004;
    let screws: Vec<Part> = (0..9)
        .map(|index| {
            let [x, z] = [0.2 + 0.517 * (index % 3) as f32, 0.2 + 0.533 * (index / 3) as f32];
            Part::lid([x, z], [x + size, z + size], size)
        })
        .collect();
    let parts: Vec<Part> = [Part::floor(2.0)].into_iter().chain(screws).collect();
    let plan = planned(&parts, Resolution::Texel(0.1));
    let light = vec![vec![DVec3::splat(3.0); plan.points().len()]];
    let map = plan.lightmap(&light);
    for layout in &map.layouts {
        for index in 0..layout.triangles.len() {
            let middle = layout.corners(index, map.size).iter().sum::<DVec2>() / 3.0;
            let read = bilinear(middle, map.size);
            let value: f64 = read
                .iter()
                .map(|(texel, weight)| f64::from(map.images[0][0][*texel as usize][0]) * weight)
                .sum();
            assert!((value - 3.0).abs() < 1e-6, "{value} on triangle {index} of surface {}", layout.surface);
        }
    }
}
