//! Scenes that ask for trouble, each made from a seed, and what must hold of every bake of theirs.
//!
//! | file | what lives there |
//! |---|---|
//! | `shapes` | layers, slivers, shells, fans, needles, sizes far apart, triangles anywhere |
//! | `nodes` | chains of nodes and instances |
//! | `damage` | bad numbers in a document and its buffer |
//! | `bake` | such a scene baked by a process, with its memory and time |
//! | `promises` | what must hold of the outcome |

mod bake;
mod damage;
mod nodes;
mod promises;
mod shapes;

use glam::DVec3;

pub use self::bake::{Bake, End, bake};
pub use self::promises::{broken, most_bytes, most_seconds};
use crate::builder::{Material, SceneBuilder, pack};
use crate::numbers::Numbers;
use crate::shapes::{box_facing_in, box_facing_out};

/// Kinds of scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Up to a hundred sheets on one another, touching or next to it.
    Layers,
    /// Triangles of any form in a few planes.
    Coplanar,
    /// Triangles of next to no height.
    Slivers,
    /// Boxes and balls in one another.
    Shells,
    /// Triangles around one point, or at one edge.
    Fans,
    /// Long thin triangles through everything.
    Needles,
    /// Things a million times as large as others.
    Sizes,
    /// Triangles anywhere, through one another.
    Soup,
    /// Many triangles too small to see.
    Crumbs,
    /// Nodes within nodes.
    Chains,
    /// One mesh many times, mirrored and squeezed.
    Instances,
    /// Numbers that are none, or beyond all measure, in one of the others.
    Numbers,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 12] = [
        Self::Layers,
        Self::Coplanar,
        Self::Slivers,
        Self::Shells,
        Self::Fans,
        Self::Needles,
        Self::Sizes,
        Self::Soup,
        Self::Crumbs,
        Self::Chains,
        Self::Instances,
        Self::Numbers,
    ];

    /// Its name, in lower case.
    #[must_use]
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// A scene that asks for trouble.
pub struct Nasty {
    /// The scene, as the bytes of a GLB.
    pub glb: Vec<u8>,
    /// Its triangles, those of an instance once for each.
    pub triangles: usize,
    /// Options of `solve`.
    pub options: Vec<String>,
    /// Most vertices of the mesh that the options allow.
    pub max_vertices: usize,
    /// Whether the options ask for more than a default bake does: it may take longer.
    pub asks_much: bool,
    /// Whether a refusal is an answer, too.
    pub is_damaged: bool,
}

/// The scene of a family and a seed, of about so many triangles at most.
#[must_use]
pub fn nasty(family: Family, seed: u64, triangles: usize) -> Nasty {
    let mut numbers = Numbers::new(seed.wrapping_mul(0x1_0001).wrapping_add(family as u64));
    let numbers = &mut numbers;
    let glb_of = |family: Family, numbers: &mut Numbers| match family {
        Family::Chains => nodes::chain(numbers, triangles),
        Family::Instances => nodes::instances(numbers, triangles),
        _ => {
            let builder = shapes::scene(family, numbers, triangles);
            let (document, binary) = builder.document();
            (document, binary, builder.triangles())
        }
    };
    let (glb, triangles) = if family == Family::Numbers {
        let other = Family::ALL[numbers.below(Family::ALL.len() - 1)];
        let (document, binary, triangles) = glb_of(other, numbers);
        (damage::damaged(document, binary, numbers), triangles)
    } else {
        let (document, binary, triangles) = glb_of(family, numbers);
        (pack(&document, &binary), triangles)
    };
    let error = numbers.of(&["0.03", "0.05", "0.1"]);
    let rows = numbers.of(&["automatic", "exact", "gather"]);
    // A mesh has the vertices of its scene in any case: three a triangle and side.
    let max_vertices = 6 * triangles + numbers.of(&[2000, 20_000]);
    let options = ["--error", error, "--rows", rows, "--max-vertices", &max_vertices.to_string()];
    Nasty {
        glb,
        triangles,
        options: options.map(str::to_owned).to_vec(),
        max_vertices,
        asks_much: rows == "exact" || error == "0.03",
        is_damaged: family == Family::Numbers,
    }
}

/// Far corner of the room that everything is in; the near one is the origin.
const ROOM: DVec3 = DVec3::splat(3.0);

/// A room with a lamp under its ceiling.
fn room(numbers: &mut Numbers) -> SceneBuilder {
    let lamp = box_facing_out(DVec3::new(1.3, 1.3, 2.6), DVec3::new(1.7, 1.7, 2.8));
    SceneBuilder::new()
        .part("room", &box_facing_in(DVec3::ZERO, ROOM), Material::grey(numbers.between(0.1, 0.9)))
        .part("lamp", &lamp, Material::grey(0.2).emitting(16.0))
}

/// What things in the room are made of.
fn material(numbers: &mut Numbers) -> Material {
    let double_sided = numbers.chance(0.4);
    Material { double_sided, ..Material::grey(numbers.between(0.0, 0.95)) }
}
