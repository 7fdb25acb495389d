//! `--weld`: vertices closer than a distance become one, over all primitives of the scene.

use std::collections::HashMap;

use foldhash::fast::RandomState;
use glam::{DVec3, I64Vec3};
use smallvec::SmallVec;

use super::PlacedPrimitive;
use super::triangles::to_world;

/// Moves every vertex to the first one, in the order of the file, within `distance` (world units). Places do not drift: a
/// vertex joins a place, not another vertex that joined it. Normals and texture coordinates stay.
pub(super) fn weld(primitives: &mut [PlacedPrimitive], distance: f64) {
    let mut places = Places { distance, places: Vec::new(), cells: HashMap::default() };
    for placed in primitives {
        let world = placed.world;
        let positions =
            placed.geometry.positions.iter().map(|&position| places.of(to_world(&world, position)));
        placed.welded = Some(positions.collect());
    }
}

/// Places that are kept, by the cells of a grid as wide as the distance.
struct Places {
    distance: f64,
    places: Vec<DVec3>,
    cells: HashMap<I64Vec3, SmallVec<[u32; 2]>, RandomState>,
}

impl Places {
    fn of(&mut self, position: DVec3) -> DVec3 {
        let cell = (position / self.distance).floor().as_i64vec3();
        let mut found: Option<u32> = None;
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    let cell = I64Vec3::new(
                        cell.x.saturating_add(x),
                        cell.y.saturating_add(y),
                        cell.z.saturating_add(z),
                    );
                    let near = |id: &&u32| self.places[**id as usize].distance(position) <= self.distance;
                    let first = self.cells.get(&cell).and_then(|ids| ids.iter().find(near));
                    found = found.into_iter().chain(first.copied()).min();
                }
            }
        }
        if let Some(id) = found {
            return self.places[id as usize];
        }
        self.cells.entry(cell).or_default().push(self.places.len() as u32);
        self.places.push(position);
        position
    }
}
