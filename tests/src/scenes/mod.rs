//! Scenes that this repository makes itself: `cargo run --release -p tests --example scenes` writes them into `tests/scenes`.
//!
//! | module | what it makes |
//! |---|---|
//! | `room` | a furnished room: textures, cushions, turned wood, lace, a plant; sun through a window, lamps |
//! | `house` | two storeys of thick walls, a studio of single sheets, in the sun; the sky is told with `--sky` |
//! | `cornell` | a Cornell box with textures, coloured vertices, holes, glass and a screen |
//! | `fine` | a room of as many textured triangles as one asks for, to measure time and memory with |
//! | `geometry` | sheets, boxes, cushions, what is turned, curtains, leaves |
//! | `pictures` | images, as PNG |
//! | `document` | the GLB around it |
//!
//! The same bytes come out on every machine: sines and powers are computed in software.

mod cornell;
mod document;
mod fine;
#[allow(missing_docs)]
mod geometry;
mod house;
mod pictures;
mod room;

pub use fine::fine_room;

/// A scene that is made.
pub struct MadeScene {
    /// Name of its file in `tests/scenes`, without the extension.
    pub name: &'static str,
    /// The GLB.
    pub glb: Vec<u8>,
}

/// All of them.
#[must_use]
pub fn all() -> Vec<MadeScene> {
    vec![
        MadeScene { name: "room", glb: room::room() },
        MadeScene { name: "house", glb: house::house() },
        MadeScene { name: "cornell-textured", glb: cornell::cornell_textured() },
    ]
}
