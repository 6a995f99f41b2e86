//! A bar on a terminal, for work that takes long.

use crate::interrupt;
use crate::tell::is_quiet;
use indicatif::{ProgressBar, ProgressStyle};
use kalmems::progress::Progress;
use std::cell::RefCell;
use std::io::IsTerminal;
use std::ops::ControlFlow;

/// Work below this many units is over before a bar could be read.
const LONG: u64 = 2_000_000;

/// Shows a bar on standard error if that is a terminal, and passes interruptions on.
pub struct Bar {
    bar: RefCell<Option<ProgressBar>>,
    shortest: u64,
}

impl Default for Bar {
    fn default() -> Self {
        Self { bar: RefCell::default(), shortest: LONG }
    }
}

impl Bar {
    /// For work of which every single unit takes time.
    pub fn of_large_units() -> Self {
        Self { bar: RefCell::default(), shortest: 1 }
    }
}

impl Progress for Bar {
    fn begin(&self, what: &str, total: u64) {
        let mut bar = self.bar.borrow_mut();
        if let Some(old) = bar.take() {
            old.finish_and_clear();
        }
        if total >= self.shortest && !is_quiet() && std::io::stderr().is_terminal() {
            let new = ProgressBar::new(total).with_message(what.to_owned());
            if let Ok(style) = ProgressStyle::with_template("{msg:24} {bar:40} {percent:>3} %  {eta} left") {
                new.set_style(style);
            }
            *bar = Some(new);
        }
    }

    fn reached(&self, done: u64) -> ControlFlow<()> {
        if let Some(bar) = &*self.bar.borrow() {
            bar.set_position(done);
        }
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        if let Some(bar) = self.bar.get_mut().take() {
            bar.finish_and_clear();
        }
    }
}
