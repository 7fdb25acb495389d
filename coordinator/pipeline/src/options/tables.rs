//! The options: each is declared here and as a field of `radiosity.v1`, and nowhere else.

use protocol::api::{self, BakeOptions, OutputOptions, SceneOptions, SubmitSceneHeader};

use bake::{BakeSettings, LightPart, Quality};
use output::export::{ExportSettings, PageFormat};
use scene::ImportOptions;

use super::kind::POSITIVE;
use super::schema::{Choice, Kind, Knob, Options};

/// Any number of 32 bits.
const ANY_32: Kind = Kind::Whole(0..=u32::MAX as i128);

/// Any number of 64 bits.
const ANY_64: Kind = Kind::Whole(0..=u64::MAX as i128);

/// An option: the field of a message by its prefix and name, the setting, the name on the command line, and the values.
macro_rules! knob {
    ($($prefix:literal +)? $field:ident -> $($setting:ident).+, $flag:literal, $kind:expr) => {
        Knob::<Self>::new(
            concat!($($prefix,)? stringify!($field)),
            $flag,
            $kind,
            |m| &mut m.$field,
            |s| &mut s.$($setting).+,
        )
    };
}

const fn choice(name: &'static str, number: i32, help: &'static str) -> Choice {
    Choice { name, aliases: &[], help, number }
}

const ROWS: &[Choice] = &[
    Choice {
        aliases: &["suiting"],
        ..choice("automatic", api::RowsOf::Unspecified as i32, "what is predicted to cost less")
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

const QUALITIES: &[Choice] = &[
    choice("draft", api::Quality::Draft as i32, "draft: to see where light falls, 10 % error"),
    choice("preview", api::Quality::Preview as i32, "preview: to work with, 5 % error"),
    choice("final", api::Quality::Final as i32, "final: to publish, 1 % error, smooth in the dark too"),
];

fn quality(number: f64) -> Quality {
    match api::Quality::try_from(number as i32) {
        Ok(api::Quality::Draft) => Quality::Draft,
        Ok(api::Quality::Final) => Quality::Final,
        _ => Quality::Preview,
    }
}

impl Options for BakeOptions {
    type Settings = BakeSettings;

    /// Those of a preview, unless the options say how exact the bake is.
    fn start(&self) -> BakeSettings {
        let is_said = self.error.is_some() || self.mesh_error.is_some() || self.shooter_edge.is_some();
        if is_said { BakeSettings::default() } else { BakeSettings::for_quality(Quality::default()) }
    }

    const HEADING: &'static str = "Quality";

    const KNOBS: &'static [Knob<Self>] = &[
        // The first two choose settings that those below change.
        knob!("bake." + quality -> quality, "quality", Kind::Choice(QUALITIES))
            .value_name("QUALITY")
            .help("Quality of a picture of the lit scene; chooses error, mesh, rays and threshold")
            .details("Each has an error, and a bound for its contrast, so that streaks do not show in the dark. With --error, --mesh-error or --shooter-edge there is no quality.")
            .label("Quality")
            .default("preview")
            .excludes(&["error", "mesh-error", "shooter-edge"])
            .change(|_, number| BakeSettings::for_quality(quality(number))),
        knob!("bake." + error -> error, "error", Kind::Fraction(1e-4..=0.5))
            .help("Target error, relative L2 of the radiosity; chooses mesh, rays and threshold")
            .details("0.02 is 2 %. The bake refines until its own estimate meets this error.")
            .label("Target error")
            .default("that of --quality")
            .excludes(&["mesh-error", "shooter-edge"])
            .change(|_, error| BakeSettings::for_error(error)),
        knob!("bake." + rows -> rows, "rows", Kind::Choice(ROWS))
            .value_name("STRATEGY")
            .help("How form factors are computed")
            .details("Automatic predicts which cost less: exact rows for few polygons or small errors, else hemisphere rows (gather)."),
        knob!("bake." + max_vertices -> max_vertices, "max-vertices", ANY_64)
            .help("Most vertices of the mesh")
            .default("200000, or twice those of the scene where that is more")
            .label("Maximum vertices"),
        knob!("bake." + max_edge -> max_edge, "max-edge", Kind::Number(POSITIVE))
            .value_name("LENGTH")
            .help("Longest edge of the output's triangles")
            .details("Holds as far as --max-vertices allows.")
            .unit("units of the file")
            .default("none"),
        knob!("bake." + mesh_error -> mesh_error, "mesh-error", Kind::Number(POSITIVE))
            .help("Interpolation error at which refinement ends, relative L2")
            .default("what --quality needs; {} with --shooter-edge")
            .advanced(),
        knob!("bake." + shooter_edge -> shooter_edge, "shooter-edge", Kind::Number(1e-3..=1.0))
            .help("Longest edge of a shooting patch, relative to the scene's extent")
            .default("of --quality; {} with --mesh-error")
            .advanced(),
        knob!("bake." + threshold -> threshold, "threshold", Kind::Number(POSITIVE))
            .help("Unshot part of the reflected flux at which the solution ends")
            .details(
            "The solution ends when rho / (1 - rho) x unshot flux is below this part of the reflected flux.",
        )
            .default("a hundredth of --error; {} with --mesh-error")
            .advanced(),
        knob!("bake." + window -> window, "window", Kind::Whole(1..=u32::MAX as i128))
            .value_name("WINDOW")
            .help("Shots chosen ahead: shot n is chosen from the state after shot n - WINDOW")
            .details("Affects the result; the number of workers does not.")
            .advanced(),
        knob!("bake." + exact_occluders -> exact_occluders, "exact-occluders", ANY_32)
            .help("Most occluders between two patches for exact visibility; with more, rays sample it")
            .advanced(),
        knob!("bake." + rays -> rays_per_hemisphere, "rays", Kind::Whole(4..=262_144))
            .help("Rays per hemisphere where visibility is sampled")
            .default("what --quality needs; {} with --mesh-error")
            .change(|settings, rays| settings.with_rays(rays))
            .advanced(),
        knob!("bake." + form_factor_error -> form_factor_error, "form-factor-error", Kind::Number(0.0..=0.5))
            .help("Relative error allowed in a form factor before occlusion")
            .details("Distant polygons may then be treated as points.")
            .advanced(),
        knob!("bake." + factor_rounding -> factor_rounding, "factor-rounding", Kind::Number(0.0..=1e-3))
            .help("Relative rounding allowed in a form factor, to send fewer bytes")
            .advanced(),
        knob!("bake." + check_points -> validation_samples, "validation-samples", Kind::Whole(0..=1_000_000))
            .aliases(&["check-points"])
            .value_name("SAMPLES")
            .help("Least number of random points at which the error is measured")
            .details("At 0 the error is predicted from the vertices alone.")
            .advanced(),
        knob!("bake." + seed -> seed, "seed", ANY_64)
            .help("Seed of all rays and validation samples")
            .advanced(),
        knob!("bake." + planar_point_lights -> planar_point_lights, "planar-point-lights", Kind::Flag)
            .help("Weight point lights by the cosine of a horizontal plane, not evenly by solid angle")
            .advanced(),
    ];
}

const LIGHT_UNITS: &[Choice] = &[
    choice("candela", api::LightUnit::Candela as i32, "candela and lux, as glTF has it"),
    choice("watt", api::LightUnit::Watt as i32, "watts and W/m^2"),
    choice("blender", api::LightUnit::Blender as i32, "Blender's exporter, lighting mode Standard"),
    choice(
        "blender-unitless",
        api::LightUnit::BlenderUnitless as i32,
        "Blender's exporter, lighting mode Unitless",
    ),
];

impl Options for SceneOptions {
    type Settings = ImportOptions;

    const HEADING: &'static str = "Scene";

    const KNOBS: &'static [Knob<Self>] = &[
        knob!("scene." + scene -> read.scene, "scene", Kind::Text)
            .value_name("INDEX|NAME")
            .help("Scene of the file")
            .details("Lights and meshes of other scenes are ignored.")
            .default("the file's default scene, or its first"),
        knob!("scene." + weld -> weld, "weld", Kind::Number(POSITIVE))
            .value_name("DISTANCE")
            .help("Merge vertices closer than this, to close gaps between triangles")
            .details("Each corner keeps its normal and texture coordinates.")
            .unit("units of the file")
            .default("none"),
        knob!("scene." + sky -> sky, "sky", Kind::Colour)
            .value_name("R,G,B")
            .help("Radiance of a uniform sky, in nit (or W/(m^2 sr) beside lights in watts)")
            .details(
                "The sky surrounds the scene on all sides, below the horizon too. An unoccluded surface receives pi times \
                 its radiance.",
            )
            .default("black"),
        knob!("scene." + light_unit -> light_unit, "light-unit", Kind::Choice(LIGHT_UNITS))
            .value_name("UNIT")
            .help("Unit of the intensities of point, spot and directional lights")
            .details(
            "With candela they are candela and lux, taken as they are; the output is in lux. With watt they are radiant watts \
             of point and spot lights, divided by 4 pi, and W/m^2 of directional ones. With blender they are watts that the \
             exporter multiplied by 683 lm/W, and are divided by that. Without this option they are taken as \
             with candela, but the output is labelled W/m^2. Emissive materials and --sky are never converted. In a file that \
             mixes units, multiply watts by 683 lm/W.",
        )
            .label("Light units")
            .default("as in the file, output in W/m^2"),
    ];
}

const DOMAINS: &[Choice] = &[
    choice("vertex", api::Domain::Vertex as i32, "share identical vertices"),
    choice("corner", api::Domain::Corner as i32, "three vertices per triangle"),
];

const PARTS: &[Choice] = &[
    choice("direct", api::Part::Direct as i32, "light straight from sources"),
    choice("indirect", api::Part::Indirect as i32, "light reflected by surfaces"),
    choice("all", api::Part::All as i32, "both"),
];

const MATERIALS: &[Choice] = &[
    choice("unlit", api::Materials::Unlit as i32, "they show the light of the bake alone"),
    choice("keep", api::Materials::Keep as i32, "they stay, and so does COLOR_0"),
];

const COMPRESSIONS: &[Choice] = &[
    choice("input", api::Compression::Unspecified as i32, "as the input: meshopt where it is, else none"),
    choice("none", api::Compression::None as i32, "vertices and indices as they are"),
    choice(
        "meshopt",
        api::Compression::Meshopt as i32,
        "EXT_meshopt_compression, a third of the size or less",
    ),
];

const PAGE_FORMATS: &[Choice] = &[
    choice("png", api::LightmapFormat::Png as i32, "PNG of eight bits with the curve of sRGB"),
    choice("rgbm", api::LightmapFormat::Rgbm as i32, "PNG of eight bits, linear, with a multiplier in alpha"),
    choice("exr", api::LightmapFormat::Exr as i32, "PNG, and OpenEXR of half floats beside the output"),
    choice("ktx2", api::LightmapFormat::Ktx2 as i32, "PNG, and KTX2 of BC6H blocks beside the output"),
];

/// The settings of the output that have an option of their own.
#[derive(Debug, Clone, Default)]
pub struct OutputSettings {
    /// Whether a lightmap is written.
    pub lightmap: bool,
    /// Edge of its texels, units of the file.
    pub texel_size: Option<f64>,
    /// Width of its one page.
    pub lightmap_size: Option<u32>,
    /// Format of its pages.
    pub lightmap_format: PageFormat,
    /// Distance of probes, units of the file.
    pub probes: Option<f64>,
    /// Distance within which things occlude, units of the file.
    pub occlusion: Option<f64>,
    /// The part of the light.
    pub only: LightPart,
    /// How the lit file is written.
    pub export: ExportSettings,
}

impl Options for OutputOptions {
    type Settings = OutputSettings;

    const HEADING: &'static str = "Output";

    const KNOBS: &'static [Knob<Self>] = &[
        knob!("output." + exposure -> export.exposure, "exposure", Kind::Number(POSITIVE))
            .help("COLOR_0 per unit of irradiance")
            .default("clips 5 % of the surface"),
        knob!("output." + unit -> export.unit, "unit", Kind::Text)
            .help("Unit of the irradiance, written to the output")
            .default("{}; lx with --light-unit candela"),
        knob!("output." + domain -> export.domain, "output-domain", Kind::Choice(DOMAINS))
            .help("Vertex sharing in the output: identical vertices, or none")
            .details("Three vertices per triangle keep creases in tools that edit the corners of faces."),
        knob!("output." + only -> only, "only", Kind::Choice(PARTS))
            .value_name("PART")
            .help("Part of the light in the output")
            .default("{}; indirect with --materials keep"),
        knob!("output." + materials -> export.materials, "materials", Kind::Choice(MATERIALS))
            .value_name("CHOICE")
            .help("What becomes of the input's materials and vertex colours")
            .details(
                "With keep, light is in _IRRADIANCE alone, for viewers that add it to their own, such as three.js with the \
                 plugin of coordinator/three. --only is then indirect, since lamps stay lamps.",
            ),
        knob!("output." + compression -> export.compression, "compress", Kind::Choice(COMPRESSIONS))
            .value_name("CODEC")
            .help("Compression of vertices and indices in .glb and .gltf")
            .details(
                "With meshopt, light keeps 0.1 % and positions a 16,000th of their mesh. three.js needs its decoder; Blender does \
                 not read it.",
            ),
        knob!("output." + lightmap -> lightmap, "lightmap", Kind::Flag)
            .help("Write the light as a lightmap, on the input's own meshes and materials")
            .details(
                "Materials name it by MOZ_lightmap; texel x intensity is the irradiance. The input's second set of texture \
                 coordinates is used where it has no overlaps and enough room between charts.",
            ),
        knob!("output." + texel_size -> texel_size, "texel-size", Kind::Number(POSITIVE))
            .value_name("LENGTH")
            .help("Edge of the lightmap's texels")
            .unit("units of the file")
            .default("what --lightmap-size allows")
            .excludes(&["lightmap-size"]),
        knob!("output." + lightmap_size -> lightmap_size, "lightmap-size", Kind::Whole(16..=4096))
            .value_name("PIXELS")
            .help("Width and largest height of the lightmap's one page, in pixels")
            .default("1024 without --texel-size"),
        knob!("output." + lightmap_format -> lightmap_format, "lightmap-format", Kind::Choice(PAGE_FORMATS))
            .value_name("FORMAT")
            .help("Format of the lightmap's pages"),
        knob!("output." + probes -> probes, "probes", Kind::Number(POSITIVE))
            .value_name("SPACING")
            .help("Also write light probes on a grid inside the scene, so far apart")
            .details(
                "Each has spherical harmonics of order 2 of the light at its place, for things that move, and a flag if it lies \
                 inside of a wall. They are in the extras of the file, and in NAME-probes.json beside it where there is no service.",
            )
            .unit("units of the file")
            .default("none"),
        knob!("output." + occlusion -> occlusion, "occlusion", Kind::Number(POSITIVE))
            .value_name("DISTANCE")
            .help("Also write ambient occlusion, by what stands nearer than this")
            .details(
                "_OCCLUSION is the part of each vertex's hemisphere, weighted by the cosine, in which nothing stands nearer: 1 in the \
                 open. Not for lightmaps.",
            )
            .unit("units of the file")
            .default("none"),
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
        knob!(name -> name, "name", Kind::Text).help("Name of the job").default("the file's name"),
        knob!(priority -> priority, "priority", Kind::Whole(-100..=100))
            .help("Jobs of higher priority begin first, from -100 to 100")
            .label("Priority")
            .default("0"),
        knob!(idempotency_key -> key, "key", Kind::Text)
            .value_name("WORD")
            .help("Idempotency key: the same key again returns the same job")
            .details("Submitting again is then safe when the first answer was lost.")
            .default("none"),
    ];
}
