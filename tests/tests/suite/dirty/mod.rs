//! Meshes as they come, against the same surfaces written with care, and against what must hold whatever the mesh.
//!
//! | module | what |
//! |---|---|
//! | `rooms` | a room of duplicates, slivers, interpenetrating furniture and thin walls |
//! | `boxes` | closed boxes in a bright room, dark inside, at every scale |

mod boxes;
mod rooms;
