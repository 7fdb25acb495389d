//! Previews of a running job: the lit mesh as the bake knows it now, made while somebody watches, and exported on demand.

use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use bake::lit::LitMesh;
use output::export::{ExportError, ExportSettings, export};
use scene::Scene;

use crate::sync::lock;

/// Least time from one preview to the next.
const INTERVAL: Duration = Duration::from_secs(2);

/// What the file of a preview is made of, beside the lit mesh.
#[derive(Debug, Clone)]
pub struct PreviewSource {
    /// The scene.
    pub scene: Arc<Scene>,
    /// How its files are written.
    pub export: ExportSettings,
}

/// Why there is no file of a preview.
#[derive(Debug, thiserror::Error)]
pub enum PreviewError {
    /// None was made yet.
    #[error("there is no preview yet")]
    None,
    /// Its file cannot be written.
    #[error(transparent)]
    Export(#[from] ExportError),
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
}

impl Preview {
    /// Allows previews: the bake begins.
    pub fn begin(&self, source: PreviewSource) {
        lock(&self.state).source = Some(source);
    }

    /// Whether the last one is old enough for another one.
    pub fn is_due(&self) -> bool {
        lock(&self.state).made.is_none_or(|made| made.elapsed() >= INTERVAL)
    }

    /// Replaces the preview, and returns its number, from 1.
    pub fn set(&self, lit: LitMesh) -> u64 {
        let mut state = lock(&self.state);
        state.lit = Some(Arc::new(lit));
        state.number += 1;
        state.made = Some(Instant::now());
        state.number
    }

    /// Writes the latest preview to `path`, and returns its number.
    ///
    /// # Errors
    /// When there is none, or the file cannot be written.
    pub fn export(&self, path: &Path) -> Result<u64, PreviewError> {
        let (source, lit, number) = {
            let state = lock(&self.state);
            let source = state.source.clone().ok_or(PreviewError::None)?;
            (source, state.lit.clone().ok_or(PreviewError::None)?, state.number)
        };
        export(&source.scene, &lit, &source.export, path)?;
        Ok(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn previews_are_not_made_too_often() {
        let preview = Preview::default();
        assert!(preview.is_due());
        assert!(matches!(preview.export(Path::new("/nowhere")), Err(PreviewError::None)));
        assert_eq!(preview.set(LitMesh::default()), 1);
        assert!(!preview.is_due(), "there has just been one");
        assert_eq!(preview.set(LitMesh::default()), 2);
    }
}
