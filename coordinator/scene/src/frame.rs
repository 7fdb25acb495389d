//! The coordinates of scenes.

use glam::DVec3;

/// Frame position = (world position - centre) / scale, world in the file's units (metres).
///
/// The scale is a power of two, so that no coordinate is rounded by it; the largest extent of the scene in the frame lies in
/// [1024, 2048), which keeps f32 rays clear of absolute thresholds in the BVH whatever the scene's size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Centre of the scene's bounding box.
    pub centre: DVec3,
    /// File units per frame unit.
    pub scale: f64,
}

impl Frame {
    /// World position to frame position.
    #[must_use]
    pub fn to_frame(&self, world: DVec3) -> DVec3 {
        (world - self.centre) / self.scale
    }

    /// Frame position to world position.
    #[must_use]
    pub fn to_world(&self, frame: DVec3) -> DVec3 {
        frame * self.scale + self.centre
    }
}
