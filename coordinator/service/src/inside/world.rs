use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicUsize};

use crate::pipes::messages::Surroundings;

/// What a job knows of the world around it.
#[derive(Debug, Default)]
pub struct World {
    /// Rows that the workers compute at the same time.
    pub threads: AtomicUsize,
    /// Whether somebody wants previews.
    pub is_watched: AtomicBool,
}

impl World {
    /// Takes what is so now.
    pub fn set(&self, now: Surroundings) {
        self.threads.store(now.threads as usize, Relaxed);
        self.is_watched.store(now.is_watched, Relaxed);
    }
}
