//! Text from C and for C.

use crate::error::{Failure, KalmemsError};
use std::ffi::{CStr, CString, c_char};

/// The text at this pointer; `what` says what it is, where it is none.
///
/// # Safety
/// The pointer is null, or to bytes that end with NUL and do not change while the text is used.
pub unsafe fn at<'a>(pointer: *const c_char, what: &str) -> Result<&'a str, Failure> {
    if pointer.is_null() {
        return Err(Failure::argument(&format!("{what} is a null pointer; text in UTF-8 is expected")));
    }
    // SAFETY: as of this function.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|error| Failure::argument(&format!("{what} is not UTF-8: {error}")))
}

/// The same where a null pointer says that there is none.
///
/// # Safety
/// As of [`at`].
pub unsafe fn at_or_none<'a>(pointer: *const c_char, what: &str) -> Result<Option<&'a str>, Failure> {
    // SAFETY: as of this function.
    if pointer.is_null() { Ok(None) } else { unsafe { at(pointer, what) }.map(Some) }
}

/// Text for C. A NUL inside, which C has no way to tell from the end, becomes a question mark.
pub fn owned(text: &str) -> CString {
    CString::new(text.replace('\0', "?")).unwrap_or_default()
}

/// Frees a text that a function of this library has returned as the caller's own; null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_text_free(text: *mut c_char) {
    if !text.is_null() {
        // SAFETY: it came from `CString::into_raw`.
        drop(unsafe { CString::from_raw(text) });
    }
}

/// A text as the caller's own, or null with the error.
pub fn handed_over(made: Result<String, Failure>, error: *mut *mut KalmemsError) -> *mut c_char {
    crate::error::or_null(made.map(|text| owned(&text).into_raw()), error)
}
