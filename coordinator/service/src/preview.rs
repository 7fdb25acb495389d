//! Previews of a running job: the lit mesh as the bake knows it now, made while somebody watches, and exported on demand.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bake::lit::LitMesh;
use output::export::ExportSettings;
use scene::Scene;

use crate::sync::lock;

/// Least time from one preview to the next.
const INTERVAL: Duration = Duration::from_secs(2);

/// How long previews are made after somebody asked for one.
const INTEREST: Duration = Duration::from_secs(30);

/// What the file of a preview is made of, beside the lit mesh.
#[derive(Debug, Clone)]
pub struct PreviewSource {
    /// The scene.
    pub scene: Arc<Scene>,
    /// How its files are written.
    pub export: ExportSettings,
}

/// The latest preview of a running job.
#[derive(Debug, Default)]
pub struct Preview {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    source: Option<PreviewSource>,
    lit: Option<Arc<LitMesh>>,
    /// Previews made so far.
    number: u64,
    made: Option<Instant>,
    asked: Option<Instant>,
}

impl Preview {
    /// Allows previews: the bake begins.
    pub fn begin(&self, source: PreviewSource) {
        lock(&self.state).source = Some(source);
    }

    /// Whether the bake should make another one now.
    pub fn is_wanted(&self, is_watched: bool) -> bool {
        let state = lock(&self.state);
        let is_due = state.made.is_none_or(|made| made.elapsed() >= INTERVAL);
        let is_asked = state.asked.is_some_and(|asked| asked.elapsed() < INTEREST);
        is_due && (is_watched || is_asked)
    }

    /// Replaces the preview, and returns its number, from 1.
    pub fn set(&self, lit: Arc<LitMesh>) -> u64 {
        let mut state = lock(&self.state);
        state.lit = Some(lit);
        state.number += 1;
        state.made = Some(Instant::now());
        state.number
    }

    /// Returns the latest preview and its number, if there is one, and asks for newer ones.
    pub fn latest(&self) -> Option<(PreviewSource, Arc<LitMesh>, u64)> {
        let mut state = lock(&self.state);
        state.asked = Some(Instant::now());
        Some((state.source.clone()?, state.lit.clone()?, state.number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn previews_are_made_while_somebody_watches_and_not_too_often() {
        let preview = Preview::default();
        assert!(!preview.is_wanted(false));
        assert!(preview.is_wanted(true));
        assert!(preview.latest().is_none());
        assert!(preview.is_wanted(false), "somebody asked");
        assert_eq!(preview.set(Arc::default()), 1);
        assert!(!preview.is_wanted(true), "there has just been one");
        assert_eq!(preview.set(Arc::default()), 2);
    }
}
