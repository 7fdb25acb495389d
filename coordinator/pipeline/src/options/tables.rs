//! The options: each is declared here and as a field of `radiosity.v1`, and nowhere else.

use protocol::api::{self, BakeOptions, OutputOptions, SceneOptions, SubmitSceneHeader};

use bake::{BakeSettings, LightPart};
use output::export::ExportSettings;
use scene::ImportOptions;

use super::kind::POSITIVE;
use super::schema::{Choice, Kind, Knob, Options};

/// Any number of 32 bits.
const ANY_32: Kind = Kind::Whole(0..=u32::MAX as i128);

/// Any number of 64 bits.
const ANY_64: Kind = Kind::Whole(0..=u64::MAX as i128);

const fn choice(name: &'static str, number: i32, help: &'static str) -> Choice {
    Choice { name, aliases: &[], help, number }
}

const ROWS: &[Choice] = &[
    Choice {
        aliases: &["suiting"],
        ..choice("automatic", api::RowsOf::Unspecified as i32, "gather for dense meshes, else exact")
    },
    Choice {
        aliases: &["shooters"],
        ..choice("exact", api::RowsOf::Shooters as i32, "exact visibility for every pair")
    },
    Choice {
        aliases: &["receivers"],
        ..choice(
            "gather",
            api::RowsOf::Receivers as i32,
            "rays over each receiver's hemisphere; scales to dense meshes",
        )
    },
];

impl Options for BakeOptions {
    type Settings = BakeSettings;

    const HEADING: &'static str = "Quality";

    const KNOBS: &'static [Knob<Self>] = &[
        // First: it chooses settings that those below change.
        Knob::<Self>::new(
            "bake.error",
            "error",
            Kind::Fraction(1e-4..=0.5),
            |m| &mut m.error,
            |s| &mut s.error,
        )
        .help("Target error, relative L2 of the radiosity; chooses mesh, rays and threshold")
        .details("0.02 is 2 %. The bake refines until its own estimate meets this error.")
        .label("Target error")
        .default("none: the options below decide")
        .excludes(&["mesh-error", "shooter-edge"])
        .change(|_, error| BakeSettings::for_error(error)),
        Knob::<Self>::new("bake.rows", "rows", Kind::Choice(ROWS), |m| &mut m.rows, |s| &mut s.rows)
            .value_name("STRATEGY")
            .help("How form factors are computed")
            .details("Automatic takes hemisphere rows (gather) for dense meshes, and exact rows for others."),
        Knob::<Self>::new(
            "bake.max_vertices",
            "max-vertices",
            ANY_64,
            |m| &mut m.max_vertices,
            |s| &mut s.max_vertices,
        )
        .help("Number of vertices at which refinement ends")
        .label("Vertex limit"),
        Knob::<Self>::new(
            "bake.max_edge",
            "max-edge",
            Kind::Number(POSITIVE),
            |m| &mut m.max_edge,
            |s| &mut s.max_edge,
        )
        .value_name("LENGTH")
        .help("Longest edge of the output's triangles")
        .details("Holds as far as --max-vertices allows.")
        .unit("units of the file")
        .default("none"),
        Knob::<Self>::new(
            "bake.mesh_error",
            "mesh-error",
            Kind::Number(POSITIVE),
            |m| &mut m.mesh_error,
            |s| &mut s.mesh_error,
        )
        .help("Interpolation error at which refinement ends, relative L2")
        .advanced(),
        Knob::<Self>::new(
            "bake.shooter_edge",
            "shooter-edge",
            Kind::Number(1e-3..=1.0),
            |m| &mut m.shooter_edge,
            |s| &mut s.shooter_edge,
        )
        .help("Longest edge of a shooting patch, relative to the scene's extent")
        .advanced(),
        Knob::<Self>::new(
            "bake.threshold",
            "threshold",
            Kind::Number(POSITIVE),
            |m| &mut m.threshold,
            |s| &mut s.threshold,
        )
        .help("Unshot part of the reflected flux at which the solution ends")
        .details(
            "The solution ends when rho / (1 - rho) x unshot flux is below this part of the reflected flux.",
        )
        .default("{}; a hundredth of --error")
        .advanced(),
        Knob::<Self>::new(
            "bake.window",
            "window",
            Kind::Whole(1..=u32::MAX as i128),
            |m| &mut m.window,
            |s| &mut s.window,
        )
        .help("Shots chosen ahead: shot n is chosen from the state after shot n - WINDOW")
        .details("Affects the result; the number of workers does not.")
        .advanced(),
        Knob::<Self>::new(
            "bake.exact_occluders",
            "exact-occluders",
            ANY_32,
            |m| &mut m.exact_occluders,
            |s| &mut s.exact_occluders,
        )
        .help("Most occluders between two patches for exact visibility; with more, rays sample it")
        .advanced(),
        Knob::<Self>::new(
            "bake.rays",
            "rays",
            Kind::Whole(4..=262_144),
            |m| &mut m.rays,
            |s| &mut s.rays_per_hemisphere,
        )
        .help("Rays per hemisphere where visibility is sampled")
        .default("{}; what --error needs")
        .change(|settings, rays| settings.with_rays(rays))
        .advanced(),
        Knob::<Self>::new(
            "bake.form_factor_error",
            "form-factor-error",
            Kind::Number(0.0..=0.5),
            |m| &mut m.form_factor_error,
            |s| &mut s.form_factor_error,
        )
        .help("Relative error allowed in a form factor before occlusion")
        .details("Distant polygons may then be treated as points.")
        .advanced(),
        Knob::<Self>::new(
            "bake.factor_rounding",
            "factor-rounding",
            Kind::Number(0.0..=1e-3),
            |m| &mut m.factor_rounding,
            |s| &mut s.factor_rounding,
        )
        .help("Relative rounding allowed in a form factor, to send fewer bytes")
        .advanced(),
        Knob::<Self>::new(
            "bake.check_points",
            "validation-samples",
            Kind::Whole(0..=1_000_000),
            |m| &mut m.check_points,
            |s| &mut s.validation_samples,
        )
        .aliases(&["check-points"])
        .value_name("SAMPLES")
        .help("Least number of random points at which the error is measured")
        .details("At 0 the error is predicted from the vertices alone.")
        .advanced(),
        Knob::<Self>::new("bake.seed", "seed", ANY_64, |m| &mut m.seed, |s| &mut s.seed)
            .help("Seed of all rays and validation samples")
            .advanced(),
        Knob::<Self>::new(
            "bake.planar_point_lights",
            "planar-point-lights",
            Kind::Flag,
            |m| &mut m.planar_point_lights,
            |s| &mut s.planar_point_lights,
        )
        .help("Weight point lights by the cosine of a horizontal plane, not evenly by solid angle")
        .advanced(),
    ];
}

const LIGHT_UNITS: &[Choice] = &[
    choice("candela", api::LightUnit::Candela as i32, "candela and lux, as glTF has it"),
    choice("watt", api::LightUnit::Watt as i32, "watts and W/m^2"),
];

impl Options for SceneOptions {
    type Settings = ImportOptions;

    const HEADING: &'static str = "Scene";

    const KNOBS: &'static [Knob<Self>] = &[
        Knob::<Self>::new("scene.scene", "scene", Kind::Text, |m| &mut m.scene, |s| &mut s.read.scene)
            .value_name("INDEX|NAME")
            .help("Scene of the file")
            .details("Lights and meshes of other scenes are ignored.")
            .default("the file's default scene, or its first"),
        Knob::<Self>::new("scene.weld", "weld", Kind::Number(POSITIVE), |m| &mut m.weld, |s| &mut s.weld)
            .value_name("DISTANCE")
            .help("Merge vertices closer than this, to close gaps between triangles")
            .details("Each corner keeps its normal and texture coordinates.")
            .unit("units of the file")
            .default("none"),
        Knob::<Self>::new("scene.sky", "sky", Kind::Colour, |m| &mut m.sky, |s| &mut s.sky)
            .value_name("R,G,B")
            .help("Radiance of a uniform sky, in nit (or W/(m^2 sr) beside lights in watts)")
            .details(
                "The sky surrounds the scene on all sides, below the horizon too. An unoccluded surface receives pi times \
                 its radiance.",
            )
            .default("black"),
        Knob::<Self>::new(
            "scene.light_unit",
            "light-unit",
            Kind::Choice(LIGHT_UNITS),
            |m| &mut m.light_unit,
            |s| &mut s.light_unit,
        )
        .value_name("UNIT")
        .help("Unit of the intensities of point, spot and directional lights")
        .details(
            "With candela they are candela and lux, taken as they are; the output is in lux. With watt they are radiant watts \
             of point and spot lights, divided by 4 pi, and W/m^2 of directional ones. Without this option they are taken as \
             with candela, but the output is labelled W/m^2. Emissive materials and --sky are never converted. In a file that \
             mixes units, multiply watts by 683 lm/W.",
        )
        .label("Light units")
        .default("as in the file, output in W/m^2"),
    ];
}

/// The settings of the output that have an option of their own.
#[derive(Debug, Clone, Default)]
pub struct OutputSettings {
    /// The part of the light.
    pub only: LightPart,
    /// How the lit file is written.
    pub export: ExportSettings,
}

impl Options for OutputOptions {
    type Settings = OutputSettings;

    const HEADING: &'static str = "Output";

    const KNOBS: &'static [Knob<Self>] = &[
        Knob::<Self>::new(
            "output.exposure",
            "exposure",
            Kind::Number(POSITIVE),
            |m| &mut m.exposure,
            |s| &mut s.export.exposure,
        )
        .help("COLOR_0 per unit of irradiance")
        .default("clips 5 % of the surface"),
        Knob::<Self>::new("output.unit", "unit", Kind::Text, |m| &mut m.unit, |s| &mut s.export.unit)
            .help("Unit of the irradiance, written to the output")
            .default("{}; lx with --light-unit candela"),
        Knob::<Self>::new(
            "output.domain",
            "output-domain",
            Kind::Choice(&[
                choice("vertex", api::Domain::Vertex as i32, "share identical vertices"),
                choice("corner", api::Domain::Corner as i32, "three vertices per triangle"),
            ]),
            |m| &mut m.domain,
            |s| &mut s.export.domain,
        )
        .help("Vertex sharing in the output: identical vertices, or none")
        .details("Three vertices per triangle keep creases in tools that edit the corners of faces."),
        Knob::<Self>::new(
            "output.only",
            "only",
            Kind::Choice(&[
                choice("direct", api::Part::Direct as i32, "light straight from sources"),
                choice("indirect", api::Part::Indirect as i32, "light reflected by surfaces"),
                choice("all", api::Part::All as i32, "both"),
            ]),
            |m| &mut m.only,
            |s| &mut s.only,
        )
        .value_name("PART")
        .help("Part of the light in the output"),
    ];
}

/// The settings of a job.
#[derive(Debug, Clone, Default)]
pub struct JobSettings {
    /// Name that the client gave it.
    pub name: String,
    /// Jobs of higher priority begin first.
    pub priority: i32,
    /// Makes a submission idempotent.
    pub key: String,
}

impl Options for SubmitSceneHeader {
    type Settings = JobSettings;

    const HEADING: &'static str = "Job";

    const KNOBS: &'static [Knob<Self>] = &[
        Knob::<Self>::new("name", "name", Kind::Text, |m| &mut m.name, |s| &mut s.name)
            .help("Name of the job")
            .default("the file's name"),
        Knob::<Self>::new(
            "priority",
            "priority",
            Kind::Whole(-100..=100),
            |m| &mut m.priority,
            |s| &mut s.priority,
        )
        .help("Jobs of higher priority begin first, from -100 to 100")
        .label("Priority")
        .default("0"),
        Knob::<Self>::new("idempotency_key", "key", Kind::Text, |m| &mut m.idempotency_key, |s| &mut s.key)
            .value_name("WORD")
            .help("Idempotency key: the same key again returns the same job")
            .details("Submitting again is then safe when the first answer was lost.")
            .default("none"),
    ];
}
