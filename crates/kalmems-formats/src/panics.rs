//! Panics of other libraries on damaged files.

use std::cell::Cell;
#[cfg(feature = "parquet")]
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static IS_CAUGHT: Cell<bool> = const { Cell::new(false) };
}

/// Whether a panic that happens now on this thread ends as a [`FormatError`](crate::FormatError).
///
/// For the panic hook of a program: the default one writes of every panic, and what is written of one that the user is
/// told as a damaged file only frightens.
pub fn panic_is_caught() -> bool {
    IS_CAUGHT.get()
}

/// What a call gives, unless it panics. What it leaves behind then must not be used again.
#[cfg(feature = "parquet")]
pub(crate) fn caught<R>(call: impl FnOnce() -> R) -> Option<R> {
    let before = IS_CAUGHT.replace(true);
    let result = catch_unwind(AssertUnwindSafe(call));
    IS_CAUGHT.set(before);
    result.ok()
}
