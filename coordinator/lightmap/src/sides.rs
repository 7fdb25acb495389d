//! The lit sides of the input's primitives: their triangles as the file has them, and the facets that they became.

use document::placement::world_matrices;
use foldhash::{HashMap, HashMapExt};
use glam::DVec3;
use gltf::Semantic;
use kernel::geometry::{PlaneId, area_vector};
use scene::{Facet, Scene, Side, triangle_list};
use smallvec::SmallVec;

/// Cosine of the angle (one degree) up to which two normals count as one.
const SAME_NORMAL: f64 = 0.999_847_695;

/// Cosine of the angle (45 degrees) between normals up to which charts lie across an edge of small facets.
const BENT: f64 = 0.707;

/// Facets that reach no farther from an edge are small, in texels: most of them lie within the texels that filtering mixes anyway.
const SMALL: f64 = 4.0;

/// A lit side of a primitive of a node.
pub struct LitSide {
    /// Its surface in the scene.
    pub surface: usize,
    /// Whether it is the back of a primitive whose front is lit, too.
    pub is_back: bool,
    /// For messages.
    pub name: String,
    /// Frame positions of the primitive's vertices.
    pub positions: Vec<DVec3>,
    /// `TEXCOORD_1`.
    pub second_set: Option<Vec<[f32; 2]>>,
    /// Its triangles, in the order of the file.
    pub triangles: Vec<SideTriangle>,
}

/// A triangle of the file.
#[derive(Debug, Clone, Copy)]
pub struct SideTriangle {
    /// Vertices of the primitive, wound as in the file.
    pub vertices: [u32; 3],
    /// Plane of its facet.
    pub plane: PlaneId,
    /// Area of its facet, square frame units.
    pub facet_area: f64,
    /// Whether it is part of the dark inside of a closed body, and needs no texels.
    pub is_sealed: bool,
    /// Unit normals at its vertices on the lit side; zero where it has no area.
    pub normals: [DVec3; 3],
    /// Whether it stands for a curved surface.
    pub is_smooth: bool,
}

impl LitSide {
    /// Frame positions of a triangle.
    pub fn corners(&self, triangle: &SideTriangle) -> [DVec3; 3] {
        triangle.vertices.map(|vertex| self.positions[vertex as usize])
    }

    /// Whether any of its triangles does.
    pub fn needs_texels(&self) -> bool {
        self.triangles.iter().any(|triangle| self.area(triangle) > 0.0)
    }

    /// Area of a triangle that needs texels, square frame units; 0 of one in the dark inside of a closed body.
    pub fn area(&self, triangle: &SideTriangle) -> f64 {
        if triangle.is_sealed {
            return 0.0;
        }
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(c - a).length() / 2.0
    }
}

/// The lit sides of a scene, in the order of its surfaces.
pub fn lit_sides(scene: &Scene) -> Vec<LitSide> {
    let document = gltf::Document::from_json_without_validation(scene.source.root.clone());
    let world = world_matrices(&document);
    let nodes: Vec<gltf::Node> = document.nodes().collect();
    let data = |buffer: gltf::Buffer<'_>| scene.source.buffers.get(buffer.index()).map(Vec::as_slice);
    let mut sides = vec![];
    for (index, surface) in scene.surfaces.iter().enumerate() {
        let primitive = nodes
            .get(surface.node)
            .and_then(|node| node.mesh())
            .and_then(|mesh| mesh.primitives().nth(surface.primitive));
        let Some(primitive) = primitive else { continue };
        let reader = primitive.reader(data);
        let Some(local) = reader.read_positions() else { continue };
        let to_world = world[surface.node];
        let mut positions: Vec<DVec3> = local
            .map(|position| {
                let position = DVec3::from_array(position.map(f64::from));
                scene.frame.to_frame(to_world.transform_point3(position))
            })
            .collect();
        let indices: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..positions.len() as u32).collect(),
        };
        let has_second_set = primitive.get(&Semantic::TexCoords(1)).is_some();
        let second_set = has_second_set.then(|| reader.read_tex_coords(1)).flatten();
        let facets = FacetOf::new(&surface.facets, &mut positions);
        let side = |vertices: [u32; 3]| facets.triangle(vertices, &positions);
        sides.push(LitSide {
            surface: index,
            is_back: surface.side == Side::Back,
            name: surface.name.clone(),
            second_set: second_set.map(|set| set.into_f32().collect()),
            triangles: triangle_list(primitive.mode(), &indices).into_iter().map(side).collect(),
            positions,
        });
    }
    sides
}

/// The facet of each triangle.
struct FacetOf<'a> {
    facets: &'a [Facet],
    of: HashMap<[u32; 3], u32>,
}

impl<'a> FacetOf<'a> {
    /// Takes over positions of vertices that the import moved.
    fn new(facets: &'a [Facet], positions: &mut [DVec3]) -> Self {
        let mut of = HashMap::new();
        for (index, facet) in facets.iter().enumerate() {
            for triangle in &facet.triangles {
                of.insert(sorted(triangle.vertices), index as u32);
                for (vertex, position) in triangle.vertices.iter().zip(triangle.positions) {
                    if let Some(own) = positions.get_mut(*vertex as usize) {
                        *own = position;
                    }
                }
            }
        }
        Self { facets, of }
    }

    fn triangle(&self, vertices: [u32; 3], positions: &[DVec3]) -> SideTriangle {
        let corners = vertices.map(|vertex| positions[vertex as usize]);
        let facet = self.of.get(&sorted(vertices)).map(|facet| &self.facets[*facet as usize]);
        let Some(facet) = facet else {
            // Without area, or the same as another: lit as it lies.
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            return SideTriangle {
                vertices,
                plane: PlaneId::NONE,
                facet_area: (b - a).cross(c - a).length() / 2.0,
                is_sealed: false,
                normals: [normal; 3],
                is_smooth: true,
            };
        };
        let normals = corners.map(|position| {
            let corner = facet.corners.iter().find(|corner| corner.position == position);
            corner.map_or(facet.normal, |corner| corner.normal)
        });
        let is_smooth = normals.iter().any(|normal| *normal != facet.normal);
        SideTriangle {
            vertices,
            plane: facet.plane,
            facet_area: area_vector(&facet.polygon().corners).length(),
            is_sealed: facet.is_sealed,
            normals,
            is_smooth,
        }
    }
}

fn sorted(mut vertices: [u32; 3]) -> [u32; 3] {
    vertices.sort_unstable();
    vertices
}

/// An edge of a triangle of a side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EdgeOf {
    /// Index of the side.
    pub side: u32,
    /// Index of the triangle.
    pub triangle: u32,
    /// Its first corner in the triangle.
    pub corner: u8,
}

impl EdgeOf {
    /// The corners of the triangle that it joins.
    pub fn corners(self) -> [usize; 2] {
        [usize::from(self.corner), (usize::from(self.corner) + 1) % 3]
    }
}

/// How the triangles of some sides meet.
#[derive(Default)]
pub struct Meetings {
    /// Edges over which light goes on smoothly, as far as normals tell: each pair once.
    pub smooth: Vec<[EdgeOf; 2]>,
    /// Edges at which charts end: all others but those where small facets meet at a small angle.
    pub sharp: Vec<EdgeOf>,
}

/// Finds where triangles of some sides meet: at edges with the same end points.
pub fn meetings(sides: &[LitSide], texel: f64) -> Meetings {
    let bits = |position: DVec3| position.to_array().map(f64::to_bits);
    let mut places: HashMap<[[u64; 3]; 2], usize> = HashMap::new();
    let mut met: Vec<SmallVec<[EdgeOf; 2]>> = vec![];
    for (side_index, side) in sides.iter().enumerate() {
        let lit = side.triangles.iter().enumerate().filter(|(_, triangle)| !triangle.is_sealed);
        for (index, triangle) in lit {
            let corners = side.corners(triangle);
            for corner in 0..3u8 {
                let edge = EdgeOf { side: side_index as u32, triangle: index as u32, corner };
                let mut key = edge.corners().map(|corner| bits(corners[corner]));
                key.sort_unstable();
                let place = *places.entry(key).or_insert(met.len());
                if place == met.len() {
                    met.push(SmallVec::new());
                }
                met[place].push(edge);
            }
        }
    }
    let mut meetings = Meetings::default();
    for edges in met {
        for (index, &edge) in edges.iter().enumerate() {
            // Fronts and backs of a sheet share their edges, and do not face the same way.
            let alike = |other: &&EdgeOf| **other != edge && cosine(sides, edge, **other) >= SAME_NORMAL;
            let bent = |other: &EdgeOf| {
                *other != edge
                    && cosine(sides, edge, *other) >= BENT
                    && [edge, *other].iter().any(|edge| reach(sides, *edge) <= SMALL * texel)
            };
            let mut others = edges.iter().filter(alike);
            match (others.next(), others.next()) {
                (Some(other), None) => {
                    let is_first = edges[index..].contains(other);
                    meetings.smooth.extend(is_first.then_some([edge, *other]));
                }
                (None, _) if edges.iter().filter(|other| bent(other)).count() == 1 => {}
                _ => meetings.sharp.push(edge),
            }
        }
    }
    meetings
}

/// Least cosine between the normals of two triangles along an edge that they share.
fn cosine(sides: &[LitSide], one: EdgeOf, other: EdgeOf) -> f64 {
    let ends = |edge: EdgeOf| {
        let side = &sides[edge.side as usize];
        let triangle = &side.triangles[edge.triangle as usize];
        let corners = side.corners(triangle);
        edge.corners().map(|corner| (corners[corner], triangle.normals[corner]))
    };
    let others = ends(other);
    let cosine = |(position, normal): (DVec3, DVec3)| {
        let same = others.iter().find(|(other, _)| *other == position);
        same.map_or(-1.0, |(_, other)| normal.dot(*other))
    };
    ends(one).map(cosine).into_iter().fold(1.0, f64::min)
}

/// How far the facet of an edge's triangle reaches from it, in the mean.
fn reach(sides: &[LitSide], edge: EdgeOf) -> f64 {
    let side = &sides[edge.side as usize];
    let triangle = &side.triangles[edge.triangle as usize];
    let corners = side.corners(triangle);
    let [a, b] = edge.corners().map(|corner| corners[corner]);
    triangle.facet_area / a.distance(b)
}
