use std::ops::ControlFlow;
use std::time::Instant;

use kernel::replica::encode_translucent_scene;

use crate::context::{Context, Work};
use crate::error::Result;
use crate::jobs::{RowClient, RowService};
use crate::lit::LitMesh;
use crate::observer::{Observer, Phase};
use crate::output_mesh::output_mesh;
use crate::preview::lit_mesh;
use crate::refinement::{Obstacle, RevealedErrors};
use crate::relight::{KeptLight, keep_light};
use crate::settings::BakeSettings;
use crate::stages::{
    AskedPoints, BakeReport, Measured, NewStart, PointLight, Setup, ShootingMesh, check_groups, occluders,
};
use scene::Scene;

/// The result of a bake.
pub struct Baked {
    /// The lit mesh.
    pub lit: LitMesh,
    /// Its metrics.
    pub report: BakeReport,
    /// What relighting needs, if it was asked for.
    pub kept: Option<KeptLight>,
    /// The light of the points that were asked about.
    pub at_points: PointLight,
}

/// Bakes a scene. Rows come from `service`; `observer` is told of progress, often.
///
/// However it ends, the service is left with nothing to do and nothing to hold for it.
///
/// # Errors
/// When the rows cannot be had, the scene gives no mesh, or the observer cancels it.
pub fn bake(
    scene: &Scene,
    settings: &BakeSettings,
    service: &mut dyn RowService,
    observer: &mut dyn Observer,
) -> Result<Baked> {
    bake_with_points(scene, settings, &AskedPoints::default(), service, observer)
}

/// Bakes a scene as [`bake()`] does, and asks the solution for the light of these points.
///
/// # Errors
/// As [`bake()`].
#[tracing::instrument(skip_all)]
pub fn bake_with_points(
    scene: &Scene,
    settings: &BakeSettings,
    points: &AskedPoints,
    service: &mut dyn RowService,
    observer: &mut dyn Observer,
) -> Result<Baked> {
    check_groups(scene, &settings.groups)?;
    let mut clock = Instant::now();
    let began = (clock, service.thread_time());
    let mut mesh = None;
    let (occluders, mut client) = rayon::in_place_scope(|scope| {
        scope.spawn(|_| mesh = Some(ShootingMesh::new(scene, settings)));
        let blockers = occluders::occluders(scene);
        let replica = encode_translucent_scene(&blockers.polygons, &blockers.opacities);
        // Workers sort them while the mesh is made.
        (blockers.polygons.len(), RowClient::new(service, observer, replica, began))
    });
    let mut settings = settings.clone();
    let mut work = Work::default();
    loop {
        let shooting = mesh.take().unwrap_or_else(|| ShootingMesh::new(scene, &settings));
        let mut cx = Context::new(scene, &settings, &mut client, work, clock);
        let setup = Setup::new(&mut cx, shooting)?;
        let NewStart { mut rows, settings: better, mesh: kept } = match setup.light(&mut cx)? {
            ControlFlow::Break(new_start) => new_start,
            ControlFlow::Continue(lit) => match lit.solve(&mut cx)?.meet_error(&mut cx)? {
                ControlFlow::Break(new_start) => new_start,
                ControlFlow::Continue(measured) => return finish(measured, cx, occluders, points),
            },
        };
        // One for which the mesh is kept comes before most of the work.
        work = Work { restarts: cx.work.restarts + u32::from(kept.is_none()), ..cx.work };
        rows.end(&mut client);
        (settings, mesh) = (better, kept);
        clock = Instant::now();
    }
}

/// What to say where the file has more vertices than it may have: refinement adds none then, but the scene needs its own.
fn over_bound(cx: &Context, vertices: usize) -> Option<String> {
    let most = cx.settings.vertices_of_file(cx.scene);
    (vertices > most).then(|| {
        format!(
            "the file has {vertices} vertices, over its bound of {most} (--max-vertices): the scene's own corners, and the lines where \
             its surfaces touch, need as many; simplify the scene"
        )
    })
}

/// Computes what is only asked of the final solution.
fn finish(mut measured: Measured, mut cx: Context, occluders: usize, points: &AskedPoints) -> Result<Baked> {
    let cx = &mut cx;
    let warnings = measured.solved.back_face_check(cx)?;
    let layers = measured.solved.layers(cx)?;
    // A mesh that may have no more vertices does not tell where light is even.
    let around = if measured.obstacle == Some(Obstacle::MaxVertices) { &[] } else { points.around };
    let at_points = measured.solved.light_at(cx, &AskedPoints { around, ..*points }, &layers)?;
    let layers = layers.into_iter().map(|layer| layer.lit).collect();
    let kept = keep_light(cx, &mut measured)?;
    let solved = &mut measured.solved;
    // What follows needs memory.
    solved.rows.end(cx.client);
    let (mesh, irradiance) = (&solved.mesh.mesh, &solved.solution.irradiance);
    cx.client.monitor.enter(Phase::ExportMesh, mesh.vertices.len());
    let (lit, fitted) =
        lit_mesh(cx.scene, mesh, cx.settings.only, (irradiance, &solved.revealed), &solved.direct);
    solved.solution.irradiance = fitted;
    solved.revealed = RevealedErrors::default();
    let lit = LitMesh { layers, ..lit };
    let (lit, difference) = if points.without_mesh {
        (lit, 0.0)
    } else {
        output_mesh(cx.scene, lit, cx.settings.simplifies().then_some(&measured.error))
    };
    measured.error = measured.error.with_simplification(difference);
    cx.client.monitor.set_error(Some(measured.error.total));
    cx.client.monitor.enter(Phase::ExportMesh, lit.vertices.len());
    cx.end_step("export mesh");
    let mut report = measured.report(cx, occluders);
    report.warnings.extend(over_bound(cx, lit.vertices.len()).filter(|_| !points.without_mesh));
    report.warnings.extend(warnings);
    Ok(Baked { lit, report, kept, at_points })
}
