//! Times a step of an extended Kalman filter whose model is a text against the same filter over the native model:
//!
//!     cargo bench -p kalmems-equations --bench step
//!
//! The two take turns of a fraction of a millisecond, and the median of the ratios of the turns is printed with its
//! quartiles: what else the machine does falls on both. Times are reported, and nothing fails because of them.

use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, Covariance, Drift, Ekf, Filter, FilterError, Mat,
    Measurement, Nodes, NoiseDensity, NumericMeasurement, NumericProcess, Process, ProcessNoise, Rk4,
};
use kalmems_equations::{Description, Device, Motion, ProgramNumbers, ReadoutProgram, StepTables};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{DriveGain, ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use std::cell::RefCell;
use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

/// Samples of one turn, which takes a tenth of a millisecond: most turns are not interrupted.
const LENGTH: usize = 512;
/// Turns of each filter.
const TURNS: usize = 1001;
/// s between two samples.
const INTERVAL: f64 = 1e-6;
/// Of the angular acceleration, in rad²/s³.
const DENSITY: f64 = 1e10;
/// V² per sample.
const VARIANCE: f64 = 1.92e-4;

const TEXT: &str = include_str!("../../../examples/equations/shared_scanner.toml");

struct Sample {
    drive: Nodes<f64>,
    signal: f64,
}

type Run<'a> = Box<dyn Fn() -> Result<[f64; 2], FilterError> + 'a>;

fn main() {
    // `cargo test --benches` runs them too, without this; only `cargo bench` optimises as a release is.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let of = |value: f64| black_box(value);
    let comb = GaussianComb { nominal: of(5.71e-12), angular_width: of(0.2), bias: of(9.79e-12) };
    let scanner = ParametricScanner {
        resonator: TorsionalResonator {
            inertia: of(1.15e-14),
            damping: of(5.95e-12),
            stiffness: of(1.10e-4),
        },
        comb,
        carrier_mean_square: of(18.0),
    };
    let readout = DemodulatedComb { comb, gain: of(-0.3574e12), offset: of(6.3945) };
    let samples = simulated(&scanner, &readout);
    println!("ns per step, and ratio to native: median (middle half) of {TURNS} turns\n");

    let device = device(TEXT);
    let process = Rk4::new(scanner, INTERVAL, &density::<2>(), (&[0.0, 0.0], &0.0));
    let text = Modelled::<2>::new(&device, &[], &process, [1.0; 2]);
    compare(
        "EKF, Runge–Kutta, 2 states",
        &[
            ("native", Box::new(|| follow(start::<2>([0.0; 2], [0.05, 5e3]), &process, &readout, &samples))),
            ("from the text", Box::new(|| follow(start::<2>([0.0; 2], [0.05, 5e3]), &text, &text, &samples))),
        ],
    );
    println!("    {} instructions a stage", text.motion.instructions());

    let drift = Drift::RandomWalk { density: 1e-8 };
    let scales = [scanner.resonator.stiffness, readout.gain, 1.0];
    let added = scales.map(|scale| AddedState { scale, drift });
    let model = DriveGain { scanner, drive_gain: of(1.0) };
    let step = Rk4::new(model, INTERVAL, &density::<2>(), (&[0.0; 2], &0.0));
    let names = [Some("scanner.resonator.stiffness"), None, None];
    let five = Augmented::<_, _, 2, 3, 5>::new(step, &added, names).expect("the names are right");
    let names = [None, Some("gain"), Some("offset")];
    let seen = AugmentedMeasurement::<_, _, 2, 3>::new(readout, &added, names).expect("the names are right");
    let free = ["k", "gain", "offset"].map(|name| device.parameter(name).expect("it has this parameter"));
    let text = Modelled::<5>::new(&device, &free, &five, [1.0, 1.0, scales[0], scales[1], scales[2]]);
    let relative = [0.0; 5];
    let absolute = [0.0, 0.0, scales[0], scales[1], 6.3945];
    let sd = [0.05, 5e3, 0.01, 0.05, 0.05];
    let sd_absolute = [0.05, 5e3, 0.01 * scales[0], 0.05 * scales[1].abs(), 0.05];
    compare(
        "EKF, Runge–Kutta, 5 states: stiffness, gain and offset too",
        &[
            ("native", Box::new(|| follow(start::<5>(relative, sd), &five, &seen, &samples))),
            ("from the text", Box::new(|| follow(start::<5>(absolute, sd_absolute), &text, &text, &samples))),
        ],
    );
    load();
}

fn density<const N: usize>() -> NoiseDensity<f64, N> {
    NoiseDensity::none().on::<1>(DENSITY)
}

fn device(text: &str) -> Device {
    Description::read(text).and_then(|read| Device::of(&read)).expect("the example is right")
}

fn start<const N: usize>(mut mean: [f64; N], sd: [f64; N]) -> Ekf<f64, N> {
    mean[0] = 0.12;
    Ekf::new(mean, Covariance::from_standard_deviations(sd))
}

/// A ring-down from 0.15 rad under a small drive, seen with noise.
fn simulated(scanner: &ParametricScanner<f64>, readout: &DemodulatedComb<f64>) -> Vec<Sample> {
    let process = Rk4::new(*scanner, INTERVAL, &NoiseDensity::none(), (&[0.0, 0.0], &0.0));
    let drive = |k: usize, part: f64| 12.0 + 12.0 * f64::sin(TAU * 31.4e3 * (k as f64 + part) * INTERVAL);
    let mut random = 0x9e37_79b9_7f4a_7c15_u64;
    let mut uniform = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        (random >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut truth = [0.15, 0.0];
    (0..LENGTH)
        .map(|k| {
            let drive = Nodes { start: drive(k, 0.0), middle: drive(k, 0.5), end: drive(k, 1.0) };
            truth = process.step(&truth, &drive);
            let [seen] = readout.predict(&truth);
            let noise = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            Sample { drive, signal: seen + noise * VARIANCE.sqrt() }
        })
        .collect()
}

/// A device from its text as a filter takes it.
struct Modelled<const N: usize> {
    motion: Motion,
    readout: ReadoutProgram,
    works: RefCell<[ProgramNumbers; 2]>,
    tables: StepTables,
    noise: ProcessNoise<f64, N>,
}

impl<const N: usize> Modelled<N> {
    /// With the process noise of another process, whose states are in these units.
    fn new<P: NumericProcess<f64, N>>(device: &Device, free: &[usize], other: &P, units: [f64; N]) -> Self {
        let motion = device.motion(free).expect("it is small");
        let readout = device.readout(0, free).expect("it has one");
        let works = RefCell::new([motion.work(&device.values()), readout.work(&device.values())]);
        let mut noise = Mat::zero();
        for (i, row) in noise.0.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate().take(i + 1) {
                *entry = other.noise_added().covariance().get(i, j) * units[i] * units[j];
            }
        }
        let tables = motion.runge_kutta(INTERVAL);
        Self { motion, readout, works, tables, noise: Covariance::from_lower(noise).into() }
    }
}

impl<const N: usize> NumericProcess<f64, N> for Modelled<N> {
    type Input = Nodes<f64>;

    fn moved(&self, x: &[f64; N], u: &Nodes<f64>) -> [f64; N] {
        NumericProcess::linearized(self, x, u).0
    }

    fn linearized(&self, x: &[f64; N], u: &Nodes<f64>) -> ([f64; N], Mat<f64, N, N>) {
        let (mut to, mut jacobian) = ([0.0; N], Mat::zero());
        let nodes = Nodes { start: &[u.start][..], middle: &[u.middle][..], end: &[u.end][..] };
        let [work, _] = &mut *self.works.borrow_mut();
        self.motion.linearized_step(work, x, &nodes, &self.tables, &mut to, jacobian.0.as_flattened_mut());
        (to, jacobian)
    }

    fn noise_added(&self) -> &ProcessNoise<f64, N> {
        &self.noise
    }

    /// What the engines do with states that depend on themselves alone.
    fn spread(&self, f: &Mat<f64, N, N>, p: &Covariance<f64, N>) -> Covariance<f64, N> {
        let moving = self.motion.moving();
        if moving >= N {
            return p.transformed(f);
        }
        let dot =
            |a: &[f64; N], b: &dyn Fn(usize) -> f64| (1..N).fold(a[0] * b(0), |sum, k| sum + a[k] * b(k));
        let mut fp = Mat::<f64, N, N>::zero();
        for i in 0..N {
            for j in 0..N {
                fp.0[i][j] =
                    if i < moving { dot(&f.0[i], &|k| p.get(k, j)) } else { f.0[i][i] * p.get(i, j) };
            }
        }
        let mut next = Mat::zero();
        for i in 0..N {
            for j in 0..=i {
                next.0[i][j] = match (i < moving, j < moving) {
                    (true, _) => dot(&fp.0[i], &|k| f.0[j][k]),
                    (false, true) => fp.0[j][i] * f.0[i][i],
                    (false, false) => fp.0[i][j] * f.0[j][j],
                };
            }
        }
        Covariance::from_lower(next)
    }
}

impl<const N: usize> NumericMeasurement<f64, N, 1> for Modelled<N> {
    fn expected(&self, x: &[f64; N]) -> [f64; 1] {
        let [_, work] = &mut *self.works.borrow_mut();
        [self.readout.read(work, x, &[0.0])]
    }

    fn linearized(&self, x: &[f64; N]) -> ([f64; 1], Mat<f64, 1, N>) {
        let mut slopes = Mat::zero();
        let [_, work] = &mut *self.works.borrow_mut();
        let y = self.readout.linearize(work, x, &[0.0], &mut slopes.0[0]);
        ([y], slopes)
    }
}

fn follow<const N: usize>(
    mut filter: Ekf<f64, N>,
    process: &impl NumericProcess<f64, N, Input = Nodes<f64>>,
    readout: &impl NumericMeasurement<f64, N, 1>,
    samples: &[Sample],
) -> Result<[f64; 2], FilterError> {
    let r = Covariance::from_variances([VARIANCE]);
    for sample in samples {
        filter.predict(process, &sample.drive)?;
        filter.update(readout, &[sample.signal], &r)?;
    }
    Ok([filter.mean()[0], filter.mean()[1]])
}

/// Times filters in turns and prints them.
fn compare(group: &str, filters: &[(&str, Run<'_>)]) {
    // The first turn warms up.
    let turns: Vec<Vec<f64>> = (0..=TURNS).map(|turn| take_turns(turn, filters)).skip(1).collect();
    println!("{group}");
    for (i, (name, run)) in filters.iter().enumerate() {
        let time = quartiles(turns.iter().map(|turn| turn[i]));
        let ratio = quartiles(turns.iter().map(|turn| turn[i] / turn[0]));
        let end = run().expect("a filter refused a step");
        println!(
            "    {name:<16}{:>7.1}  {:>6.3} ({:.3} to {:.3})   ends at {:.12} rad",
            time[1] / LENGTH as f64,
            ratio[1],
            ratio[0],
            ratio[2],
            end[0]
        );
    }
}

/// ns of each filter for the whole signal, another one first in each turn.
fn take_turns(turn: usize, filters: &[(&str, Run<'_>)]) -> Vec<f64> {
    let mut times = vec![0.0; filters.len()];
    for step in 0..filters.len() {
        let i = (turn + step) % filters.len();
        let start = Instant::now();
        let outcome = black_box(&filters[i].1)();
        times[i] = start.elapsed().as_secs_f64() * 1e9;
        assert!(black_box(outcome).is_ok(), "a filter refused a step");
    }
    times
}

/// The first quartile, the median and the third.
fn quartiles(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    [1, 2, 3].map(|quarter| sorted[(sorted.len() - 1) * quarter / 4])
}

/// From the text of a file to the first step of a filter, with its Jacobian.
fn load() {
    println!("\nFrom the text to the first step, ms: median (middle half) of 101");
    for (name, text) in [
        ("shared scanner", TEXT),
        ("two axes", include_str!("../../../examples/equations/two_axes.toml")),
        ("accelerometer", include_str!("../../../examples/equations/accelerometer.toml")),
        ("micro-stage", include_str!("../../../examples/equations/micro_stage.toml")),
    ] {
        let once = || {
            let start = Instant::now();
            let device = device(black_box(text));
            let motion = device.motion(&[]).expect("it is small");
            let readout = device.readout(0, &[]).expect("it has one");
            let (mut work, mut seen) = (motion.work(&device.values()), readout.work(&device.values()));
            let n = motion.states();
            let (x, mut to, mut jacobian) = (vec![1e-7; n], vec![0.0; n], vec![0.0; n * n]);
            let inputs = vec![0.0; device.inputs().len()];
            let nodes = Nodes::held(&inputs[..]);
            let tables = motion.runge_kutta(1e-6);
            assert!(motion.linearized_step(&mut work, &x, &nodes, &tables, &mut to, &mut jacobian));
            black_box(readout.linearize(&mut seen, &to, &inputs, &mut jacobian[..n]));
            start.elapsed().as_secs_f64() * 1e3
        };
        let time = quartiles((0..101).map(|_| once()));
        println!("    {name:<16}{:.3} ({:.3} to {:.3})", time[1], time[0], time[2]);
    }
}
