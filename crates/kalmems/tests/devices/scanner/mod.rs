//! A scanner that is simulated with one set of parameters and estimated with another.

#![allow(dead_code)] // each test uses its part

use kalmems::estimate::SegmentEstimate;
use kalmems::estimate::Trajectory;
use kalmems::evaluate::{Accuracy, ComparisonExtent, MotionErrors, ReferenceMotion, evaluate_motion};
use kalmems::progress::{Interruption, Silent};
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::simulate::{Drive, Simulator, WhiteNoise};
use kalmems_core::{Dynamics, Measurement};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{DriveGain, ParametricScanner, TorsionalResonator};
use kalmems_models::readout::{AngleBefore, DemodulatedComb, LowPassedComb};
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// Chen et al., 2020, Table II.
pub const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
pub const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: COMB,
    carrier_mean_square: 18.0,
};
pub const READOUT: DemodulatedComb<f64> = DemodulatedComb { comb: COMB, gain: -0.3574e12, offset: 6.3945 };
pub const NOISE_VARIANCE: f64 = 1.92e-4;
/// The corners of the demodulator's stages in Hz.
pub const POLE_HZ: f64 = 31_350.0;
pub const RATE_HZ: f64 = 1e6;
/// Steps of the simulation per sample.
const STEPS: usize = 10;
pub const DURATION_S: f64 = 0.024;
pub const SKIP_S: f64 = 8e-3;

pub fn drive(frequency_hz: f64) -> Drive {
    Drive::Sine { offset: 90.0, amplitude: 90.0, frequency_hz, phase_rad: 0.0 }
}

/// A steady motion: the drive's frequency, the state where the drive's phase is 0, and the amplitude in rad.
#[derive(Clone, Copy, Debug)]
pub struct Steady {
    pub drive_hz: f64,
    pub start: [f64; 2],
    pub amplitude: f64,
}

/// The motions of a slow sweep down from 31.50 kHz to 31.11 kHz in `count` steps, where the scanner moves.
pub fn swept_down(count: u32) -> Vec<Steady> {
    let mut state = [1e-3, 0.0];
    let mut steady = Vec::new();
    for i in 0..count {
        let drive_hz = 31_500.0 - 390.0 * f64::from(i) / f64::from(count - 1);
        let mut simulator = Simulator::new(SCANNER, drive(drive_hz), drive_hz * 40.0, state);
        let mut amplitude = 0.0_f64;
        // An even number of periods of the drive, so that the motion's sign is the same at each frequency.
        for step in 0..40 * 4000 {
            simulator.step();
            if step > 40 * 3900 {
                amplitude = amplitude.max(simulator.state()[0].abs());
            }
        }
        state = *simulator.state();
        if amplitude > 1_f64.to_radians() {
            steady.push(Steady { drive_hz, start: state, amplitude });
        } else {
            state = [1e-3, 0.0];
        }
    }
    steady
}

/// A recording and the truth behind it.
pub struct Simulated {
    pub drive_v: Vec<f64>,
    pub signal: Vec<f64>,
    pub reference: ReferenceMotion,
    pub motion_hz: f64,
}

/// Simulates `samples` of the scanner in a steady motion; `staged` reads it through the demodulator's stages.
pub fn simulate(steady: &Steady, staged: bool, samples: usize, seed: u64) -> Simulated {
    let mut noise = WhiteNoise::new(seed, 0);
    let sd = NOISE_VARIANCE.sqrt();
    if staged {
        let model = low_passed();
        let settled = model.voltage(steady.start[0]);
        // The stages settle within a millisecond; they are let, over whole periods of the motion.
        let start = [steady.start[0], steady.start[1], settled, settled];
        let mut settling = Simulator::new(model, drive(steady.drive_hz), steady.drive_hz * 40.0, start);
        for _ in 0..40 * 40 {
            settling.step();
        }
        return sample(model, *settling.state(), &model, steady, samples, || sd * noise.sample());
    }
    sample(SCANNER, steady.start, &READOUT, steady, samples, || sd * noise.sample())
}

pub fn low_passed() -> LowPassedComb<f64> {
    LowPassedComb {
        device: DriveGain { scanner: SCANNER, drive_gain: 1.0 },
        before: AngleBefore::none(),
        gain: READOUT.gain,
        offset: READOUT.offset,
        poles: [TAU * POLE_HZ; 2],
    }
}

fn sample<D, H, const N: usize>(
    dynamics: D,
    start: [f64; N],
    readout: &H,
    steady: &Steady,
    samples: usize,
    mut noise: impl FnMut() -> f64,
) -> Simulated
where
    D: Dynamics<f64, N, Input = f64> + Copy,
    H: Measurement<f64, N, 1>,
{
    let mut simulator = Simulator::new(dynamics, drive(steady.drive_hz), RATE_HZ * STEPS as f64, start);
    let mut reference = ReferenceMotion {
        states: ["angle", "rate"],
        time_s: Vec::new(),
        angle: Vec::new(),
        rate: Some(Vec::new()),
        accuracy: Accuracy::default(),
    };
    let (mut drive_v, mut signal) = (Vec::new(), Vec::new());
    for k in 0..samples {
        if k > 0 {
            for _ in 0..STEPS {
                simulator.step();
            }
        }
        reference.time_s.push(k as f64 / RATE_HZ);
        reference.angle.push(simulator.state()[0]);
        reference.rate.as_mut().unwrap().push(simulator.state()[1]);
        drive_v.push(simulator.drive());
        signal.push(readout.predict(simulator.state())[0] + noise());
    }
    Simulated { drive_v, signal, reference, motion_hz: steady.drive_hz / 2.0 }
}

/// What the filters are told of the device: factors on the truth, and the voltage that the offset is off.
#[derive(Clone, Copy, Debug)]
pub struct Told {
    pub stiffness: f64,
    pub damping: f64,
    pub drive: f64,
    pub gain: f64,
    pub offset_v: f64,
}

pub const TRUTH: Told = Told { stiffness: 1.0, damping: 1.0, drive: 1.0, gain: 1.0, offset_v: 0.0 };

/// An experiment with these filters, as TOML tables, on `recording.csv` beside it.
pub fn experiment(told: &Told, skip_s: f64, filters: &str) -> String {
    format!(
        "name = \"simulated\"
[device.shared_scanner.resonator]
inertia = \"1.15e-14 kg m^2\"
stiffness = \"{:e} N m\"
damping = \"{:e} N m s\"
[device.shared_scanner.comb]
nominal_capacitance = \"5.71 pF\"
angular_width = \"0.2 rad\"
bias_capacitance = \"9.79 pF\"
[device.shared_scanner.readout]
gain = \"{:e} V/pF\"
offset = \"{} V\"
noise_variance = \"1.92e-4 V^2\"
poles = [\"31.35 kHz\", \"31.35 kHz\"]
[device.shared_scanner.carrier]
amplitude = \"6 V\"
included_in_drive = false
[[recording]]
role = \"test\"
file = \"recording.csv\"
clock = {{ column = \"time_s\" }}
channels = {{ drive = \"drive_V\", signal = \"cap_V\" }}
[estimate]
skip = \"{skip_s:e} s\"
process_noise = {{ angular_acceleration = \"1e4 rad^2/s^3\" }}
{filters}",
        1.10e-4 * told.stiffness,
        5.95e-12 * told.damping,
        -0.3574 * told.gain,
        6.3945 + told.offset_v,
    )
}

/// A filter's table from its lines.
pub fn filter(name: &str, method: &str, lines: &str) -> String {
    format!(
        "[[estimate.filter]]\nname = \"{name}\"\nmethod = \"{method}\"\nstart = {{ angle = \"0.05 rad\", rate = \"0 rad/s\" }}\n{lines}\n"
    )
}

/// The start that knows next to nothing.
pub const WIDE: &str = "start_sd = { angle = \"0.15 rad\", rate = \"15e3 rad/s\" }\n";

/// Runs the experiment's filters on a simulated recording, whose drive the told factor is taken off.
pub fn estimate(simulated: &Simulated, told: &Told, toml: &str) -> SegmentEstimate {
    let folder = tempfile::tempdir().unwrap();
    let mut csv = String::from("time_s,drive_V,cap_V\n");
    for (k, (drive, signal)) in simulated.drive_v.iter().zip(&simulated.signal).enumerate() {
        let _ = writeln!(csv, "{:e},{:e},{signal:e}", k as f64 / RATE_HZ, drive * told.drive);
    }
    std::fs::write(folder.path().join("recording.csv"), csv).unwrap();
    let path = folder.path().join("experiment.toml");
    let experiment = published().parse(toml, &path).unwrap_or_else(|e| panic!("{e}"));
    let rig = published().rig(&experiment).unwrap();
    let index = rig.wanted(&experiment).unwrap()[0];
    let recording = SampledRecording::read(
        &folder.path().join("recording.csv"),
        &rig.layout(&experiment, index).unwrap(),
    )
    .unwrap();
    rig.estimate(&experiment, index, &recording, &Silent).unwrap_or_else(|e| panic!("{e}")).remove(0)
}

/// The errors of a trajectory; the sign of the motion is taken as known.
pub fn errors(simulated: &Simulated, trajectory: &Trajectory, skip_s: f64) -> MotionErrors {
    let extent = ComparisonExtent { from_s: skip_s, motion_hz: simulated.motion_hz, drive: None };
    let direct = evaluate_motion(trajectory, &simulated.reference, extent, &Interruption::never()).unwrap();
    if !direct.sign_disagrees {
        return direct;
    }
    let mut mirrored = trajectory.clone();
    for state in mirrored.states.iter_mut().take(2) {
        for mean in &mut state.mean {
            *mean = -*mean;
        }
    }
    evaluate_motion(&mirrored, &simulated.reference, extent, &Interruption::never()).unwrap()
}

/// The first quartile, the median and the third.
pub fn quartiles(values: &[f64]) -> [f64; 3] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    [1, 2, 3].map(|quarter| sorted[(sorted.len() - 1) * quarter / 4])
}
