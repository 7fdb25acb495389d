use std::collections::HashMap;
use std::ffi::OsString;
use std::fmt;
use std::fs;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};
use std::process::ChildStdin;
use std::sync::{Arc, Mutex};

use tokio::sync::oneshot;

use super::frames::Outlet;
use super::messages::{ExportPreview, Exported, Order, ToJob};
use crate::sync::lock;

/// The way to a running process, for previews.
#[derive(Default)]
pub struct JobLink {
    outlet: Mutex<Option<Arc<Outlet<ChildStdin>>>>,
    exports: Mutex<HashMap<PathBuf, oneshot::Sender<Exported>>>,
}

impl fmt::Debug for JobLink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("JobLink").finish_non_exhaustive()
    }
}

impl JobLink {
    /// Orders go this way from now on.
    pub fn open(&self, outlet: &Arc<Outlet<ChildStdin>>) {
        *lock(&self.outlet) = Some(Arc::clone(outlet));
    }

    /// Has the latest preview exported to `path`. Nothing comes where the job ends before.
    pub fn export_preview(&self, path: &Path) -> oneshot::Receiver<Exported> {
        let (sender, exported) = oneshot::channel();
        if let Some(outlet) = &*lock(&self.outlet) {
            lock(&self.exports).insert(path.to_owned(), sender);
            let order = Order::ExportPreview(ExportPreview { path: path.as_os_str().as_bytes().to_vec() });
            // Where the process is gone, the link is about to be closed.
            let _ = outlet.send(&ToJob { order: Some(order) });
        }
        exported
    }

    /// Hands an answer to who waits for it.
    pub fn exported(&self, exported: Exported) {
        let path = PathBuf::from(OsString::from_vec(exported.path.clone()));
        let waiting = lock(&self.exports).remove(&path);
        if waiting.is_none_or(|waiting| waiting.send(exported).is_err()) {
            // Nobody waits for it any more.
            let _ = fs::remove_file(&path);
        }
    }

    /// The process has ended.
    pub fn close(&self) {
        *lock(&self.outlet) = None;
        for (path, _) in lock(&self.exports).drain() {
            let _ = fs::remove_file(&path);
        }
    }
}
