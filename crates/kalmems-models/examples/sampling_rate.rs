//! How accurate a scanner's filter is at a sampling rate and with fewer corrections, and what a microcontroller pays:
//!
//!     cargo run --release -p kalmems-models --example sampling_rate
//!
//! The scanner of Chen et al. (shared electrodes, 2020) swings steadily; a random acceleration pushes it and the signal
//! has noise, four seeds. The bound is that of Cramér and Rao along the true motion, by the Jacobians at the truth. The
//! filters compute in f32 as a microcontroller does; each is given the decade of q that serves it best. Instructions are
//! what `.ci/firmware` counts on an emulated Cortex-M4F.

use kalmems_core::bound::CramerRao;
use kalmems_core::{
    Covariance, Ekf, Euler, Filter, Mat, Measurement, Nodes, NoiseDensity, Process, Rk4, Scalar,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use std::f64::consts::TAU;

/// Instructions of a prediction, and of a prediction with its correction: `.ci/firmware`.
const EULER: [f64; 2] = [92.0, 149.0];
const RUNGE_KUTTA: [f64; 2] = [317.0, 383.0];

const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: COMB,
    carrier_mean_square: 18.0,
};
const READOUT: DemodulatedComb<f64> = DemodulatedComb { comb: COMB, gain: -0.3574e12, offset: 6.3945 };
const VARIANCE: f64 = 1.92e-4;
const DENSITY: f64 = 1e6;
/// The finest step of the truth in s; sampling intervals are multiples of it.
const FINE_S: f64 = 0.125e-6;
const SETTLING_S: f64 = 30e-3;
const SEEDS: u64 = 4;
/// What a filter settles in, and what is scored after it, in s.
const SPAN_S: [f64; 2] = [6e-3, 6e-3];

fn drive(t: f64) -> f64 {
    90.0 + 90.0 * (TAU * 31_350.0 * t).sin()
}

fn nodes(from_s: f64, interval_s: f64) -> Nodes<f64> {
    Nodes { start: drive(from_s), middle: drive(from_s + 0.5 * interval_s), end: drive(from_s + interval_s) }
}

fn process(interval_s: f64, density: f64) -> Rk4<ParametricScanner<f64>, f64, 2> {
    Rk4::new(SCANNER, interval_s, &NoiseDensity::none().on::<1>(density), (&[0.0; 2], &0.0))
}

/// Gaussians: SplitMix64 with Box and Muller.
struct Chance(u64);

impl Chance {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (((z ^ (z >> 31)) >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn gaussian(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// A true motion from the end of the settling on, at each fine step, and when it begins.
fn truth(chance: &mut Chance) -> (Vec<[f64; 2]>, f64) {
    let step = process(FINE_S, DENSITY);
    let push = step.noise().covariance().get(1, 1).sqrt();
    let mut x = [0.14, 0.0];
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small positive count
    let count = |seconds: f64| (seconds / FINE_S).round() as usize;
    let (before, after) = (count(SETTLING_S), count(SPAN_S[0] + SPAN_S[1]));
    let mut kept = Vec::with_capacity(after + 1);
    for k in 0..=before + after {
        if k >= before {
            kept.push(x);
        }
        x = step.step(&x, &nodes(k as f64 * FINE_S, FINE_S));
        x[1] += push * chance.gaussian();
    }
    (kept, before as f64 * FINE_S)
}

/// How a step is integrated.
#[derive(Clone, Copy, PartialEq)]
enum Scheme {
    Euler,
    RungeKutta,
}

/// One way of sampling.
#[derive(Clone, Copy)]
struct Sampling {
    /// Fine steps in an interval.
    stride: usize,
    /// Corrections by one sample in so many.
    every: usize,
}

impl Sampling {
    fn interval_s(self) -> f64 {
        self.stride as f64 * FINE_S
    }

    fn scored_from(self) -> usize {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a small positive count
        let samples = (SPAN_S[0] / self.interval_s()).round() as usize;
        samples
    }
}

/// The mean square of the angle's bound.
fn bound(motion: &[[f64; 2]], from_s: f64, sampling: Sampling) -> f64 {
    let (h, step) = (sampling.interval_s(), process(sampling.interval_s(), DENSITY));
    let r = Covariance::from_variances([VARIANCE]);
    let mut bound = CramerRao::new(Covariance::from_standard_deviations([0.02, 2000.0]));
    let (mut sum, mut count) = (0.0, 0.0);
    for (k, x) in motion.iter().step_by(sampling.stride).enumerate() {
        if k % sampling.every == 0 && bound.observe(&READOUT.linearize(x).1, &r).is_err() {
            return f64::NAN;
        }
        if k >= sampling.scored_from() {
            sum += bound.covariance().get(0, 0);
            count += 1.0;
        }
        let (_, f) = step.linearize(x, &nodes(from_s + k as f64 * h, h));
        bound.advance(&f, step.noise().covariance());
    }
    sum / count
}

/// The mean square error of a filter's angle, in the units that an export has.
fn filtered<T: Scalar + Into<f64>>(
    (motion, from_s): (&[[f64; 2]], f64),
    (sampling, scheme, density): (Sampling, Scheme, f64),
    chance: &mut Chance,
) -> f64 {
    let (h, of) = (sampling.interval_s(), T::of);
    let units = [COMB.angular_width, COMB.angular_width / h];
    let resonator = TorsionalResonator {
        inertia: of(1.0),
        damping: of(5.95e-12 / 1.15e-14 * h),
        stiffness: of(1.10e-4 / 1.15e-14 * h * h),
    };
    let comb = |nominal: f64| GaussianComb { nominal: of(nominal), angular_width: of(1.0), bias: of(-0.0) };
    let pull = COMB.nominal / 1.15e-14 / (units[0] * units[0]) * h * h;
    let scanner = ParametricScanner { resonator, comb: comb(pull), carrier_mean_square: of(18.0) };
    let sd = VARIANCE.sqrt();
    let readout = DemodulatedComb {
        comb: comb(1.0),
        gain: of(READOUT.gain * COMB.nominal / sd),
        offset: of((READOUT.gain * COMB.bias + READOUT.offset) / sd),
    };
    let q = process(h, density);
    let q = |i: usize, j: usize| of(q.noise().covariance().get(i, j) / (units[i] * units[j]));
    let noise = Covariance::from_lower(Mat([[q(0, 0), of(0.0)], [q(1, 0), q(1, 1)]]));
    let (euler, rk4) = (Euler::new(scanner, of(1.0), noise), Rk4::with_noise(scanner, of(1.0), noise.into()));
    let off = [motion[0][0] + 0.02 * chance.gaussian(), motion[0][1] + 2000.0 * chance.gaussian()];
    let mut filter = Ekf::new(
        [of(off[0] / units[0]), of(off[1] / units[1])],
        Covariance::from_standard_deviations([of(0.02 / units[0]), of(2000.0 / units[1])]),
    );
    let one = Covariance::from_variances([of(1.0)]);
    let (mut sum, mut count) = (0.0, 0.0);
    for (k, x) in motion.iter().step_by(sampling.stride).enumerate() {
        if k > 0 {
            let drive = nodes(from_s + (k - 1) as f64 * h, h);
            let stepped = match scheme {
                Scheme::Euler => filter.predict(&euler, &of(drive.start)),
                Scheme::RungeKutta => {
                    let [start, middle, end] = [drive.start, drive.middle, drive.end].map(of);
                    filter.predict(&rk4, &Nodes { start, middle, end })
                }
            };
            if stepped.is_err() {
                return f64::INFINITY;
            }
        }
        let signal = READOUT.voltage(x[0]) / sd + chance.gaussian();
        if k % sampling.every == 0 && filter.update(&readout, &[of(signal)], &one).is_err() {
            return f64::INFINITY;
        }
        if k >= sampling.scored_from() {
            let angle: f64 = filter.mean()[0].into();
            sum += (angle * units[0] - x[0]).powi(2);
            count += 1.0;
        }
    }
    sum / count
}

/// The least root mean square error over decades of q, and that decade.
fn best<T: Scalar + Into<f64>>(
    motions: &[(Vec<[f64; 2]>, f64)],
    sampling: Sampling,
    scheme: Scheme,
) -> (f64, i32) {
    let decades = if scheme == Scheme::Euler { 6..=13 } else { 6..=8 };
    let one = |decade: i32| {
        let squares = motions.iter().enumerate().map(|(seed, (motion, from_s))| {
            let mut chance = Chance(1000 + seed as u64);
            filtered::<T>((motion, *from_s), (sampling, scheme, 10.0_f64.powi(decade)), &mut chance)
        });
        (squares.sum::<f64>() / motions.len() as f64).sqrt()
    };
    decades.map(|decade| (one(decade), decade)).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NAN, 0))
}

fn main() {
    let motions: Vec<_> = (1..=SEEDS).map(|seed| truth(&mut Chance(seed))).collect();
    println!(
        "| rate in kHz | one in | bound | Runge–Kutta f32 | f32 to f64 | Euler f32, its q | instructions/s, Runge–Kutta | Euler |"
    );
    println!("|--:|--:|--:|--:|--:|--:|--:|--:|");
    for stride in [4, 8, 16, 32] {
        for every in [1, 2, 4, 8] {
            let sampling = Sampling { stride, every };
            let rate_hz = sampling.interval_s().recip();
            let bound = motions.iter().map(|(motion, from_s)| bound(motion, *from_s, sampling)).sum::<f64>();
            let single = best::<f32>(&motions, sampling, Scheme::RungeKutta).0;
            let double = best::<f64>(&motions, sampling, Scheme::RungeKutta).0;
            let euler = best::<f32>(&motions, sampling, Scheme::Euler);
            let share = 1.0 / every as f64;
            let cost =
                |[prediction, step]: [f64; 2]| rate_hz * (prediction + share * (step - prediction)) / 1e6;
            // Where the largest errors of the filter are of the motion's size it follows nothing.
            let euler_error = if euler.0.to_degrees() < 1.0 {
                format!("{:.1} mdeg, 1e{}", 1e3 * euler.0.to_degrees(), euler.1)
            } else {
                "lost".to_owned()
            };
            println!(
                "| {:.0} | {every} | {:.2} mdeg | {:.2} mdeg | {:+.2} % | {euler_error} | {:.0} M | {:.0} M |",
                rate_hz / 1e3,
                1e3 * (bound / SEEDS as f64).sqrt().to_degrees(),
                1e3 * single.to_degrees(),
                100.0 * (single / double - 1.0),
                cost(RUNGE_KUTTA),
                cost(EULER),
            );
        }
    }
}
