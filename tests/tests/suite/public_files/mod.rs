//! Scenes in the shape of the Khronos sample assets' feature tests: each holds a bake to what its test is about. `docs/files.md` says
//! which of the real files were tried.
//!
//! | module | after |
//! |---|---|
//! | `accessors` | SimpleSparseAccessor, BoxInterleaved, the index types and primitive modes of the asset generator |
//! | `lights` | LightsPunctualLamp, EmissiveStrengthTest |
//! | `nodes` | NegativeScaleTest, OrientationTest |
//! | `materials` | TextureTransformTest, MultiUVTest, VertexColorTest, AlphaBlendModeTest, UnlitTest |

mod accessors;
mod lights;
mod materials;
mod nodes;
