use clap::{Args, ValueEnum};
use glam::DVec3;
use pipeline::options::{Violations, import_options};
use protocol::api;
use scene::ImportOptions;

use super::knobs::positive;

/// How the scene's file is read.
#[derive(Args)]
pub struct SceneOptions {
    /// Scene of the file that is meant, where it has several. Lights and meshes of the others play no part
    /// [default: the file's default scene, or its first].
    #[arg(id = "scene_choice", long = "scene", value_name = "INDEX|NAME")]
    scene: Option<String>,
    /// Make vertices that are closer than this one, in the file's units: for meshes with gaps between their triangles. Normals
    /// and texture coordinates stay those of each corner.
    #[arg(long, value_name = "DISTANCE", value_parser = positive)]
    weld: Option<f64>,
    /// Radiance of a sky, the same from all directions, below the horizon too, where no ground hides it. In the unit of the
    /// scene's light: nit (cd/m^2) beside lights in candela and lux, W/(m^2 sr) beside watts. A free surface gets pi times it.
    #[arg(long, value_name = "R,G,B", value_parser = radiance)]
    sky: Option<DVec3>,
    /// What the numbers of the file's point, spot and directional lights mean. Candela, as glTF has it: candela and lux, taken as they
    /// are. Watt: radiant watts of point and spot lights, divided by 4 pi, and W/m^2 of directional ones, as they are. Emissive
    /// materials and --sky are never converted, and nothing is between lumen and watt: for a file that mixes them, multiply watts by
    /// 683 lm/W [default: candela].
    #[arg(long, value_name = "UNIT")]
    light_unit: Option<LightUnitName>,
}

/// What the numbers of lights mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LightUnitName {
    /// Candela and lux.
    Candela,
    /// Radiant watts and W/m^2.
    Watt,
}

impl SceneOptions {
    /// The flags as a service is told of them.
    pub fn options(&self) -> api::SceneOptions {
        api::SceneOptions {
            scene: self.scene.clone().unwrap_or_default(),
            weld: self.weld,
            sky: self.sky.map(|sky| api::Colour { r: sky.x, g: sky.y, b: sky.z }),
            light_unit: match self.light_unit {
                Some(LightUnitName::Watt) => api::LightUnit::Watt,
                Some(LightUnitName::Candela) => api::LightUnit::Candela,
                None => api::LightUnit::Unspecified,
            }
            .into(),
        }
    }

    /// Radiance of the sky, where one was given.
    pub fn sky(&self) -> Option<DVec3> {
        self.sky
    }

    /// The options that the flags ask for: those that a service would take them for.
    pub fn import_options(&self) -> anyhow::Result<ImportOptions> {
        let mut wrong = Violations::default();
        let options = import_options(&self.options(), &mut wrong);
        wrong.check()?;
        Ok(options)
    }
}

/// Three numbers, finite and not negative.
pub fn radiance(text: &str) -> Result<DVec3, String> {
    let parsed: Vec<f64> = text.split(',').filter_map(|number| number.trim().parse().ok()).collect();
    match parsed.as_slice() {
        &[r, g, b] if text.split(',').count() == 3 => Some(DVec3::new(r, g, b)),
        _ => None,
    }
    .filter(|sky| sky.is_finite() && sky.min_element() >= 0.0)
    .ok_or_else(|| "must be three numbers that are not negative, such as 0.8,0.9,1.2".to_owned())
}
