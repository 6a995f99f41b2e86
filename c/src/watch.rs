//! How far long work is, and how it is stopped from C.

use kalmems::progress::Progress;
use std::ffi::{CString, c_char, c_void};
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

/// A function of the caller that hears what is done, how much of it and of how much, with what the caller gave for it; `false` stops the work. It is
/// called by the thread that estimates or by one that reads a file, once at a time; it must return, and not call the library with objects of this
/// estimate.
pub type KalmemsProgress =
    Option<unsafe extern "C" fn(what: *const c_char, done: u64, total: u64, user: *mut c_void) -> bool>;

/// Tells a function of the caller.
pub struct Watch {
    heard: KalmemsProgress,
    // A number, so that it may go to the thread that reads a file; only the caller makes a pointer of it again.
    user: usize,
    begun: Mutex<(CString, u64)>,
}

impl Watch {
    /// With a function, or none.
    pub fn new(heard: KalmemsProgress, user: *mut c_void) -> Self {
        Self { heard, user: user as usize, begun: Mutex::default() }
    }
}

impl Progress for Watch {
    fn begin(&self, what: &str, total: u64) {
        *self.begun.lock().unwrap_or_else(PoisonError::into_inner) = (crate::text::owned(what), total);
    }

    fn reached(&self, done: u64) -> ControlFlow<()> {
        let Some(heard) = self.heard else { return ControlFlow::Continue(()) };
        // One call at a time, whichever thread comes.
        let begun = self.begun.lock().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: the caller's function, with what the caller gave for it.
        let goes_on = unsafe { heard(begun.0.as_ptr(), done, begun.1, self.user as *mut c_void) };
        if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}
