//! A scene of this crate, baked in this process and held against its path-traced reference.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};

use bake::{BakeReport, BakeSettings};
use output::export::{ExportSettings, export};
use scene::{ImportOptions, ReadOptions, import};
use verify::score::{Score, score};

use crate::baking::baked;
use crate::data;

/// A bake and its score.
pub struct Measured {
    /// Figures of the bake.
    pub report: BakeReport,
    /// How far it is from the reference.
    pub score: Score,
}

/// Bakes `scenes/NAME.glb` and scores it against `references/NAME.reference.csv`.
///
/// # Panics
/// When anything fails.
#[must_use]
pub fn measured(name: &str, settings: &BakeSettings) -> Measured {
    measured_as(name, &ImportOptions::default(), settings)
}

/// As [`measured`], for a reference that was made with these options.
///
/// # Panics
/// When anything fails.
#[must_use]
pub fn measured_as(name: &str, options: &ImportOptions, settings: &BakeSettings) -> Measured {
    static NUMBER: AtomicU32 = AtomicU32::new(0);
    let path = data(&format!("scenes/{name}.glb"));
    let scene = import(&path, options).unwrap_or_else(|error| panic!("{error}"));
    let baked = baked(&scene, settings);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let lit: PathBuf = std::env::temp_dir().join(format!("halflight-{}-{number}.glb", std::process::id()));
    let export_settings = ExportSettings::default();
    export(&scene, &baked.lit, &export_settings, &lit).unwrap_or_else(|error| panic!("{error}"));
    let score =
        score(&lit, &data(&format!("references/{name}.reference.csv")), &path, &ReadOptions::default());
    let _ = std::fs::remove_file(&lit);
    Measured { report: baked.report, score: score.unwrap_or_else(|error| panic!("{error}")) }
}
