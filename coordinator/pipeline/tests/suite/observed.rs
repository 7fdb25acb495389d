//! Observers see a bake while it runs, can cancel it, and change nothing.

use std::time::Duration;

use glam::DVec3;
use gltf::Semantic;

use bake::lit::LitMesh;
use bake::*;
use cluster::{Cluster, Workers};
use output::export::{ExportSettings, export};
use scene::Scene;
use scene::{ImportOptions, import};

fn cornell() -> Scene {
    import("../../tests/scenes/cornell.glb".as_ref(), &ImportOptions::default()).unwrap()
}

fn cluster() -> Cluster {
    Cluster::start(&Workers::Embedded { threads: 2 }.into()).unwrap()
}

fn settings(rows: RowStrategy) -> BakeSettings {
    BakeSettings {
        mesh_error: 0.02,
        validation_samples: 64,
        rays_per_hemisphere: 64,
        rows,
        ..BakeSettings::default()
    }
}

/// Always asks.
#[derive(Default)]
struct Curious {
    phase: Option<Phase>,
    seen: Vec<(Phase, LitMesh)>,
    errors: Vec<Option<f64>>,
}

impl Observer for Curious {
    fn progress(&mut self, progress: &Progress) {
        self.phase = Some(progress.phase);
        self.errors.push(progress.error);
    }

    fn wants_preview(&mut self) -> bool {
        true
    }

    fn preview(&mut self, lit: LitMesh) {
        self.seen.push((self.phase.unwrap(), lit));
    }
}

#[test]
fn an_observer_changes_no_bit() {
    let scene = cornell();
    for rows in [RowStrategy::Exact, RowStrategy::Gather] {
        let (alone, watched) = (cluster(), cluster());
        let expected = bake(&scene, &settings(rows), &mut alone.handle(0), &mut Unobserved).unwrap();
        let mut curious = Curious::default();
        let baked = bake(&scene, &settings(rows), &mut watched.handle(0), &mut curious).unwrap();
        assert_eq!(baked.lit.vertices, expected.lit.vertices);
        assert_eq!(baked.lit.surfaces, expected.lit.surfaces);
        assert!(baked.lit.unshot.is_empty());
        for phase in [Phase::Light, Phase::Shoot, Phase::Refine, Phase::FinalSolve] {
            // Noise of rays may leave nothing to refine.
            let may_be_left_out = phase == Phase::Refine && rows == RowStrategy::Gather;
            assert!(
                may_be_left_out || curious.seen.iter().any(|(seen, _)| *seen == phase),
                "nothing was shown in {phase:?}"
            );
        }
        assert_eq!(curious.errors.first(), Some(&None));
        assert_eq!(curious.errors.last(), Some(&Some(baked.report.error.total)));
        check_states(&curious.seen);
    }
}

/// States are whole, and light arrives while what is unshot goes.
fn check_states(seen: &[(Phase, LitMesh)]) {
    for (_, lit) in seen {
        assert_eq!(lit.unshot.len(), lit.vertices.len());
        assert!(lit.unshot.iter().all(|unshot| unshot.is_finite()));
    }
    let unshot = |lit: &LitMesh| -> f64 {
        let all: DVec3 = lit.unshot.iter().map(|unshot| unshot.abs()).sum();
        all.element_sum() / lit.unshot.len() as f64
    };
    let light = |lit: &LitMesh| -> f64 {
        let all: DVec3 = lit.vertices.iter().map(|vertex| vertex.irradiance).sum();
        all.element_sum() / lit.vertices.len() as f64
    };
    let ([(_, first), ..], [.., (_, last)]) = (seen, seen) else { panic!("nothing was shown") };
    assert!(unshot(last) < 0.05 * unshot(first), "{} of {} is unshot", unshot(last), unshot(first));
    // On the same vertices.
    let unrefined = seen.iter().rfind(|(_, lit)| lit.vertices.len() == first.vertices.len());
    let shot = &unrefined.unwrap().1;
    assert!(light(shot) > 1.2 * light(first), "{} after {}", light(shot), light(first));
}

#[test]
fn a_preview_can_be_exported_with_unshot_light() {
    let scene = cornell();
    let mut curious = Curious::default();
    bake(&scene, &settings(RowStrategy::Exact), &mut cluster().handle(0), &mut curious).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("present.glb");
    let (_, lit) = &curious.seen[curious.seen.len() / 2];
    export(&scene, lit, &ExportSettings::default(), &path).unwrap();
    let document = gltf::Gltf::open(&path).unwrap();
    let unshot = Semantic::Extras("UNSHOT".into());
    assert!(document.meshes().flat_map(|mesh| mesh.primitives()).all(|p| p.get(&unshot).is_some()));
    // Who bakes it again does not take what was unshot for an attribute of the scene.
    let again = import(&path, &ImportOptions::default()).unwrap();
    let done = LitMesh { unshot: vec![], ..lit.clone() };
    export(&scene, &done, &ExportSettings::default(), &path).unwrap();
    let document = gltf::Gltf::open(&path).unwrap();
    assert!(document.meshes().flat_map(|mesh| mesh.primitives()).all(|p| p.get(&unshot).is_none()));
    assert_eq!(again.surfaces.len(), scene.surfaces.len());
}

/// Ends the bake as soon as it enters a phase.
struct Impatient {
    phase: Phase,
    is_there: bool,
}

impl Observer for Impatient {
    fn progress(&mut self, progress: &Progress) {
        self.is_there |= progress.phase == self.phase;
    }

    fn is_cancelled(&mut self) -> bool {
        self.is_there
    }
}

#[test]
fn a_cancelled_bake_ends_and_leaves_its_workers_to_the_next() {
    let scene = cornell();
    let expected =
        bake(&scene, &settings(RowStrategy::Exact), &mut cluster().handle(0), &mut Unobserved).unwrap();
    let cluster = cluster();
    let mut handle = cluster.handle(0);
    for phase in [Phase::Light, Phase::Shoot, Phase::Refine, Phase::FinalSolve, Phase::Measure] {
        let mut impatient = Impatient { phase, is_there: false };
        let cancelled = bake(&scene, &settings(RowStrategy::Exact), &mut handle, &mut impatient);
        assert!(matches!(cancelled.map(|_| ()), Err(BakeError::Cancelled)), "not cancelled in {phase:?}");
        assert!(!matches!(handle.next_within(Duration::from_millis(50)), Ok(Some(_))), "an answer to nobody");
    }
    let baked = bake(&scene, &settings(RowStrategy::Exact), &mut handle, &mut Unobserved).unwrap();
    assert_eq!(baked.lit.vertices, expected.lit.vertices);
}
