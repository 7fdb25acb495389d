use kernel::replica::encode_translucent_scene;

use super::layers::check_groups;
use super::measure::Measured;
use super::occluders::occluders;
use super::relight::KeptLight;
use super::report::BakeReport;
use super::setup::Setup;
use crate::context::{Context, Work};
use crate::error::BakeError;
use crate::jobs::{RowClient, RowService};
use crate::lit::LitMesh;
use crate::observer::Observer;
use crate::preview::lit_mesh;
use crate::settings::BakeSettings;
use scene::Scene;

/// The result of a bake.
pub struct Baked {
    /// The lit mesh.
    pub lit: LitMesh,
    /// Its metrics.
    pub report: BakeReport,
    /// What relighting needs, if it was asked for.
    pub kept: Option<KeptLight>,
}

/// Bakes a scene. Rows come from `service`; `observer` is told of progress, often.
///
/// However it ends, the service is left with nothing to do and nothing to hold for it.
///
/// # Errors
/// When the rows cannot be had, the scene gives no mesh, or the observer cancels it.
#[tracing::instrument(skip_all)]
pub fn bake(
    scene: &Scene,
    settings: &BakeSettings,
    service: &mut dyn RowService,
    observer: &mut dyn Observer,
) -> Result<Baked, BakeError> {
    check_groups(scene, &settings.groups)?;
    let blockers = occluders(scene);
    let replica = encode_translucent_scene(&blockers.polygons, &blockers.opacities);
    let mut client = RowClient::new(service, observer, replica);
    let mut settings = settings.clone();
    let mut work = Work::default();
    loop {
        let mut cx = Context::new(scene, &settings, &mut client, work);
        let measured = Setup::new(&mut cx)?.light(&mut cx)?.solve(&mut cx)?.meet_error(&mut cx)?;
        let Some(better) = measured.better_settings(&cx) else {
            return measured.finish(cx, blockers.polygons.len());
        };
        work = Work { restarts: cx.work.restarts + 1, ..cx.work };
        measured.solved.rows.release(&mut client);
        settings = better;
    }
}

impl Measured {
    /// What is only asked of the final solution.
    fn finish(mut self, mut cx: Context, occluders: usize) -> Result<Baked, BakeError> {
        let cx = &mut cx;
        let warnings = self.solved.back_face_check(cx)?;
        let layers = self.solved.layers(cx)?;
        let kept = self.keep_light(cx)?;
        let (mesh, irradiance) = (&self.solved.mesh.mesh, &self.solved.solution.irradiance);
        let (lit, fitted) = lit_mesh(cx.scene, mesh, cx.settings.only, irradiance, &self.solved.direct);
        self.solved.solution.irradiance = fitted;
        cx.end_step("export mesh");
        let mut report = self.report(cx, occluders);
        report.warnings.extend(warnings);
        Ok(Baked { lit: LitMesh { layers, ..lit }, report, kept })
    }
}
