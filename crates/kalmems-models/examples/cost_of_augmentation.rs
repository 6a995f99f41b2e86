//! What an added state costs: the time of one step of the scanner's EKF, prediction and correction, with more
//! and more parameters as states; and what a late readout costs.
//!
//!     cargo run --release -p kalmems-models --example cost_of_augmentation
//!
//! The machine decides on the nanoseconds; the ratios to the filter of two states are what it is for.

use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, Covariance, Drift, Dynamics, Ekf, Filter, Measurement,
    Nodes, NoiseDensity, Over, Process, Rk4, Scalar,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{DriveGain, ParametricScanner, TorsionalResonator};
use kalmems_models::readout::{AngleBefore, DelayedComb, DemodulatedComb, LowPassedComb};
use std::hint::black_box;
use std::time::Instant;

const COMB: GaussianComb<f64> = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: COMB,
    carrier_mean_square: 18.0,
};
const READOUT: DemodulatedComb<f64> = DemodulatedComb { comb: COMB, gain: -0.3574e12, offset: 6.3945 };

/// The stiffness as a third state, written by hand into the model.
struct WithStiffness<P>(ParametricScanner<P>);
impl<T: Scalar> Dynamics<T, 3> for WithStiffness<T> {
    type Input = T;
    #[inline(always)]
    fn derivative<S: Over<T>>(&self, x: &[S; 3], voltage: &T) -> [S; 3] {
        let own = &self.0;
        let varied = ParametricScanner {
            resonator: TorsionalResonator {
                inertia: S::lift(own.resonator.inertia),
                damping: S::lift(own.resonator.damping),
                stiffness: x[2] * own.resonator.stiffness,
            },
            comb: GaussianComb {
                nominal: S::lift(own.comb.nominal),
                angular_width: S::lift(own.comb.angular_width),
                bias: S::lift(own.comb.bias),
            },
            carrier_mean_square: S::lift(own.carrier_mean_square),
        };
        [x[1], varied.acceleration(x[0], x[1], S::lift(*voltage)), S::of(0.0)]
    }
}

/// The drive and the signal of 4 ms.
fn recording() -> Vec<(Nodes<f64>, f64)> {
    let drive = |t: f64| 90.0 + 90.0 * (std::f64::consts::TAU * 31_350.0 * t).sin();
    let process = Rk4::new(SCANNER, 1e-6, &NoiseDensity::none(), (&[0.0, 0.0], &0.0));
    let mut x = [0.15, 0.0];
    (0..4000)
        .map(|k| {
            let t = f64::from(k) * 1e-6;
            let nodes = Nodes { start: drive(t), middle: drive(t + 0.5e-6), end: drive(t + 1e-6) };
            x = process.step(&x, &nodes);
            let [y] = READOUT.predict(&x);
            (nodes, y)
        })
        .collect()
}

/// The time of one step in ns: the least of many passes.
#[inline(never)]
fn time<const N: usize>(
    process: &impl Process<f64, N, Input = Nodes<f64>>,
    readout: &impl Measurement<f64, N, 1>,
    start: &Ekf<f64, N>,
    recording: &[(Nodes<f64>, f64)],
) -> f64 {
    let r = Covariance::from_variances([1.92e-4]);
    (0..60)
        .map(|_| {
            let mut filter = black_box(*start);
            let (process, readout) = (black_box(process), black_box(readout));
            let begun = Instant::now();
            for (nodes, y) in recording {
                let _ = filter.predict(process, nodes);
                let _ = filter.update(readout, &[*y], &r);
            }
            let taken = begun.elapsed();
            assert!(black_box(filter.mean())[0].abs() < 1.0);
            taken.as_secs_f64() * 1e9 / recording.len() as f64
        })
        .fold(f64::INFINITY, f64::min)
}

fn start<const N: usize>() -> Ekf<f64, N> {
    let mut mean = [0.0; N];
    mean[0] = 0.14;
    Ekf::new(mean, Covariance::from_standard_deviations(std::array::from_fn(|i| [0.05, 5e3, 1.0][i.min(2)])))
}

fn augmented<const A: usize, const N: usize>(
    data: &[(Nodes<f64>, f64)],
    noise: &NoiseDensity<f64, 2>,
    process: [Option<&str>; A],
    readout: [Option<&str>; A],
    scales: [f64; A],
) -> f64 {
    let added = scales.map(|scale| AddedState { scale, drift: Drift::RandomWalk { density: 1e-3 } });
    let model = Rk4::new(SCANNER, 1e-6, noise, (&[0.0, 0.0], &0.0));
    let process = Augmented::<_, _, 2, A, N>::new(model, &added, process).unwrap();
    let readout = AugmentedMeasurement::<_, _, 2, A>::new(READOUT, &added, readout).unwrap();
    time(&process, &readout, &start::<N>(), data)
}

fn main() {
    let data = recording();
    let noise = NoiseDensity::none().on::<1>(1e8);
    let two = || {
        let process = Rk4::new(SCANNER, 1e-6, &noise, (&[0.0, 0.0], &0.0));
        time(&process, &READOUT, &start::<2>(), &data)
    };
    let by_hand = || {
        let noise = NoiseDensity::none().on::<1>(1e8).on::<2>(1e-9);
        let process = Rk4::new(WithStiffness(SCANNER), 1e-6, &noise, (&[0.0, 0.0, 1.0], &0.0));
        let sd = Covariance::from_standard_deviations([0.05, 5e3, 3e-3]);
        time(&process, &READOUT, &Ekf::new([0.14, 0.0, 1.0], sd), &data)
    };
    let (k, b, a, o) = ("resonator.stiffness", "resonator.damping", "gain", "offset");
    let three = || augmented::<1, 3>(&data, &noise, [Some(k)], [None], [3.3e-7]);
    let four = || augmented::<2, 4>(&data, &noise, [Some(k), Some(b)], [None; 2], [3.3e-7, 6e-13]);
    let five = || {
        augmented::<3, 5>(
            &data,
            &noise,
            [Some(k), None, None],
            [None, Some(a), Some(o)],
            [3.3e-7, 1e10, 0.02],
        )
    };
    let six = || {
        let process = [Some(k), Some(b), None, None];
        let readout = [None, None, Some(a), Some(o)];
        augmented::<4, 6>(&data, &noise, process, readout, [3.3e-7, 6e-13, 1e10, 0.02])
    };
    let late = || {
        let process = Rk4::new(SCANNER, 1e-6, &noise, (&[0.0, 0.0], &0.0));
        time(&process, &DelayedComb::of(&READOUT, 1.16e-6, &SCANNER.resonator), &start::<2>(), &data)
    };
    let staged = |delay: f64| {
        let stages = LowPassedComb {
            device: DriveGain { scanner: SCANNER, drive_gain: 1.0 },
            before: AngleBefore::of(delay, &SCANNER.resonator),
            gain: READOUT.gain,
            offset: READOUT.offset,
            poles: [2.57e5; 2],
        };
        let process = Rk4::new(stages, 1e-6, &NoiseDensity::none().on::<1>(1e8), (&[0.0; 4], &0.0));
        let sd = Covariance::from_standard_deviations([0.05, 5e3, 0.5, 0.5]);
        time(&process, &stages, &Ekf::new([0.14, 0.0, 1.5, 1.5], sd), &data)
    };
    let (staged_at_once, staged_late) = (|| staged(0.0), || staged(1.16e-6));
    let variants: [(&str, &dyn Fn() -> f64); 9] = [
        ("2 states", &two),
        ("2 states, a late readout", &late),
        ("4 states: two stages", &staged_at_once),
        ("4 states: two stages behind a late readout", &staged_late),
        ("3 states, stiffness by hand", &by_hand),
        ("3 states: stiffness", &three),
        ("4 states: stiffness, damping", &four),
        ("5 states: stiffness, gain, offset", &five),
        ("6 states: stiffness, damping, gain, offset", &six),
    ];
    let base = two();
    for (name, run) in variants {
        let ns = run();
        println!("{name:45} {ns:7.1} ns {:6.2}", ns / base);
    }
}
