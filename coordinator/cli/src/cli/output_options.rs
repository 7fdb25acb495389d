use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bake::BakeSettings;
use clap::Args;
use output::export::ExportSettings;
use pipeline::lightmap_run::LightmapSettings;
use pipeline::options::{
    Violations, export_settings, irradiance_unit, light_parts, lightmap_settings, occlusion_distance,
    probe_places,
};
use probes::Places;
use protocol::api;

use super::options::Given;

/// What comes out of a bake.
#[derive(Args)]
pub struct OutputOptions {
    #[command(flatten)]
    given: Given<api::OutputOptions>,
    /// Also write the light of these sources, as attribute _IRRADIANCE_NAME (repeatable)
    ///
    /// Lights are named by their node, emissive surfaces by their node or material; the sky is `sky`.
    #[arg(long = "group", value_name = "NAME=LIGHT,LIGHT", value_parser = group, help_heading = "Output")]
    groups: Vec<api::LightGroup>,
    /// Write light probes at the points of this file: x, y and z on each line, in units of the file
    #[arg(long, value_name = "FILE", value_parser = points, help_heading = "Output", conflicts_with = "output.probes")]
    probe_points: Option<Arc<ProbePoints>>,
}

/// Points of a file.
struct ProbePoints {
    path: PathBuf,
    /// One coordinate after another.
    coordinates: Vec<f64>,
}

impl OutputOptions {
    /// The file with the points of probes.
    pub fn probe_points_path(&self) -> Option<&Path> {
        self.probe_points.as_ref().map(|points| &*points.path)
    }

    /// The options as a message, with the format of the output.
    pub fn options(&self, format: api::Format) -> api::OutputOptions {
        let probe_points =
            self.probe_points.as_ref().map_or_else(Vec::new, |points| points.coordinates.clone());
        let groups = self.groups.clone();
        api::OutputOptions { format: format.into(), groups, probe_points, ..self.given.0.clone() }
    }

    /// The settings that the options ask for, added to those of the bake.
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

    /// The lightmap that the options ask for.
    pub fn lightmap(&self) -> anyhow::Result<Option<LightmapSettings>> {
        self.checked(lightmap_settings)
    }

    /// The distance within which things occlude, if the options ask for ambient occlusion.
    pub fn occlusion(&self) -> anyhow::Result<Option<f64>> {
        self.checked(occlusion_distance)
    }

    /// The probes that the options ask for.
    pub fn probes(&self) -> anyhow::Result<Option<Places>> {
        self.checked(probe_places)
    }

    /// What is read from the options, unless something is wrong with it.
    fn checked<T>(&self, read: impl Fn(&api::OutputOptions, &mut Violations) -> T) -> anyhow::Result<T> {
        let mut wrong = Violations::default();
        let found = read(&self.options(api::Format::Unspecified), &mut wrong);
        wrong.check()?;
        Ok(found)
    }
}

/// The points of a file.
fn points(path: &str) -> Result<Arc<ProbePoints>, String> {
    let text = fs::read_to_string(path).map_err(|error| error.to_string())?;
    let mut points = vec![];
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let words = line.split([',', ' ', '\t']).filter(|word| !word.is_empty());
        let numbers: Option<Vec<f64>> =
            words.map(|word| word.parse().ok().filter(|value: &f64| value.is_finite())).collect();
        let numbers = numbers.filter(|numbers| numbers.len() == 3);
        points.extend(numbers.ok_or_else(|| format!("line {}: must be three numbers", number + 1))?);
    }
    if points.is_empty() {
        return Err("it has no points".into());
    }
    Ok(Arc::new(ProbePoints { path: path.into(), coordinates: points }))
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
