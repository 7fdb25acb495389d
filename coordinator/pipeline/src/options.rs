//! What the options of the API mean: each is checked and becomes what import, bake and export take. The command line goes this way
//! too, so a bake by the service has the settings of the same bake by `solve`.

use std::ops::RangeInclusive;

use glam::DVec3;
use protocol::api;

use bake::{BakeSettings, LightChange, LightGroup, LightPart, NewLight, RowStrategy};
use output::export::{Domain, ExportSettings, check_group_names};
use scene::{ImportOptions, LightUnit, ReadOptions};

/// Longest text of a client: names, units, keys.
pub const LONGEST_TEXT: usize = 200;

/// Most groups of lights, and most names in all of them.
pub const MOST_NAMES: usize = 1000;

/// Most violations that are told: an error must fit into the head of an answer.
const MOST_VIOLATIONS: usize = 20;

/// Most validation samples of a bake.
const MOST_VALIDATION_SAMPLES: u64 = 1_000_000;

/// A field of a request that is wrong.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// The field, as `bake.error`.
    pub field: String,
    /// What it should be.
    pub should: String,
}

impl Violation {
    /// A field that is wrong.
    pub fn new(field: impl Into<String>, should: impl Into<String>) -> Self {
        Self { field: field.into(), should: should.into() }
    }
}

/// Options that are wrong, each with what it should be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{}", sentences(.0))]
pub struct InvalidOptions(pub Vec<Violation>);

fn sentences(violations: &[Violation]) -> String {
    let sentence = |violation: &Violation| format!("{} {}", violation.field, violation.should);
    violations.iter().map(sentence).collect::<Vec<_>>().join("; ")
}

/// Fields that are wrong, as they are found.
#[derive(Debug, Default)]
pub struct Violations(Vec<Violation>);

impl Violations {
    /// Nothing, or all that is wrong.
    ///
    /// # Errors
    /// When something is wrong.
    pub fn check(self) -> Result<(), InvalidOptions> {
        if self.0.is_empty() { Ok(()) } else { Err(InvalidOptions(self.0)) }
    }

    /// Notes that a field is not as it should be.
    pub fn demand(&mut self, holds: bool, field: &str, should: impl Into<String>) {
        let violation = (!holds).then(|| Violation::new(field, should));
        self.0.extend(violation.filter(|new| self.0.len() < MOST_VIOLATIONS && !self.0.contains(new)));
    }

    fn in_range(&mut self, value: Option<f64>, range: RangeInclusive<f64>, field: &str) {
        let should = format!("must be a number from {} to {}", range.start(), range.end());
        self.demand(value.is_none_or(|value| range.contains(&value)), field, should);
    }

    fn positive(&mut self, value: Option<f64>, field: &str) {
        let holds = value.is_none_or(|value| value > 0.0 && value.is_finite());
        self.demand(holds, field, "must be a positive number");
    }

    /// Notes that a text is too long.
    pub fn short(&mut self, text: &str, field: &str) {
        let holds = text.chars().count() <= LONGEST_TEXT && !text.contains(char::is_control);
        self.demand(
            holds,
            field,
            format!("must have {LONGEST_TEXT} characters at most, all of them printable"),
        );
    }

    fn colour(&mut self, colour: Option<api::Colour>, field: &str) -> Option<DVec3> {
        let colour = colour.map(|colour| DVec3::new(colour.r, colour.g, colour.b));
        let is_right = |colour: DVec3| colour.is_finite() && colour.min_element() >= 0.0;
        self.demand(colour.is_none_or(is_right), field, "must be three numbers that are not negative");
        colour
    }
}

/// How a scene's file is read.
pub fn import_options(options: &api::SceneOptions, wrong: &mut Violations) -> ImportOptions {
    wrong.short(&options.scene, "scene.scene");
    wrong.positive(options.weld, "scene.weld");
    let light_unit = match api::LightUnit::try_from(options.light_unit) {
        Ok(api::LightUnit::Watt) => LightUnit::Watt,
        Ok(api::LightUnit::Candela | api::LightUnit::Unspecified) => LightUnit::Candela,
        Err(_) => {
            wrong.demand(false, "scene.light_unit", "is none that this service knows");
            LightUnit::Candela
        }
    };
    ImportOptions {
        read: ReadOptions {
            scene: (!options.scene.is_empty()).then(|| options.scene.clone()),
            ..ReadOptions::default()
        },
        weld: options.weld,
        light_unit,
        sky: wrong.colour(options.sky, "scene.sky").unwrap_or(DVec3::ZERO),
        ..ImportOptions::default()
    }
}

/// Unit of the irradiance that comes of it, for the output. Where it is not said what the numbers of lights mean, they may mean
/// anything: W/m^2 is what the output has always said.
#[must_use]
pub fn irradiance_unit(options: &api::SceneOptions) -> &'static str {
    match options.light_unit() {
        api::LightUnit::Candela => "lx",
        api::LightUnit::Watt | api::LightUnit::Unspecified => "W/m^2",
    }
}

/// How exactly a scene is baked.
pub fn bake_settings(options: &api::BakeOptions, wrong: &mut Violations) -> BakeSettings {
    wrong.in_range(options.error, 1e-4..=0.5, "bake.error");
    let is_alone = options.error.is_none() || options.mesh_error.or(options.shooter_edge).is_none();
    wrong.demand(is_alone, "bake.error", "excludes bake.mesh_error and bake.shooter_edge: it chooses them");
    wrong.positive(options.mesh_error, "bake.mesh_error");
    wrong.in_range(options.shooter_edge, 1e-3..=1.0, "bake.shooter_edge");
    wrong.positive(options.max_edge, "bake.max_edge");
    wrong.positive(options.threshold, "bake.threshold");
    wrong.demand(options.window != Some(0), "bake.window", "must be a whole number from 1");
    let rays = options.rays.is_none_or(|rays| (4..=262_144).contains(&rays));
    wrong.demand(rays, "bake.rays", "must be a whole number from 4 to 262144");
    wrong.in_range(options.form_factor_error, 0.0..=0.5, "bake.form_factor_error");
    wrong.in_range(options.factor_rounding, 0.0..=1e-3, "bake.factor_rounding");
    let points = options.check_points.is_none_or(|points| points <= MOST_VALIDATION_SAMPLES);
    wrong.demand(points, "bake.check_points", format!("must be {MOST_VALIDATION_SAMPLES} at most"));
    let rows = match api::RowsOf::try_from(options.rows) {
        Ok(api::RowsOf::Shooters) => RowStrategy::Exact,
        Ok(api::RowsOf::Receivers) => RowStrategy::Gather,
        Ok(api::RowsOf::Unspecified) => RowStrategy::Automatic,
        Err(_) => {
            wrong.demand(false, "bake.rows", "are of none that this service knows");
            RowStrategy::Automatic
        }
    };
    let default = BakeSettings::default();
    let picked = match options.error {
        Some(error) => BakeSettings::for_error(error),
        None => BakeSettings {
            shooter_edge: options.shooter_edge.unwrap_or(default.shooter_edge),
            mesh_error: options.mesh_error.unwrap_or(default.mesh_error),
            ..default.clone()
        },
    };
    let picked = match options.rays {
        Some(rays) => picked.with_rays(f64::from(rays)),
        None => picked,
    };
    let whole = |number: Option<u64>, default| match number {
        Some(number) => usize::try_from(number).unwrap_or(usize::MAX),
        None => default,
    };
    BakeSettings {
        threshold: options.threshold.unwrap_or(picked.threshold),
        form_factor_error: options.form_factor_error.unwrap_or(default.form_factor_error),
        factor_rounding: options.factor_rounding.unwrap_or(default.factor_rounding),
        max_edge: options.max_edge,
        max_vertices: whole(options.max_vertices, default.max_vertices),
        rows,
        window: whole(options.window.map(u64::from), default.window),
        exact_occluders: options.exact_occluders.unwrap_or(default.exact_occluders),
        validation_samples: whole(options.check_points, default.validation_samples),
        seed: options.seed.unwrap_or(default.seed),
        planar_point_lights: options.planar_point_lights,
        ..picked
    }
}

/// Which part of the light is wanted, and which groups of its sources by themselves.
pub fn light_parts(options: &api::OutputOptions, wrong: &mut Violations) -> (LightPart, Vec<LightGroup>) {
    let only = match api::Part::try_from(options.only) {
        Ok(api::Part::Direct) => LightPart::Direct,
        Ok(api::Part::Indirect) => LightPart::Indirect,
        Ok(api::Part::All | api::Part::Unspecified) => LightPart::All,
        Err(_) => {
            wrong.demand(false, "output.only", "is no part that this service knows");
            LightPart::All
        }
    };
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
    wrong.positive(options.exposure, "output.exposure");
    wrong.short(&options.unit, "output.unit");
    let is_known = api::Format::try_from(options.format).is_ok();
    wrong.demand(is_known, "output.format", "is none that this service knows");
    let domain = match api::Domain::try_from(options.domain) {
        Ok(api::Domain::Corner) => Domain::Corner,
        Ok(api::Domain::Vertex | api::Domain::Unspecified) => Domain::Vertex,
        Err(_) => {
            wrong.demand(false, "output.domain", "is none that this service knows");
            Domain::Vertex
        }
    };
    ExportSettings {
        exposure: options.exposure,
        unit: if options.unit.is_empty() { default_unit.to_owned() } else { options.unit.clone() },
        domain,
        ..ExportSettings::default()
    }
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
}

/// What the options of a submission ask for.
pub fn wanted(header: &api::SubmitSceneHeader, wrong: &mut Violations) -> Wanted {
    let scene = header.scene.clone().unwrap_or_default();
    let output = header.output.clone().unwrap_or_default();
    let (only, groups) = light_parts(&output, wrong);
    let bake = bake_settings(&header.bake.unwrap_or_default(), wrong);
    Wanted {
        import: import_options(&scene, wrong),
        bake: BakeSettings { only, groups, ..bake },
        export: export_settings(&output, irradiance_unit(&scene), wrong),
    }
}

#[cfg(test)]
mod tests {
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
        assert_eq!(wanted.bake, BakeSettings::default());
        assert_eq!(wanted.export.unit, "W/m^2");
        assert!(wrong.check().is_ok());
    }

    #[test]
    fn no_more_is_told_than_an_answer_has_room_for() {
        let mut wrong = Violations::default();
        for index in 0..100 {
            wrong.demand(false, "same", "must be so");
            wrong.demand(false, &format!("field{index}"), "must be so");
        }
        let Err(InvalidOptions(told)) = wrong.check() else { panic!("nothing is wrong") };
        assert_eq!(told.len(), MOST_VIOLATIONS);
        assert_eq!(told.iter().filter(|violation| violation.field == "same").count(), 1);
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
