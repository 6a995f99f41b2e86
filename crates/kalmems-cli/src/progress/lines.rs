//! A line on standard error for each percent, which the page that the command runs in shows as a bar.

use crate::tell::line;
use std::cell::Cell;

/// What such a line begins with; no other line does.
const MARK: &str = "\u{1}progress";

pub struct BrowserLines {
    what: String,
    total: u64,
    told: Cell<u64>,
}

impl BrowserLines {
    // The same as of a bar on a terminal, which is not always there.
    #[allow(clippy::unnecessary_wraps)]
    pub fn begin(what: &str, total: u64) -> Option<Self> {
        line(format_args!("{MARK} 0 {what}"));
        Some(Self { what: what.to_owned(), total, told: Cell::new(0) })
    }

    pub fn reached(&self, done: u64) {
        let percent = 100 * done.min(self.total) / self.total.max(1);
        if percent > self.told.replace(percent) {
            line(format_args!("{MARK} {percent} {}", self.what));
        }
    }
}
