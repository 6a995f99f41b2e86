//! The workbench as a Python module: arrays in, motion out.
//!
//! What a Python program sees is the package `kalmems` in `python/`; this module is what that is made from. Here numbers change their owner
//! and errors their type, and nothing is computed.

mod applications;
mod batch;
mod command;
mod document;
mod errors;
mod estimate;
mod figures;
mod filters;
mod identify;
mod recording;
mod simulate;
mod stream;
mod study;
mod watch;

use pyo3::prelude::*;

/// What the package `kalmems` is made from.
#[pymodule]
mod _kalmems {
    #[pymodule_export]
    use super::applications::{calibrate, image, spectrum};
    #[pymodule_export]
    use super::batch::{batch_files, estimate_many};
    #[pymodule_export]
    use super::command::run_command;
    #[pymodule_export]
    use super::document::{check, replaced, to_dict, to_toml};
    #[pymodule_export]
    use super::estimate::{Outcome, estimate};
    #[pymodule_export]
    use super::filters::{Equations, innovation_tests, kalman, nonlinear};
    #[pymodule_export]
    use super::identify::{diagnose, identify};
    #[pymodule_export]
    use super::recording::Columns;
    #[pymodule_export]
    use super::simulate::simulate;
    #[pymodule_export]
    use super::stream::Stream;
    #[pymodule_export]
    use super::study::{study_check, study_merge, study_run};

    #[pymodule_export]
    #[allow(non_upper_case_globals)] // as Python calls it
    const __version__: &str = env!("CARGO_PKG_VERSION");

    #[pymodule_init]
    fn init() {
        // A damaged file makes a reader's library panic; that is told as the error that it becomes.
        kalmems_cli::tell_of_unexpected_panics_alone();
    }
}
