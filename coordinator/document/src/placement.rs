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
/// Nodes of no scene have one too. In a hierarchy that contains itself, which no valid document has, the walk to the root
/// ends after as many steps as there are nodes.
pub fn world_matrices(document: &gltf::Document) -> Vec<DMat4> {
    let nodes: Vec<_> = document.nodes().collect();
    let mut parents = vec![None; nodes.len()];
    for node in &nodes {
        for child in node.children() {
            parents[child.index()] = Some(node.index());
        }
    }
    (0..nodes.len())
        .map(|start| {
            std::iter::successors(Some(start), |&index| parents[index])
                .take(nodes.len())
                .fold(DMat4::IDENTITY, |below, index| local_matrix(&nodes[index]) * below)
        })
        .collect()
}
