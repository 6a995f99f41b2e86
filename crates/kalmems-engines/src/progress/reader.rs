//! How far a reader has come.

use super::Progress;
use std::ops::ControlFlow;

/// Passes on what a reader of a file says: that it begins, once it knows how much there is, and how far it has come.
pub struct ReaderProgress<'a> {
    progress: &'a dyn Progress,
    what: &'static str,
    begun: bool,
}

impl<'a> ReaderProgress<'a> {
    /// Of a reader that does this, such as `reading`.
    pub fn new(progress: &'a dyn Progress, what: &'static str) -> Self {
        Self { progress, what, begun: false }
    }

    /// So much is read of so much.
    pub fn hear(&mut self, done: u64, total: u64) -> ControlFlow<()> {
        if !self.begun {
            self.progress.begin(self.what, total);
            self.begun = true;
        }
        self.progress.reached(done)
    }
}
