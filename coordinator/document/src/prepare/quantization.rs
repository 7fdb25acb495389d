//! KHR_mesh_quantization: vertex attributes of 8 and 16 bits become floats. Their scale and offset are in the
//! transforms of nodes and textures already.

use std::collections::BTreeMap;

use gltf::Semantic;
use gltf::json::accessor::{ComponentType, GenericComponentType};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Index};

use super::storage::Storage;
use super::values;
use crate::error::ImportProblem;

/// Name of the extension.
pub(super) const NAME: &str = "KHR_mesh_quantization";

/// Turns every accessor that only this extension allows into floats.
pub(super) fn undo(storage: &mut Storage) -> Result<(), ImportProblem> {
    // Those of several primitives are converted once.
    let mut accessors: BTreeMap<u32, String> = BTreeMap::new();
    for primitive in storage.root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        let attributes = primitive.attributes.iter().filter_map(|(name, &index)| match name {
            Valid(semantic) if is_quantized(semantic, storage.root.get(index)?) => {
                Some((index, semantic.to_string()))
            }
            _ => None,
        });
        let targets = primitive.targets.iter().flatten().flat_map(|target| {
            [
                (Semantic::Positions, target.positions),
                (Semantic::Normals, target.normals),
                (Semantic::Tangents, target.tangents),
            ]
        });
        let displacements = targets.filter_map(|(semantic, index)| {
            let index = index?;
            is_quantized(&semantic, storage.root.get(index)?).then(|| (index, semantic.to_string()))
        });
        accessors.extend(attributes.chain(displacements).map(|(index, name)| (index.value() as u32, name)));
    }
    for (index, name) in accessors {
        let index: Index<Accessor> = Index::new(index);
        let values = values::read(storage, index, &|| format!("quantized {name}"))?;
        if values.width > 4 {
            continue;
        }
        let floats = storage.floats(&values.numbers, values.width)?;
        let accessor = &mut storage.root.accessors[index.value()];
        *accessor = Accessor { name: accessor.name.take(), extras: accessor.extras.take(), ..floats };
    }
    Ok(())
}

/// Whether the attribute has integers that glTF allows only with the extension.
fn is_quantized(semantic: &Semantic, accessor: &Accessor) -> bool {
    let Valid(GenericComponentType(component)) = accessor.component_type else { return false };
    let small =
        matches!(component, ComponentType::I8 | ComponentType::U8 | ComponentType::I16 | ComponentType::U16);
    let unsigned = matches!(component, ComponentType::U8 | ComponentType::U16);
    match semantic {
        Semantic::Positions | Semantic::Normals | Semantic::Tangents => small,
        Semantic::TexCoords(_) => small && !(unsigned && accessor.normalized),
        _ => false,
    }
}
