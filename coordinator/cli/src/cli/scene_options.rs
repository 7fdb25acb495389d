use clap::Args;
use glam::DVec3;
use pipeline::options::schema::{Kind, Value};
use pipeline::options::{Violations, import_options};
use protocol::api;
use scene::ImportOptions;

use super::options::{Given, Unused};

/// How the scene's file is read.
#[derive(Args)]
pub struct SceneOptions<U: Unused = ()> {
    #[command(flatten)]
    given: Given<api::SceneOptions, U>,
}

impl<U: Unused> SceneOptions<U> {
    /// The options as a message.
    pub fn options(&self) -> api::SceneOptions {
        self.given.0.clone()
    }

    /// Radiance of the sky, where one was given.
    pub fn sky(&self) -> Option<DVec3> {
        self.given.0.sky.map(|sky| DVec3::new(sky.r, sky.g, sky.b))
    }

    /// The settings that the options ask for.
    pub fn import_options(&self) -> anyhow::Result<ImportOptions> {
        let mut wrong = Violations::default();
        let options = import_options(&self.given.0, &mut wrong);
        wrong.check()?;
        Ok(options)
    }
}

/// Three numbers, finite and not negative.
pub fn radiance(text: &str) -> Result<DVec3, String> {
    match Kind::Colour.parse(text)? {
        Value::Colour(colour) => Ok(colour),
        _ => Err(Kind::Colour.should()),
    }
}
