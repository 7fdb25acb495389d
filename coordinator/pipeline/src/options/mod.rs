//! The options of a bake: declared once, in `tables`, for the command line, the service and the page.
//!
//! The options of a message are checked and become the settings of import, bake and export. The command line fills in the same
//! messages, so a bake by the service has the settings of the same bake by `solve`.
//!
//! | module | contents |
//! |---|---|
//! | [`schema`] | what an option is; `kind`: the values that it may have |
//! | [`slot`] | the places where values are kept |
//! | [`tables`] | all options |
//! | `violations` | what is wrong with options |
//! | [`form`](form()) | the form of the page |

mod form;
mod kind;
pub mod schema;
pub mod slot;
pub mod tables;
mod violations;

use glam::DVec3;
use protocol::api;

use bake::{BakeSettings, LightChange, LightGroup, LightPart, NewLight};
use lightmap::Resolution;
use output::export::{ExportSettings, Materials, check_group_names};
use probes::{MOST_PROBES, Places};
use scene::ImportOptions;

use crate::lightmap_run::LightmapSettings;
pub use form::form;
pub use kind::is_short;
use tables::OutputSettings;
pub use violations::{InvalidOptions, Violation, Violations};

/// Most groups of lights, and most names in all of them.
pub const MOST_NAMES: usize = 1000;

/// Width of a lightmap's page, in pixels, where nothing else is said.
const DEFAULT_PAGE: u32 = 1024;

/// How a scene's file is read.
pub fn import_options(options: &api::SceneOptions, wrong: &mut Violations) -> ImportOptions {
    schema::settings(options, wrong)
}

/// Unit of the irradiance that comes of it, for the output. Where it is not said what the numbers of lights mean, they may mean
/// anything: W/m^2 is what the output has always said.
#[must_use]
pub fn irradiance_unit(options: &api::SceneOptions) -> &'static str {
    match options.light_unit() {
        api::LightUnit::Candela => "lx",
        api::LightUnit::Watt
        | api::LightUnit::Blender
        | api::LightUnit::BlenderUnitless
        | api::LightUnit::Unspecified => "W/m^2",
    }
}

/// How a scene is baked.
pub fn bake_settings(options: &api::BakeOptions, wrong: &mut Violations) -> BakeSettings {
    schema::settings(options, wrong)
}

/// Which part of the light is wanted, and which groups of its sources by themselves.
pub fn light_parts(options: &api::OutputOptions, wrong: &mut Violations) -> (LightPart, Vec<LightGroup>) {
    let OutputSettings { only, export, .. } = schema::settings(options, wrong);
    // Lamps of a file with its own materials shine in viewers.
    let is_said = options.only() != api::Part::Unspecified;
    let only = if export.materials == Materials::Keep && !is_said { LightPart::Indirect } else { only };
    let group =
        |group: &api::LightGroup| LightGroup { name: group.name.clone(), lights: group.lights.clone() };
    let names: usize = options.groups.iter().map(|group| 1 + group.lights.len()).sum();
    wrong.demand(names <= MOST_NAMES, "output.groups", format!("must name {MOST_NAMES} things at most"));
    if names > MOST_NAMES {
        return (only, vec![]);
    }
    for (name, lights) in options.groups.iter().map(|group| (&group.name, &group.lights)) {
        let named = [name].into_iter().chain(lights);
        named.for_each(|name| wrong.short(name, "output.groups"));
    }
    let groups: Vec<LightGroup> = options.groups.iter().map(group).collect();
    if let Err(error) = check_group_names(&groups) {
        wrong.demand(false, "output.groups", format!("have wrong names: {error}"));
    }
    (only, groups)
}

/// The light that a relight asks for, all of it.
pub fn new_light(relight: &api::Relight, wrong: &mut Violations) -> NewLight {
    let holds = relight.lights.len() <= MOST_NAMES;
    wrong.demand(holds, "relight.lights", format!("must name {MOST_NAMES} lights at most"));
    let mut changes = vec![];
    for change in relight.lights.iter().take(MOST_NAMES) {
        wrong.short(&change.light, "relight.lights");
        wrong.demand(change.factor.is_some(), "relight.lights", "must have a factor each");
        let factor = wrong.colour(change.factor, "relight.lights").unwrap_or(DVec3::ONE);
        changes.push(LightChange { light: change.light.clone(), factor });
    }
    NewLight { changes, sky: wrong.colour(relight.sky, "relight.sky"), ..NewLight::default() }
}

/// How the lit file is written, its extras aside.
pub fn export_settings(
    options: &api::OutputOptions,
    default_unit: &str,
    wrong: &mut Violations,
) -> ExportSettings {
    let is_known = api::Format::try_from(options.format).is_ok();
    wrong.demand(is_known, "output.format", "must be GLB or PLY");
    let OutputSettings { export, .. } = schema::settings(options, wrong);
    if options.unit.is_empty() { ExportSettings { unit: default_unit.to_owned(), ..export } } else { export }
}

/// The lightmap that is asked for, if one is.
pub fn lightmap_settings(options: &api::OutputOptions, wrong: &mut Violations) -> Option<LightmapSettings> {
    let OutputSettings { lightmap, texel_size, lightmap_size, lightmap_format, .. } =
        schema::settings(options, wrong);
    let parts =
        [(texel_size.is_some(), "output.texel_size"), (lightmap_size.is_some(), "output.lightmap_size")];
    for (is_given, field) in parts {
        wrong.demand(lightmap || !is_given, field, "is for lightmaps only: give lightmap, too");
    }
    let resolution = match (texel_size, lightmap_size) {
        (Some(texel), _) => Resolution::Texel(texel),
        (None, size) => Resolution::Page(size.unwrap_or(DEFAULT_PAGE)),
    };
    lightmap.then_some(LightmapSettings { resolution, format: lightmap_format })
}

/// The probes that are asked for, if any are.
pub fn probe_places(options: &api::OutputOptions, wrong: &mut Violations) -> Option<Places> {
    let OutputSettings { probes, .. } = schema::settings(options, wrong);
    let points = &options.probe_points;
    if points.is_empty() {
        return probes.map(Places::Grid);
    }
    let field = "output.probe_points";
    wrong.demand(probes.is_none(), field, "cannot be combined with output.probes");
    wrong.demand(points.len() <= 3 * MOST_PROBES, field, format!("must be {MOST_PROBES} points at most"));
    let is_whole = points.len().is_multiple_of(3) && points.iter().all(|value| value.is_finite());
    wrong.demand(is_whole, field, "must be three finite numbers each");
    Some(Places::Points(points.chunks_exact(3).map(DVec3::from_slice).collect()))
}

/// The distance within which things occlude, if ambient occlusion is asked for.
pub fn occlusion_distance(options: &api::OutputOptions, wrong: &mut Violations) -> Option<f64> {
    let OutputSettings { occlusion, lightmap, .. } = schema::settings(options, wrong);
    let holds = occlusion.is_none() || !lightmap;
    wrong.demand(holds, "output.occlusion", "is for vertices: bake without lightmap");
    occlusion
}

/// All that a job needs to know of what was asked for.
#[derive(Debug, Clone)]
pub struct Wanted {
    /// How the file is read.
    pub import: ImportOptions,
    /// How it is baked.
    pub bake: BakeSettings,
    /// How it is written.
    pub export: ExportSettings,
    /// The lightmap that it gets.
    pub lightmap: Option<LightmapSettings>,
    /// Where it has probes.
    pub probes: Option<Places>,
    /// Distance within which things occlude, where it has ambient occlusion.
    pub occlusion: Option<f64>,
}

/// What the options of a submission ask for.
pub fn wanted(header: &api::SubmitSceneHeader, wrong: &mut Violations) -> Wanted {
    let scene = header.scene.clone().unwrap_or_default();
    let output = header.output.clone().unwrap_or_default();
    let (only, groups) = light_parts(&output, wrong);
    let bake = bake_settings(&header.bake.unwrap_or_default(), wrong);
    schema::settings(header, wrong);
    let lightmap = lightmap_settings(&output, wrong);
    let has_files = lightmap.is_some_and(|lightmap| lightmap.format.beside().is_some());
    wrong.demand(!has_files, "output.lightmap_format", "must be png or rgbm: a job has one file");
    let is_mesh = output.format() == api::Format::Ply;
    wrong.demand(lightmap.is_none() || !is_mesh, "output.lightmap", "needs the format GLB");
    let probes = probe_places(&output, wrong);
    wrong.demand(probes.is_none() || !is_mesh, "output.probes", "need the format GLB");
    Wanted {
        import: import_options(&scene, wrong),
        bake: BakeSettings { only, groups, ..bake },
        export: export_settings(&output, irradiance_unit(&scene), wrong),
        lightmap,
        probes,
        occlusion: occlusion_distance(&output, wrong),
    }
}

#[cfg(test)]
mod tests {
    use bake::Quality;

    use super::*;

    fn fields(header: &api::SubmitSceneHeader) -> Vec<String> {
        let mut wrong = Violations::default();
        wanted(header, &mut wrong);
        match wrong.check() {
            Err(InvalidOptions(violations)) => violations.into_iter().map(|wrong| wrong.field).collect(),
            _ => vec![],
        }
    }

    #[test]
    fn what_is_not_said_is_as_it_is_by_default() {
        let mut wrong = Violations::default();
        let wanted = wanted(&api::SubmitSceneHeader::default(), &mut wrong);
        assert_eq!(wanted.bake, BakeSettings::for_quality(Quality::Preview));
        assert_eq!(wanted.export.unit, "W/m^2");
        assert!(wrong.check().is_ok());
    }

    fn baked_with(bake: api::BakeOptions) -> (BakeSettings, Result<(), InvalidOptions>) {
        let mut wrong = Violations::default();
        let settings = bake_settings(&bake, &mut wrong);
        (settings, wrong.check())
    }

    #[test]
    fn a_quality_chooses_what_others_may_change() {
        let bake = api::BakeOptions { rays: Some(64), ..api::BakeOptions::default() };
        let of = |quality: api::Quality| api::BakeOptions { quality: quality.into(), ..bake };
        let expected = |quality| BakeSettings::for_quality(quality).with_rays(64.0);
        assert_eq!(baked_with(bake), (expected(Quality::Preview), Ok(())));
        assert_eq!(baked_with(of(api::Quality::Draft)), (expected(Quality::Draft), Ok(())));
        assert_eq!(baked_with(of(api::Quality::Final)), (expected(Quality::Final), Ok(())));
    }

    #[test]
    fn other_errors_exclude_a_quality() {
        let quality = api::Quality::Final.into();
        let error = api::BakeOptions { error: Some(0.1), ..api::BakeOptions::default() };
        let mesh = api::BakeOptions { mesh_error: Some(0.1), ..api::BakeOptions::default() };
        assert_eq!(baked_with(error).0, BakeSettings::for_error(0.1));
        assert_eq!(baked_with(mesh).0, BakeSettings { mesh_error: 0.1, ..BakeSettings::default() });
        for (other, field) in [(error, "bake.error"), (mesh, "bake.mesh_error")] {
            let (_, checked) = baked_with(api::BakeOptions { quality, ..other });
            let text = checked.unwrap_err().to_string();
            assert_eq!(text, format!("bake.quality cannot be combined with {field}, which it chooses"));
        }
    }

    #[test]
    fn no_more_is_told_than_an_answer_has_room_for() {
        let mut wrong = Violations::default();
        for index in 0..100 {
            wrong.demand(false, "same", "must be so");
            wrong.demand(false, &format!("field{index}"), "must be so");
        }
        let Err(InvalidOptions(told)) = wrong.check() else { panic!("nothing is wrong") };
        assert_eq!(told.len(), violations::MOST_VIOLATIONS);
        assert_eq!(told.iter().filter(|violation| violation.field == "same").count(), 1);
    }

    #[test]
    fn kept_materials_get_indirect_light_unless_another_part_is_said() {
        let mut wrong = Violations::default();
        let keep = api::OutputOptions { materials: api::Materials::Keep.into(), ..Default::default() };
        let all = api::OutputOptions { only: api::Part::All.into(), ..keep.clone() };
        assert_eq!(light_parts(&keep, &mut wrong).0, LightPart::Indirect);
        assert_eq!(light_parts(&all, &mut wrong).0, LightPart::All);
        assert_eq!(light_parts(&api::OutputOptions::default(), &mut wrong).0, LightPart::All);
        assert!(wrong.check().is_ok());
    }

    #[test]
    fn probes_are_on_a_grid_or_at_points() {
        let of = |output: api::OutputOptions| {
            let mut wrong = Violations::default();
            let header = api::SubmitSceneHeader { output: Some(output), ..Default::default() };
            (wanted(&header, &mut wrong).probes, wrong.check())
        };
        let grid = api::OutputOptions { probes: Some(0.5), ..Default::default() };
        let points = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let points = api::OutputOptions { probe_points: points, ..Default::default() };
        assert_eq!(of(grid.clone()), (Some(Places::Grid(0.5)), Ok(())));
        let expected = [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0)].to_vec();
        assert_eq!(of(points.clone()), (Some(Places::Points(expected)), Ok(())));
        let odd = api::OutputOptions { probe_points: vec![1.0, f64::NAN], ..Default::default() };
        let both = api::OutputOptions { probes: Some(0.5), ..points };
        let ply = api::OutputOptions { format: api::Format::Ply.into(), ..grid };
        let mapped = api::OutputOptions { occlusion: Some(1.0), lightmap: true, ..Default::default() };
        for (output, field) in [
            (odd, "output.probe_points must be three finite numbers each"),
            (both, "output.probe_points cannot be combined with output.probes"),
            (ply, "output.probes need the format GLB"),
            (mapped, "output.occlusion is for vertices: bake without lightmap"),
        ] {
            assert_eq!(of(output).1.unwrap_err().to_string(), field);
        }
    }

    #[test]
    fn each_wrong_field_is_named() {
        let bake = api::BakeOptions {
            error: Some(f64::NAN),
            mesh_error: Some(-1.0),
            window: Some(0),
            rays: Some(3),
            rows: 77,
            ..api::BakeOptions::default()
        };
        let output = api::OutputOptions {
            exposure: Some(0.0),
            unit: "x".repeat(201),
            format: 9,
            ..api::OutputOptions::default()
        };
        let scene = api::SceneOptions {
            sky: Some(api::Colour { r: -1.0, g: 0.0, b: 0.0 }),
            weld: Some(f64::INFINITY),
            ..api::SceneOptions::default()
        };
        let header = api::SubmitSceneHeader {
            bake: Some(bake),
            output: Some(output),
            scene: Some(scene),
            ..api::SubmitSceneHeader::default()
        };
        let found = fields(&header);
        for field in [
            "bake.error",
            "bake.mesh_error",
            "bake.window",
            "bake.rays",
            "bake.rows",
            "output.exposure",
            "output.unit",
            "output.format",
            "scene.sky",
            "scene.weld",
        ] {
            assert!(found.iter().any(|name| name == field), "{field} is missing in {found:?}");
        }
    }
}
