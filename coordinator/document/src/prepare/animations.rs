//! Animations are passed on as they are: a viewer must be able to play them.

use std::collections::BTreeSet;
use std::mem;

use gltf::json::accessor::ComponentType;
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Animation, Index, Root};

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
    // Beside the document while that is read: names are wanted in messages only, and may be long.
    let animations = mem::take(&mut root.animations);
    let result = check_all(&animations, root, buffers, limits);
    root.animations = animations;
    result
}

fn check_all(
    animations: &[Animation],
    root: &mut Root,
    buffers: &mut Vec<Vec<u8>>,
    limits: Limits,
) -> Result<(), ImportProblem> {
    let mut checked = BTreeSet::new();
    let numbers = animations.iter().enumerate().flat_map(|(index, animation)| numbers(index, animation));
    for Numbers { index, sampler, what, accessor } in numbers {
        if !checked.insert(accessor.value()) || !is_float(root, accessor) {
            continue;
        }
        let place = || {
            let name = animations[index].name.as_ref();
            let name = name.map_or_else(|| index.to_string(), |name| format!("\"{name}\""));
            format!("animation {name}, sampler {sampler}, {what}")
        };
        // Each is forgotten before the next one is read.
        let read = values::read(&mut Storage::new(root, buffers, limits), accessor, &place)?;
        if let Some(&value) = read.numbers.iter().find(|number| !number.is_finite()) {
            return Err(ImportProblem::NonFiniteAnimation { place: place(), value });
        }
    }
    Ok(())
}

/// An accessor of a sampler of an animation, by their numbers.
struct Numbers {
    index: usize,
    sampler: usize,
    what: &'static str,
    accessor: Index<Accessor>,
}

fn numbers(index: usize, animation: &Animation) -> impl Iterator<Item = Numbers> {
    animation.samplers.iter().enumerate().flat_map(move |(sampler, of)| {
        [("times", of.input), ("values", of.output)].map(|(what, accessor)| Numbers {
            index,
            sampler,
            what,
            accessor,
        })
    })
}

/// Whether there may be other numbers than finite ones. What is no accessor is found by the validation of the whole.
fn is_float(root: &Root, accessor: Index<Accessor>) -> bool {
    let is_float =
        |of: &Accessor| matches!(&of.component_type, Valid(component) if component.0 == ComponentType::F32);
    root.get(accessor).is_some_and(is_float)
}
