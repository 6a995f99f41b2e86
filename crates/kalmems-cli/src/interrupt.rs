//! Interruption: a flag that long work looks at, and an end for work that does not look in time.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

#[cfg(not(target_family = "wasm"))]
mod handler;
#[cfg(not(target_family = "wasm"))]
pub use handler::listen;

/// Does nothing: a browser ends the worker that a command runs in.
#[cfg(target_family = "wasm")]
pub const fn listen() {}

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Whether a hang-up is no interruption, and how many there were.
static OUTLIVES_HANGUPS: AtomicBool = AtomicBool::new(false);
static HANGUPS: AtomicU64 = AtomicU64::new(0);

/// From now on a hang-up (SIGHUP) ends nothing: a service has no terminal that could be gone.
pub fn outlive_hangups() {
    OUTLIVES_HANGUPS.store(true, Ordering::Relaxed);
}

/// How often that has happened.
pub fn hangups() -> u64 {
    HANGUPS.load(Ordering::Relaxed)
}

/// The exit code of a command that was interrupted.
pub const EXIT_CODE: u8 = 130;

/// Whether the work shall end.
pub fn requested() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Asks the command that runs to end, as an interruption by the system does.
pub fn request() {
    INTERRUPTED.store(true, Ordering::Relaxed);
}

/// Forgets that an earlier command was asked to end, where a process runs one after the other.
pub fn forget() {
    INTERRUPTED.store(false, Ordering::Relaxed);
    OUTLIVES_HANGUPS.store(false, Ordering::Relaxed);
}
