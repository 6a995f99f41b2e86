//! A recording of the scanner with two axes that is computed.

use super::band_plan::{BandPlan, PlannedDrive};
use super::hardware::TwoAxisHardware;
use crate::config::{
    ConfigError, ConfigFault, DriveSource, ExpectedEntry, Experiment, Sign, Simulate, Values,
};
use crate::shared_scanner::device::SharedScanner;
use crate::shared_scanner::simulation::{NoisyReadout, ScannerSimulation};
use crate::simulate::{Drive, SimulateError, SimulatedColumn, Simulation};
use crate::units::kind;

/// The simulation of both axes: the truth is angle and rate of each.
pub fn simulation(experiment: &Experiment) -> Result<Box<dyn Simulation>, SimulateError> {
    refuse_what_is_for_one_axis(experiment)?;
    let TwoAxisHardware { scanner, readout, noise_variance } = TwoAxisHardware::of(experiment)?;
    let sensor =
        |simulate: &Simulate, _: &Drive| Ok(NoisyReadout::new(readout, 0.0, noise_variance, simulate));
    let outlook = |_: &NoisyReadout<_>, drive: &Drive, _: [f64; 4]| {
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
            SimulatedColumn { meaning: "angle_x", column: "angle_x_rad" },
            SimulatedColumn { meaning: "rate_x", column: "rate_x_rad_per_s" },
            SimulatedColumn { meaning: "angle_y", column: "angle_y_rad" },
            SimulatedColumn { meaning: "rate_y", column: "rate_y_rad_per_s" },
        ],
        outlook,
    )?;
    Ok(Box::new(simulation))
}

/// A ring-down and the circuit are computed for one axis; simulated as something else they would be believed.
fn refuse_what_is_for_one_axis(experiment: &Experiment) -> Result<(), ConfigError> {
    let drive = experiment.simulate.as_ref().map(|simulate| &simulate.drive);
    let has_circuit = experiment.device::<SharedScanner>()?.circuit.is_some();
    let (key, why) = if matches!(drive, Some(DriveSource::RingDown(_))) {
        let why = "a ring-down of two axes on one electrode is not computed; simulate each axis by itself, without \
                   `[device.shared_scanner.second_axis]`, or with another drive, such as `[simulate.drive.tones]`";
        ("simulate.drive.ring_down", why)
    } else if has_circuit {
        let why = "the circuit is computed for one axis; leave it out, and the signal is that of `readout`";
        ("device.shared_scanner.circuit", why)
    } else {
        return Ok(());
    };
    Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }))
}

/// A state to simulate from; refused where both axes lie exactly still.
fn state_at(experiment: &Experiment, key: &str, values: &Values) -> Result<[f64; 4], ConfigError> {
    let entry = |name, kind| ExpectedEntry::new(name, kind, Sign::Any);
    let entries = [
        entry("angle_x", &kind::ANGLE),
        entry("rate_x", &kind::ANGULAR_RATE),
        entry("angle_y", &kind::ANGLE),
        entry("rate_y", &kind::ANGULAR_RATE),
    ];
    let state = experiment.values(key, values, entries)?;
    if state == [0.0; 4] {
        let why = "all of it is exactly 0, where neither axis would ever move; start from a small angle, such as \
                   `angle_x = \"1e-6 rad\"`";
        return Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }));
    }
    Ok(state)
}
