use std::fs;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use clap::builder::ValueParser;
use clap::{Arg, ArgMatches, Args, Command, Error, FromArgMatches};
use glam::DVec3;
use pipeline::options::schema::{Kind, Options, Value};
use pipeline::options::{Violations, import_options};
use protocol::api;
use scene::{ImportOptions, PutSkyError, ReadOptions, SkyImage, SkyPattern, put_sky_image};

use super::options::{Given, Unused, positive};

/// Path of the option of the sky among the arguments, and its flag.
const SKY: &str = "scene.sky";
const SKY_FLAG: &str = "sky";

const ROTATION: &str = "sky-rotation";
const INTENSITY: &str = "sky-intensity";

/// How the scene's file is read.
#[derive(Args)]
pub struct SceneOptions<U: Unused = ()> {
    #[command(flatten)]
    given: Given<api::SceneOptions, U>,
    #[command(flatten)]
    image: SkyFile<U>,
}

impl<U: Unused> SceneOptions<U> {
    /// The options as a message.
    pub fn options(&self) -> api::SceneOptions {
        let sky = self.given.0.sky.filter(|_| self.image.path.is_none());
        api::SceneOptions { sky, ..self.given.0.clone() }
    }

    /// Radiance of the sky, where one was given.
    ///
    /// # Errors
    /// When an image was given, in place of `other`.
    pub fn sky(&self, other: &str) -> anyhow::Result<Option<DVec3>> {
        if let Some(path) = &self.image.path {
            anyhow::bail!("--sky {} is an image, which is not taken here: {other}", path.display());
        }
        Ok(self.given.0.sky.map(|sky| DVec3::new(sky.r, sky.g, sky.b)))
    }

    /// The settings that the options ask for, without a sky image: the sky is the factor of one.
    pub fn import_options(&self) -> anyhow::Result<ImportOptions> {
        let mut wrong = Violations::default();
        let options = import_options(&self.options(), &mut wrong);
        wrong.check()?;
        let sky = if self.image.path.is_some() { DVec3::splat(self.image.intensity) } else { options.sky };
        Ok(ImportOptions { sky, ..options })
    }

    /// The sky image, where one was given.
    pub fn sky_image(&self) -> anyhow::Result<Option<SkyImage>> {
        let Some(path) = &self.image.path else { return Ok(None) };
        let image = SkyImage::open(path).with_context(|| path.display().to_string())?;
        Ok(Some(image.turned(self.image.rotation)))
    }

    /// The settings that the options ask for.
    pub fn with_sky(&self) -> anyhow::Result<ImportOptions> {
        let pattern = self.sky_image()?.map(|image| Arc::new(SkyPattern::new(&image)));
        if let (Some(pattern), Some(path)) = (&pattern, &self.image.path) {
            anyhow::ensure!(!pattern.is_dark(), "{}: is black all over; give another sky", path.display());
        }
        let options = self.import_options()?;
        let mean = pattern.as_ref().map_or(DVec3::ONE, |pattern| pattern.mean());
        let sky = options.sky * mean;
        anyhow::ensure!(sky.is_finite(), "the sky is too bright: give a smaller --sky-intensity");
        Ok(ImportOptions { sky, sky_pattern: pattern, ..options })
    }

    /// The scene with the sky image in it, where one was given: for those who take one file.
    pub fn put_sky(&self, scene: &Path) -> anyhow::Result<Option<Vec<u8>>> {
        let Some(path) = &self.image.path else { return Ok(None) };
        // What is wrong with it is said before it is sent.
        self.with_sky()?;
        let read = |path: &Path| fs::read(path).with_context(|| format!("{} cannot be read", path.display()));
        let (bytes, image) = (read(scene)?, read(path)?);
        match put_sky_image(&bytes, &image, self.image.rotation, self.image.intensity) {
            Ok(scene) => Ok(Some(scene)),
            Err(error @ PutSkyError::Sky(_)) => Err(error).with_context(|| path.display().to_string()),
            Err(error @ PutSkyError::Scene(_)) => Err(error).with_context(|| scene.display().to_string()),
        }
    }

    /// File of the sky image, where one was given.
    pub fn sky_path(&self) -> Option<&std::path::Path> {
        self.image.path.as_deref()
    }
}

/// Which files beside a scene are read.
#[derive(Args)]
pub struct BesideOptions {
    /// Also read buffers and images outside the scene's folder: by `..`, absolute paths or links
    ///
    /// For scenes that you trust: the output holds what was read.
    #[arg(long, help_heading = "Scene")]
    pub outside_files: bool,
}

impl BesideOptions {
    /// The options of a reader that may read these files.
    pub fn read(&self) -> ReadOptions {
        ReadOptions { outside_files: self.outside_files, ..ReadOptions::default() }
    }

    /// The options of an import that may read these files.
    pub fn allow(&self, mut options: ImportOptions) -> ImportOptions {
        options.read.outside_files = self.outside_files;
        options
    }
}

/// A sky image in place of a colour.
struct SkyFile<U> {
    path: Option<PathBuf>,
    rotation: f64,
    intensity: f64,
    unused: PhantomData<U>,
}

impl<U: Unused> Args for SkyFile<U> {
    /// To be added after the options of the schema, whose sky it changes.
    fn augment_args(command: Command) -> Command {
        if U::FLAGS.contains(&SKY_FLAG) {
            return command;
        }
        command
            .mut_arg(SKY, |sky| {
                let help = "Radiance of the sky in nit: a colour, or an image (.hdr, .exr) [default: that of the file, or black]";
                sky.value_name("R,G,B|IMAGE").value_parser(ValueParser::new(sky_or_image)).help(help).long_help(format!(
                    "{help}\n\n\
                     Beside lights in watts it is in W/(m^2 sr). The sky surrounds the scene on all sides, below the horizon too. \
                     An unoccluded surface under a uniform one receives pi times its radiance. An image is equirectangular: up is \
                     +Y, its middle +X, and what is right of it +Z, as in three.js. Files have skies in EXT_lights_image_based."
                ))
            })
            .arg(
                Arg::new(ROTATION)
                    .long(ROTATION)
                    .value_name("DEGREES")
                    .help("Turn the sky image counter-clockwise, seen from above [default: 0]")
                    .help_heading(api::SceneOptions::HEADING)
                    .allow_negative_numbers(true)
                    .requires(SKY)
                    .value_parser(ValueParser::new(degrees)),
            )
            .arg(
                Arg::new(INTENSITY)
                    .long(INTENSITY)
                    .value_name("NUMBER")
                    .help("Factor of the sky image: its unit in nit [default: 1]")
                    .help_heading(api::SceneOptions::HEADING)
                    .requires(SKY)
                    .value_parser(ValueParser::new(positive)),
            )
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<U: Unused> FromArgMatches for SkyFile<U> {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let number = |name| matches.try_get_one::<f64>(name).ok().flatten().copied();
        let path = match matches.try_get_one::<Value>(SKY).ok().flatten() {
            Some(Value::Text(path)) => Some(PathBuf::from(path)),
            _ => None,
        };
        for name in [ROTATION, INTENSITY] {
            if path.is_none() && number(name).is_some() {
                let message = format!("--{name} changes a sky image: give one with --sky");
                return Err(Error::raw(clap::error::ErrorKind::ArgumentConflict, message + "\n"));
            }
        }
        Ok(Self {
            path,
            rotation: number(ROTATION).unwrap_or(0.0),
            intensity: number(INTENSITY).unwrap_or(1.0),
            unused: PhantomData,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// A colour, or the path of an image.
fn sky_or_image(text: &str) -> Result<Value, String> {
    let is_image = [".exr", ".hdr"].iter().any(|end| text.to_ascii_lowercase().ends_with(end));
    if is_image { Ok(Value::Text(text.to_owned())) } else { Kind::Colour.parse(text) }
}

fn degrees(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|angle: &f64| angle.is_finite()).ok_or_else(|| "must be a number".to_owned())
}

/// Three numbers, finite and not negative.
pub fn radiance(text: &str) -> Result<DVec3, String> {
    match Kind::Colour.parse(text)? {
        Value::Colour(colour) => Ok(colour),
        _ => Err(Kind::Colour.should()),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        options: SceneOptions,
    }

    fn parsed(arguments: &str) -> Result<SceneOptions, String> {
        let all = ["solve"].into_iter().chain(arguments.split_whitespace());
        Command::try_parse_from(all).map(|command| command.options).map_err(|error| error.to_string())
    }

    #[test]
    fn a_sky_is_a_colour_or_an_image() {
        let colour = parsed("--sky 1,2,3").unwrap();
        assert_eq!(colour.sky("").unwrap(), Some(DVec3::new(1.0, 2.0, 3.0)));
        assert_eq!(colour.import_options().unwrap().sky, DVec3::new(1.0, 2.0, 3.0));
        assert!(colour.sky_path().is_none() && colour.sky_image().unwrap().is_none());
        let image = parsed("--sky day.HDR --sky-rotation -30 --sky-intensity 2").unwrap();
        assert_eq!(image.sky_path(), Some(std::path::Path::new("day.HDR")));
        assert_eq!(image.options().sky, None);
        assert_eq!(image.import_options().unwrap().sky, DVec3::splat(2.0));
        assert!(image.sky("bake anew").unwrap_err().to_string().contains("bake anew"));
        let missing = image.with_sky().unwrap_err();
        assert!(format!("{missing:#}").starts_with("day.HDR: cannot be read"), "{missing:#}");
    }

    #[test]
    fn options_of_an_image_need_one() {
        for wrong in [
            "--sky-rotation 3",
            "--sky 1,1,1 --sky-rotation 3",
            "--sky a.exr --sky-intensity 0",
            "--sky a.png",
            "--sky a.exr --sky-rotation inf",
        ] {
            assert!(parsed(wrong).is_err(), "{wrong}");
        }
    }
}
