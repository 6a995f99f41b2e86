//! The scanner in the loop of a regulator: what is simulated, estimated and commanded together.
//!
//! The true device drifts with a temperature; a filter that knows only the signal and the commanded drive observes it; a
//! [`Regulator`](kalmems_models::control::Regulator) acts on what the filter says. The truth is kept beside it and judged
//! afterwards.

mod design;
mod drift;
mod files;
mod filter;
mod observer;
mod report;
mod run;

pub use design::Regulation;
pub use observer::RegulationObserver;
pub use report::{RegulationReport, RegulationWindow, TriggerCheck, WorstErrors};
pub use run::RegulatedSimulation;

use crate::config::{DriveSource, Experiment, Simulate};
use crate::simulate::{Drive, SimulateError, drive_of};

/// The drive of the file; of a regulated one, what keeps up the wanted motion at the temperature of the start.
pub fn expected_drive(experiment: &Experiment, simulate: &Simulate) -> Result<Drive, SimulateError> {
    if matches!(simulate.drive, DriveSource::Regulated(_)) {
        return Ok(Regulation::of(experiment)?.expected_drive());
    }
    Ok(drive_of(experiment, simulate)?.0)
}
