//! The workbench for C, and for every language that calls C: `include/kalmems.h` declares it.
//!
//! For every function: a pointer to text is text in UTF-8 that ends with NUL, or is null where the function says so; an object is one that this
//! library has made and that was not freed; an array has as many elements as its count says. Objects may be used by one thread at a time, and
//! different ones by several; a stream by one that pushes and one that polls. A function that fails says so by its value, and puts an error to where its
//! last argument points, unless that is null.
//! Null in the place of an object is an error and no crash.

mod error;
mod estimate;
mod experiment;
mod findings;
mod recording;
mod stream;
mod text;
mod watch;

use std::ffi::{OsString, c_char, c_int};

/// The version of the library.
#[unsafe(no_mangle)]
pub extern "C" fn kalmems_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// The command `kalmems` with these arguments, of which the first is the name of the program; its exit code. It prints to standard output and standard
/// error of the process, sets no handler of signals, and returns 2 for a null pointer and 70 for a defect of the library. One command at a time.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_run(argument_count: c_int, arguments: *const *const c_char) -> c_int {
    let mut all: Vec<OsString> = Vec::new();
    if arguments.is_null() && argument_count > 0 {
        return 2;
    }
    for index in 0..usize::try_from(argument_count).unwrap_or(0) {
        // SAFETY: there are as many arguments as their count says.
        let argument = unsafe { text::at(*arguments.add(index), "an argument") };
        match argument {
            Ok(argument) => all.push(argument.into()),
            Err(_) => return 2,
        }
    }
    // A panic must not go through C.
    let ended = std::panic::catch_unwind(|| kalmems_cli::run_within(kalmems::rigs::published(), all));
    ended.map_or(DEFECT, Into::into)
}

/// The exit code of a command that a defect ended.
const DEFECT: c_int = 70;
