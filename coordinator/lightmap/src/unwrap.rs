//! Charts made and packed, by `uvunwrap`, where the input has none that can be used.

use std::sync::Arc;

use glam::DVec3;
use scene::Scene;
use serde::Serialize;
use uvunwrap::{Density, InstanceRect, MeshInput, Options, Packing, generate_with_progress};

use crate::error::{LightmapError, MOST_TEXELS, Stop};
use crate::instances::{Instances, instances};
use crate::layout::{SharedLayout, SideLayout};
use crate::meetings::Meetings;
use crate::sides::{LitSide, SideTriangle};

/// Longest side of a page, in texels: what graphics cards of phones take.
pub const LARGEST_PAGE: u32 = 4096;

/// Empty texels around each chart: twice as many lie between two of them.
pub const PADDING: u32 = 2;

/// Part of a page that charts fill, at least: with less, one page that grows to fit may become too large.
const LEAST_FILL: f64 = 0.4;

/// Part of a page's area that a layout of several sides may take.
const LARGEST_SHARED: f64 = 0.25;

/// Largest angle between a facet and the mean of its chart, in degrees: texels where a bevelled edge is finer than they are would mix the
/// light of its two sides.
const MOST_TURNED: f32 = 30.0;

/// From this number of triangles on, charts are packed fast rather than tightly.
const MANY_TRIANGLES: usize = 5_000;

/// How fine a lightmap is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Resolution {
    /// Edge of a texel, units of the file.
    Texel(f64),
    /// Width and largest height of its one page, in texels.
    Page(u32),
}

/// Sides laid out on pages.
pub struct Pages {
    /// Columns and rows of each page.
    pub size: [u32; 2],
    /// Number of pages.
    pub count: u32,
    /// Edge of a texel, units of the file.
    pub texel: f64,
    /// By side.
    pub layouts: Vec<SideLayout>,
    /// Connected parts of the surfaces.
    pub charts: u32,
}

/// Area of some sides, in square units of the file.
pub fn area<'a>(scene: &Scene, sides: impl IntoIterator<Item = &'a LitSide>) -> f64 {
    let of_side = |side: &LitSide| side.triangles.iter().map(|triangle| side.area(triangle)).sum::<f64>();
    sides.into_iter().map(of_side).sum::<f64>() * scene.frame.scale * scene.frame.scale
}

/// Refuses texels that are too small for the surfaces.
///
/// # Errors
/// When there would be more than [`MOST_TEXELS`].
pub fn check_size(area: f64, texel: f64) -> Result<(), LightmapError> {
    let texels = area / (texel * texel);
    if texels <= MOST_TEXELS as f64 {
        return Ok(());
    }
    Err(LightmapError::TooManyTexels { texel, texels, least: 1.05 * (area / MOST_TEXELS as f64).sqrt() })
}

/// Makes charts of all sides, which end at sharp edges, and packs them.
pub fn unwrap(
    scene: &Scene,
    sides: &[LitSide],
    meetings: &Meetings,
    resolution: Resolution,
    stop: Stop,
) -> Result<Pages, LightmapError> {
    let page_area = match resolution {
        // Texels are found to fit.
        Resolution::Page(_) => f64::INFINITY,
        Resolution::Texel(texel) => (texel / scene.frame.scale * f64::from(LARGEST_PAGE)).powi(2),
    };
    let groups = instances(scene, sides, LARGEST_SHARED * page_area);
    let to_file = |position: &DVec3| (*position * scene.frame.scale).as_vec3().to_array();
    let firsts = || groups.iter().map(|group| &sides[group.sides[0]]);
    let positions: Vec<Vec<[f32; 3]>> =
        firsts().map(|side| side.positions.iter().map(to_file).collect()).collect();
    let indices: Vec<Vec<u32>> =
        firsts().map(|side| side.triangles.iter().flat_map(|triangle| triangle.vertices).collect()).collect();
    let mut group_of = vec![0; sides.len()];
    for (index, group) in groups.iter().enumerate() {
        group.sides.iter().for_each(|side| group_of[*side] = index);
    }
    let mut seams: Vec<Vec<[bool; 3]>> =
        firsts().map(|side| vec![[false; 3]; side.triangles.len()]).collect();
    for edge in &meetings.sharp {
        seams[group_of[edge.side as usize]][edge.triangle as usize][usize::from(edge.corner)] = true;
    }
    let is_sealed = |group: &Instances, triangle: usize| {
        group.sides.iter().all(|side| sides[*side].triangles[triangle].is_sealed)
    };
    let sealed: Vec<Vec<bool>> = groups
        .iter()
        .map(|group| (0..sides[group.sides[0]].triangles.len()).map(|own| is_sealed(group, own)).collect())
        .collect();
    let meshes: Vec<MeshInput> = groups
        .iter()
        .zip(positions.iter().zip(&indices).zip(seams.iter().zip(&sealed)))
        .map(|(group, ((positions, indices), (seams, sealed)))| MeshInput {
            seams: Some(seams),
            ignored_faces: Some(sealed),
            instance_scales: if group.sides.len() > 1 { &group.scales } else { &[] },
            ..MeshInput::new(positions, indices)
        })
        .collect();
    let density = match resolution {
        Resolution::Page(page_size) => Density::Auto { page_size },
        Resolution::Texel(texel) => {
            let texels = area(scene, sides) / (texel * texel);
            let is_one = texels < LEAST_FILL * f64::from(LARGEST_PAGE) * f64::from(LARGEST_PAGE);
            let page_size = (!is_one).then_some(LARGEST_PAGE);
            Density::Fixed { texels_per_unit: (1.0 / texel) as f32, page_size }
        }
    };
    let triangles: usize = sides.iter().map(|side| side.triangles.len()).sum();
    let options = Options {
        density,
        padding: PADDING,
        packing: if triangles < MANY_TRIANGLES { Packing::Shape } else { Packing::Fast },
        max_chart_size: LARGEST_PAGE - 4 * PADDING,
        max_chart_angle: MOST_TURNED,
        ..Options::default()
    };
    let atlas = generate_with_progress(&meshes, &options, |_| !stop()).map_err(|error| match error {
        uvunwrap::Error::Cancelled => LightmapError::Cancelled,
        error => LightmapError::Layout(error.to_string()),
    })?;
    let mut layouts = vec![SideLayout::default(); sides.len()];
    for (number, (group, mesh)) in groups.iter().zip(&atlas.meshes).enumerate() {
        let first = layout(&sides[group.sides[0]], mesh)?;
        match mesh.instances.as_slice() {
            [] => layouts[group.sides[0]] = first,
            rectangles => place(&mut layouts, sides, (number, group), &first, rectangles),
        }
    }
    Ok(Pages {
        size: [atlas.width.max(1), atlas.height.max(1)],
        count: atlas.page_count.max(1),
        texel: f64::from(atlas.texels_per_unit).recip(),
        layouts,
        charts: atlas.chart_count,
    })
}

/// Gives each of the sides that share a layout its rectangle.
fn place(
    layouts: &mut [SideLayout],
    sides: &[LitSide],
    (number, group): (usize, &Instances),
    first: &SideLayout,
    rectangles: &[InstanceRect],
) {
    let coordinates: Arc<[[f32; 2]]> = first.coordinates.clone().into();
    for (&index, rectangle) in group.sides.iter().zip(rectangles) {
        let side = &sides[index];
        let offset = rectangle.min;
        let scale = [rectangle.max[0] - offset[0], rectangle.max[1] - offset[1]];
        let on_page = |place: &[f32; 2]| [offset[0] + scale[0] * place[0], offset[1] + scale[1] * place[1]];
        let page = |triangle| (side.area(triangle) > 0.0).then_some(rectangle.page);
        layouts[index] = SideLayout {
            surface: side.surface,
            coordinates: coordinates.iter().map(on_page).collect(),
            pages: side.triangles.iter().map(page).collect(),
            shared: Some(SharedLayout {
                group: number as u32,
                offset,
                scale,
                coordinates: coordinates.clone(),
            }),
            ..first.clone()
        };
    }
}

/// Puts the input's vertices first, and copies of those on borders of charts behind them.
fn layout(side: &LitSide, mesh: &uvunwrap::OutputMesh) -> Result<SideLayout, LightmapError> {
    let count = side.positions.len();
    let too_many = || LightmapError::TooManyVertices(side.name.clone());
    let mut sources: Vec<u32> = (0..u32::try_from(count).map_err(|_| too_many())?).collect();
    let mut coordinates = vec![[0.0; 2]; count];
    let mut is_placed = vec![false; count];
    let mut places = Vec::with_capacity(mesh.vertices.len());
    for vertex in &mesh.vertices {
        let source = vertex.xref as usize;
        if std::mem::replace(&mut is_placed[source], true) {
            // The last number restarts a primitive.
            let place = u32::try_from(sources.len()).ok().filter(|place| *place < u32::MAX);
            places.push(place.ok_or_else(too_many)?);
            sources.push(vertex.xref);
            coordinates.push(vertex.uv);
        } else {
            places.push(vertex.xref);
            coordinates[source] = vertex.uv;
        }
    }
    let (corners, _) = mesh.indices.as_chunks::<3>();
    let triangles: Vec<[u32; 3]> = corners.iter().map(|t| t.map(|index| places[index as usize])).collect();
    let page = |(corners, triangle): (&[u32; 3], &SideTriangle)| {
        let of_corners = corners.iter().find_map(|index| mesh.vertices[*index as usize].page);
        of_corners.filter(|_| !triangle.is_sealed)
    };
    Ok(SideLayout {
        surface: side.surface,
        sources,
        coordinates,
        triangles,
        pages: corners.iter().zip(&side.triangles).map(page).collect(),
        shared: None,
    })
}
