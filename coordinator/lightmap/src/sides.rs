//! The lit sides of the input's primitives: their triangles as the file has them, and the facets that they became.

use document::placement::world_matrices;
use foldhash::{HashMap, HashMapExt};
use glam::DVec3;
use gltf::Semantic;
use kernel::geometry::{PlaneId, area_vector};
use scene::{Facet, Scene, Side, triangle_list};

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
    /// With its area.
    of: HashMap<[u32; 3], (&'a Facet, f64)>,
}

impl<'a> FacetOf<'a> {
    /// Takes over positions of vertices that the import moved.
    fn new(facets: &'a [Facet], positions: &mut [DVec3]) -> Self {
        let mut of = HashMap::new();
        for facet in facets {
            let area = facet.polygon().area();
            for triangle in &facet.triangles {
                of.insert(sorted(triangle.vertices), (facet, area));
                for (vertex, position) in triangle.vertices.iter().zip(triangle.positions) {
                    if let Some(own) = positions.get_mut(*vertex as usize) {
                        *own = position;
                    }
                }
            }
        }
        Self { of }
    }

    fn triangle(&self, vertices: [u32; 3], positions: &[DVec3]) -> SideTriangle {
        let corners = vertices.map(|vertex| positions[vertex as usize]);
        let Some(&(facet, facet_area)) = self.of.get(&sorted(vertices)) else {
            // Without area, or the same as another: lit as it lies.
            let area = area_vector(&corners);
            let normal = area.normalize_or_zero();
            return SideTriangle {
                vertices,
                plane: PlaneId::NONE,
                facet_area: area.length(),
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
            facet_area,
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
