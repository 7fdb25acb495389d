//! The present state of a job that runs: the lit mesh of what it knows by now, made while somebody looks, and written as a file
//! when it is asked for.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::progress::lock;
use bake::lit::LitMesh;
use output::export::ExportSettings;
use scene::Scene;

/// From one present state to the next: a bake has other things to do.
const INTERVAL: Duration = Duration::from_secs(2);

/// Who asked for one so long ago does not look any more.
const INTEREST: Duration = Duration::from_secs(30);

/// What a file is made of.
#[derive(Debug, Clone)]
pub struct Stage {
    /// The scene.
    pub scene: Arc<Scene>,
    /// How its files are written.
    pub export: ExportSettings,
}

/// The present state of a job that runs.
#[derive(Debug, Default)]
pub struct Present {
    state: Mutex<Known>,
}

#[derive(Debug, Default)]
struct Known {
    stage: Option<Stage>,
    lit: Option<Arc<LitMesh>>,
    /// Grows with each one.
    number: u64,
    made: Option<Instant>,
    asked: Option<Instant>,
}

impl Present {
    /// The bake begins: from now on there will be present states.
    pub fn begin(&self, stage: Stage) {
        lock(&self.state).stage = Some(stage);
    }

    /// Whether another one is wanted now.
    pub fn is_wanted(&self, is_watched: bool) -> bool {
        let known = lock(&self.state);
        let is_due = known.made.is_none_or(|made| made.elapsed() >= INTERVAL);
        let is_asked = known.asked.is_some_and(|asked| asked.elapsed() < INTEREST);
        is_due && (is_watched || is_asked)
    }

    /// Takes another one: its number, from 1.
    pub fn set(&self, lit: Arc<LitMesh>) -> u64 {
        let mut known = lock(&self.state);
        known.lit = Some(lit);
        known.number += 1;
        known.made = Some(Instant::now());
        known.number
    }

    /// The latest one with its number; `None` where there is none yet. Whoever asks will find newer ones later.
    pub fn latest(&self) -> Option<(Stage, Arc<LitMesh>, u64)> {
        let mut known = lock(&self.state);
        known.asked = Some(Instant::now());
        Some((known.stage.clone()?, known.lit.clone()?, known.number))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_made_for_those_who_look_and_not_too_often() {
        let present = Present::default();
        assert!(!present.is_wanted(false));
        assert!(present.is_wanted(true));
        assert!(present.latest().is_none());
        assert!(present.is_wanted(false), "somebody asked");
        assert_eq!(present.set(Arc::default()), 1);
        assert!(!present.is_wanted(true), "there has just been one");
        assert_eq!(present.set(Arc::default()), 2);
    }
}
