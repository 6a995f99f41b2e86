//! The command `kalmems`.

use kalmems::rigs::published;
use pyo3::prelude::*;
use std::ffi::OsString;

/// Does what these arguments say, of which the first is the name of the program; its exit code.
#[pyfunction]
pub fn run_command(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| kalmems_cli::run_with(published(), arguments))
}
