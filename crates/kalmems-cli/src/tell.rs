//! What is told on standard error. Whoever reads it may have gone, as in `kalmems … 2>&1 | head`: what cannot be written
//! there is lost, and the work and its exit code stay what they are.

use std::fmt::Arguments;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether the user wants results and errors only.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Says whether progress, notes and hints are shown from here on.
pub fn set_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

/// Whether the user wants results and errors only.
pub fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Standard error as a place to write to that never fails.
pub struct StandardError;

impl Write for StandardError {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let _ = io::stderr().write_all(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let _ = io::stderr().flush();
        Ok(())
    }
}

/// Writes a line in one piece, so that those of several threads do not mix.
pub fn line(text: Arguments) {
    let _ = io::stderr().write_all(format!("{text}\n").as_bytes());
}

/// A note or a hint, which `--quiet` leaves out.
pub fn note(text: Arguments) {
    if !is_quiet() {
        line(text);
    }
}

/// A note or a hint on standard error. `eprintln!` would panic where that is closed.
macro_rules! tell {
    ($($arguments:tt)*) => {
        $crate::tell::note(format_args!($($arguments)*))
    };
}

pub(crate) use tell;
