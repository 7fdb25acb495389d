//! The scenes, and a bake of one of them on a simulated cluster.

use std::cell::Cell;
use std::error::Error;
use std::fs;
use std::path::Path;

use bake::{BakeReport, BakeSettings, Baked, Observer, Phase, Progress, RowStrategy, bake};
use glam::DVec3;
use kernel::replica::Digest;
use scene::{ImportOptions, Scene, import_slice};
use tests::baking::imported;
use tests::building::building;

use crate::account::Account;
use crate::cluster::Simulated;
use crate::model::Model;
use crate::processor::Nanoseconds;
use crate::recorder::Recorder;

/// A scene to bake.
pub struct Named {
    /// What it is called.
    pub name: &'static str,
    /// Of a furnished building; none in the house, which has a sky.
    rooms: usize,
    /// Edge of the shooting patches, in metres.
    edge: f64,
    mesh_error: f64,
    /// Points at which the error is measured.
    validation_samples: usize,
    /// The error that is asked for, if one is: rows are then of the kind that is expected to take less. Else they are exact.
    error: Option<f64>,
}

/// A room, four of them, and eight, with exact rows; eight, sixteen and 44 with the error measured; eight until an error is met, and a
/// smaller one; a house under sun and sky.
pub const SCENES: [Named; 9] = [
    Named { name: "small", ..ROOM },
    Named { name: "medium", rooms: 4, mesh_error: 0.2, ..ROOM },
    Named { name: "large", rooms: 8, ..ROOM },
    Named { name: "checked", rooms: 8, validation_samples: 256, ..ROOM },
    Named { name: "long", rooms: 16, validation_samples: 256, ..ROOM },
    Named { name: "huge", rooms: 44, validation_samples: 256, ..ROOM },
    Named { name: "error", rooms: 8, error: Some(0.03), ..ROOM },
    Named { name: "fine", rooms: 8, error: Some(0.01), ..ROOM },
    Named { name: "house", rooms: 0, error: Some(0.02), ..ROOM },
];

/// A room whose error is neither asked for nor measured.
const ROOM: Named =
    Named { name: "", rooms: 1, edge: 0.6, mesh_error: 0.1, validation_samples: 0, error: None };

/// Radiance of the sky over the house.
const SKY: DVec3 = DVec3::new(1.0, 1.25, 1.6);

/// A scene ready to be baked again and again.
pub struct Prepared {
    scene: Scene,
    /// How it is baked.
    pub settings: BakeSettings,
    recorder: Recorder,
}

/// How a bake went.
pub struct Run {
    /// Seconds on the simulated clock.
    pub seconds: f64,
    /// Where they went.
    pub account: Account,
    /// Figures of the bake.
    pub report: BakeReport,
    /// Of the light at all vertices.
    pub digest: Digest,
}

impl Named {
    /// Builds the scene and opens its rows.
    ///
    /// # Errors
    /// When the rows cannot be read or kept.
    pub fn prepare(&self) -> Result<Prepared, Box<dyn Error>> {
        let (scene, extent) = match self.rooms {
            0 => {
                let house = fs::read(tests::data("scenes/house.glb"))?;
                let options = ImportOptions { sky: SKY, ..ImportOptions::default() };
                (import_slice(&house, &options)?, f64::INFINITY)
            }
            rooms => {
                let building = building(rooms);
                (imported(&building.scene.glb()), building.extent)
            }
        };
        let settings = match self.error {
            Some(error) => BakeSettings::for_error(error),
            None => BakeSettings {
                rows: RowStrategy::Exact,
                shooter_edge: self.edge / extent,
                mesh_error: self.mesh_error,
                validation_samples: self.validation_samples,
                ..BakeSettings::default()
            },
        };
        let folder = Path::new("target/scale");
        fs::create_dir_all(folder)?;
        let recorder = Recorder::open(&folder.join(format!("{}.rows", self.name)))?;
        Ok(Prepared { scene, settings, recorder })
    }
}

impl Prepared {
    /// Bakes the scene on such a cluster.
    ///
    /// # Errors
    /// When it cannot be baked.
    pub fn run(&mut self, model: Model) -> Result<Run, Box<dyn Error>> {
        let phase = Cell::new(Phase::Light);
        let mut cluster = Simulated::new(&mut self.recorder, model, &phase);
        let mut watched = Watched { phase: &phase };
        let Baked { lit, report, .. } = bake(&self.scene, &self.settings, &mut cluster, &mut watched)?;
        let seconds = in_seconds(cluster.finish());
        let light = lit.vertices.iter().flat_map(|vertex| vertex.irradiance.to_array());
        let digest = Digest::of(&light.flat_map(f64::to_le_bytes).collect::<Vec<u8>>());
        Ok(Run { seconds, account: cluster.account, report, digest })
    }
}

/// Tells the cluster what the bake is doing.
struct Watched<'a> {
    phase: &'a Cell<Phase>,
}

impl Observer for Watched<'_> {
    fn progress(&mut self, progress: &Progress) {
        self.phase.set(progress.phase);
    }
}

/// Nanoseconds in seconds.
#[must_use]
pub fn in_seconds(time: Nanoseconds) -> f64 {
    time as f64 * 1e-9
}
