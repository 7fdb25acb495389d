use std::time::Instant;

use protocol::api::submit_scene_header::Source;
use protocol::api::{Outcome, Phase};

use crate::job::{Record, Relit};
use crate::progress::Live;
use crate::run::{Ending, Means, names_of_lights, of_light, scene_of, write_result};
use bake::{KeptLight, NewLight, relight};
use output::export::ExportSettings;
use pipeline::options::{Violations, Wanted, export_settings, import_options, irradiance_unit, new_light};
use pipeline::summary::{relit_extras, relit_json};
use scene::ImportOptions;

/// Lights the scene of a job that is done otherwise. It takes so little that nothing of it is kept on the way: a job that is
/// interrupted begins anew.
pub(super) fn relight_baked(
    means: &Means<'_>,
    record: &Record,
    relit: &Relit,
    wanted: Wanted,
    live: &Live,
) -> Result<Outcome, Ending> {
    let clock = Instant::now();
    let failed = |error: &dyn ToString| Ending::Failed(error.to_string());
    let mut wrong = Violations::default();
    let light = match &record.header.source {
        Some(Source::Relight(relight)) => new_light(relight, &mut wrong),
        _ => NewLight::default(),
    };
    let light = NewLight { only: wanted.bake.only, groups: wanted.bake.groups, ..light };
    let kept = KeptLight::read(&means.store.light(relit.baked)).map_err(of_light)?;
    let options = ImportOptions { sky: kept.sky(), ..import_options(&relit.options, &mut wrong) };
    let output = record.header.output.clone().unwrap_or_default();
    let export_settings = export_settings(&output, irradiance_unit(&relit.options), &mut wrong);
    wrong.check().map_err(|refusal| failed(&refusal))?;
    let scene = scene_of(means, record, &options)?;
    if live.is_stopped() {
        return Err(Ending::Stopped);
    }
    let relit = relight(&scene, &kept, &light).map_err(of_light)?;

    live.enter(Phase::Export);
    let settings = ExportSettings { extras: relit_extras(&relit), ..export_settings };
    let (exported, written) = write_result(means, record, &relit.scene, &relit.lit, &settings)?;
    let report_json =
        relit_json(&relit, &exported, clock.elapsed().as_secs_f64()).map_err(|error| failed(&error))?;
    let warnings = [&scene.warnings, &relit.report.warnings, &exported.warnings];
    Ok(Outcome {
        report_json,
        warnings: warnings.into_iter().flatten().cloned().collect(),
        took: clock.elapsed().try_into().ok(),
        can_be_relit: true,
        lights: names_of_lights(&kept),
        ..written
    })
}
