//! A bar on standard error.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;

pub struct TerminalBar(ProgressBar);

impl TerminalBar {
    /// One, if standard error is a terminal.
    pub fn begin(what: &str, total: u64) -> Option<Self> {
        if !std::io::stderr().is_terminal() {
            return None;
        }
        let bar = ProgressBar::new(total).with_message(crate::tell::visible(what).into_owned());
        if let Ok(style) = ProgressStyle::with_template("{msg:24} {bar:40} {percent:>3} %  {eta} left") {
            bar.set_style(style);
        }
        Some(Self(bar))
    }

    pub fn reached(&self, done: u64) {
        self.0.set_position(done);
    }
}

impl Drop for TerminalBar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
