//! What an interruption by the system does.

use super::{EXIT_CODE, INTERRUPTED};
#[cfg(unix)]
use super::{HANGUPS, OUTLIVES_HANGUPS};
use crate::tell::tell;
use std::io::Write as _;
use std::process::exit;
use std::sync::atomic::Ordering;
#[cfg(unix)]
use std::sync::{Arc, atomic::AtomicBool};
use std::thread;
use std::time::{Duration, Instant};

/// How long a command has to end by itself, which leaves nothing half done and says what it has.
const PATIENCE: Duration = Duration::from_millis(800);

/// How long after an interruption another one is the same: an impatient key, or a signal that comes by two ways.
const SAME: Duration = Duration::from_millis(300);

/// How long a message has to be written; what standard error goes to may take none.
const TELLING: Duration = Duration::from_millis(50);

/// What the command ends with where the system gives it no more memory: with an error.
#[cfg(unix)]
const NO_MEMORY_EXIT_CODE: i32 = 1;

/// From now on an interruption or a request to end sets the flag. A command that has not ended by itself soon after is ended
/// where it is, and at once after another one: results are put in their place whole, so that this leaves none of them half
/// written.
pub fn listen() {
    let mut first = None;
    let handler = move || {
        let begun = *first.get_or_insert_with(Instant::now);
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            if begun.elapsed() < SAME {
                return;
            }
            end("interrupted again; ended at once: what was not finished is not there");
        }
        let guard = thread::Builder::new().name("interruption".to_owned()).spawn(|| {
            thread::sleep(PATIENCE);
            end("interrupted; ended in the middle of its work: what was not finished is not there");
        });
        if guard.is_err() {
            // There is no thread to wait in.
            end("interrupted; what was not finished is not there");
        }
    };
    if let Err(e) = set_handler(handler) {
        tell!("warning: interruptions will not be handled: {e}");
    }
}

/// Signals are taken on a thread of their own.
#[cfg(unix)]
fn set_handler(mut handler: impl FnMut() + Send + 'static) -> std::io::Result<()> {
    use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM};
    // Where the system refuses memory, the standard library says how much was asked for and aborts: that is an error like others, and no crash.
    signal_hook::flag::register_conditional_shutdown(
        SIGABRT,
        NO_MEMORY_EXIT_CODE,
        Arc::new(AtomicBool::new(true)),
    )?;
    let mut signals = signal_hook::iterator::Signals::new([SIGHUP, SIGINT, SIGTERM])?;
    let take = move || {
        for signal in signals.forever() {
            if signal == SIGHUP && OUTLIVES_HANGUPS.load(Ordering::Relaxed) {
                HANGUPS.fetch_add(1, Ordering::Relaxed);
            } else {
                handler();
            }
        }
    };
    thread::Builder::new().name("signals".to_owned()).spawn(take).map(|_| ())
}

#[cfg(not(unix))]
fn set_handler(handler: impl FnMut() + Send + 'static) -> Result<(), ctrlc::Error> {
    ctrlc::set_handler(handler)
}

/// Ends the process, whatever its threads wait for.
fn end(why: &'static str) -> ! {
    let told = thread::Builder::new().spawn(move || writeln!(std::io::stderr(), "error: {why}"));
    if told.is_ok() {
        thread::sleep(TELLING);
    }
    exit(EXIT_CODE.into())
}
