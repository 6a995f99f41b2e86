//! A piston mirror that is simulated and estimated, without files.

#![allow(dead_code)] // each test uses its part

use kalmems::config::Experiment;
use kalmems::estimate::Trajectory;
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::simulate::ComputedRecording;
use kalmems::workflow::{self, Outcome};
use std::path::Path;

/// Faller and Zangl, 2017: 109.3 fF at 1 mm, 500 Hz, 0.5 mm.
pub const BASE_F: f64 = 109.3e-15;

/// What is simulated.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    pub noise_af: f64,
    pub rate_hz: f64,
    pub duration_s: f64,
    /// Relative, per minute.
    pub drift: f64,
    pub frequency_hz: f64,
    pub phase_rad: f64,
    pub amplitude_mm: f64,
    pub seed: u64,
}

pub const CASE: Case = Case {
    noise_af: 0.151,
    rate_hz: 20e3,
    duration_s: 1.6,
    drift: 0.0,
    frequency_hz: 500.0,
    phase_rad: 0.7,
    amplitude_mm: 0.5,
    seed: 1,
};

/// Five states from the signal.
pub const FIVE: &str = r#"
[[estimate.filter]]
name = "five"
method = "ekf"
start = "from_signal"
process_noise = { frequency = "1e-8 Hz^2/s", offset = "1e-19 m^2/s", amplitude_rate = "1e-14 m^2/s^3" }
"#;

impl Case {
    /// The file, with these tables of filters and `skip`.
    pub fn experiment(&self, skip: &str, filters: &str) -> Experiment {
        let Self { noise_af, rate_hz, duration_s, drift, frequency_hz, phase_rad, amplitude_mm, seed } = self;
        let rate = drift * amplitude_mm * 1e-3 / 60.0;
        let text = format!(
            r#"
name = "piston"
[device.piston_mirror]
capacitance = {{ reference_distance = "1 mm", coefficients = ["0 F", "109.3 fF"] }}
readout = {{ noise_density = "{noise_af} aF/sqrt(Hz)" }}
[[recording]]
role = "test"
file = "recording.csv"
clock = {{ column = "time_s" }}
channels = {{ signal = "cap_F" }}
[recording.reference]
file = "reference.csv"
channels = {{ position = "position_m", velocity = "velocity_m_per_s" }}
[simulate]
duration = "{duration_s} s"
sampling_rate = "{rate_hz} Hz"
integration_rate = "{rate_hz} Hz"
seed = {seed}
drive = {{ prescribed = {{}} }}
[simulate.start]
amplitude = "{amplitude_mm} mm"
frequency = "{frequency_hz} Hz"
phase = "{phase_rad} rad"
offset = "1 mm"
amplitude_rate = "{rate:e} m/s"
[estimate]
skip = "{skip}"
{filters}
"#
        );
        published().parse(&text, Path::new("piston.toml")).unwrap_or_else(|e| panic!("{e}"))
    }

    /// Simulates and estimates.
    pub fn run(&self, skip: &str, filters: &str) -> (Outcome, Metrics) {
        let experiment = self.experiment(skip, filters);
        let simulation = published().rig(&experiment).unwrap().simulate(&experiment).unwrap();
        let unwritten = ComputedRecording::of(&*simulation, &Silent).unwrap();
        let outcome = workflow::estimate_computed(published(), &experiment, &unwritten, &Silent).unwrap();
        let metrics = Metrics::of(&outcome);
        (outcome, metrics)
    }
}

pub fn trajectory<'a>(outcome: &'a Outcome, key: &str) -> &'a Trajectory {
    let trajectories = &outcome.recordings[0].segments[0].estimate.trajectories;
    trajectories.iter().find(|t| t.key == key).unwrap()
}
