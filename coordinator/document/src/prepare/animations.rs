//! Animations are passed on as they are: a viewer must be able to play them.

use std::collections::BTreeSet;

use gltf::json::accessor::ComponentType;
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Index, Root};

use super::Limits;
use super::storage::Storage;
use super::values;
use crate::error::ImportProblem;

/// Checks that the floats of all animations lie within the file and are finite.
pub(super) fn check(
    root: &mut Root,
    buffers: &mut Vec<Vec<u8>>,
    limits: Limits,
) -> Result<(), ImportProblem> {
    let mut checked = BTreeSet::new();
    for animation in 0..root.animations.len() {
        for sampler in 0..root.animations[animation].samplers.len() {
            let at = &root.animations[animation].samplers[sampler];
            for (what, accessor) in [("times", at.input), ("values", at.output)] {
                if !checked.insert(accessor.value()) || !is_float(root, accessor) {
                    continue;
                }
                let name = root.animations[animation].name.as_ref();
                let name = name.map_or_else(|| animation.to_string(), |name| format!("\"{name}\""));
                let place = format!("animation {name}, sampler {sampler}, {what}");
                // Each is forgotten before the next one is read.
                let read =
                    values::read(&mut Storage::new(root, buffers, limits), accessor, &|| place.clone())?;
                if let Some(&value) = read.numbers.iter().find(|number| !number.is_finite()) {
                    return Err(ImportProblem::NonFiniteAnimation { place, value });
                }
            }
        }
    }
    Ok(())
}

/// Whether there may be other numbers than finite ones. What is no accessor is found by the validation of the whole.
fn is_float(root: &Root, accessor: Index<Accessor>) -> bool {
    let is_float =
        |of: &Accessor| matches!(&of.component_type, Valid(component) if component.0 == ComponentType::F32);
    root.get(accessor).is_some_and(is_float)
}
