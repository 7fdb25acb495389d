//! Names of the parts of a document, as messages have them.

use gltf::{Material, Node};

/// `node "name"`, or `node 3` for one without a name.
#[must_use]
pub fn node_label(node: &Node) -> String {
    match node.name() {
        Some(name) if !name.is_empty() => format!("node \"{name}\""),
        _ => format!("node {}", node.index()),
    }
}

/// `material "name"`, or `material 3` for one without a name.
#[must_use]
pub fn material_label(material: &Material) -> String {
    match (material.name(), material.index()) {
        (Some(name), _) if !name.is_empty() => format!("material \"{name}\""),
        (_, Some(index)) => format!("material {index}"),
        (_, None) => "the default material".to_owned(),
    }
}
