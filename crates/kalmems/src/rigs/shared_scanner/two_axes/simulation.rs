//! A recording of the scanner with two axes that is computed.

use super::band_plan::{BandPlan, PlannedDrive};
use super::hardware::Hardware;
use super::settings::state_at;
use crate::config::{Experiment, Simulate, Values};
use crate::rigs::shared_scanner::simulation::{Readout, ScannerSimulation};
use crate::simulate::{Channel, Drive, SimulateError, Simulation};

/// The simulation of both axes: the truth is angle and rate of each.
pub fn simulation(experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
    let Hardware { scanner, readout, noise_variance } = Hardware::of(experiment)?;
    let sensor = |simulate: &Simulate, _: &Drive| Ok(Readout::new(readout, 0.0, noise_variance, simulate));
    let outlook = |_: &Readout<_>, drive: &Drive, _: [f64; 4]| {
        let drive = PlannedDrive::of(drive)?;
        Some(BandPlan::of(&scanner, &drive, BandPlan::GUARD_HZ).to_string())
    };
    let start = |key: &str, values: &Values| state_at(experiment, key, values);
    let simulation = ScannerSimulation::of(
        experiment,
        scanner,
        sensor,
        start,
        &[
            Channel { meaning: "angle_x", column: "angle_x_rad" },
            Channel { meaning: "rate_x", column: "rate_x_rad_per_s" },
            Channel { meaning: "angle_y", column: "angle_y_rad" },
            Channel { meaning: "rate_y", column: "rate_y_rad_per_s" },
        ],
        outlook,
    )?;
    Ok(Box::new(simulation))
}
