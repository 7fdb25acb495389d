//! Scenes: what a bake needs to know of a glTF file.
//!
//! In: a file, or its bytes. Out: a [`Scene`] of flat convex facets in f64, with reflectance and exitance, lights and an import
//! report. It must not know meshes of the bake, workers or outputs. Begin reading at [`Scene`], then [`import()`].
//!
//! | module | what lives there |
//! |---|---|
//! | `model`, `facet`, `light` | the scene, its surfaces, facets and lights |
//! | `import` | glTF in, scene out |
//! | `appearance` | materials that vary over a surface, and their means over polygons |
//! | `means` | means of images over polygons |
//! | `report` | the import report |
//! | `sky` | a sky's radiance by direction |

mod appearance;
mod facet;
mod frame;
mod import;
mod light;
mod means;
mod model;
mod report;
mod sky;

pub use appearance::Appearance;
pub use document::sky::{EXT_LIGHTS_IMAGE_BASED, PutSkyError, SkyError, SkyImage, put_sky_image};
pub use document::{ImportError, ImportProblem, LightUnit, ReadOptions};
pub use facet::{Corner, Facet, SourceTriangle};
pub use frame::Frame;
pub use import::{ImportOptions, LitDocument, LitPrimitive, import, import_lit, import_slice, triangle_list};
pub use light::{AreaLight, AreaShape, Light, LightEntry, LightKind, colour_and_rest};
pub use model::{Scene, Side, SourceDocument, Surface};
pub use report::ImportReport;
pub use sky::{SkyCell, SkyPattern};
