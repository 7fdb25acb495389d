//! Sides of one mesh at several nodes, which can have one layout.

use document::placement::world_matrices;
use foldhash::{HashMap, HashMapExt};
use glam::{DMat3, DMat4};
use scene::Scene;

use crate::sides::LitSide;

/// Largest part by which a node may stretch its mesh in one direction more than in another.
const STRETCH: f64 = 1e-4;

/// Most times that an instance may be as large as another: room around charts grows with it.
const LARGEST_SCALE: f64 = 2.0;

/// Sides that one layout serves.
#[derive(Debug, Clone, PartialEq)]
pub struct Instances {
    /// Their indices; the layout is that of the first.
    pub sides: Vec<usize>,
    /// How large each is, relative to the first.
    pub scales: Vec<f32>,
}

/// All sides by the geometry that they share: those of nodes that place, turn and evenly scale one mesh. Those that are larger than
/// `largest`, in square frame units, stay by themselves, since a layout must fit a page.
pub fn instances(scene: &Scene, sides: &[LitSide], largest: f64) -> Vec<Instances> {
    let document = gltf::Document::from_json_without_validation(scene.source.root.clone());
    let world = world_matrices(&document);
    let mut groups: Vec<Instances> = vec![];
    let mut of_mesh: HashMap<(usize, usize, bool), Vec<usize>> = HashMap::new();
    for (index, side) in sides.iter().enumerate() {
        let surface = &scene.surfaces[side.surface];
        let mesh = scene.source.root.nodes.get(surface.node).and_then(|node| node.mesh);
        let area = || side.triangles.iter().map(|triangle| side.area(triangle)).sum::<f64>();
        // Those without charts share nothing.
        let has_charts = side.needs_texels() && area() <= largest;
        let scale = world.get(surface.node).and_then(even_scale).filter(|_| has_charts);
        if let (Some(mesh), Some(scale)) = (mesh, scale) {
            let known = of_mesh.entry((mesh.value(), surface.primitive, side.is_back)).or_default();
            let scale_of = |group: &Instances| {
                let first = &scene.surfaces[sides[group.sides[0]].surface];
                even_scale(&world[first.node]).map(|first| scale / first)
            };
            let fitting = known.iter().find_map(|group| {
                let relative = scale_of(&groups[*group])?;
                (1.0 / LARGEST_SCALE..=LARGEST_SCALE).contains(&relative).then_some((*group, relative))
            });
            if let Some((group, relative)) = fitting {
                groups[group].sides.push(index);
                groups[group].scales.push(relative as f32);
                continue;
            }
            known.push(groups.len());
        }
        groups.push(Instances { sides: vec![index], scales: vec![1.0] });
    }
    groups
}

/// By how much a transform scales, if it does so evenly and does not mirror.
fn even_scale(transform: &DMat4) -> Option<f64> {
    let linear = DMat3::from_mat4(*transform);
    let scale = linear.determinant().cbrt();
    let excess = linear.transpose() * linear * (1.0 / (scale * scale)) - DMat3::IDENTITY;
    let is_even = excess.to_cols_array().iter().all(|value| value.abs() <= STRETCH);
    (scale > 0.0 && is_even).then_some(scale)
}
