//! Transforms of nodes, in f64.

use glam::{DMat4, DQuat, DVec3};
use gltf::scene::Transform;

/// The node's transform relative to its parent.
///
/// The quaternion is normalised in f64, so that its rounding to f32 does not scale the node, and the parts are composed in
/// f64: `gltf::scene::Transform::matrix` rounds every product to f32, which moves vertices far from the origin.
pub fn local_matrix(node: &gltf::Node<'_>) -> DMat4 {
    match node.transform() {
        Transform::Matrix { matrix } => {
            DMat4::from_cols_array_2d(&matrix.map(|column| column.map(f64::from)))
        }
        Transform::Decomposed { translation, rotation, scale } => DMat4::from_scale_rotation_translation(
            DVec3::from_array(scale.map(f64::from)),
            DQuat::from_array(rotation.map(f64::from)).normalize(),
            DVec3::from_array(translation.map(f64::from)),
        ),
    }
}

/// The transform of every node of the document to the world.
///
/// Nodes of no scene have one too. In a hierarchy that contains itself, which no valid document has, a node is placed as if it had
/// no parent where its ancestors lead back to it.
pub fn world_matrices(document: &gltf::Document) -> Vec<DMat4> {
    let nodes: Vec<_> = document.nodes().collect();
    let mut parents = vec![None; nodes.len()];
    for node in &nodes {
        for child in node.children() {
            parents[child.index()] = Some(node.index());
        }
    }
    // Each node once, after its parent: a chain of nodes costs no more than as many children of one.
    let mut placed: Vec<Option<DMat4>> = vec![None; nodes.len()];
    let mut is_waiting = vec![false; nodes.len()];
    let mut chain = Vec::new();
    for start in 0..nodes.len() {
        let mut above = Some(start);
        while let Some(index) = above.filter(|&index| placed[index].is_none() && !is_waiting[index]) {
            is_waiting[index] = true;
            chain.push(index);
            above = parents[index];
        }
        let mut world = above.and_then(|index| placed[index]).unwrap_or(DMat4::IDENTITY);
        while let Some(index) = chain.pop() {
            world *= local_matrix(&nodes[index]);
            placed[index] = Some(world);
        }
    }
    placed.into_iter().map(Option::unwrap_or_default).collect()
}

#[cfg(test)]
mod tests {
    use gltf::json::Root;
    use serde_json::json;

    use super::*;

    fn matrices(nodes: serde_json::Value) -> Vec<DMat4> {
        let root = json!({ "asset": { "version": "2.0" }, "nodes": nodes });
        let root: Root = serde_json::from_value(root).unwrap();
        world_matrices(&gltf::Document::from_json_without_validation(root))
    }

    #[test]
    fn each_node_is_placed_below_its_parent() {
        let nodes = json!([
            { "translation": [1, 0, 0] },
            { "children": [2, 0], "scale": [2, 2, 2] },
            { "translation": [0, 1, 0] },
        ]);
        let origins = matrices(nodes).into_iter().map(|matrix| matrix.transform_point3(DVec3::ZERO));
        assert!(origins.eq([DVec3::new(2.0, 0.0, 0.0), DVec3::ZERO, DVec3::new(0.0, 2.0, 0.0)]));
    }

    /// A walk from each node to the root would take five thousand million steps.
    #[test]
    fn a_chain_of_nodes_is_placed_in_one_walk() {
        let count = 100_000;
        for is_reversed in [false, true] {
            let node = |index: usize| {
                let child =
                    if is_reversed { index.checked_sub(1) } else { Some(index + 1).filter(|at| *at < count) };
                match child {
                    Some(child) => json!({ "translation": [0, 0, 1], "children": [child] }),
                    None => json!({ "translation": [0, 0, 1] }),
                }
            };
            let world = matrices((0..count).map(node).collect());
            let height = |index: usize| world[index].w_axis.z as usize;
            assert_eq!((height(0), height(count - 1)), if is_reversed { (count, 1) } else { (1, count) });
        }
    }

    #[test]
    fn cycles_end() {
        let world = matrices(json!([{ "children": [1] }, { "children": [0] }, { "children": [2] }]));
        assert!(world.iter().all(|matrix| *matrix == DMat4::IDENTITY));
    }
}
