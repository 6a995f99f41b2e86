//! How runs in the middle of their work hear that all of it is to stop, and how many rows all of them have filtered.

use crate::progress::Progress;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Whether the work was stopped, and the rows that were filtered.
#[derive(Clone, Debug, Default)]
pub(super) struct StopFlag(Arc<(AtomicBool, AtomicU64)>);

impl StopFlag {
    /// The same progress, which remembers here that it was stopped.
    pub(super) fn watching<'a>(&self, progress: &'a dyn Progress) -> ObservedProgress<'a> {
        ObservedProgress { progress, stop: self.clone() }
    }

    pub(super) fn count(&self, rows: usize) {
        self.0.1.fetch_add(rows as u64, Ordering::Relaxed);
    }

    /// The rows that were filtered so far.
    pub(super) fn rows(&self) -> u64 {
        self.0.1.load(Ordering::Relaxed)
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.0.0.load(Ordering::Relaxed)
    }
}

/// For a run: it says nothing, and is stopped with all others.
impl Progress for StopFlag {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, _: u64) -> ControlFlow<()> {
        if self.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// A progress whose end is heard by the runs.
pub(super) struct ObservedProgress<'a> {
    progress: &'a dyn Progress,
    stop: StopFlag,
}

impl Progress for ObservedProgress<'_> {
    fn begin(&self, what: &str, total: u64) {
        self.progress.begin(what, total);
    }

    fn reached(&self, done: u64) -> ControlFlow<()> {
        let heard = self.progress.reached(done);
        if heard.is_break() {
            self.stop.0.0.store(true, Ordering::Relaxed);
        }
        heard
    }
}
