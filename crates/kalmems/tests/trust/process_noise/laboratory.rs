//! Devices whose rates of change have white noise, in equations of their own, and what is told of them.

use crate::coverage::chance::Chance;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// States of the largest device.
pub type State = [f64; 5];

/// A device, its drive and its recording.
pub struct Laboratory {
    pub name: &'static str,
    /// The place of each density in the experiment, its truth and the state whose rate has it.
    pub densities: &'static [(&'static str, f64, usize)],
    /// The place of the noise of each signal in the experiment, and the standard deviation of a sample.
    pub noises: &'static [(&'static str, f64)],
    /// A noise as the experiment has it, from the variance of a sample.
    pub noise: fn(f64) -> f64,
    /// The drive's column, where there is one, and those of the signals.
    pub drive: Option<fn(f64) -> f64>,
    pub columns: &'static str,
    pub start: State,
    pub rates: fn(&State, f64) -> State,
    pub signals: fn(&State) -> Vec<f64>,
    pub interval_s: f64,
    pub steps: u32,
    pub samples: u32,
    /// The experiment, with every noise left to the recording.
    pub told: &'static str,
}

impl Laboratory {
    /// Writes a recording and the experiment that is told of it: the mean square of each noise that was added to a signal, over its variance.
    pub fn write(&self, seed: u64, is_noisy: bool, folder: &Path) -> Vec<f64> {
        let mut chance = Chance::new(seed);
        let mut squares = vec![0.0; self.noises.len()];
        let h = self.interval_s / f64::from(self.steps);
        let drive = |time: f64| self.drive.map_or(0.0, |drive| drive(time));
        let mut x = self.start;
        let mut rows = format!("{}\n", self.columns);
        for k in 0..self.samples {
            let time = f64::from(k) * self.interval_s;
            write!(rows, "{time:.9}").unwrap();
            if self.drive.is_some() {
                write!(rows, ",{:.9}", drive(time)).unwrap();
            }
            for ((signal, (_, sd)), sum) in (self.signals)(&x).iter().zip(self.noises).zip(&mut squares) {
                let drawn = chance.normal();
                *sum += drawn * drawn / f64::from(self.samples);
                write!(rows, ",{:.15e}", signal + sd * drawn).unwrap();
            }
            rows.push('\n');
            for step in 0..self.steps {
                let time = time + f64::from(step) * h;
                x = self.step(&x, [drive(time), drive(time + 0.5 * h), drive(time + h)], h);
                for (_, density, state) in self.densities.iter().filter(|_| is_noisy) {
                    x[*state] += (density * h).sqrt() * chance.normal();
                }
            }
        }
        fs::write(folder.join("recording.csv"), rows).unwrap();
        fs::write(folder.join("experiment.toml"), self.told).unwrap();
        squares
    }

    /// One step of Runge and Kutta's method.
    fn step(&self, x: &State, [first, middle, last]: [f64; 3], h: f64) -> State {
        let beside = |slope: &State, h: f64| -> State { std::array::from_fn(|i| x[i] + h * slope[i]) };
        let k1 = (self.rates)(x, first);
        let k2 = (self.rates)(&beside(&k1, 0.5 * h), middle);
        let k3 = (self.rates)(&beside(&k2, 0.5 * h), middle);
        let k4 = (self.rates)(&beside(&k3, h), last);
        std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
    }
}

const fn variance(variance: f64) -> f64 {
    variance
}

/// A comb's capacitance that moves, and its slope.
fn comb(nominal: f64, angle: f64) -> [f64; 2] {
    let bell = nominal * (-(angle / 0.2) * (angle / 0.2)).exp();
    [bell, -50.0 * angle * bell]
}

/// The rate of an axis from inertia, stiffness, damping and nominal capacitance; the carrier adds 18 V² to the drive's.
fn axis([inertia, stiffness, damping, nominal]: [f64; 4], [angle, rate]: [f64; 2], volts: f64) -> f64 {
    (0.5 * comb(nominal, angle)[1] * (volts * volts + 18.0) - damping * rate - stiffness * angle) / inertia
}

const X: [f64; 4] = [1.15e-14, 1.10e-4, 5.95e-12, 5.71e-12];
const Y: [f64; 4] = [6.0e-14, 1.00e-4, 1.0e-11, 4.0e-12];

pub const SCANNER: Laboratory = Laboratory {
    name: "shared scanner",
    densities: &[("estimate.process_noise.angular_acceleration", 1e8, 1)],
    noises: &[("device.shared_scanner.readout.noise_variance", 0.013_856_406_460_551_018)],
    noise: variance,
    drive: Some(|time| 90.0 + 90.0 * (TAU * 31_350.0 * time).sin()),
    columns: "time_s,drive_V,cap_V",
    start: [0.117, 12.8e3, 0.0, 0.0, 0.0],
    rates: |x, volts| [x[1], axis(X, [x[0], x[1]], volts), 0.0, 0.0, 0.0],
    signals: |x| vec![-0.3574e12 * (comb(X[3], x[0])[0] + 9.79e-12) + 6.3945],
    interval_s: 1e-6,
    steps: 5,
    samples: 10_000,
    told: include_str!("scanner.toml"),
};

pub const TWO_AXES: Laboratory = Laboratory {
    name: "two axes",
    densities: &[
        ("estimate.process_noise.angular_acceleration_x", 1e8, 1),
        ("estimate.process_noise.angular_acceleration_y", 1e7, 3),
    ],
    noises: &[("device.shared_scanner.readout.noise_variance", 0.013_856_406_460_551_018)],
    noise: variance,
    drive: Some(|time| 90.0 + 90.0 * (TAU * 31_350.0 * time).sin() + 70.0 * (TAU * 13_080.0 * time).sin()),
    columns: "time_s,drive_V,cap_V",
    start: [-0.117, -12.8e3, 0.117, 2.5e3, 0.0],
    rates: |x, volts| [x[1], axis(X, [x[0], x[1]], volts), x[3], axis(Y, [x[2], x[3]], volts), 0.0],
    signals: |x| vec![-0.3574e12 * (comb(X[3], x[0])[0] + comb(Y[3], x[2])[0] + 14.79e-12) + 6.3945],
    interval_s: 1e-6,
    steps: 5,
    samples: 12_000,
    told: include_str!("two_axes.toml"),
};

pub const THRESHOLD: Laboratory = Laboratory {
    name: "threshold scanner",
    densities: &[("estimate.process_noise.angular_acceleration", 1e4, 1)],
    noises: &[("device.threshold_scanner.readout.noise_variance", 0.0435)],
    noise: variance,
    drive: Some(|_| 0.0),
    columns: "time_s,drive_V,cap_V",
    start: [-0.102, 413.0, 0.0, 0.0, 0.0],
    rates: |x, _| {
        let natural = TAU * 624.6;
        [x[1], -2.0 * 0.0066 * natural * x[1] - natural * natural * x[0], 0.0, 0.0, 0.0]
    },
    signals: |x| {
        let curve = 1.0 / (1.0 + (-76.0 * (x[0] - 3.7e-3)).exp()) - 0.5;
        vec![2.82e-3 * curve * x[1]]
    },
    interval_s: 4e-6,
    steps: 4,
    samples: 12_000,
    told: include_str!("threshold.toml"),
};

/// Inner and outer end of each electrode of the stage in m.
const ENDS: [[f64; 2]; 4] = [[-1.39e-3, -0.99e-3], [475e-6, 795e-6], [0.99e-3, 1.39e-3], [-795e-6, -475e-6]];

/// dC/dθ of plates of 0.4 mm whose gap is 19.2 µm − w·t, t = tan θ, by Simpson's formula on forty parts.
fn slope([from, to]: [f64; 2], angle: f64) -> f64 {
    let t = angle.tan();
    let at = |k: u32| {
        let w = from + (to - from) * f64::from(k) / 40.0;
        let weight = if k == 0 || k == 40 {
            1.0
        } else if k.is_multiple_of(2) {
            2.0
        } else {
            4.0
        };
        weight * w / ((19.2e-6 - w * t) * (19.2e-6 - w * t))
    };
    let integral = (0..=40).map(at).sum::<f64>() * (to - from) / 120.0;
    8.854_187_8e-12 * 0.4e-3 * (1.0 + t * t) * integral
}

pub const STAGE: Laboratory = Laboratory {
    name: "micro-stage",
    densities: &[("estimate.process_noise.angular_acceleration", 0.5, 1)],
    noises: &[
        ("device.micro_stage.electrodes.1A.noise_variance", 4e-6),
        ("device.micro_stage.electrodes.1B.noise_variance", 4e-6),
        ("device.micro_stage.electrodes.2A.noise_variance", 4e-6),
        ("device.micro_stage.electrodes.2B.noise_variance", 4e-6),
    ],
    noise: variance,
    drive: Some(|time| 1.2 * (TAU * 1700.0 * time).sin()),
    columns: "time_s,drive_V,c1A_V,c1B_V,c2A_V,c2B_V",
    start: [0.0; 5],
    rates: |x, volts| {
        let natural = TAU * 1714.5;
        let acceleration = 3782.5 * volts - 0.01 * natural * x[1] - natural * natural * x[0];
        [x[1], acceleration, 0.0, 0.0, 0.0]
    },
    signals: |x| ENDS.iter().map(|ends| -2.407_52e7 * slope(*ends, x[0]) * x[1]).collect(),
    interval_s: 1.6e-6,
    steps: 4,
    samples: 8000,
    told: include_str!("stage.toml"),
};

pub const EQUATIONS: Laboratory = Laboratory {
    name: "comb resonator (equations)",
    densities: &[("estimate.process_noise.v", 1e-5, 1)],
    noises: &[("device.equations.noise.signal", 1e-3)],
    noise: variance,
    drive: Some(|time| 10.0 + 2.0 * (TAU * 10_020.0 * time).sin()),
    columns: "time_s,drive_V,signal_V",
    start: [0.0; 5],
    rates: |x, volts| {
        let spring = 4.7374 * x[0] * (1.0 + 6.25e8 * x[0] * x[0]);
        [x[1], (2.96e-9 * volts * volts - 3.0159e-7 * x[1] - spring) / 1.2e-9, 0.0, 0.0, 0.0]
    },
    signals: |x| vec![0.2e6 * x[0]],
    interval_s: 2e-6,
    steps: 4,
    samples: 12_000,
    told: include_str!("equations.toml"),
};

/// Amplitude, its rate, frequency, rest position and phase.
pub const PISTON: Laboratory = Laboratory {
    name: "piston mirror",
    densities: &[
        ("estimate.process_noise.frequency", 1e-6, 2),
        ("estimate.process_noise.offset", 1e-15, 3),
        ("estimate.process_noise.amplitude_rate", 1e-13, 1),
    ],
    noises: &[("device.piston_mirror.readout.noise_density", 0.151e-16)],
    // One-sided white noise of density n² at 20 kHz: a sample has the variance n²·f/2.
    noise: |variance| (variance / 10e3).sqrt(),
    drive: None,
    columns: "time_s,cap_F",
    start: [0.5e-3, 0.0, 500.0, 1e-3, 0.7],
    rates: |x, _| [x[1], 0.0, 0.0, 0.0, TAU * x[2]],
    signals: |x| vec![109.3e-15 * 1e-3 / (x[3] + x[0] * x[4].cos())],
    interval_s: 5e-5,
    steps: 1,
    samples: 30_000,
    told: include_str!("piston.toml"),
};
