//! A light source, and what of a scene it is.

use glam::DVec3;
use kernel::row::Shooter;

/// A light source. It has a row of its own, or glows.
#[derive(Clone)]
pub struct LightSource {
    /// The shooter of its row. None where it glows: its light is then gathered like reflected light.
    pub shooter: Option<Shooter>,
    /// What one unit of the row is worth: exitance of a polygon, intensity of a point or spot light per squared frame unit,
    /// irradiance across a directional light. Of what glows, a factor of its exitance.
    pub strength: DVec3,
    /// What of the scene it is.
    pub origin: Origin,
    /// True where its light comes from outside of the scene: of what it emits only what falls on the scene is counted.
    pub is_outside: bool,
}

/// What of a scene a light source is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A facet, or a part of one, of the surface with this index.
    Surface(usize),
    /// Small lamps that share a row.
    Lamps,
    /// The light with this index.
    Light(usize),
    /// A part of the sky.
    Sky,
}
