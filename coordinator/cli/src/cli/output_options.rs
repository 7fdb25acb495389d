use bake::BakeSettings;
use clap::{Args, ValueEnum};
use output::export::ExportSettings;
use pipeline::options::{Violations, export_settings, irradiance_unit, light_parts};
use protocol::api;

use super::knobs::positive;

/// What comes out of a bake.
#[derive(Args)]
pub struct OutputOptions {
    /// COLOR_0 per unit of irradiance [default: one at which 5 % of the surface is clipped].
    #[arg(long, value_parser = positive)]
    exposure: Option<f64>,
    /// Unit of the irradiance, as the scene's lights mean it; written to the output [default: W/m^2, or lx with --light-unit
    /// candela].
    #[arg(long)]
    unit: Option<String>,
    /// Which vertices the triangles of the output share: those that are the same in everything, or none, so that tools which work on
    /// the corners of faces keep creases.
    #[arg(long, value_enum, default_value_t = OutputDomain::Vertex)]
    output_domain: OutputDomain,
    /// Which part of the light the output has: what comes straight from lights, what surfaces have reflected, or both.
    #[arg(long, value_enum, default_value_t = Only::All)]
    only: Only,
    /// Write the light of these sources by itself as well, as the attribute _IRRADIANCE_NAME. Lights are named by their node;
    /// emissive surfaces by their node or material; the sky is `sky`. May be given several times.
    #[arg(long = "group", value_name = "NAME=LIGHT,LIGHT", value_parser = group)]
    groups: Vec<api::LightGroup>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Only {
    /// Light without a reflection.
    Direct,
    /// Light after a reflection or more.
    Indirect,
    /// Both.
    All,
}

#[derive(Clone, Copy, ValueEnum)]
enum OutputDomain {
    /// Shared vertices.
    Vertex,
    /// Three vertices to each triangle.
    Corner,
}

impl OutputOptions {
    /// The flags as a service is told of them, with the format that the output's name says.
    pub fn options(&self, format: api::Format) -> api::OutputOptions {
        api::OutputOptions {
            format: format.into(),
            exposure: self.exposure,
            unit: self.unit.clone().unwrap_or_default(),
            domain: match self.output_domain {
                OutputDomain::Vertex => api::Domain::Vertex,
                OutputDomain::Corner => api::Domain::Corner,
            }
            .into(),
            only: match self.only {
                Only::All => api::Part::All,
                Only::Direct => api::Part::Direct,
                Only::Indirect => api::Part::Indirect,
            }
            .into(),
            groups: self.groups.clone(),
        }
    }

    /// The settings that the flags ask for, beside these of the bake: those that a service would take them for.
    pub fn settings(
        &self,
        scene: &api::SceneOptions,
        bake: BakeSettings,
    ) -> anyhow::Result<(BakeSettings, ExportSettings)> {
        let mut wrong = Violations::default();
        let options = self.options(api::Format::Unspecified);
        let (only, groups) = light_parts(&options, &mut wrong);
        let export = export_settings(&options, irradiance_unit(scene), &mut wrong);
        wrong.check()?;
        Ok((BakeSettings { only, groups, ..bake }, export))
    }
}

/// `NAME=LIGHT,LIGHT`.
fn group(text: &str) -> Result<api::LightGroup, String> {
    let (name, lights) = text.split_once('=').ok_or("not NAME=LIGHT,LIGHT")?;
    let lights: Vec<String> = lights.split(',').map(|light| light.trim().to_owned()).collect();
    if name.trim().is_empty() || lights.iter().any(String::is_empty) {
        return Err("neither the group's name nor that of a light may be empty".into());
    }
    Ok(api::LightGroup { name: name.trim().to_owned(), lights })
}
