//! Charts and pages.

use glam::DVec3;
use serde_json::{Value, json};

use super::{Part, planned, scene_of};
use crate::Resolution;
use crate::plan::plan;

#[test]
fn nodes_that_place_turn_or_scale_one_mesh_share_a_layout() {
    let half = 0.5_f64.sqrt();
    let nodes = [
        json!({ "mesh": 0 }),
        json!({ "mesh": 1 }),
        json!({ "mesh": 1, "translation": [3, 0, 0], "rotation": [0, half, 0, half] }),
        json!({ "mesh": 1, "translation": [0, 0, 3], "scale": [1.5, 1.5, 1.5] }),
        // Not these: stretched, mirrored, far larger.
        json!({ "mesh": 1, "translation": [6, 0, 0], "scale": [1, 2, 1] }),
        json!({ "mesh": 1, "translation": [0, 0, 6], "scale": [1, 1, -1] }),
        json!({ "mesh": 1, "translation": [8, 0, 8], "scale": [4, 4, 4] }),
    ];
    let scene = scene_of(&[Part::floor(16.0), Part::lid([0.5, 0.5], [1.5, 1.5], 1.0)], &nodes);
    let plan = plan(&scene, Resolution::Texel(0.05), &|| false).unwrap();
    assert_eq!((plan.report().instances, plan.report().uses_second_set), (2, false));
    let count = plan.points().len();
    let map = plan.lightmap(&[vec![DVec3::ONE; count]]);
    let of_nodes =
        |node: usize| map.layouts.iter().find(|layout| scene.surfaces[layout.surface].node == node).unwrap();
    let groups: Vec<Option<u32>> =
        (0..nodes.len()).map(|node| of_nodes(node).shared.as_ref().map(|shared| shared.group)).collect();
    assert!(groups[1].is_some() && groups[1..4].iter().all(|group| *group == groups[1]), "{groups:?}");
    assert!(groups[0].is_none() && groups[4..].iter().all(Option::is_none), "{groups:?}");
    let [first, turned, larger] = [1, 2, 3].map(of_nodes);
    for layout in [first, turned, larger] {
        let shared = layout.shared.as_ref().unwrap();
        assert_eq!((&layout.triangles, &layout.sources), (&first.triangles, &first.sources));
        for (place, common) in layout.coordinates.iter().zip(shared.coordinates.iter()) {
            let expected = [0, 1].map(|axis| shared.offset[axis] + shared.scale[axis] * common[axis]);
            assert_eq!(*place, expected);
        }
        // Texels as large as elsewhere, in the file's units.
        let texels: f64 = (0..layout.triangles.len())
            .map(|index| layout.corners(index, map.size))
            .map(|[a, b, c]| (b - a).perp_dot(c - a).abs() / 2.0)
            .sum();
        let size = if std::ptr::eq(layout, larger) { 1.5 } else { 1.0 };
        let expected = 5.0 * size * size / (0.05 * 0.05);
        assert!((texels / expected - 1.0).abs() < 0.1, "{texels} texels, expected {expected}");
    }
    // Each has its own part of the page.
    let rectangles = [first, turned, larger].map(|layout| layout.shared.clone().unwrap().offset);
    assert!(
        rectangles[0] != rectangles[1] && rectangles[1] != rectangles[2] && rectangles[0] != rectangles[2]
    );
}

#[test]
fn a_page_has_the_size_that_is_asked_for() {
    let report = planned(&[Part::floor(2.0)], Resolution::Page(64)).report().clone();
    assert!(report.size[0] == 64 && report.size[1] <= 64 && report.texels > 2000, "{report:?}");
}

#[test]
fn a_second_set_is_used_where_it_can_be() {
    let set = |low: f32, high: f32| vec![[low, 0.1], [high, 0.1], [high, 0.9], [low, 0.9]];
    let part = |set: Vec<[f32; 2]>, at: f32| Part {
        second_set: set,
        ..Part::square([at, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    };
    let own = planned(&[part(set(0.05, 0.45), 0.0), part(set(0.55, 0.95), 3.0)], Resolution::Page(100));
    assert!(own.report().uses_second_set, "{:?}", own.report());
    assert_eq!((own.report().size, own.report().charts), ([100, 100], 2));

    let problem = |sets: [Vec<[f32; 2]>; 2]| {
        let [one, other] = sets;
        let plan = planned(&[part(one, 0.0), part(other, 3.0)], Resolution::Page(100));
        assert!(!plan.report().uses_second_set);
        plan.report().second_set_problem.clone().unwrap()
    };
    let overlap = problem([set(0.05, 0.6), set(0.5, 0.95)]);
    assert!(overlap.contains("overlap") && overlap.contains("node 1"), "{overlap}");
    assert!(problem([set(0.05, 0.5), set(0.505, 0.95)]).contains("less than a pixel apart"));
    assert!(problem([set(0.05, 0.45), set(0.55, 1.5)]).contains("outside of [0, 1]"));
    assert!(problem([set(0.05, 0.45), vec![]]).contains("has none"));
}

/// Small facets of a round thing lie in few charts, large ones each in one of its own, and so does each side of a small box.
#[test]
fn charts_go_over_edges_of_small_facets_that_meet_at_small_angles() {
    let charts = |part: Part, texel: f64| planned(&[part], Resolution::Texel(texel)).report().charts;
    let facets = 12 * 24;
    let [fine, coarse] = [0.1, 0.01].map(|texel| charts(Part::ball(12, 24).flat(), texel));
    assert!(fine <= facets / 10, "{fine} charts where texels are large");
    assert!(coarse >= facets * 3 / 4, "{coarse} charts where texels are small");
    assert_eq!(charts(Part::lid([0.0, 0.0], [0.1, 0.1], 0.1), 0.1), 5);
}

/// Nobody sees the insides of closed bodies: they have neither charts nor texels, and share none.
#[test]
fn dark_insides_have_no_texels() {
    let mut body = Part::lid([0.3; 2], [1.3; 2], 1.0);
    let bottom = Part::square([0.3, 0.0, 0.3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let first = body.positions.len() as u32;
    body.indices.extend(bottom.indices.iter().map(|index| first + index));
    body.positions.extend(bottom.positions);
    let flat = Part { indices: vec![0, 1, 1], ..Part::floor(1.0) };
    let twice = [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]];
    let nodes: Vec<Value> =
        (0..2).flat_map(|mesh| twice.map(|at| json!({ "mesh": mesh, "translation": at }))).collect();
    let mut reports = vec![];
    for is_double_sided in [false, true] {
        let parts = [Part { is_double_sided, ..body.clone() }, flat.clone()];
        for resolution in [Resolution::Texel(0.1), Resolution::Page(64)] {
            for nodes in [&nodes[..1], &nodes] {
                reports.push(plan(&scene_of(&parts, nodes), resolution, &|| false).unwrap().report().clone());
            }
        }
    }
    assert_eq!((reports[0].charts, reports[0].hidden_texels, reports[1].instances), (6, 0, 1));
    let (plain, double_sided) = reports.split_at(reports.len() / 2);
    assert_eq!(double_sided, plain);
}
