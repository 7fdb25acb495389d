//! Nodes, meshes and primitives of the output.

use std::collections::{BTreeMap, BTreeSet};
use std::mem;

use gltf::Semantic;
use gltf::json::animation::Property;
use gltf::json::extras::RawValue;
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::validation::Checked::Valid;
use gltf::json::{Index, Mesh, Root};
use serde_json::{Map, Value, json};

use super::buffer::{self, NewData};
use super::materials::{LitMaterials, complete_texture_transforms};
use super::refined::{Placement, RefinedPrimitive, refine};
use super::{ExportError, ExportSettings, attributes};
use crate::lit::LitMesh;
use crate::placement::world_matrices;
use crate::scene::{Scene, Side};

/// The output before it is written.
pub(super) struct Assembled {
    pub(super) root: Root,
    /// The bytes of its only buffer.
    pub(super) binary: Vec<u8>,
    /// Vertices of the lit primitives.
    pub(super) vertices: usize,
    /// Triangles of the lit primitives.
    pub(super) triangles: usize,
}

/// Lit sides, as indices into the scene's surfaces, by primitive.
type LitPrimitives = BTreeMap<usize, Vec<usize>>;

/// Puts the refined geometry into a copy of the input document.
pub(super) fn assemble(scene: &Scene, lit: &LitMesh, exposure: f64) -> Result<Assembled, ExportError> {
    let mut assembler = Assembler::new(scene, lit, exposure)?;
    let lit_nodes = lit_nodes(scene, lit)?;
    for (&node, primitives) in &lit_nodes {
        assembler.light_node(node, primitives)?;
    }
    assembler.drop_replaced(&lit_nodes)?;
    complete_texture_transforms(&mut assembler.root);
    let Assembler { mut root, new, vertices, triangles, .. } = assembler;
    let binary = buffer::gather(&mut root, &scene.source.buffers, new)?;
    Ok(Assembled { root, binary, vertices, triangles })
}

/// The lit sides of each node. A side without triangles, which glTF cannot express, does not count.
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
        if !triangles.is_empty() {
            nodes.entry(surface.node).or_default().entry(surface.primitive).or_default().push(index);
        }
    }
    Ok(nodes)
}

struct Assembler<'a> {
    scene: &'a Scene,
    lit: &'a LitMesh,
    exposure: f64,
    /// The input, to read from while the output changes.
    document: gltf::Document,
    world: Vec<glam::DMat4>,
    root: Root,
    new: NewData,
    materials: LitMaterials,
    replaced_meshes: BTreeSet<usize>,
    vertices: usize,
    triangles: usize,
}

impl<'a> Assembler<'a> {
    fn new(scene: &'a Scene, lit: &'a LitMesh, exposure: f64) -> Result<Self, ExportError> {
        let root = scene.source.root.clone();
        let document = gltf::Document::from_json_without_validation(root.clone());
        Ok(Self {
            scene,
            lit,
            exposure,
            world: world_matrices(&document),
            document,
            new: NewData::new(scene.source.buffers.len()),
            root,
            materials: LitMaterials::default(),
            replaced_meshes: BTreeSet::new(),
            vertices: 0,
            triangles: 0,
        })
    }

    /// Gives the node a mesh of its own, with its light.
    fn light_node(&mut self, node: usize, primitives: &LitPrimitives) -> Result<(), ExportError> {
        let missing = || ExportError::Mismatch(format!("node {node} has no mesh"));
        let source = self.root.nodes.get(node).and_then(|node| node.mesh).ok_or_else(missing)?;
        let mut mesh: Mesh = self.root.get(source).ok_or_else(missing)?.clone();
        // Pose and expression are those that the light was computed with.
        mesh.weights = None;
        for primitive in &mut mesh.primitives {
            primitive.targets = None;
            primitive
                .attributes
                .retain(|name, _| !matches!(name, Valid(Semantic::Joints(_) | Semantic::Weights(_))));
        }
        let mut further_sides = Vec::new();
        for (&index, surfaces) in primitives {
            let original =
                mesh.primitives.get(index).cloned().ok_or_else(|| {
                    ExportError::Mismatch(format!("mesh {source} has no primitive {index}"))
                })?;
            let mut sides = surfaces
                .iter()
                .map(|&surface| self.light_primitive(surface, source, &original))
                .collect::<Result<Vec<_>, _>>()?
                .into_iter();
            if let Some(first) = sides.next() {
                mesh.primitives[index] = first;
            }
            further_sides.extend(sides);
        }
        mesh.primitives.extend(further_sides);
        let mesh = self.root.push(mesh);
        self.replaced_meshes.insert(source.value());
        let node = &mut self.root.nodes[node];
        node.mesh = Some(mesh);
        node.skin = None;
        node.weights = None;
        Ok(())
    }

    /// The primitive of one lit side.
    fn light_primitive(
        &mut self,
        surface_index: usize,
        mesh: Index<Mesh>,
        original: &Primitive,
    ) -> Result<Primitive, ExportError> {
        let surface = &self.scene.surfaces[surface_index];
        let source = self
            .document
            .meshes()
            .nth(mesh.value())
            .and_then(|mesh| mesh.primitives().nth(surface.primitive))
            .ok_or_else(|| ExportError::Mismatch(format!("{} has no primitive", surface.name)))?;
        let placement = Placement::new(self.scene.frame, self.world[surface.node])
            .ok_or_else(|| ExportError::SingularNode(surface.name.clone()))?;
        let attributes = attributes::read(&source, &self.scene.source.buffers)?;
        let triangles = &self.lit.surfaces[surface_index];
        let refined = refine(surface, triangles, self.lit, &placement, self.exposure, &attributes)?;
        self.vertices += refined.positions.len();
        self.triangles += triangles.len();
        let one_side = self.scene.surfaces.iter().any(|other| {
            other.side == Side::Back && (other.node, other.primitive) == (surface.node, surface.primitive)
        });
        let material = self.materials.lit(&mut self.root, original.material, one_side);
        Ok(self.store(refined, Primitive { material: Some(material), ..original.clone() }))
    }

    /// Puts geometry in place of the primitive's own.
    fn store(&mut self, refined: RefinedPrimitive, primitive: Primitive) -> Primitive {
        let own = [
            (Semantic::Positions, refined.positions),
            (Semantic::Normals, refined.normals),
            (Semantic::Colors(0), refined.colours),
            (Semantic::Extras("IRRADIANCE".into()), refined.irradiances),
        ];
        let vertices = own[0].1.len();
        let attributes = own
            .into_iter()
            .map(|(semantic, values)| (semantic, 3, values.into_flattened()))
            .chain(refined.further)
            .map(|(semantic, width, values)| {
                let accessor = self.new.push_attribute(&mut self.root, &semantic, width, &values);
                (Valid(semantic), accessor)
            })
            .collect();
        let indices = Some(self.new.push_indices(&mut self.root, &refined.indices, vertices));
        Primitive { attributes, indices, mode: Valid(Mode::Triangles), targets: None, ..primitive }
    }

    /// Removes meshes and materials that only lit nodes used, and what animated the shape of lit meshes.
    fn drop_replaced(&mut self, lit_nodes: &BTreeMap<usize, LitPrimitives>) -> Result<(), ExportError> {
        let root = &mut self.root;
        let meshes = mem::take(&mut root.meshes);
        let used = root.nodes.iter_mut().filter_map(|node| node.mesh.as_mut()).collect();
        root.meshes = buffer::retain(meshes, used, |mesh| !self.replaced_meshes.contains(&mesh))?;
        let materials = mem::take(&mut root.materials);
        let primitives = root.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives);
        let used = primitives.filter_map(|primitive| primitive.material.as_mut()).collect();
        root.materials = buffer::retain(materials, used, |material| !self.materials.replaces(material))?;
        for animation in &mut root.animations {
            animation.channels.retain(|channel| {
                channel.target.path != Valid(Property::MorphTargetWeights)
                    || !lit_nodes.contains_key(&channel.target.node.value())
            });
        }
        root.animations.retain(|animation| !animation.channels.is_empty());
        Ok(())
    }
}

/// Writes down who made the output and how, and which extensions it uses.
pub(super) fn describe(root: &mut Root, exposure: f64, settings: &ExportSettings) -> Result<(), ExportError> {
    let mut halflight = match &settings.extras {
        Value::Object(members) => members.clone(),
        Value::Null => Map::new(),
        other => Map::from_iter([("settings".to_owned(), other.clone())]),
    };
    halflight.insert("exposure".into(), json!(exposure));
    halflight.insert("unit".into(), json!(settings.unit));
    let mut extras =
        match root.asset.extras.as_deref().map(|raw| serde_json::from_str(raw.get())).transpose()? {
            Some(Value::Object(members)) => members,
            None | Some(Value::Null) => Map::new(),
            Some(other) => Map::from_iter([("source".to_owned(), other)]),
        };
    extras.insert("halflight".into(), halflight.into());
    root.asset.extras = Some(RawValue::from_string(serde_json::to_string(&extras)?)?);
    root.asset.generator = Some(concat!("Halflight ", env!("CARGO_PKG_VERSION")).into());

    let mut used = BTreeSet::new();
    extensions(&root.to_value()?, &mut used);
    root.extensions_required.retain(|name| used.contains(name));
    root.extensions_used = used.into_iter().collect();
    Ok(())
}

/// Collects the names of the extensions in a glTF object and everything in it but extras, where anything may stand.
fn extensions(value: &Value, names: &mut BTreeSet<String>) {
    match value {
        Value::Array(items) => items.iter().for_each(|item| extensions(item, names)),
        Value::Object(members) => {
            for (key, member) in members.iter().filter(|(key, _)| *key != "extras") {
                if let (true, Value::Object(used)) = (key == "extensions", member) {
                    names.extend(used.keys().cloned());
                }
                extensions(member, names);
            }
        }
        _ => {}
    }
}
