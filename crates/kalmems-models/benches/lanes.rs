//! Time per step of a filter in lanes, against as many scalar filters advanced in a loop:
//!
//!     cargo bench -p kalmems-models --bench lanes
//!
//! 1024 scanners with different parameters, each followed by its own extended filter of two states; at each step all
//! filters are advanced once. The scalar loop is the same kernel with one lane, and the bench stops where a lane does
//! not end at its angle to the bit. Each figure is the least of many short rounds in which all are measured one after
//! the other: whatever else a machine does only adds to it.
//!
//! Times are reported beside their goals, and nothing fails because of them.

use kalmems_core::lanes::{Isa, Kernel, Lane, Real};
use kalmems_core::{
    Covariance, Ekf, Euler, Filter, Mat, Measurement, Nodes, NoiseDensity, Process, ProcessNoise, Rk4, Scalar,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use std::hint::black_box;
use std::time::Instant;

const DEVICES: usize = 1024;
const STEPS: usize = 16;
const ROUNDS: usize = 201;
const INTERVAL: f64 = 1e-6;
const DRIVE: f64 = 23.76;

/// Which process the filters step with.
#[derive(Clone, Copy, Debug)]
enum Integrator {
    Rk4,
    Euler,
}

/// How many times as fast as scalar filters those in lanes shall be, with filters in f64 and in f32.
fn goals(isa: Isa) -> Option<[f64; 2]> {
    match isa {
        Isa::Portable => None,
        Isa::Avx2 => Some([4.0, 8.0]),
        Isa::Avx512 => Some([6.0, 12.0]),
    }
}

/// Says how many lanes there are.
struct Width;

impl<F: Real> Kernel<F> for Width {
    type Output = usize;

    #[inline(always)]
    fn run<L: Lane<F>>(self) -> usize {
        L::WIDTH
    }
}

/// A scanner and its readout.
type Device = (ParametricScanner<f64>, DemodulatedComb<f64>);

/// The parameters of one device.
fn device(index: usize) -> Device {
    let vary = |by: f64, step: usize| 1.0 + by * ((index * step % DEVICES) as f64 / DEVICES as f64 - 0.5);
    let comb =
        GaussianComb { nominal: 5.71e-12 * vary(0.1, 7), angular_width: 0.2 * vary(0.1, 11), bias: 9.79e-12 };
    let scanner = ParametricScanner {
        resonator: TorsionalResonator {
            inertia: 1.15e-14 * vary(0.02, 13),
            damping: 5.95e-12 * vary(0.3, 17),
            stiffness: 1.10e-4 * vary(0.02, 19),
        },
        comb,
        carrier_mean_square: 18.0,
    };
    (scanner, DemodulatedComb { comb, gain: -0.3574e12, offset: 6.3945 })
}

/// The same with one device in each lane.
fn devices<F: Real, L: Lane<F>>(first: usize) -> (ParametricScanner<L>, DemodulatedComb<L>) {
    let each = |f: fn(&Device) -> f64| L::from_fn(|lane| F::of(f(&device(first + lane))));
    let comb = GaussianComb {
        nominal: each(|d| d.0.comb.nominal),
        angular_width: each(|d| d.0.comb.angular_width),
        bias: each(|d| d.0.comb.bias),
    };
    let scanner = ParametricScanner {
        resonator: TorsionalResonator {
            inertia: each(|d| d.0.resonator.inertia),
            damping: each(|d| d.0.resonator.damping),
            stiffness: each(|d| d.0.resonator.stiffness),
        },
        comb,
        carrier_mean_square: each(|d| d.0.carrier_mean_square),
    };
    (scanner, DemodulatedComb { comb, gain: each(|d| d.1.gain), offset: each(|d| d.1.offset) })
}

/// What each device's sensor says at each step, step after step.
fn measurements<F: Real>() -> Vec<F> {
    let density = NoiseDensity::none().on::<1>(1e6);
    let mut all = vec![F::of(0.0); DEVICES * STEPS];
    for index in 0..DEVICES {
        let (scanner, readout) = device(index);
        let process = Rk4::new(scanner, INTERVAL, &density, (&[0.0, 0.0], &DRIVE));
        let mut truth = [0.15, 0.0];
        for step in 0..STEPS {
            truth = process.step(&truth, &Nodes::held(DRIVE));
            all[step * DEVICES + index] = F::of(readout.predict(&truth)[0]);
        }
    }
    all
}

/// Advances all filters over all steps.
#[derive(Clone, Copy)]
struct Advance<'a, F> {
    measurements: &'a [F],
    integrator: Integrator,
}

/// One filter in each lane, with its models.
struct Followed<L: Scalar, P> {
    filter: Ekf<L, 2>,
    process: P,
    readout: DemodulatedComb<L>,
}

impl<F: Real> Kernel<F> for Advance<'_, F> {
    /// Nanoseconds per step of one filter, and the angle that each ends with.
    type Output = (f64, Vec<F>);

    #[inline(always)]
    fn run<L: Lane<F>>(self) -> Self::Output {
        let start = Covariance::from_standard_deviations([L::of(0.05), L::of(5e3)]);
        let filters = |first: usize| (Ekf::new([L::of(0.12), L::of(0.0)], start), devices::<F, L>(first));
        let noise = Covariance::from_variances([L::of(1e-16), L::of(1.0)]);
        match self.integrator {
            Integrator::Rk4 => self.follow(
                |first| {
                    let (filter, (scanner, readout)) = filters(first);
                    let process = Rk4::with_noise(scanner, L::of(INTERVAL), ProcessNoise::from(noise));
                    Followed { filter, process, readout }
                },
                &Nodes::held(L::of(black_box(DRIVE))),
            ),
            Integrator::Euler => self.follow(
                |first| {
                    let (filter, (scanner, readout)) = filters(first);
                    Followed { filter, process: Euler::new(scanner, L::of(INTERVAL), noise), readout }
                },
                &L::of(black_box(DRIVE)),
            ),
        }
    }
}

impl<F: Real> Advance<'_, F> {
    #[inline(always)]
    fn follow<L: Lane<F>, P: Process<L, 2>>(
        &self,
        make: impl Fn(usize) -> Followed<L, P>,
        u: &P::Input,
    ) -> (f64, Vec<F>) {
        let mut filters: Vec<Followed<L, P>> = (0..DEVICES).step_by(L::WIDTH).map(make).collect();
        let r = Covariance::from_lower(Mat([[L::of(black_box(1.92e-4))]]));
        let start = Instant::now();
        for step in self.measurements.chunks_exact(DEVICES) {
            for (f, y) in filters.iter_mut().zip(step.chunks_exact(L::WIDTH)) {
                // A refused step would show in the angles.
                let _ = f.filter.predict(&f.process, u);
                let _ = f.filter.update(&f.readout, &[L::load(y, F::of(0.0))], &r);
            }
        }
        let time = start.elapsed().as_secs_f64() * 1e9 / (DEVICES * STEPS) as f64;
        let mut angles = vec![F::of(0.0); DEVICES];
        for (to, from) in angles.chunks_mut(L::WIDTH).zip(&filters) {
            from.filter.mean()[0].store(to);
        }
        (time, angles)
    }
}

/// Times the scalar loop and every instruction set, and prints one row for each; `precision` is the place of F's goal.
fn bench<F: Real + PartialEq>(number: &str, precision: usize, integrator: Integrator) {
    let measurements = measurements::<F>();
    let kernel = Advance { measurements: black_box(&measurements[..]), integrator };
    let isas: Vec<Isa> = Isa::available().collect();
    let (mut scalar, mut times) = (f64::INFINITY, vec![f64::INFINITY; isas.len()]);
    for _ in 0..ROUNDS {
        let (time, expected) = kernel.run::<F>();
        scalar = scalar.min(time);
        for (isa, least) in isas.iter().zip(&mut times) {
            let (time, angles) = isa.run(kernel).expect("it is available");
            assert!(angles == expected, "{isa:?} and scalar filters do not agree");
            *least = least.min(time);
        }
    }
    let method = format!("{integrator:?}");
    println!("{number:<5}{method:<8}{:<10}{:>6}{scalar:>10.2}{:>8.2}", "scalar", 1, 1.0);
    for (isa, time) in isas.iter().zip(times) {
        let (name, ratio) = (format!("{isa:?}"), scalar / time);
        let width = isa.run::<F, _>(Width).expect("it is available");
        let goal = goals(*isa).map_or(String::new(), |goals| {
            let goal = goals[precision];
            format!("{goal:>6.0}{}", if ratio >= goal { "" } else { "  MISSED" })
        });
        println!("{number:<5}{method:<8}{name:<10}{width:>6}{time:>10.2}{ratio:>8.2}{goal}");
    }
}

fn main() {
    // `cargo test --benches` runs them too, without this; only `cargo bench` optimises as a release is.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    println!(
        "lanes: ns per step of one filter, and how many times as fast as the scalar loop: the least of {ROUNDS} rounds"
    );
    println!("{:<13}{:<10}{:>6}{:>10}{:>8}{:>6}", "", "", "lanes", "ns/step", "ratio", "goal");
    for integrator in [Integrator::Rk4, Integrator::Euler] {
        bench::<f64>("f64", 0, integrator);
        bench::<f32>("f32", 1, integrator);
    }
}
