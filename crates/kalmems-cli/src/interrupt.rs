//! Interruption: a flag that long work looks at, so that it ends without leaving anything behind.

use std::sync::atomic::{AtomicBool, Ordering};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// From now on an interruption or a request to end sets the flag. A second one does no more: ending at once would
/// leave a half-written result behind.
pub fn listen() {
    let handler = || INTERRUPTED.store(true, Ordering::Relaxed);
    if let Err(e) = ctrlc::set_handler(handler) {
        eprintln!("warning: interruptions will not be handled: {e}");
    }
}

/// Whether the work shall end.
pub fn requested() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}
