//! Nodes, meshes and primitives of the output.

use std::collections::{BTreeMap, BTreeSet};
use std::mem;
use std::path::Path;

use gltf::Semantic;
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Index, Material, Mesh, Root};
use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::attributes::{IRRADIANCE, Keeps};
use super::buffer;
use super::draft::{Assembled, Draft, posed, source_primitive};
use super::layers::Parts;
use super::materials::LitMaterials;
use super::refined::{Placement, RefinedPrimitive, Show, refine};
use super::{
    Domain, ExportError, ExportSettings, Materials, Unshared, attributes, extensions, layers, materials,
};
use bake::lit::LitMesh;
use document::Glass;
use document::placement::world_matrices;
use scene::{Scene, Side};

/// Lit sides, as indices into the scene's surfaces, by primitive.
type LitPrimitives = BTreeMap<usize, Vec<usize>>;

/// Puts the refined geometry into a copy of the input document.
pub(super) fn assemble(
    scene: &Scene,
    lit: &LitMesh,
    exposure: f64,
    settings: &ExportSettings,
    output: &Path,
) -> Result<Assembled, ExportError> {
    let lit_nodes = lit_nodes(scene, lit)?;
    let is_lit = |node| lit_nodes.contains_key(&node);
    let mut assembler = Assembler::new(Draft::new(scene, is_lit), lit, exposure, settings)?;
    assembler.refine_sides(&lit_nodes)?;
    // Of each mesh, the nodes that show it and the vertices that they get.
    let mut shown: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
    for (&node, primitives) in &lit_nodes {
        let before = assembler.draft.vertices;
        let mesh = assembler.light_node(node, primitives)?;
        let (nodes, vertices) = shown.entry(mesh.value()).or_default();
        *nodes += 1;
        *vertices += assembler.draft.vertices - before;
    }
    assembler.settle_materials()?;
    let several = shown.values().filter(|(nodes, _)| *nodes > 1);
    let unshared = several.fold(Unshared::default(), |sum, (nodes, vertices)| Unshared {
        meshes: sum.meshes + 1,
        nodes: sum.nodes + nodes,
        vertices: sum.vertices + vertices,
    });
    let assembled = assembler.draft.finish(is_lit, output)?;
    Ok(Assembled { unshared: (unshared.meshes > 0).then_some(unshared), ..assembled })
}

/// The lit sides of each node. A side without triangles, which glTF cannot express, does not count; a primitive of which other
/// primitives in its plane hide all sides has none.
fn lit_nodes(scene: &Scene, lit: &LitMesh) -> Result<BTreeMap<usize, LitPrimitives>, ExportError> {
    if scene.surfaces.len() != lit.surfaces.len() {
        return Err(ExportError::Mismatch(format!(
            "{} surfaces, {} of them lit",
            scene.surfaces.len(),
            lit.surfaces.len()
        )));
    }
    let mut nodes: BTreeMap<usize, LitPrimitives> = BTreeMap::new();
    for (index, (surface, triangles)) in scene.surfaces.iter().zip(&lit.surfaces).enumerate() {
        let is_hidden = surface.facets.is_empty();
        if !triangles.is_empty() || is_hidden {
            let sides = nodes.entry(surface.node).or_default().entry(surface.primitive).or_default();
            sides.extend((!is_hidden).then_some(index));
        }
    }
    Ok(nodes)
}

/// The geometry of a lit side, and whether it glows.
struct LitSide {
    refined: RefinedPrimitive,
    glows: bool,
    glass: Option<Glass>,
}

struct Assembler<'a> {
    draft: Draft<'a>,
    lit: &'a LitMesh,
    exposure: f64,
    domain: Domain,
    /// Whether materials and `COLOR_0` are the input's.
    keeps_materials: bool,
    /// Light groups and unshot radiosity of the lit mesh.
    parts: Parts<'a>,
    world: Vec<glam::DMat4>,
    materials: LitMaterials,
    /// Nodes with a back side that is lit, by primitive.
    two_sided: BTreeSet<(usize, usize)>,
    /// By surface, until they are stored.
    sides: BTreeMap<usize, LitSide>,
}

impl<'a> Assembler<'a> {
    fn new(
        draft: Draft<'a>,
        lit: &'a LitMesh,
        exposure: f64,
        settings: &ExportSettings,
    ) -> Result<Self, ExportError> {
        let backs = draft.scene.surfaces.iter().filter(|surface| surface.side == Side::Back);
        Ok(Self {
            lit,
            exposure,
            domain: settings.domain,
            keeps_materials: settings.materials == Materials::Keep,
            parts: layers::parts(lit)?,
            world: world_matrices(&draft.document),
            materials: LitMaterials::default(),
            two_sided: backs.map(|surface| (surface.node, surface.primitive)).collect(),
            sides: BTreeMap::new(),
            draft,
        })
    }

    /// Refines all lit sides, on all threads.
    fn refine_sides(&mut self, nodes: &BTreeMap<usize, LitPrimitives>) -> Result<(), ExportError> {
        let surfaces: Vec<usize> = nodes.values().flat_map(BTreeMap::values).flatten().copied().collect();
        let side = |surface: &usize| Ok((*surface, self.side(*surface)?));
        let sides: Vec<Result<_, ExportError>> = surfaces.par_iter().map(side).collect();
        // The first error in their order, whichever thread is first.
        self.sides = sides.into_iter().collect::<Result<_, _>>()?;
        Ok(())
    }

    fn side(&self, surface_index: usize) -> Result<LitSide, ExportError> {
        let scene = self.draft.scene;
        let surface = &scene.surfaces[surface_index];
        let mesh = scene.source.root.nodes.get(surface.node).and_then(|node| node.mesh);
        let mesh = mesh.ok_or_else(|| ExportError::Mismatch(format!("{} has no mesh", surface.name)))?;
        let source = source_primitive(&self.draft.document, mesh, surface)?;
        let placement = Placement::new(scene.frame, self.world[surface.node])
            .ok_or_else(|| ExportError::SingularNode(surface.name.clone()))?;
        let keeps = Keeps { colours: self.keeps_materials, normals: surface.keeps_normals };
        let attributes = attributes::read(&source, &scene.source.buffers, keeps)?;
        let triangles = &self.lit.surfaces[surface_index];
        let glows = materials::glows(self.lit, surface, triangles)?;
        let material = source.material().index().and_then(|index| scene.source.root.materials.get(index));
        // Colours of vertices would tint what passes from vertex to vertex.
        let has_colours = source.get(&Semantic::Colors(0)).is_some();
        let glass = material.and_then(Glass::of).filter(|_| !has_colours);
        let show = Show {
            exposure: self.exposure,
            diffuse: materials::diffuse_part(material, glows, glass),
            domain: self.domain,
        };
        let refined = refine(surface, triangles, self.lit, &self.parts, &placement, show, &attributes)?;
        Ok(LitSide { refined, glows, glass })
    }

    /// Gives the node a mesh of its own, with its light. Returns the input's.
    fn light_node(&mut self, node: usize, primitives: &LitPrimitives) -> Result<Index<Mesh>, ExportError> {
        let (source, mut mesh) = posed(&self.draft.scene.source.root, node)?;
        let mut further_sides = Vec::new();
        let mut hidden = BTreeSet::new();
        for (&index, surfaces) in primitives {
            let original =
                mesh.primitives.get(index).cloned().ok_or_else(|| {
                    ExportError::Mismatch(format!("mesh {source} has no primitive {index}"))
                })?;
            let mut sides = surfaces
                .iter()
                .map(|&surface| self.light_primitive(surface, &original))
                .collect::<Result<Vec<_>, _>>()?
                .into_iter();
            match sides.next() {
                Some(first) => mesh.primitives[index] = first,
                None => _ = hidden.insert(index),
            }
            further_sides.extend(sides);
        }
        let shown = mesh.primitives.into_iter().enumerate().filter(|(index, _)| !hidden.contains(index));
        mesh.primitives = shown.map(|(_, primitive)| primitive).chain(further_sides).collect();
        self.draft.put(node, source, mesh);
        Ok(source)
    }

    /// The primitive of one lit side.
    fn light_primitive(
        &mut self,
        surface_index: usize,
        original: &Primitive,
    ) -> Result<Primitive, ExportError> {
        let surface = &self.draft.scene.surfaces[surface_index];
        let LitSide { refined, glows, glass } = self
            .sides
            .remove(&surface_index)
            .ok_or_else(|| ExportError::Mismatch(format!("{} is shown twice", surface.name)))?;
        self.draft.vertices += refined.positions.len();
        self.draft.triangles += refined.indices.len() / 3;
        let one_side = self.two_sided.contains(&(surface.node, surface.primitive));
        let material = if self.keeps_materials && !one_side {
            original.material
        } else {
            let stays = glows || self.keeps_materials;
            Some(self.materials.lit(&mut self.draft.root, original.material, one_side, stays, glass)?)
        };
        Ok(self.store(refined, Primitive { material, ..original.clone() }))
    }

    /// Puts geometry in place of the primitive's own.
    fn store(&mut self, refined: RefinedPrimitive, primitive: Primitive) -> Primitive {
        let vertices = refined.positions.len();
        let colour_width = refined.colour_width();
        let own = [
            (Semantic::Positions, 3, refined.positions.into_flattened()),
            (Semantic::Normals, 3, refined.normals.into_flattened()),
            (Semantic::Colors(0), colour_width, refined.colours),
            (Semantic::Extras(IRRADIANCE.into()), 3, refined.irradiances.into_flattened()),
        ];
        let names = self.parts.iter().map(|(semantic, _)| semantic.clone());
        let parts = names.zip(refined.parts);
        // The input's colours are among the further attributes where they are kept.
        let shows = |semantic: &Semantic| !self.keeps_materials || *semantic != Semantic::Colors(0);
        let own: Vec<_> = own.into_iter().filter(|(semantic, ..)| shows(semantic)).collect();
        let attributes = own
            .into_iter()
            .chain(parts.map(|(semantic, values)| (semantic, 3, values.into_flattened())))
            .chain(refined.further)
            .map(|(semantic, width, values)| {
                let accessor = self.draft.new.push_attribute(&mut self.draft.root, &semantic, width, &values);
                (Valid(semantic), accessor)
            })
            .collect();
        let indices = Some(self.draft.new.push_indices(&mut self.draft.root, &refined.indices, vertices));
        Primitive { attributes, indices, mode: Valid(Mode::Triangles), targets: None, ..primitive }
    }

    /// Puts lit materials in the places of those that nothing else uses.
    fn settle_materials(&mut self) -> Result<(), ExportError> {
        let root = &mut self.draft.root;
        let inputs = self.draft.scene.source.root.materials.len();
        let mut used: Vec<&mut Index<Material>> = root
            .meshes
            .iter_mut()
            .flat_map(|mesh| &mut mesh.primitives)
            .filter_map(|p| p.material.as_mut())
            .collect();
        let mut taken: BTreeSet<usize> = used.iter().map(|index| index.value()).collect();
        let mut moved: BTreeMap<usize, usize> = BTreeMap::new();
        for (original, lit) in self.materials.lit_counterparts() {
            if taken.insert(original) {
                moved.insert(lit.value(), original);
                root.materials.swap(original, lit.value());
            }
        }
        for index in &mut used {
            if let Some(&original) = moved.get(&index.value()) {
                **index = Index::new(original as u32);
            }
        }
        let materials = mem::take(&mut root.materials);
        root.materials = buffer::retain(materials, used, |material| material < inputs)?;
        Ok(())
    }
}

/// Writes down who made the output and how, and which extensions it uses.
pub(super) fn describe(
    root: &mut Root,
    lit: &LitMesh,
    exposure: f64,
    settings: &ExportSettings,
) -> Result<(), ExportError> {
    let mut halflight = match &settings.extras {
        Value::Object(members) => members.clone(),
        Value::Null => Map::new(),
        other => Map::from_iter([("settings".to_owned(), other.clone())]),
    };
    halflight.insert("exposure".into(), json!(exposure));
    halflight.insert("unit".into(), json!(settings.unit));
    if !lit.layers.is_empty() {
        halflight.insert("groups".into(), layers::describe(lit)?);
    }
    extensions::note(&mut root.asset.extras, halflight)?;
    root.asset.generator = Some(concat!("Halflight ", env!("CARGO_PKG_VERSION")).into());

    extensions::declare(root)
}
