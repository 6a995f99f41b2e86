//! What is told on standard error. Whoever reads it may have gone, as in `kalmems … 2>&1 | head`: what cannot be written
//! there is lost, and the work and its exit code stay what they are.

use std::fmt::Arguments;
use std::io::{self, Write};

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

/// A line on standard error. `eprintln!` would panic where that is closed.
macro_rules! tell {
    ($($arguments:tt)*) => {
        $crate::tell::line(format_args!($($arguments)*))
    };
}

pub(crate) use tell;
