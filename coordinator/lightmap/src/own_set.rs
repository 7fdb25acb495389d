//! The input's second set of texture coordinates, which a lightmap uses where it can.

use foldhash::{HashMap, HashMapExt};
use kernel::disjoint_sets::DisjointSets;
use scene::Scene;

use crate::layout::SideLayout;
use crate::raster::covered;
use crate::sides::LitSide;
use crate::unwrap::{LARGEST_PAGE, Pages, Resolution, area};

/// How far coordinates may lie outside of the page: roundings of coordinates of 16 bits.
const OUTSIDE: f32 = 1.0 / 32_768.0;

/// How much of a texel triangles may cover in all, in texels.
const WHOLE: f32 = 1.001;

/// A texel that no chart covers.
const NO_CHART: u32 = u32::MAX;

/// Lays sides out by their own second set; backs have a page of their own. `None` where the input has no such set, and in words
/// why it cannot be used.
pub fn own_set(scene: &Scene, sides: &[LitSide], resolution: Resolution) -> Option<Result<Pages, String>> {
    sides.iter().any(|side| side.second_set.is_some()).then(|| checked(scene, sides, resolution))
}

fn checked(scene: &Scene, sides: &[LitSide], resolution: Resolution) -> Result<Pages, String> {
    let mut layouts = vec![];
    for side in sides {
        let set = side.second_set.as_ref().ok_or_else(|| format!("{} has none", side.name))?;
        let is_inside = |value: &f32| (-OUTSIDE..=1.0 + OUTSIDE).contains(value);
        if let Some(vertex) = set.iter().position(|pair| !pair.iter().all(is_inside)) {
            return Err(format!("vertex {vertex} of {} lies outside of [0, 1]", side.name));
        }
        let page = u32::from(side.is_back);
        let pages = side.triangles.iter().map(|triangle| (side.area(triangle) > 0.0).then_some(page));
        layouts.push(SideLayout {
            surface: side.surface,
            sources: (0..side.positions.len() as u32).collect(),
            coordinates: set.clone(),
            triangles: side.triangles.iter().map(|triangle| triangle.vertices).collect(),
            pages: pages.collect(),
            shared: None,
        });
    }
    let fronts = || layouts.iter().zip(sides).filter(|(_, side)| !side.is_back);
    let in_page: f64 = fronts()
        .flat_map(|(layout, _)| (0..layout.triangles.len()).map(|index| layout.corners(index, [1, 1])))
        .map(|[a, b, c]| (b - a).perp_dot(c - a).abs() / 2.0)
        .sum();
    let of_fronts = area(scene, fronts().map(|(_, side)| side));
    if in_page.is_nan() || in_page <= 0.0 {
        return Err("its charts have no area".to_owned());
    }
    let edge = match resolution {
        Resolution::Page(edge) => edge,
        Resolution::Texel(texel) => {
            let edge = ((of_fronts / in_page).sqrt() / texel).ceil();
            if edge > f64::from(LARGEST_PAGE) {
                return Err(format!(
                    "its charts would need a page of {edge} pixels, and {LARGEST_PAGE} are the most"
                ));
            }
            (edge as u32).max(4)
        }
    };
    let size = [edge, edge];
    let charts =
        check_charts(&fronts().map(|(layout, side)| (layout, &*side.name)).collect::<Vec<_>>(), size)?;
    Ok(Pages {
        size,
        count: 1 + u32::from(sides.iter().any(|side| side.is_back && side.needs_texels())),
        texel: (of_fronts / in_page).sqrt() / f64::from(edge),
        layouts,
        charts,
    })
}

/// Checks that charts neither overlap nor come so close that filtering mixes them. Returns their number.
fn check_charts(layouts: &[(&SideLayout, &str)], size: [u32; 2]) -> Result<u32, String> {
    let [width, height] = size.map(|side| side as usize);
    let mut chart_of = vec![NO_CHART; width * height];
    let mut area = vec![0f32; width * height];
    let mut charts = 0;
    for (layout, name) in layouts {
        let of_triangles = charts_of(layout);
        let mut overlap = None;
        let mut is_close = false;
        for (triangle, chart) in of_triangles.iter().enumerate() {
            covered(layout.corners(triangle, size), size, |[x, y], part, _| {
                let at = y as usize * width + x as usize;
                area[at] += part as f32;
                if area[at] > WHOLE {
                    overlap = Some([x, y]);
                }
                let own = charts + chart;
                is_close |= chart_of[at] != NO_CHART && chart_of[at] != own;
                chart_of[at] = own;
            });
        }
        if let Some([x, y]) = overlap {
            return Err(format!("its charts overlap in pixel ({x}, {y}), in {name}"));
        }
        charts += of_triangles.iter().map(|chart| chart + 1).max().unwrap_or(0);
        if is_close {
            return Err(close(size, name));
        }
    }
    let name = layouts.first().map_or("", |(_, name)| name);
    for y in 0..height {
        for x in 0..width {
            let own = chart_of[y * width + x];
            let near = [(x + 1, y), (x, y + 1), (x + 1, y + 1), (x.wrapping_sub(1), y + 1)];
            let is_close = near.into_iter().filter(|(x, y)| *x < width && *y < height).any(|(x, y)| {
                let other = chart_of[y * width + x];
                own != NO_CHART && other != NO_CHART && own != other
            });
            if is_close {
                return Err(close(size, name));
            }
        }
    }
    Ok(charts)
}

fn close([width, height]: [u32; 2], name: &str) -> String {
    format!("its charts are less than a pixel apart on a page of {width} x {height}, near those of {name}")
}

/// The chart of each triangle of a side: triangles that have a place on the page in common.
fn charts_of(layout: &SideLayout) -> Vec<u32> {
    let mut joined = DisjointSets::new(layout.triangles.len());
    let mut first: HashMap<[u32; 2], usize> = HashMap::new();
    for (index, triangle) in layout.triangles.iter().enumerate() {
        for vertex in triangle {
            let place = layout.coordinates[*vertex as usize].map(f32::to_bits);
            joined.join(*first.entry(place).or_insert(index), index);
        }
    }
    let mut numbers: HashMap<usize, u32> = HashMap::new();
    (0..layout.triangles.len())
        .map(|index| {
            let next = numbers.len() as u32;
            *numbers.entry(joined.representative(index)).or_insert(next)
        })
        .collect()
}
