//! The scanner with shared electrodes, recordings of it made by simulation, and how an estimate is scored.

use super::chance::Chance;
use kalmems_core::{Measurement, Nodes, NoiseDensity, Process, Rk4};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use std::f64::consts::TAU;

/// The device of Chen et al. 2020, Table II.
pub const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
pub const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: COMB,
    carrier_mean_square: 18.0,
};
pub const READOUT: DemodulatedComb<f64> = DemodulatedComb { comb: COMB, gain: -0.3574e12, offset: 6.3945 };

/// Of one sample, in V².
pub const NOISE_VARIANCE: f64 = 1.92e-4;
/// Between two samples, in s.
pub const INTERVAL: f64 = 1e-6;
/// Of the random angular acceleration in truth, in rad²/s³: the motion wanders by about 0.02°.
pub const DENSITY: f64 = 1e6;
/// How far off the filters start, by one standard deviation: rad and rad/s.
pub const START_SD: [f64; 2] = [0.02, 2e3];
/// The drive is 90 V + 90 V·sin, in Hz: near the upper edge of the resonance.
const DRIVE_HZ: f64 = 31_350.0;
/// Steps of the truth in one interval.
const STEPS: u32 = 10;

/// What a recording is made with.
#[derive(Clone, Copy)]
pub struct Truth {
    /// The true stiffness over that of [`SCANNER`]; the drive's frequency goes with its root.
    pub stiffness: f64,
    /// Of the angular acceleration, in rad²/s³.
    pub density: f64,
    pub samples: usize,
}

/// The drive, and the motion that it made.
pub struct Motion {
    pub truth: Truth,
    pub drive: Vec<Nodes<f64>>,
    /// dV/dt at the samples, in V/s.
    pub drive_slope: Vec<f64>,
    /// θ and θ̇ at the samples.
    pub state: Vec<[f64; 2]>,
    /// C(θ) behind two first-order low-pass filters, in F.
    pub filtered_capacitance: Vec<f64>,
    /// Where a filter starts: the truth of the first sample's beginning, missed at random.
    pub start: [f64; 2],
}

/// The corner of both poles of the demodulator, in rad/s.
pub const POLE: f64 = TAU * 31e3;

impl Truth {
    fn frequency(&self) -> f64 {
        DRIVE_HZ * self.stiffness.sqrt()
    }

    /// The drive at a time.
    pub fn volts(&self, time: f64) -> f64 {
        90.0 + 90.0 * (TAU * self.frequency() * time).sin()
    }

    /// The drive over an interval from a time on.
    pub fn nodes(&self, from: f64, interval: f64) -> Nodes<f64> {
        let at = |part: f64| self.volts(from + part * interval);
        Nodes { start: at(0.0), middle: at(0.5), end: at(1.0) }
    }

    /// Integrated by Runge–Kutta steps of a tenth of the interval. Sample k is at the end of interval k.
    pub fn motion(self, chance: &mut Chance) -> Motion {
        let resonator = TorsionalResonator {
            stiffness: self.stiffness * SCANNER.resonator.stiffness,
            ..SCANNER.resonator
        };
        let device = ParametricScanner { resonator, ..SCANNER };
        let step = INTERVAL / f64::from(STEPS);
        let process = Rk4::new(device, step, &NoiseDensity::none(), (&[0.0, 0.0], &0.0));
        let mut x = [0.15, 0.0];
        let start = [x[0] + START_SD[0] * chance.gaussian(), x[1] + START_SD[1] * chance.gaussian()];
        let mut low_pass = [COMB.capacitance(x[0]); 2];
        let share = 1.0 - (-POLE * step).exp();
        let mut motion = Motion {
            truth: self,
            drive: Vec::new(),
            drive_slope: Vec::new(),
            state: Vec::new(),
            filtered_capacitance: Vec::new(),
            start,
        };
        for k in 0..self.samples {
            let from = k as f64 * INTERVAL;
            for i in 0..STEPS {
                let before = COMB.capacitance(x[0]);
                x = process.step(&x, &self.nodes(from + f64::from(i) * step, step));
                x[1] += (self.density * step).sqrt() * chance.gaussian();
                let middle = f64::midpoint(before, COMB.capacitance(x[0]));
                let first = low_pass[0];
                low_pass[0] += share * (middle - low_pass[0]);
                low_pass[1] += share * (f64::midpoint(first, low_pass[0]) - low_pass[1]);
            }
            let rate = TAU * self.frequency();
            motion.drive.push(self.nodes(from, INTERVAL));
            motion.drive_slope.push(90.0 * rate * (rate * (from + INTERVAL)).cos());
            motion.state.push(x);
            motion.filtered_capacitance.push(low_pass[1]);
        }
        motion
    }
}

/// What a sensor without faults reads.
pub fn signal(motion: &Motion, noise_sd: f64, chance: &mut Chance) -> Vec<f64> {
    motion.state.iter().map(|x| READOUT.predict(x)[0] + noise_sd * chance.gaussian()).collect()
}

/// The root mean square error of an estimate.
#[derive(Clone, Copy)]
pub struct Score {
    /// Of the angle, in 10⁻³ degrees.
    pub angle_mdeg: f64,
    /// Of the motion's phase, cycle by cycle, in degrees of a cycle.
    pub phase_deg: f64,
}

impl Score {
    /// From sample `from` on.
    pub fn of(angle: &[f64], motion: &Motion, from: usize) -> Self {
        let pairs: Vec<(f64, f64)> = angle
            .iter()
            .zip(&motion.state)
            .map(|(estimate, truth)| (*estimate, truth[0]))
            .skip(from)
            .collect();
        let mean_square = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let squares: Vec<f64> = pairs.iter().map(|(a, b)| (a - b).powi(2)).collect();
        // The mirror swings at half of the drive's frequency.
        let turn = TAU * motion.truth.frequency() / 2.0 * INTERVAL;
        let cycle = 64; // samples, less 0.3 %
        let phases: Vec<f64> = pairs
            .chunks_exact(cycle)
            .map(|cycle| {
                let mut sums = [0.0; 4];
                for (i, (a, b)) in cycle.iter().enumerate() {
                    let (sin, cos) = (turn * i as f64).sin_cos();
                    for (sum, part) in sums.iter_mut().zip([a * cos, a * sin, b * cos, b * sin]) {
                        *sum += part;
                    }
                }
                let [ac, as_, bc, bs] = sums;
                (as_ * bc - ac * bs).atan2(ac * bc + as_ * bs).powi(2)
            })
            .collect();
        Self {
            angle_mdeg: mean_square(&squares).sqrt().to_degrees() * 1e3,
            phase_deg: mean_square(&phases).sqrt().to_degrees(),
        }
    }
}
