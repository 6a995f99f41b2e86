//! How runs in the middle of their work hear that all of it is to stop.

use crate::progress::Progress;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the work was stopped.
#[derive(Clone, Debug, Default)]
pub(super) struct StopFlag(Arc<AtomicBool>);

impl StopFlag {
    /// The same progress, which remembers here that it was stopped.
    pub(super) fn watching<'a>(&self, progress: &'a dyn Progress) -> ObservedProgress<'a> {
        ObservedProgress { progress, stop: self.clone() }
    }
}

/// For a run: it says nothing, and is stopped with all others.
impl Progress for StopFlag {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, _: u64) -> ControlFlow<()> {
        if self.0.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
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
            self.stop.0.store(true, Ordering::Relaxed);
        }
        heard
    }
}
