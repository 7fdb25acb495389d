//! What the accessors of a document are for.

use std::collections::BTreeMap;

use gltf::Semantic;
use gltf::accessor::{DataType, Dimensions};
use gltf::json::mesh::Mode;
use gltf::json::validation::Checked::Valid;
use gltf::json::{Accessor, Index, Root};

use super::super::attributes::{IRRADIANCE, OCCLUSION, TINT, UNSHOT};

/// What an accessor is for, as far as its encoding depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Position,
    Direction,
    Coordinates,
    Colour,
    Light,
    /// Numbers that may mean anything.
    Exact,
    /// Indices of triangles.
    Triangles,
    /// Something else, or several things.
    Other,
}

impl Role {
    fn of(semantic: &Semantic) -> Self {
        match semantic {
            Semantic::Positions => Self::Position,
            Semantic::Normals | Semantic::Tangents => Self::Direction,
            Semantic::TexCoords(_) => Self::Coordinates,
            Semantic::Colors(_) => Self::Colour,
            Semantic::Extras(name)
                if [TINT, UNSHOT, OCCLUSION].contains(&name.as_str()) || name.starts_with(IRRADIANCE) =>
            {
                Self::Light
            }
            _ => Self::Exact,
        }
    }
}

/// What each accessor that primitives name is for.
pub(super) fn roles(root: &Root) -> BTreeMap<usize, Role> {
    let mut roles: BTreeMap<usize, Role> = BTreeMap::new();
    let mut note = |accessor: Index<Accessor>, role: Role| {
        let known = roles.entry(accessor.value()).or_insert(role);
        if *known != role {
            *known = Role::Other;
        }
    };
    for primitive in root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        for (name, accessor) in &primitive.attributes {
            note(*accessor, if let Valid(semantic) = name { Role::of(semantic) } else { Role::Other });
        }
        let is_list = primitive.mode == Valid(Mode::Triangles);
        let role = if is_list { Role::Triangles } else { Role::Other };
        primitive.indices.iter().for_each(|indices| note(*indices, role));
        for target in primitive.targets.iter().flatten() {
            let deltas = [target.positions, target.normals, target.tangents];
            deltas.into_iter().flatten().for_each(|accessor| note(accessor, Role::Other));
        }
    }
    for sampler in root.animations.iter().flat_map(|animation| &animation.samplers) {
        [sampler.input, sampler.output].into_iter().for_each(|accessor| note(accessor, Role::Other));
    }
    let skins = root.skins.iter().filter_map(|skin| skin.inverse_bind_matrices);
    skins.for_each(|accessor| note(accessor, Role::Other));
    roles
}

/// Whether an accessor can be encoded for what it is used for.
pub(super) fn can_be(accessor: &gltf::Accessor, role: Role) -> bool {
    let is_plain = accessor.sparse().is_none() && accessor.view().is_some() && accessor.count() > 0;
    let is_float = accessor.data_type() == DataType::F32;
    let width = accessor.dimensions().multiplicity();
    let is_vector = width <= 4 && accessor.dimensions() != Dimensions::Mat2;
    is_plain
        && is_vector
        && match role {
            Role::Triangles => accessor.count().is_multiple_of(3),
            Role::Direction | Role::Colour => is_float && width >= 3,
            _ => is_float,
        }
}
