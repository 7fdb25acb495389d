//! Triangles that rays and segments meet, behind a tree whose nodes have eight children.
//!
//! | module | what lives there |
//! |---|---|
//! | `tree` | building the tree from a binary one |
//! | `node` | eight boxes against a ray |
//! | `packet` | eight triangles against a ray |
//! | `sight` | a ray as packets see it |
//! | `segment` | is a segment blocked? |
//! | `ray` | triangles along a ray, nearest first |
//! | `lanes` | eight numbers that are computed with together |
//!
//! A first test in f32 decides wherever rounding cannot change the answer, and leaves the rest to a test in f64, which is the
//! caller's: the answer is that of the f64 test for every ray, on every processor.

mod lanes;
mod node;
mod packet;
mod ray;
mod segment;
mod sight;
mod tree;

pub use lanes::with_lanes;
pub use ray::Ray;
pub use segment::{PacketId, Segment, crosses};
pub use tree::{Fan, PADDING, Tree, binary_tree};
