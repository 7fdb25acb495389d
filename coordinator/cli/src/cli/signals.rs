use std::process::exit;
use std::thread;

use anyhow::Context;
use tokio::runtime::Builder;
use tokio::signal::unix::{SignalKind, signal};

use super::console::say;

/// Lets SIGTERM and SIGINT end this process at once if it is process 1, as in a container; `remains` tells what is left of its work.
///
/// The system ignores signals to process 1 that have no handler. Elsewhere it ends the process by itself, and a shell sees from the
/// status that a signal did: a handler would hide that.
pub fn end_process_one(remains: String) -> anyhow::Result<()> {
    if std::process::id() != 1 {
        return Ok(());
    }
    let runtime = Builder::new_current_thread().enable_all().build().context("cannot listen for signals")?;
    let listening = runtime.enter();
    let mut terminate = signal(SignalKind::terminate()).context("cannot listen for signals")?;
    let mut interrupt = signal(SignalKind::interrupt()).context("cannot listen for signals")?;
    drop(listening);
    let waiting = move || {
        let (name, kind) = runtime.block_on(async {
            tokio::select! {
                _ = terminate.recv() => ("SIGTERM", SignalKind::terminate()),
                _ = interrupt.recv() => ("SIGINT", SignalKind::interrupt()),
            }
        });
        say(format_args!("error: stopped by {name}: {remains}"));
        // As shells report a process that a signal ended.
        exit(128 + kind.as_raw_value())
    };
    thread::Builder::new().name("signals".into()).spawn(waiting).context("cannot listen for signals")?;
    Ok(())
}
