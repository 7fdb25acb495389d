//! The three scenes at default settings, from GLB to GLB, against their path-traced references.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::LazyLock;

use bake::{BakeReport, BakeSettings};
use gltf::{Gltf, Semantic};
use output::export::{ExportSettings, Exported, export};
use scene::{ImportOptions, ReadOptions, import};
use serde_json::{Value, json};
use tests::baking::baked;
use tests::data;
use verify::score::score;

/// A scene that was baked and written.
struct LitScene {
    name: &'static str,
    path: PathBuf,
    exported: Exported,
    report: BakeReport,
}

impl LitScene {
    fn new(name: &'static str) -> Self {
        let scene = import(&data(&format!("scenes/{name}.glb")), &ImportOptions::default()).unwrap();
        let baked = baked(&scene, &BakeSettings::default());
        // In cargo's folder for tests' files: shared by the tests of this program, replaced by the next run.
        let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-lit.glb"));
        let extras = json!({ "energy_balance": baked.report.balance });
        let settings = ExportSettings { extras, ..ExportSettings::default() };
        let exported = export(&scene, &baked.lit, &settings, &path).unwrap();
        Self { name, path, exported, report: baked.report }
    }

    fn all() -> [&'static Self; 3] {
        [&CORNELL, &TABLE, &DOORWAY].map(|scene| &**scene)
    }

    /// The score, which must be within these limits.
    fn assert_score(&self, relative_l2: f64, energy: f64) {
        let reference = data(&format!("references/{}.reference.csv", self.name));
        let score = score(
            &self.path,
            &reference,
            &data(&format!("scenes/{}.glb", self.name)),
            &ReadOptions::default(),
        )
        .unwrap();
        assert_eq!((score.uncovered, score.not_finite), (0, 0), "{score:?}");
        assert!(score.relative_l2 <= relative_l2, "{score:?}");
        assert!((score.energy_ratio - 1.0).abs() <= energy, "{score:?}");
    }

    fn read(&self) -> (Gltf, Gltf) {
        (Gltf::open(&self.path).unwrap(), Gltf::open(data(&format!("scenes/{}.glb", self.name))).unwrap())
    }
}

static CORNELL: LazyLock<LitScene> = LazyLock::new(|| LitScene::new("cornell"));
static TABLE: LazyLock<LitScene> = LazyLock::new(|| LitScene::new("table"));
static DOORWAY: LazyLock<LitScene> = LazyLock::new(|| LitScene::new("doorway"));

#[test]
fn cornell_agrees_with_its_reference() {
    CORNELL.assert_score(0.03, 0.01);
}

#[test]
fn table_agrees_with_its_reference() {
    TABLE.assert_score(0.025, 0.01);
}

#[test]
fn doorway_agrees_with_its_reference() {
    DOORWAY.assert_score(0.03, 0.015);
}

/// Energy is neither lost nor made, and no vertex sees more than its hemisphere.
#[test]
fn reports_add_up() {
    for scene in LitScene::all() {
        let report = &scene.report;
        let balance = &report.balance;
        assert!(balance.relative_imbalance().abs() <= 0.02, "{}: {balance:?}", scene.name);
        for channel in 0..3 {
            let parts = [balance.absorbed, balance.unshot, balance.escaped, balance.imbalance]
                .map(|part| part[channel]);
            let emitted = balance.emitted[channel];
            assert!(
                (parts.iter().sum::<f64>() / emitted - 1.0).abs() <= 1e-12,
                "{}: {balance:?}",
                scene.name
            );
        }
        assert!(report.unshot_bound <= 1e-6, "{}: {}", scene.name, report.unshot_bound);
        // Each factor may be rounded by so much of it, and so may their sum.
        let rounding = BakeSettings::default().factor_rounding;
        assert!(report.row_sums.largest <= 1.0 + rounding, "{}: {:?}", scene.name, report.row_sums);
    }
}

#[test]
fn nodes_names_and_materials_are_kept() {
    for scene in LitScene::all() {
        let (lit, source) = scene.read();
        assert_eq!(lit.nodes().len(), source.nodes().len());
        for (lit, source) in lit.nodes().zip(source.nodes()) {
            assert_eq!(lit.name(), source.name());
            assert_eq!(lit.transform().matrix(), source.transform().matrix());
            assert_eq!(lit.light().map(|light| light.index()), source.light().map(|light| light.index()));
            assert_eq!(lit.mesh().is_some(), source.mesh().is_some());
            let Some((lit, source)) = lit.mesh().zip(source.mesh()) else { continue };
            assert_eq!(lit.name(), source.name());
            for (lit, source) in lit.primitives().zip(source.primitives()) {
                let (lit, source) = (lit.material(), source.material());
                assert_eq!(lit.name(), source.name());
                assert_eq!(
                    lit.pbr_metallic_roughness().base_color_factor(),
                    source.pbr_metallic_roughness().base_color_factor()
                );
                assert_eq!(lit.emissive_factor(), source.emissive_factor());
                assert_eq!(lit.emissive_strength(), source.emissive_strength());
                assert_eq!(lit.unlit(), source.emissive_factor() == [0.0; 3]);
            }
        }
    }
}

#[test]
fn light_stands_at_every_vertex() {
    let mut all_covered = 0;
    for scene in LitScene::all() {
        let (lit, _) = scene.read();
        let (mut vertices, mut triangles) = (0, 0);
        // Nodes of these scenes stand at the origin.
        assert!(lit.nodes().all(|node| {
            node.mesh().is_none() || node.transform().matrix() == glam::Mat4::IDENTITY.to_cols_array_2d()
        }));
        let (mut covered, mut lit_at) = (vec![], HashMap::<_, Vec<[f32; 3]>>::new());
        for primitive in lit.meshes().flat_map(|mesh| mesh.primitives()) {
            let reader = primitive.reader(|_| lit.blob.as_deref());
            let colours: Vec<[f32; 3]> = reader.read_colors(0).unwrap().into_rgb_f32().collect();
            let accessor = primitive.get(&Semantic::Extras("IRRADIANCE".into())).unwrap();
            let irradiances: Vec<[f32; 3]> =
                gltf::accessor::Iter::new(accessor, |_| lit.blob.as_deref()).unwrap().collect();
            let count = reader.read_positions().unwrap().len();
            assert_eq!((colours.len(), irradiances.len()), (count, count));
            let light = colours.iter().zip(&irradiances);
            let positions = reader.read_positions().unwrap();
            for ((colour, irradiance), position) in light.zip(positions) {
                assert!(
                    irradiance.iter().all(|value| value.is_finite() && *value >= 0.0),
                    "{}: irradiance {irradiance:?}",
                    scene.name
                );
                let shown = irradiance.map(|value| (f64::from(value) * scene.exported.exposure).min(1.0));
                let off = (0..3).map(|i| (f64::from(colour[i]) - shown[i]).abs()).fold(0.0, f64::max);
                if off > 1e-6 {
                    let is_dark = shown.iter().all(|channel| *channel < 1e-3);
                    assert!(is_dark, "{}: {colour:?}, not {shown:?}", scene.name);
                    covered.push((position, *colour));
                } else if *irradiance != [0.0; 3] {
                    lit_at.entry(position.map(f32::to_bits)).or_default().push(*colour);
                }
            }
            vertices += count;
            triangles += reader.read_indices().unwrap().into_u32().count() / 3;
        }
        assert_eq!((vertices, triangles), (scene.exported.vertices, scene.exported.triangles));
        all_covered += covered.len();
        for (position, colour) in covered {
            let beside = &lit_at[&position.map(f32::to_bits)];
            for channel in 0..3 {
                let values = || beside.iter().map(|colour| colour[channel]);
                let range = values().fold(1.0, f32::min)..=values().fold(0.0, f32::max);
                assert!(range.contains(&colour[channel]), "{}: {colour:?} beside {beside:?}", scene.name);
            }
        }
    }
    assert!(all_covered > 0, "boxes stand on floors");
}

#[test]
fn extras_say_how_the_light_was_made() {
    for scene in LitScene::all() {
        let (lit, _) = scene.read();
        let extras = lit.as_json().asset.extras.as_ref().unwrap();
        let extras: Value = serde_json::from_str(extras.get()).unwrap();
        let halflight = &extras["halflight"];
        // JSON's decimal numbers may be off in their last digit.
        let assert_near = |found: &Value, expected: f64| {
            let found = found.as_f64().unwrap();
            assert!((found / expected - 1.0).abs() <= 1e-15, "{found}, not {expected}");
        };
        assert_near(&halflight["exposure"], scene.exported.exposure);
        assert_eq!(halflight["unit"], "W/m^2");
        for (channel, absorbed) in scene.report.balance.absorbed.into_iter().enumerate() {
            assert_near(&halflight["energy_balance"]["absorbed"][channel], absorbed);
        }
    }
}
