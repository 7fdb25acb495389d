use std::f64::consts::PI;

use glam::DVec3;
use scene::{ImportOptions, Scene, import_slice};
use serde_json::{Value, json};

use crate::plan::{Plan, plan};
use crate::seams::bilinear;
use crate::texels::NO_POINT;
use crate::{LightmapError, MOST_TEXELS, Resolution};

/// A mesh of a scene.
#[derive(Default)]
struct Part {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
    second_set: Vec<[f32; 2]>,
    indices: Vec<u32>,
}

impl Part {
    /// A square from a corner along two edges.
    fn square(corner: [f32; 3], u: [f32; 3], v: [f32; 3]) -> Self {
        let at = |a: f32, b: f32| [0, 1, 2].map(|i| corner[i] + a * u[i] + b * v[i]);
        let positions = vec![at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)];
        Self { positions, indices: vec![0, 1, 2, 0, 2, 3], ..Self::default() }
    }

    /// A square on the ground.
    fn floor(size: f32) -> Self {
        Self::square([0.0; 3], [0.0, 0.0, size], [size, 0.0, 0.0])
    }

    /// The walls and the lid of a box on the ground, facing out.
    fn lid(low: [f32; 2], high: [f32; 2], height: f32) -> Self {
        let ([x, z], [dx, dz]) = (low, [high[0] - low[0], high[1] - low[1]]);
        let up = [0.0, height, 0.0];
        let squares = [
            Self::square([x, 0.0, z], up, [dx, 0.0, 0.0]),
            Self::square([x, 0.0, high[1]], [dx, 0.0, 0.0], up),
            Self::square([x, 0.0, z], [0.0, 0.0, dz], up),
            Self::square([high[0], 0.0, z], up, [0.0, 0.0, dz]),
            Self::square([x, height, z], [0.0, 0.0, dz], [dx, 0.0, 0.0]),
        ];
        let mut all = Self::default();
        for square in squares {
            let first = all.positions.len() as u32;
            all.indices.extend(square.indices.iter().map(|index| first + index));
            all.positions.extend(square.positions);
        }
        all
    }

    /// A ball with smooth normals.
    fn ball(rings: u32, sectors: u32) -> Self {
        let mut ball = Self::default();
        for ring in 0..=rings {
            for sector in 0..sectors {
                let (polar, turn) = (
                    PI * f64::from(ring) / f64::from(rings),
                    2.0 * PI * f64::from(sector) / f64::from(sectors),
                );
                let normal = DVec3::new(polar.sin() * turn.cos(), polar.cos(), -polar.sin() * turn.sin());
                ball.positions.push(normal.as_vec3().to_array());
                ball.normals.push(normal.as_vec3().to_array());
                if ring < rings {
                    let (here, next) = (ring * sectors + sector, ring * sectors + (sector + 1) % sectors);
                    ball.indices.extend([here, here + sectors, next + sectors]);
                    ball.indices.extend([here, next + sectors, next]);
                }
            }
        }
        ball
    }
}

/// A scene of these meshes under a white sky.
fn scene(parts: &[Part]) -> Scene {
    scene_of(parts, &(0..parts.len()).map(|mesh| json!({ "mesh": mesh })).collect::<Vec<_>>())
}

/// A scene of nodes that show these meshes.
fn scene_of(parts: &[Part], nodes: &[Value]) -> Scene {
    let (mut bytes, mut views, mut accessors) = (vec![], vec![], vec![]);
    let mut push = |data: Vec<u8>, accessor: Value| {
        views.push(json!({ "buffer": 0, "byteOffset": bytes.len(), "byteLength": data.len() }));
        let mut accessor = accessor;
        accessor["bufferView"] = json!(views.len() - 1);
        accessors.push(accessor);
        bytes.extend(data);
        accessors.len() - 1
    };
    let floats = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let mut meshes = vec![];
    for part in parts {
        let count = part.positions.len();
        let mut attributes = json!({});
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..3).map(|i| part.positions.iter().map(|p| p[i]).reduce(pick).unwrap()).collect()
        };
        let vectors = json!({ "componentType": 5126, "count": count, "type": "VEC3" });
        let mut positions = vectors.clone();
        (positions["min"], positions["max"]) = (json!(bound(f32::min)), json!(bound(f32::max)));
        attributes["POSITION"] = json!(push(floats(part.positions.as_flattened()), positions));
        if !part.normals.is_empty() {
            attributes["NORMAL"] = json!(push(floats(part.normals.as_flattened()), vectors));
        }
        if !part.second_set.is_empty() {
            let pairs = json!({ "componentType": 5126, "count": count, "type": "VEC2" });
            let set = json!(push(floats(part.second_set.as_flattened()), pairs));
            (attributes["TEXCOORD_0"], attributes["TEXCOORD_1"]) = (set.clone(), set);
        }
        let indices = part.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        let scalars = json!({ "componentType": 5125, "count": part.indices.len(), "type": "SCALAR" });
        let indices = push(indices, scalars);
        meshes.push(json!({ "primitives": [{ "attributes": attributes, "indices": indices }] }));
    }
    let document = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes, "meshes": meshes, "accessors": accessors, "bufferViews": views,
        "buffers": [{ "byteLength": bytes.len() }],
    });
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + json.len() as u32 + bytes.len() as u32).to_le_bytes());
    file.extend((json.len() as u32).to_le_bytes());
    file.extend(b"JSON");
    file.extend(json);
    file.extend((bytes.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(bytes);
    import_slice(&file, &ImportOptions { sky: DVec3::ONE, ..ImportOptions::default() }).unwrap()
}

fn planned(parts: &[Part], resolution: Resolution) -> Plan {
    plan(&scene(parts), resolution, &|| false).unwrap()
}

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

#[test]
fn filtering_reads_four_texels_whose_weights_sum_to_one() {
    for place in [glam::DVec2::new(0.0, 0.0), glam::DVec2::new(3.7, 1.2), glam::DVec2::new(4.0, 4.0)] {
        let read = bilinear(place, [4, 4]);
        assert!((read.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-12);
        assert!(read.iter().all(|(texel, _)| *texel < 16));
    }
}
