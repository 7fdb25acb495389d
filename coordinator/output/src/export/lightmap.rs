//! The input document with a lightmap: its own meshes and materials, with texture coordinates and images of the light.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use gltf::Semantic;
use gltf::json::image::MimeType;
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::texture::{MagFilter, MinFilter, Sampler, Texture, WrappingMode};
use gltf::json::validation::Checked::{self, Valid};
use gltf::json::{Accessor, Image, Index, Material, Mesh, Root};
use serde_json::{Value, json};

use super::ExportError;
use super::attributes::components;
use super::draft::{Assembled, Draft, posed, source_primitive};
use super::ktx2::ktx2;
use super::pages::{PageFormat, exr, largest, png};
use document::MOZ_LIGHTMAP;
use lightmap::{Lightmap, SharedLayout, SideLayout};
use scene::{Scene, Side};

/// The extension by which an instance has its part of a page.
const TEXTURE_TRANSFORM: &str = "KHR_texture_transform";

/// The set of texture coordinates that a lightmap has, unless the input's materials use it.
const FIRST_SET: u32 = 1;

/// A lightmap with the names of its layers, and how its pages are written.
pub struct LightmapPages<'a> {
    /// The pages.
    pub map: &'a Lightmap,
    /// Names of the light groups, in the order of the layers behind the first.
    pub groups: Vec<String>,
    /// How they are written.
    pub format: PageFormat,
}

/// Files beside the output: of each page, where the format has any.
pub(super) fn files(path: &Path, pages: u32, format: PageFormat) -> Vec<PathBuf> {
    let Some(ending) = format.beside() else { return vec![] };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    (0..pages).map(|page| path.with_file_name(format!("{stem}-lightmap-{page}.{ending}"))).collect()
}

/// The files beside the output with their contents.
pub(super) fn contents(pages: &LightmapPages, path: &Path) -> Result<Vec<(PathBuf, Vec<u8>)>, ExportError> {
    let map = pages.map;
    // One layer alone needs no name; several need one each.
    let whole = (!pages.groups.is_empty()).then_some("lightmap");
    let names = || [whole].into_iter().chain(pages.groups.iter().map(|name| Some(name.as_str())));
    let file = |(page, path): (usize, PathBuf)| {
        let layers: Vec<(Option<&str>, &[[f32; 3]])> =
            names().zip(&map.images).map(|(name, layer)| (name, layer[page].as_slice())).collect();
        let encode = if pages.format == PageFormat::Ktx2 { ktx2 } else { exr };
        Ok((path, encode(&layers, map.size)?))
    };
    files(path, map.report.pages, pages.format).into_iter().enumerate().map(file).collect()
}

/// Puts the lightmap into a copy of the input document. Returns it with what its extras say of the lightmap.
pub(super) fn assemble(
    scene: &Scene,
    pages: &LightmapPages,
    output: &Path,
) -> Result<(Assembled, Value), ExportError> {
    let mut by_node: BTreeMap<usize, BTreeMap<usize, Vec<&SideLayout>>> = BTreeMap::new();
    for layout in &pages.map.layouts {
        let surface = &scene.surfaces[layout.surface];
        by_node.entry(surface.node).or_default().entry(surface.primitive).or_default().push(layout);
    }
    let is_lit = |node| by_node.contains_key(&node);
    let draft = Draft::new(scene, is_lit);
    let mut assembler = Assembler {
        set: free_set(&draft.root, pages.map.report.uses_second_set)?,
        draft,
        textures: vec![],
        scale: 1.0,
        materials: BTreeMap::new(),
        shared: BTreeMap::new(),
    };
    let mut extras = assembler.add_pages(pages)?;
    if pages.format.beside().is_some() {
        let beside = files(output, pages.map.report.pages, pages.format);
        let names = beside.iter().filter_map(|file| Some(file.file_name()?.to_string_lossy()));
        extras["files"] = names.collect();
    }
    for (&node, primitives) in &by_node {
        assembler.light_node(node, primitives)?;
    }
    Ok((assembler.draft.finish(is_lit, output)?, extras))
}

/// The set of texture coordinates for the lightmap: no material may use it for anything else.
fn free_set(root: &Root, uses_second_set: bool) -> Result<u32, ExportError> {
    fn collect(value: &Value, used: &mut BTreeSet<u64>) {
        match value {
            Value::Array(items) => items.iter().for_each(|item| collect(item, used)),
            Value::Object(members) => {
                used.extend(members.get("texCoord").and_then(Value::as_u64));
                members.values().for_each(|member| collect(member, used));
            }
            _ => {}
        }
    }
    if uses_second_set {
        return Ok(FIRST_SET);
    }
    let mut used = BTreeSet::new();
    collect(&serde_json::to_value(&root.materials)?, &mut used);
    Ok((FIRST_SET..).find(|set| !used.contains(&u64::from(*set))).unwrap_or(FIRST_SET))
}

struct Assembler<'a> {
    draft: Draft<'a>,
    /// Set of texture coordinates of the lightmap.
    set: u32,
    /// Texture of each page.
    textures: Vec<Index<Texture>>,
    /// Irradiance that 1 stands for in them.
    scale: f32,
    /// Materials with their lightmap.
    materials: BTreeMap<MaterialKey, Index<Material>>,
    /// What sides with one layout have in common, by its number.
    shared: BTreeMap<u32, (Attributes, Option<Index<Accessor>>)>,
}

/// The material of the input, the page, whether it is for one side only, and the bits of its rectangle, if there are several on a page.
type MaterialKey = (Option<usize>, u32, bool, Option<[u32; 4]>);

/// The attributes of a primitive.
type Attributes = BTreeMap<Checked<Semantic>, Index<Accessor>>;

/// The indices of a primitive on each page; none where its vertices follow one another.
type Pages = Vec<(u32, Option<Index<Accessor>>)>;

impl Assembler<'_> {
    /// Adds the images of all layers. Returns what the extras say of them.
    fn add_pages(&mut self, pages: &LightmapPages) -> Result<Value, ExportError> {
        let LightmapPages { map, groups, format } = pages;
        let sampler = self.draft.root.push(Sampler {
            mag_filter: Some(Valid(MagFilter::Linear)),
            min_filter: Some(Valid(MinFilter::Linear)),
            name: None,
            wrap_s: Valid(WrappingMode::ClampToEdge),
            wrap_t: Valid(WrappingMode::ClampToEdge),
            extensions: None,
            extras: None,
        });
        let names =
            ["lightmap".to_owned()].into_iter().chain(groups.iter().map(|name| format!("lightmap {name}")));
        let mut layers = vec![];
        for (name, images) in names.zip(&map.images) {
            let scale = largest(images);
            let mut textures = vec![];
            for (page, image) in images.iter().enumerate() {
                let view = self.draft.new.push_view(
                    &mut self.draft.root,
                    png(image, map.size, *format, scale)?,
                    None,
                );
                let name = Some(format!("{name} {page}"));
                let source = self.draft.root.push(Image {
                    buffer_view: Some(view),
                    mime_type: Some(MimeType("image/png".into())),
                    name: name.clone(),
                    uri: None,
                    extensions: None,
                    extras: None,
                });
                textures.push(self.draft.root.push(Texture {
                    name,
                    sampler: Some(sampler),
                    source,
                    extensions: None,
                    extras: None,
                }));
            }
            layers.push((scale, textures));
        }
        let mut layers = layers.into_iter();
        (self.scale, self.textures) = layers.next().unwrap_or((1.0, vec![]));
        let numbers = |textures: &[Index<Texture>]| -> Value {
            textures.iter().map(|texture| texture.value()).collect()
        };
        let group = |(name, (scale, textures)): (&String, (f32, Vec<Index<Texture>>))| json!({ "name": name, "scale": scale, "textures": numbers(&textures) });
        Ok(json!({
            "texCoord": self.set,
            "texelSize": map.report.texel_size,
            "encoding": format.encoding(),
            "scale": self.scale,
            "textures": numbers(&self.textures),
            "groups": groups.iter().zip(layers).map(group).collect::<Vec<_>>(),
        }))
    }

    /// Gives the node a mesh of its own, with coordinates for its light.
    fn light_node(
        &mut self,
        node: usize,
        primitives: &BTreeMap<usize, Vec<&SideLayout>>,
    ) -> Result<(), ExportError> {
        let (source, mut mesh) = posed(&self.draft.scene.source.root, node)?;
        let mut all = vec![];
        for (index, original) in std::mem::take(&mut mesh.primitives).into_iter().enumerate() {
            match primitives.get(&index) {
                Some(sides) => {
                    for side in sides {
                        all.extend(self.side(side, sides.len() > 1, source, &original)?);
                    }
                }
                None => all.push(original),
            }
        }
        mesh.primitives = all;
        self.draft.put(node, source, mesh);
        Ok(())
    }

    /// The primitives of a side: one for each page that it lies on.
    fn side(
        &mut self,
        layout: &SideLayout,
        one_side: bool,
        mesh: Index<Mesh>,
        original: &Primitive,
    ) -> Result<Vec<Primitive>, ExportError> {
        self.draft.vertices += layout.sources.len();
        self.draft.triangles += layout.triangles.len();
        let known = layout.shared.as_ref().and_then(|shared| self.shared.get(&shared.group)).cloned();
        let (attributes, pages) = match known {
            Some((attributes, indices)) => {
                let page = layout.pages.iter().flatten().next().copied().unwrap_or(0);
                (attributes, vec![(page, indices)])
            }
            None => self.geometry(layout, mesh, original)?,
        };
        if let (Some(shared), [(_, indices)]) = (&layout.shared, pages.as_slice()) {
            self.shared.entry(shared.group).or_insert_with(|| (attributes.clone(), *indices));
        }
        let mut primitives = vec![];
        for (page, indices) in pages {
            let material = Some(self.material(original.material, page, one_side, layout.shared.as_ref())?);
            let attributes = attributes.clone();
            primitives.push(Primitive {
                attributes,
                indices,
                material,
                mode: Valid(Mode::Triangles),
                ..original.clone()
            });
        }
        Ok(primitives)
    }

    /// The attributes of a side, and its indices by page.
    fn geometry(
        &mut self,
        layout: &SideLayout,
        mesh: Index<Mesh>,
        original: &Primitive,
    ) -> Result<(Attributes, Pages), ExportError> {
        let surface = &self.draft.scene.surfaces[layout.surface];
        let source = source_primitive(&self.draft.document, mesh, surface)?;
        let is_back = surface.side == Side::Back;
        let count = source.get(&Semantic::Positions).map_or(0, |positions| positions.count());
        let has_copies = layout.sources.len() != count;
        let mut attributes = BTreeMap::new();
        for (semantic, accessor) in source.attributes() {
            let turns = is_back && matches!(semantic, Semantic::Normals | Semantic::Tangents);
            let kept = original.attributes.get(&Valid(semantic.clone())).copied();
            let Some(kept) = kept else { continue };
            if !has_copies && !turns {
                attributes.insert(Valid(semantic), kept);
                continue;
            }
            let width = accessor.dimensions().multiplicity();
            if width > 4 || accessor.dimensions() == gltf::accessor::Dimensions::Mat2 {
                continue;
            }
            let values = components(&accessor, &self.draft.scene.source.buffers)
                .ok_or_else(|| ExportError::Buffer(format!("attribute {}", semantic.to_string())))?;
            let sign = if turns { -1.0 } else { 1.0 };
            let of_vertex =
                |vertex: &u32| values.get(*vertex as usize * width..).and_then(|rest| rest.get(..width));
            let values: Option<Vec<&[f64]>> = layout.sources.iter().map(of_vertex).collect();
            let values: Vec<f32> = values
                .ok_or_else(|| ExportError::Mismatch(format!("{} lacks source vertices", surface.name)))?
                .into_iter()
                .flatten()
                .map(|value| (sign * value) as f32)
                .collect();
            attributes.insert(
                Valid(semantic.clone()),
                self.draft.new.push_attribute(&mut self.draft.root, &semantic, width, &values),
            );
        }
        let own = Semantic::TexCoords(self.set);
        let coordinates = layout.shared.as_ref().map_or(&*layout.coordinates, |shared| &shared.coordinates);
        let coordinates = coordinates.as_flattened();
        let coordinates = self.draft.new.push_attribute(&mut self.draft.root, &own, 2, coordinates);
        for set in 0..self.set {
            // Sets must be numbered without gaps.
            attributes.entry(Valid(Semantic::TexCoords(set))).or_insert(coordinates);
        }
        attributes.insert(Valid(own), coordinates);
        let by_page = layout.by_page();
        let keeps_indices =
            by_page.len() == 1 && !is_back && !has_copies && original.mode == Valid(Mode::Triangles);
        let mut pages = vec![];
        for (page, mut indices) in by_page {
            if is_back {
                indices.chunks_exact_mut(3).for_each(|triangle| triangle.swap(1, 2));
            }
            let indices = if keeps_indices {
                original.indices
            } else {
                Some(self.draft.new.push_indices(&mut self.draft.root, &indices, layout.sources.len()))
            };
            pages.push((page, indices));
        }
        Ok((attributes, pages))
    }

    /// The material with the lightmap of a page.
    fn material(
        &mut self,
        original: Option<Index<Material>>,
        page: u32,
        one_side: bool,
        shared: Option<&SharedLayout>,
    ) -> Result<Index<Material>, ExportError> {
        let rectangle = shared.map(|SharedLayout { offset: [x, y], scale: [width, height], .. }| {
            [x, y, width, height].map(|value| value.to_bits())
        });
        let key = (original.map(|index| index.value()), page, one_side, rectangle);
        if let Some(&made) = self.materials.get(&key) {
            return Ok(made);
        }
        let mut material = original.and_then(|index| self.draft.root.get(index)).cloned().unwrap_or_default();
        if one_side {
            material.double_sided = false;
        }
        let texture = self.textures.get(page as usize);
        let texture = texture.ok_or_else(|| ExportError::Mismatch(format!("lightmap has no page {page}")))?;
        let mut link = json!({ "index": texture.value(), "texCoord": self.set, "intensity": self.scale });
        if let Some(SharedLayout { offset, scale, .. }) = shared {
            link["extensions"] = json!({ TEXTURE_TRANSFORM: { "offset": offset, "scale": scale } });
        }
        material.extensions.get_or_insert_default().others.insert(MOZ_LIGHTMAP.into(), link);
        let made = self.draft.root.push(material);
        self.materials.insert(key, made);
        Ok(made)
    }
}
