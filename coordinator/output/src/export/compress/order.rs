//! Triangles and vertices in an order that compresses well: neighbours follow one another.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::rc::Rc;

use gltf::Semantic;
use gltf::json::Root;
use gltf::json::mesh::Primitive;
use gltf::json::validation::Checked::Valid;
use meshopt::optimize_vertex_cache;

use super::super::ExportError;
use super::roles::Role;

/// How many vertices each accessor of indices may name.
pub(super) fn vertices(root: &Root) -> HashMap<usize, usize> {
    let mut vertices: HashMap<usize, usize> = HashMap::new();
    for primitive in root.meshes.iter().flat_map(|mesh| &mesh.primitives) {
        let positions = primitive.attributes.get(&Valid(Semantic::Positions)).and_then(|own| root.get(*own));
        if let (Some(indices), Some(positions)) = (primitive.indices, positions) {
            let count = positions.count.0 as usize;
            vertices.entry(indices.value()).and_modify(|most| *most = count.max(*most)).or_insert(count);
        }
    }
    vertices
}

/// The triangles and vertices of a primitive in another order.
pub(super) struct Order {
    pub(super) indices: Vec<u32>,
    /// The vertices, by their former numbers.
    pub(super) vertices: Vec<u32>,
}

/// A better order for the accessors of each primitive that nothing else uses.
pub(super) fn orders(
    root: &Root,
    roles: &BTreeMap<usize, Role>,
    read: impl Fn(usize) -> Result<Vec<u32>, ExportError>,
) -> Result<HashMap<usize, Rc<Order>>, ExportError> {
    let named = |primitive: &Primitive| -> BTreeSet<usize> {
        primitive.attributes.values().copied().chain(primitive.indices).map(|index| index.value()).collect()
    };
    let mut users: HashMap<usize, usize> = HashMap::new();
    let primitives = || root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    primitives().flat_map(named).for_each(|accessor| *users.entry(accessor).or_default() += 1);
    let mut orders = HashMap::new();
    for primitive in primitives() {
        let accessors = named(primitive);
        let Some(indices) = primitive.indices.filter(|own| roles.get(&own.value()) == Some(&Role::Triangles))
        else {
            continue;
        };
        let is_own = |accessor: &usize| {
            users.get(accessor) == Some(&1) && roles.get(accessor).is_some_and(|role| *role != Role::Other)
        };
        let positions = primitive.attributes.get(&Valid(Semantic::Positions)).and_then(|own| root.get(*own));
        let Some(count) = positions.map(|positions| positions.count) else { continue };
        let mut attributes = primitive.attributes.values().filter_map(|own| root.get(*own));
        if primitive.targets.is_some()
            || !accessors.iter().all(is_own)
            || !attributes.all(|own| own.count == count)
        {
            continue;
        }
        let count = count.0 as usize;
        let indices = read(indices.value())?;
        if indices.iter().any(|index| *index as usize >= count) {
            continue;
        }
        let mut indices = optimize_vertex_cache(&indices, count);
        let mut places = vec![u32::MAX; count];
        let mut vertices = vec![];
        for index in &mut indices {
            let place = &mut places[*index as usize];
            if *place == u32::MAX {
                *place = vertices.len() as u32;
                vertices.push(*index);
            }
            *index = *place;
        }
        let order = Rc::new(Order { indices, vertices });
        orders.extend(accessors.into_iter().map(|accessor| (accessor, order.clone())));
    }
    Ok(orders)
}
