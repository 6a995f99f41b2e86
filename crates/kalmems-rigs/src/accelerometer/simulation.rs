//! A recording of the accelerometer that is computed, from what the experiment says of it.

use super::dither;
use super::run::{Acceleration, AccelerometerRun, ControllerInput, ControllerTiming};
use super::settings::AccelerometerHardware;
use crate::accelerometer::device::{AccelerometerTable, ForceFeedback};
use crate::config::{
    AccelerationDrive, ConfigError, ConfigFault, DriveSource, ExpectedEntry, Experiment, Key, Quantity, Sign,
    Simulate,
};
use crate::simulate::{SimulateError, SimulatedColumn, SimulatedSample, Simulation};
use crate::units::kind;
use kalmems_models::control::{Comparator, PiController, RebalanceLoop};
use std::ops::ControlFlow;
use std::sync::Arc;

/// The accelerometer, its loop and what it is to measure.
pub struct AccelerometerSimulation {
    run: AccelerometerRun,
    records_acceleration: bool,
}

/// The columns of a recording; that of the acceleration where a filter is given it.
pub const RECORDED: [SimulatedColumn; 3] = [
    SimulatedColumn { meaning: "feedback", column: "feedback_V" },
    SimulatedColumn { meaning: "signal", column: "output_V" },
    SimulatedColumn { meaning: "acceleration", column: "known_acceleration_m_per_s2" },
];

/// Those of what is true.
pub const TRUE: [SimulatedColumn; 3] = [
    SimulatedColumn { meaning: "acceleration", column: "acceleration_m_per_s2" },
    SimulatedColumn { meaning: "displacement", column: "displacement_m" },
    SimulatedColumn { meaning: "velocity", column: "velocity_m_per_s" },
];

/// Where the mass is at the start.
const START: [ExpectedEntry; 2] = [
    ExpectedEntry::new("displacement", &kind::LENGTH, Sign::Any),
    ExpectedEntry::new("velocity", &kind::VELOCITY, Sign::Any),
];

/// What the file says of the device.
fn described(experiment: &Experiment) -> Option<Arc<AccelerometerTable>> {
    experiment.device().ok()
}

/// What the file says of the feedback, where there is one.
pub fn feedback(experiment: &Experiment) -> Option<ForceFeedback> {
    described(experiment)?.feedback.clone()
}

/// The force-rebalance loop that an experiment describes, sampled at this interval in s; with a controller of zeros where it
/// describes none.
pub fn closed_loop(experiment: &Experiment, interval_s: f64) -> Result<RebalanceLoop<f64>, ConfigError> {
    let hardware = AccelerometerHardware::of(experiment)?;
    let feedback = feedback(experiment);
    let is = |flag: fn(&ForceFeedback) -> bool| feedback.as_ref().is_some_and(flag);
    // What is held is half an interval late on average.
    let held = if is(|f| f.continuous) { 0.0 } else { 0.5 };
    let computed = if is(|f| f.one_sample_late) { 1.0 } else { 0.0 };
    Ok(RebalanceLoop {
        device: hardware.sensed.device,
        readout: hardware.readout,
        controller: PiController {
            proportional: feedback.as_ref().map_or(0.0, |feedback| feedback.proportional_gain.si()),
            integral: feedback.as_ref().map_or(0.0, |feedback| feedback.integral_gain.si()),
        },
        delay: (held + computed) * interval_s,
    })
}

/// When the controller acts, and how; what cannot be together is refused.
pub fn acting(experiment: &Experiment) -> Result<ControllerTiming, ConfigError> {
    let Some(feedback) = feedback(experiment) else { return Ok(ControllerTiming::Sampled) };
    let refuse = |name: &str, why: &str| {
        let key = ["accelerometer", "feedback", name].into_iter().fold(Key::from("device"), Key::child);
        Err(experiment.error(key, ConfigFault::Value { why: why.to_owned() }))
    };
    let sampled = feedback.one_sample_late || feedback.through_observer || feedback.one_bit.is_some();
    if feedback.continuous && sampled {
        let why = "an analogue controller has no samples: it is neither late by one, nor behind an observer, nor of \
                   one bit; leave one of them out";
        return refuse("continuous", why);
    }
    if feedback.one_bit.is_some() && feedback.through_observer {
        return refuse(
            "one_bit",
            "what an observer makes of the output has no use for one bit; leave one out",
        );
    }
    Ok(match &feedback.one_bit {
        Some(one_bit) => ControllerTiming::OneBit(Comparator {
            level: one_bit.level.si(),
            lead_s: one_bit.lead.as_ref().map_or(0.0, Quantity::si),
        }),
        None if feedback.continuous => ControllerTiming::Continuously,
        None => ControllerTiming::Sampled,
    })
}

impl AccelerometerSimulation {
    /// Reads and checks what the file says. A loop that is not stable is refused.
    pub fn of(experiment: &Experiment) -> Result<Self, SimulateError> {
        let hardware = AccelerometerHardware::of(experiment)?;
        hardware.require_rest(experiment)?;
        let Some(simulate) = &experiment.simulate else {
            let remedy = "add the table `[simulate]` with `duration`, `sampling_rate`, `integration_rate`, `start` and \
                          `[simulate.drive.acceleration]`";
            return Err(experiment
                .error("simulate", ConfigFault::MissingKey { remedy: remedy.to_owned() })
                .into());
        };
        if simulate.adc.is_some() {
            let why = "no converter is built for the accelerometer; leave it out".to_owned();
            return Err(experiment.error("simulate.adc", ConfigFault::Value { why }).into());
        }
        let start = experiment.values("simulate.start", &simulate.start, START)?;
        if start != [0.0; 2] {
            let why =
                "an accelerometer starts at rest: write `{ displacement = \"0 m\", velocity = \"0 m/s\" }`";
            return Err(experiment
                .error("simulate.start", ConfigFault::Value { why: why.to_owned() })
                .into());
        }
        let interval_s = 1.0 / simulate.sampling_rate.si();
        let closed = closed_loop(experiment, interval_s)?;
        let acting = acting(experiment)?;
        // Of what one bit does there is no linear loop; a run says whether the mass stays.
        let computed_every_s = match acting {
            ControllerTiming::Sampled => Some(interval_s),
            ControllerTiming::Continuously => Some(1.0 / simulate.integration_rate.si()),
            ControllerTiming::OneBit(_) => None,
        };
        if let Some(every_s) = computed_every_s.filter(|every_s| !closed.is_stable(*every_s)) {
            return Err(unstable(experiment, &closed, every_s).into());
        }
        let mut filters = experiment.estimate.iter().flat_map(|estimate| &estimate.filters);
        let records_acceleration =
            filters.any(|filter| filter.known_states().1.any(|name| name == "acceleration"));
        let through_observer = feedback(experiment).is_some_and(|feedback| feedback.through_observer);
        let (acceleration, full_carrier) = driven(experiment, &simulate.drive)?;
        let run = AccelerometerRun {
            hardware,
            closed,
            acting,
            observer: if through_observer { ControllerInput::Estimate } else { ControllerInput::Output },
            acceleration,
            samples: simulate.samples(),
            interval_s,
            steps: u32::try_from(simulate.steps_per_sample()).unwrap_or(u32::MAX),
            noise: simulate.noise,
            carrier_hz: if full_carrier { Some(carrier(experiment, simulate)?) } else { None },
            dither: match (&simulate.dither, acting) {
                (Some(dither), ControllerTiming::Sampled) => Some(dither::tones(dither, simulate.seed)),
                (Some(_), _) => {
                    let why = "a dither is added to what a sampled controller holds; leave out `continuous` and `one_bit`";
                    return Err(experiment
                        .error("simulate.dither", ConfigFault::Value { why: why.to_owned() })
                        .into());
                }
                (None, _) => None,
            },
            seed: simulate.seed,
        };
        Ok(Self { run, records_acceleration })
    }
}

/// Integration steps of a carrier's period, at least.
const STEPS_PER_PERIOD: f64 = 16.0;

/// The frequency of the carrier that is to be simulated in full, in Hz.
fn carrier(experiment: &Experiment, simulate: &Simulate) -> Result<f64, ConfigError> {
    let readout = ["accelerometer", "readout"].into_iter().fold(Key::from("device"), Key::child);
    let device = described(experiment);
    let described = device.as_ref().map(|device| &device.readout);
    let Some(frequency) = described.and_then(|readout| readout.carrier_frequency.as_ref()) else {
        let remedy = "a carrier in full has a frequency: write `carrier_frequency = \"1 MHz\"`".to_owned();
        return Err(experiment.error(readout.child("carrier_frequency"), ConfigFault::MissingKey { remedy }));
    };
    if described.is_some_and(|readout| readout.carrier_mean_square.si() != 0.5) {
        let why = "a carrier in full is a sine, whose mean square is 0.5".to_owned();
        return Err(experiment.error(readout.child("carrier_mean_square"), ConfigFault::Value { why }));
    }
    if simulate.integration_rate.si() < STEPS_PER_PERIOD * frequency.si() {
        let why = format!(
            "a carrier in full needs {STEPS_PER_PERIOD} steps to a period: write `{:.0} MHz` or more",
            1e-6 * STEPS_PER_PERIOD * frequency.si()
        );
        return Err(experiment.error("simulate.integration_rate", ConfigFault::Value { why }));
    }
    Ok(frequency.si())
}

/// What is to be measured, from the file, and whether under the carrier in full.
fn driven(experiment: &Experiment, drive: &DriveSource) -> Result<(Acceleration, bool), ConfigError> {
    let key = || Key::from("simulate").child("drive");
    let DriveSource::Acceleration(AccelerationDrive { amplitude, frequency, full_carrier }) = drive else {
        let why =
            "an accelerometer measures an acceleration; write `[simulate.drive.acceleration]`".to_owned();
        return Err(experiment.error(key(), ConfigFault::Value { why }));
    };
    let missing = |name: &str, remedy: &str| {
        let remedy = format!("a sine has both: write `{name} = \"{remedy}\"`");
        Err(experiment.error(key().child("acceleration").child(name), ConfigFault::MissingKey { remedy }))
    };
    match (amplitude.as_ref().map(Quantity::si), frequency.as_ref().map(Quantity::si)) {
        (Some(amplitude), Some(frequency_hz)) => {
            Ok((Acceleration::Sine { amplitude, frequency_hz }, *full_carrier))
        }
        (None, None) => Ok((Acceleration::Chance, *full_carrier)),
        (Some(_), None) => missing("frequency", "10 Hz"),
        (None, Some(_)) => missing("amplitude", "1 gn"),
    }
}

/// Why a loop does not hold.
fn unstable(experiment: &Experiment, closed: &RebalanceLoop<f64>, interval_s: f64) -> ConfigError {
    let key = ["accelerometer", "feedback", "proportional_gain"];
    let key = key.into_iter().fold(Key::from("device"), Key::child);
    let why = if closed.controller.proportional < 0.0 {
        "the loop is unstable: its gain is negative, which pushes the mass away from rest; change its sign"
            .to_owned()
    } else if closed.device.softened_spring(0.0) <= 0.0 && closed.controller.proportional == 0.0 {
        "the plates pull more than the spring holds; lower the carrier or the bias".to_owned()
    } else {
        let nyquist = std::f64::consts::PI / interval_s;
        let margin = closed.margins(1.0, nyquist).phase.map_or(f64::NAN, f64::to_degrees);
        format!(
            "the loop is unstable at this sampling rate (phase margin {margin:.0}°); lower the gain, or sample faster"
        )
    };
    experiment.error(key, ConfigFault::Value { why })
}

impl Simulation for AccelerometerSimulation {
    fn recorded(&self) -> &[SimulatedColumn] {
        const WITHOUT: &[SimulatedColumn] = &[RECORDED[0], RECORDED[1]];
        if self.records_acceleration { &RECORDED } else { WITHOUT }
    }

    fn truth(&self) -> &[SimulatedColumn] {
        &TRUE
    }

    fn samples(&self) -> u64 {
        self.run.samples
    }

    fn run(&self, each: &mut dyn FnMut(&SimulatedSample) -> ControlFlow<()>) -> Result<(), SimulateError> {
        self.run.follow(&mut |moment| {
            let recorded = [moment.feedback, moment.output, moment.acceleration];
            each(&SimulatedSample {
                time_s: moment.time_s,
                recorded: &recorded[..self.recorded().len()],
                truth: &[moment.acceleration, moment.displacement, moment.velocity],
            })
        })
    }
}
