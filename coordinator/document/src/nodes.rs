//! The walk over the nodes: world matrices in f64.

use glam::{DAffine3, DMat3};
use gltf::{Document, Node};

use super::error::ImportProblem;
use crate::labels::node_label;
use crate::placement::local_matrix;

/// A node of the default scene with its world transform.
pub struct PlacedNode<'a> {
    /// The node.
    pub node: Node<'a>,
    /// Node to world.
    pub world: DAffine3,
    /// Whether its meshes and lights are there: neither it nor a node above it is hidden.
    pub is_visible: bool,
}

/// The extension that hides nodes and what is below them.
pub(crate) const NODE_VISIBILITY: &str = "KHR_node_visibility";

/// Whether a node hides itself and what is below it.
#[must_use]
pub fn is_hidden(node: &Node) -> bool {
    let visible = node.extension_value(NODE_VISIBILITY).and_then(|own| own.get("visible")?.as_bool());
    visible == Some(false)
}

/// All nodes of the default scene (else of the first; without scenes all nodes that have no parent and what is under
/// them), parents first, in the order of the file.
///
/// Validation passes cyclic graphs: a visited set finds them, and no recursion overflows on a long chain.
pub fn walk(document: &Document) -> Result<Vec<PlacedNode<'_>>, ImportProblem> {
    let mut visited = vec![false; document.nodes().len()];
    let mut stack: Vec<(Node, DAffine3, bool)> =
        roots(document)?.into_iter().map(|node| (node, DAffine3::IDENTITY, true)).collect();
    stack.reverse();
    let mut placed = Vec::new();
    while let Some((node, parent, is_visible)) = stack.pop() {
        if std::mem::replace(&mut visited[node.index()], true) {
            return Err(ImportProblem::CyclicNodes { node: node_label(&node) });
        }
        let world = parent * DAffine3::from_mat4(local_matrix(&node));
        if !world.is_finite() {
            return Err(ImportProblem::NodeTransform { node: node_label(&node) });
        }
        let is_visible = is_visible && !is_hidden(&node);
        let first = stack.len();
        stack.extend(node.children().map(|child| (child, world, is_visible)));
        stack[first..].reverse();
        placed.push(PlacedNode { node, world, is_visible });
    }
    Ok(placed)
}

fn roots(document: &Document) -> Result<Vec<Node<'_>>, ImportProblem> {
    if let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) {
        return Ok(scene.nodes().collect());
    }
    let mut is_child = vec![false; document.nodes().len()];
    for child in document.nodes().flat_map(|node| node.children()) {
        is_child[child.index()] = true;
    }
    let roots: Vec<Node> = document.nodes().filter(|node| !is_child[node.index()]).collect();
    match document.nodes().next() {
        Some(node) if roots.is_empty() => Err(ImportProblem::CyclicNodes { node: node_label(&node) }),
        _ => Ok(roots),
    }
}

/// How normals transform: inverse transpose, up to a positive factor.
///
/// The matrix of cofactors is the inverse transpose times the determinant and exists for singular matrices too; the sign
/// takes the mirroring out again, as the flipped winding does for the facets.
pub fn normal_matrix(matrix: DMat3) -> DMat3 {
    let cofactors = DMat3::from_cols(
        matrix.y_axis.cross(matrix.z_axis),
        matrix.z_axis.cross(matrix.x_axis),
        matrix.x_axis.cross(matrix.y_axis),
    );
    if matrix.determinant() < 0.0 { -cofactors } else { cofactors }
}
