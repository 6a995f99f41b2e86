//! What is told on standard error. Whoever reads it may have gone, as in `kalmems … 2>&1 | head`: what cannot be written
//! there is lost, and the work and its exit code stay what they are.

use std::borrow::Cow;
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
    let _ = io::stderr().write_all(format!("{}\n", visible(&text.to_string())).as_bytes());
}

/// A text in which nothing commands a terminal: a name of a file or a column that somebody else chose may hold what clears a screen, or turns the
/// direction of the letters. Such a letter is written as its number.
pub fn visible(text: &str) -> Cow<'_, str> {
    if !text.contains(is_command) {
        return Cow::Borrowed(text);
    }
    let mut letters = text.chars().peekable();
    let mut all = String::with_capacity(text.len() + 16);
    while let Some(letter) = letters.next() {
        let ends_line = letter == '\r' && letters.peek() == Some(&'\n');
        if is_command(letter) && !ends_line {
            all.extend(letter.escape_unicode());
        } else {
            all.push(letter);
        }
    }
    Cow::Owned(all)
}

/// Whether a letter is one that no reader sees and that changes what is seen of others.
pub fn is_command(letter: char) -> bool {
    let turns = matches!(letter, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}');
    turns || (letter.is_control() && !matches!(letter, '\n' | '\t'))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_commands_a_terminal_is_visible() {
        assert_eq!(visible("r\u{1b}[2J\u{7}\u{9b}1m.csv\n"), "r\\u{1b}[2J\\u{7}\\u{9b}1m.csv\n");
        assert_eq!(visible("gnp.\u{202e}vsc"), "gnp.\\u{202e}vsc");
        assert_eq!(visible("over\rwritten\r\n"), "over\\u{d}written\r\n");
        assert!(matches!(visible("µ · ±3.0 °\t–\n"), Cow::Borrowed(_)));
    }
}
