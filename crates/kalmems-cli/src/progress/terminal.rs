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
        // Within 80 columns. Without a number of units there is no share, and no remaining time.
        let template = if total > 0 {
            "{msg:30!} {bar:27} {percent:>3} %  {eta} left"
        } else {
            "{msg:30!} for {elapsed}"
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.tick();
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
