//! Scenes: what a bake needs to know of a glTF file.
//!
//! In: the bytes of a file. Out: a [`Scene`] of flat convex facets in f64, with reflectance and exitance, lights and an import
//! report. It must not know meshes of the bake, workers or outputs. Begin reading at [`model`], then [`import()`].
//!
//! | module | what lives there |
//! |---|---|
//! | [`model`], [`facet`], [`light`] | the scene, its surfaces, facets and lights |
//! | [`import`](mod@import) | glTF in, scene out |
//! | [`appearance`] | materials that vary over a surface, and their means over polygons |
//! | [`means`] | means of images over polygons |
//! | [`account`] | the import report |

pub mod account;
pub mod appearance;
pub mod facet;
pub mod import;
pub mod light;
pub mod means;
pub mod model;

pub use account::Account;
pub use document::{ImportError, ImportProblem, LightUnit, ReadOptions};
pub use facet::{Corner, Facet, SourceTriangle};
pub use import::{ImportOptions, LitDocument, LitPrimitive, import, import_lit, import_slice};
pub use light::{AreaLight, AreaShape, Light, LightEntry, LightKind};
pub use model::{Frame, Scene, Side, SourceDocument, Surface};
