//! How far long work is: a bar on a terminal, and in a browser lines for the page that the command runs in.

use crate::interrupt;
use crate::tell::is_quiet;
use kalmems::progress::Progress;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

#[cfg_attr(target_family = "wasm", path = "progress/lines.rs")]
#[cfg_attr(not(target_family = "wasm"), path = "progress/terminal.rs")]
mod shown;
#[cfg(target_family = "wasm")]
use shown::BrowserLines as ShownProgress;
#[cfg(not(target_family = "wasm"))]
use shown::TerminalBar as ShownProgress;

/// A command that has ended before this time shows no bar, which nobody could read; a browser has no cursor that blinks meanwhile.
const SILENT: Duration = Duration::from_millis(if cfg!(target_family = "wasm") { 200 } else { 1000 });

/// Shows the stage of the work and how far it is, from one second after its beginning on, and passes interruptions on.
pub struct ProgressDisplay {
    begun: Instant,
    /// The stage and its number of units, 0 if nobody knows it.
    stage: RefCell<Option<(String, u64)>>,
    shown: RefCell<Option<ShownProgress>>,
}

impl Default for ProgressDisplay {
    fn default() -> Self {
        Self { begun: Instant::now(), stage: RefCell::default(), shown: RefCell::default() }
    }
}

impl ProgressDisplay {
    fn show_if_due(&self) {
        if self.begun.elapsed() >= SILENT
            && let Some((what, total)) = self.stage.borrow_mut().take()
        {
            *self.shown.borrow_mut() = ShownProgress::begin(&what, total);
        }
    }
}

impl Progress for ProgressDisplay {
    fn begin(&self, what: &str, total: u64) {
        // One is gone before the next is there.
        *self.shown.borrow_mut() = None;
        *self.stage.borrow_mut() = (!is_quiet()).then(|| (what.to_owned(), total));
        self.show_if_due();
    }

    fn reached(&self, done: u64) -> ControlFlow<()> {
        self.show_if_due();
        if let Some(shown) = &*self.shown.borrow() {
            shown.reached(done);
        }
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
