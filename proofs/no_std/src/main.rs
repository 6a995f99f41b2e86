//! Proof that the core needs no standard library, does not allocate and cannot panic.
//!
//! There is no `std` and no allocator here, and the panic handler calls a function that does not exist: if any
//! panic survived the optimiser, this would not link. It runs the shared-electrode scanner's filters on a
//! signal made on the spot, and returns 0 where they followed it.

#![no_std]
#![no_main]

mod around;
mod detection;

use around::what_stands_around_the_filters;
use core::hint::black_box;
use detection::crossings_that_were_found;
use kalmems_core::smooth::FixedLag;
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, IteratedEkf, Measurement, Nodes, NoiseDensity, Process, Rk4,
    Scalar, SchmidtEkf, SigmaPoints, SquareRootEkf, SquareRootUkf, Ukf,
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
fn follow<T: Scalar, F: Filter<T, 2>>(filter: &mut F) -> Result<T, FilterError> {
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
    let around = what_stands_around_the_filters().is_some_and(|error| error < 1e-3);
    let crossings = crossings_that_were_found().is_some_and(|error| error < 1e-3);
    i32::from(!(passed && around && crossings))
}
