//! How far long work is: a bar on a terminal, and in a browser lines for the page that the command runs in.

use crate::interrupt;
use crate::tell::is_quiet;
use kalmems::progress::Progress;
use std::cell::RefCell;
use std::ops::ControlFlow;

#[cfg_attr(target_family = "wasm", path = "progress/lines.rs")]
#[cfg_attr(not(target_family = "wasm"), path = "progress/terminal.rs")]
mod shown;
#[cfg(target_family = "wasm")]
use shown::BrowserLines as ShownProgress;
#[cfg(not(target_family = "wasm"))]
use shown::TerminalBar as ShownProgress;

/// Work below this many units is over before a bar could be read; a browser takes longer, and has no cursor that blinks.
const LONG: u64 = if cfg!(target_family = "wasm") { 100_000 } else { 2_000_000 };

/// Shows progress where somebody sees it, and passes interruptions on.
pub struct ProgressDisplay {
    shown: RefCell<Option<ShownProgress>>,
    shortest: u64,
}

impl Default for ProgressDisplay {
    fn default() -> Self {
        Self { shown: RefCell::default(), shortest: LONG }
    }
}

impl ProgressDisplay {
    /// For work of which every single unit takes time.
    pub fn of_large_units() -> Self {
        Self { shown: RefCell::default(), shortest: 1 }
    }
}

impl Progress for ProgressDisplay {
    fn begin(&self, what: &str, total: u64) {
        let mut shown = self.shown.borrow_mut();
        // One is gone before the next is there.
        *shown = None;
        if total >= self.shortest && !is_quiet() {
            *shown = ShownProgress::begin(what, total);
        }
    }

    fn reached(&self, done: u64) -> ControlFlow<()> {
        if let Some(shown) = &*self.shown.borrow() {
            shown.reached(done);
        }
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
