//! Runs from file to file: what they write, resume and leave alone.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use bake::{BakeError, BakeSettings, LightChange, NewLight, Observer, Progress};
use cluster::ClusterSettings;
use glam::DVec3;
use output::export::ExportSettings;
use pipeline::relight::{RelightRequest, Relighted};
use pipeline::run::{
    BakeRequest, CheckpointFile, Finished, RunError, RunObserver, SceneSource, Workers, run,
};
use scene::{ImportOptions, Scene};
use tempfile::TempDir;

/// Cancels when the scene is imported, if it is told to.
#[derive(Default)]
struct Recorder {
    cancels: bool,
    imported: bool,
    exporting: bool,
}

impl Observer for Recorder {
    fn progress(&mut self, _: &Progress) {}

    fn is_cancelled(&mut self) -> bool {
        self.cancels && self.imported
    }
}

impl RunObserver for Recorder {
    fn warn(&mut self, warnings: &[String]) {
        assert_eq!(warnings, [""; 0]);
    }

    fn imported(&mut self, scene: &Arc<Scene>) {
        assert!(!scene.surfaces.is_empty());
        self.imported = true;
    }

    fn exporting(&mut self) {
        self.exporting = true;
    }
}

fn cornell() -> Vec<u8> {
    fs::read("../../tests/scenes/cornell.glb").unwrap()
}

/// A quick bake of cornell into `folder`, with all files that a run can write.
fn bake(folder: &Path, keep: bool, observer: &mut Recorder) -> Result<Finished, RunError> {
    let request = BakeRequest {
        scene: SceneSource::Bytes(cornell()),
        import: ImportOptions::default(),
        bake: BakeSettings {
            keep_light: Some(u64::MAX),
            validation_samples: 64,
            ..BakeSettings::for_error(0.2)
        },
        lightmap: None,
        probes: None,
        occlusion: None,
        export: ExportSettings::default(),
        output: &folder.join("lit.glb"),
        kept_light: Some(&folder.join("light")),
        report: Some(&folder.join("report.json")),
        checkpoint: Some(CheckpointFile {
            path: &folder.join("rows"),
            max_bytes: 1 << 30,
            replace: true,
            keep,
        }),
    };
    let two: ClusterSettings = cluster::Workers::Embedded { threads: 2 }.into();
    run(request, Workers::Exclusive(&two), observer)
}

#[test]
fn a_run_writes_its_files_and_resumes_from_its_checkpoint() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("rows"), "no checkpoint").unwrap();
    let mut observer = Recorder::default();
    let first = bake(folder.path(), true, &mut observer).unwrap();
    assert!(observer.imported && observer.exporting);
    assert_eq!(fs::read_to_string(path("report.json")).unwrap(), first.report_json);
    let lit = fs::read(path("lit.glb")).unwrap();
    let second = bake(folder.path(), false, &mut Recorder::default()).unwrap();
    // The first run reads back rows of its own.
    let [first_rows, rows] = [&first, &second].map(|run| run.summary.checkpoint.as_ref().unwrap());
    assert!(rows.rows_read > first_rows.rows_read && rows.rows_written < first_rows.rows_written);
    assert_eq!(fs::read(path("lit.glb")).unwrap(), lit);
    assert!(!path("rows").exists());

    let request = RelightRequest {
        scene: SceneSource::Bytes(cornell()),
        import: ImportOptions::default(),
        kept_light: &path("light"),
        light: NewLight {
            changes: vec![LightChange { light: second.lights.unwrap()[0].clone(), factor: DVec3::ONE }],
            ..NewLight::default()
        },
        export: ExportSettings::default(),
        output: &path("relit.glb"),
        report: None,
    };
    let Relighted { report, lights, .. } = pipeline::relight::run(request, &mut Recorder::default()).unwrap();
    assert_eq!(report.vertices, second.summary.bake.vertices);
    assert_eq!(lights, first.lights.unwrap());
    assert!(path("relit.glb").exists());
}

#[test]
fn a_cancelled_run_leaves_the_old_output_and_the_checkpoint() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("lit.glb"), "old").unwrap();
    let mut observer = Recorder { cancels: true, ..Recorder::default() };
    let cancelled = bake(folder.path(), false, &mut observer);
    assert!(matches!(cancelled, Err(RunError::Bake(BakeError::Cancelled))));
    assert!(!observer.exporting);
    assert_eq!(fs::read(folder.path().join("lit.glb")).unwrap(), b"old");
    assert!(folder.path().join("rows").exists());
    assert!(!folder.path().join("report.json").exists());
}
