//! The vertices and triangles of each side with their texture coordinates.

use std::sync::Arc;

use glam::{DVec2, Vec2};

/// A lit side of a primitive, laid out on the pages of a lightmap.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SideLayout {
    /// Its surface in the scene.
    pub surface: usize,
    /// The input's vertex that each vertex is. Those of the input come first, in their order; copies of those on borders of charts
    /// follow.
    pub sources: Vec<u32>,
    /// Coordinates of each vertex on its page, in [0, 1] from the image's top left corner.
    pub coordinates: Vec<[f32; 2]>,
    /// The triangles of the input, in their order.
    pub triangles: Vec<[u32; 3]>,
    /// The page of each triangle; `None` where it has no area.
    pub pages: Vec<Option<u32>>,
    /// Where the coordinates are those of several sides, each in a rectangle of its own: these lie on one page each.
    pub shared: Option<SharedLayout>,
}

/// Coordinates that several sides have in common: those on the page are offset + scale x shared.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedLayout {
    /// Number of the sides that share them.
    pub group: u32,
    /// Corner of the rectangle with the smallest coordinates.
    pub offset: [f32; 2],
    /// Width and height of the rectangle.
    pub scale: [f32; 2],
    /// The coordinates, in [0, 1].
    pub coordinates: Arc<[[f32; 2]]>,
}

impl SideLayout {
    /// Corners of a triangle in texels of a page of this size.
    #[must_use]
    pub fn corners(&self, triangle: usize, size: [u32; 2]) -> [DVec2; 3] {
        let size = DVec2::new(f64::from(size[0]), f64::from(size[1]));
        self.triangles[triangle]
            .map(|vertex| Vec2::from_array(self.coordinates[vertex as usize]).as_dvec2() * size)
    }

    /// Indices of the triangles on each page, with those without area on the first.
    #[must_use]
    pub fn by_page(&self) -> Vec<(u32, Vec<u32>)> {
        let mut all: Vec<u32> = self.pages.iter().flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        let first = all.first().copied().unwrap_or(0);
        if all.is_empty() {
            all.push(first);
        }
        let on = |page: u32| {
            let own = self.triangles.iter().zip(&self.pages);
            own.filter(|(_, own)| own.unwrap_or(first) == page).flat_map(|(triangle, _)| *triangle).collect()
        };
        all.into_iter().map(|page| (page, on(page))).collect()
    }
}

/// Barycentric coordinates of a point in a triangle of the plane; `None` where it has no area.
pub fn barycentric([a, b, c]: [DVec2; 3], point: DVec2) -> Option<[f64; 3]> {
    let whole = (b - a).perp_dot(c - a);
    let parts = [(b - point).perp_dot(c - point), (c - point).perp_dot(a - point)];
    let [first, second] = parts.map(|part| part / whole);
    (first.is_finite() && second.is_finite()).then_some([first, second, 1.0 - first - second])
}
