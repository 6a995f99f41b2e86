//! Proof that the core needs no standard library, does not allocate and cannot panic.
//!
//! There is no `std` and no allocator here, and the panic handler calls a function that does not exist: if any
//! panic survived the optimiser, this would not link. It runs the shared-electrode scanner's filters on a
//! signal made on the spot, one by one and in lanes, and returns 0 where they followed it.

#![no_std]
#![no_main]

mod around;
mod detection;

use around::what_stands_around_the_filters;
use core::hint::black_box;
use detection::crossings_that_were_found;
use kalmems_core::lanes::{Isa, Kernel, Lane, Real};
use kalmems_core::smooth::FixedLag;
use kalmems_core::update::Gate;
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, IteratedEkf, Measurement, Nodes, NoiseDensity, Process,
    ProcessNoise, Rk4, Scalar, SchmidtEkf, SigmaPoints, SquareRootEkf, SquareRootUkf, Ukf,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;

#[link(name = "c")]
unsafe extern "C" {}

unsafe extern "C" {
    fn a_panic_path_survived() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo) -> ! {
    // SAFETY: never linked; see above.
    unsafe { a_panic_path_survived() }
}

/// The shared-electrode scanner and its readout.
#[inline(always)]
fn models<T: Scalar>() -> (ParametricScanner<T>, DemodulatedComb<T>) {
    let of = |value: f64| T::of(black_box(value));
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
    (scanner, DemodulatedComb { comb, gain: of(-0.3574e12), offset: of(6.3945) })
}

/// One filter against a simulated ring-down; the error of its angle at the end, in rad.
fn follow<T: Scalar<Mask = bool>, F: Filter<T, 2>>(filter: &mut F) -> Result<T, FilterError> {
    let of = |value: f64| T::of(black_box(value));
    let (scanner, readout) = models::<T>();
    let noise = NoiseDensity::none().on::<1>(of(1e6));
    let process = Rk4::new(scanner, of(1e-6), &noise, (&[of(0.0), of(0.0)], &of(23.76)));
    let r = Covariance::from_variances([of(1.92e-4)]);
    let mut truth = [of(0.15), of(0.0)];
    for _ in 0..black_box(2000) {
        truth = process.step(&truth, &Nodes::held(of(23.76)));
        filter.predict(&process, &Nodes::held(of(23.76)))?;
        filter.update(&readout, &readout.predict(&truth), &r)?;
    }
    Ok((filter.mean()[0] - truth[0]).abs())
}

/// Filters in lanes against a simulated ring-down from several angles at once; the largest error at the end, in rad.
///
/// Two call sites of each model function, so that none is inlined by chance.
struct InLanes;

/// The other filters, likewise.
struct OthersInLanes;

impl<F: Real + Into<f64>> Kernel<F> for InLanes {
    type Output = Option<f64>;

    #[inline(always)]
    fn run<L: Lane<F>>(self) -> Option<f64> {
        let (mean, start) = beginning::<L>();
        let extended = Ekf::new(mean, start);
        let unscented = Ukf::new(mean, start, SigmaPoints::standard());
        follow_in_lanes::<F, L, _, _>(extended, unscented)
    }
}

impl<F: Real + Into<f64>> Kernel<F> for OthersInLanes {
    type Output = Option<f64>;

    #[inline(always)]
    fn run<L: Lane<F>>(self) -> Option<f64> {
        let (mean, start) = beginning::<L>();
        let iterated = IteratedEkf::<L, 2, 2>::new(mean, start, L::of(1e-3));
        let considering = SchmidtEkf::new(mean, start, [false, false]);
        let worst = follow_in_lanes::<F, L, _, _>(iterated, considering)?;
        let factored = SquareRootEkf::new(mean, start);
        let both = SquareRootUkf::new(mean, start, SigmaPoints::standard());
        let other = follow_in_lanes::<F, L, _, _>(factored, both)?;
        Some(if other > worst { other } else { worst })
    }
}

/// Where the filters start.
#[inline(always)]
fn beginning<L: Scalar>() -> ([L; 2], Covariance<L, 2>) {
    ([L::of(0.12), L::of(0.0)], Covariance::from_standard_deviations([L::of(0.05), L::of(5e3)]))
}

/// Two filters.
#[inline(always)]
fn follow_in_lanes<F: Real + Into<f64>, L: Lane<F>, A: Filter<L, 2>, B: Filter<L, 2>>(
    mut a: A,
    mut b: B,
) -> Option<f64> {
    let (scanner, readout) = models::<L>();
    let q = Covariance::from_variances([1e-16, 1.0].map(|q| L::of(black_box(q))));
    let process = Rk4::with_noise(scanner, L::of(black_box(1e-6)), ProcessNoise::from(q));
    let r = Covariance::from_variances([L::of(black_box(1.92e-4))]);
    let drive = Nodes::held(L::of(black_box(23.76)));
    let gate = Gate { nis: L::of(black_box(1e6)) };
    let mut truth = [L::from_fn(|lane| F::of(0.14 + 0.001 * lane as f64)), L::of(0.0)];
    for _ in 0..black_box(2000) {
        truth = process.step(&truth, &drive);
        let y = readout.predict(&truth);
        a.predict(&process, &drive).ok()?;
        a.update_where(&readout, &y, &r, &gate).ok()?;
        b.predict(&process, &drive).ok()?;
        b.update_where(&readout, &y, &r, &gate).ok()?;
    }
    let mut worst = 0.0;
    for angle in [a.mean()[0], b.mean()[0]] {
        for lane in 0..L::WIDTH {
            let error: f64 = (angle - truth[0]).abs().lane(lane)?.into();
            worst = if error > worst { error } else { worst };
        }
    }
    Some(worst)
}

#[unsafe(no_mangle)]
extern "C" fn main() -> i32 {
    let start = Covariance::from_standard_deviations([0.05, 5e3]);
    let narrow = Covariance::from_standard_deviations([0.05_f32, 5e3]);
    let good = |error: Result<f64, FilterError>| error.is_ok_and(|e| e < 1e-3);
    let fine = |error: Result<f32, FilterError>| error.is_ok_and(|e| e < 1e-3);
    let points = SigmaPoints::standard();
    let passed = good(follow(&mut Ekf::new([0.12, 0.0], start)))
        && good(follow(&mut IteratedEkf::<_, 2, 2>::new([0.12, 0.0], start, 1e-3)))
        && good(follow(&mut SquareRootEkf::new([0.12, 0.0], start)))
        && good(follow(&mut SquareRootUkf::new([0.12, 0.0], start, points)))
        && good(follow(&mut SchmidtEkf::new([0.12, 0.0], start, [false; 2])))
        && good(follow(&mut FixedLag::<_, _, 2, 8>::new(Ekf::new([0.12, 0.0], start))))
        && fine(follow(&mut SquareRootEkf::new([0.12, 0.0], narrow)))
        && good(follow(&mut Ukf::new([0.12, 0.0], start, SigmaPoints::standard())))
        && fine(follow(&mut Ekf::new([0.12, 0.0], narrow)))
        && fine(follow(&mut Ukf::new([0.12, 0.0], narrow, SigmaPoints::standard())));
    let in_lanes = Isa::available().all(|isa| {
        let followed = |error: Option<Option<f64>>| error.flatten().is_some_and(|e| e < 1e-3);
        followed(isa.run::<f64, _>(InLanes))
            && followed(isa.run::<f32, _>(InLanes))
            && followed(isa.run::<f64, _>(OthersInLanes))
    });
    let around = what_stands_around_the_filters().is_some_and(|error| error < 1e-3);
    let crossings = crossings_that_were_found().is_some_and(|error| error < 1e-3);
    i32::from(!(passed && in_lanes && around && crossings))
}
