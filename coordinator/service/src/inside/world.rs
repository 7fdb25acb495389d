use std::sync::Mutex;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::atomic::{AtomicBool, AtomicUsize};

use bake::ThreadTime;

use crate::pipes::messages::Surroundings;
use crate::sync::lock;

/// What a job knows of the world around it.
#[derive(Debug, Default)]
pub struct World {
    /// Rows that the workers compute at the same time.
    pub threads: AtomicUsize,
    /// Jobs that keep all of them busy.
    pub jobs_ahead: AtomicUsize,
    /// Whether somebody wants previews.
    pub is_watched: AtomicBool,
    time: Mutex<ThreadTime>,
}

impl World {
    /// Takes what is so now.
    pub fn set(&self, now: Surroundings) {
        self.threads.store(now.threads as usize, Relaxed);
        self.jobs_ahead.store(now.jobs_ahead as usize, Relaxed);
        *lock(&self.time) = now.time.into();
        self.is_watched.store(now.is_watched, Relaxed);
    }

    /// What the threads of the workers did, when that was told last.
    pub fn thread_time(&self) -> ThreadTime {
        *lock(&self.time)
    }
}
