//! Reports a run to the service.

use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::{Duration, Instant};

use bake::lit::LitMesh;
use bake::{Observer, Phase, Progress};
use output::export::ExportSettings;
use pipeline::run::RunObserver;
use protocol::api;
use scene::Scene;

use super::preview::{Preview, PreviewSource};
use super::world::World;
use crate::pipes::Outlet;
use crate::pipes::messages::Word;

/// Least time between two reports of a phase: rows come by the ten thousand.
const INTERVAL: Duration = Duration::from_millis(50);

/// Passes a run's progress on.
pub struct Reporter<W: Write> {
    /// What the scene file and the output lack, so far.
    pub warnings: Vec<String>,
    /// How previews are written.
    pub export: ExportSettings,
    outlet: Arc<Outlet<W>>,
    world: Arc<World>,
    preview: Arc<Preview>,
    told: Option<(Instant, Phase)>,
}

impl<W: Write> Reporter<W> {
    pub fn new(outlet: Arc<Outlet<W>>, world: Arc<World>, preview: Arc<Preview>) -> Self {
        let export = ExportSettings::default();
        Self { warnings: vec![], export, outlet, world, preview, told: None }
    }

    /// The run enters a phase outside the bake.
    pub fn enter(&mut self, phase: api::Phase) {
        self.told = None;
        self.outlet.say(Word::Enter(phase.into()));
    }
}

impl<W: Write> Observer for Reporter<W> {
    fn progress(&mut self, progress: &Progress) {
        let now = Instant::now();
        if self.told.is_some_and(|(time, phase)| phase == progress.phase && now - time < INTERVAL) {
            return;
        }
        self.told = Some((now, progress.phase));
        self.outlet.say(Word::Progress(progress.into()));
    }

    fn wants_preview(&mut self) -> bool {
        self.world.is_watched.load(Relaxed) && self.preview.is_due()
    }

    fn preview(&mut self, lit: LitMesh) {
        let number = self.preview.set(lit);
        self.outlet.say(Word::Preview(number));
    }
}

impl<W: Write> RunObserver for Reporter<W> {
    fn warn(&mut self, warnings: &[String]) {
        self.warnings.extend_from_slice(warnings);
    }

    fn imported(&mut self, scene: &Arc<Scene>) {
        self.preview.begin(PreviewSource { scene: Arc::clone(scene), export: self.export.clone() });
    }

    fn exporting(&mut self) {
        self.enter(api::Phase::Export);
    }
}
