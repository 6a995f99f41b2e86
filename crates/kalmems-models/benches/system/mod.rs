//! The one problem that all filters here solve: the shared-electrode scanner at 1 MHz.
//!
//! Two states [θ, θ̇], one measurement through one exp. By Euler's method, as in the published filters, a step has
//! one exp in the process and one in the measurement; by Runge–Kutta's, as the workbench runs it, four and one.
//!
//! The filter with a constant gain needs a linear process: the same mirror and readout, held at an angle by a torque
//! in place of the electrodes.

#![allow(dead_code)] // each bench and test uses its part

mod by_hand;
pub mod signal;

pub use by_hand::{EulerByHand, Laws};
pub use signal::{HeldSample, Sample};

use kalmems_core::{
    Covariance, Euler, FilterError, FixedGain, LinearProcess, NoiseDensity, OperatingPoint, Process, Rk4,
    Scalar,
};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;
use std::hint::black_box;

/// s between two samples.
const INTERVAL: f64 = 1e-6;

/// The density of the angular acceleration that drives the state, in rad²/s³. Large enough for the filter to
/// follow although Euler's method adds energy.
const ACCELERATION_DENSITY: f64 = 1e10;

/// V² per sample.
const READOUT_VARIANCE: f64 = 1.92e-4;

/// The angle at which the torque holds the mirror, in rad: where the readout has its slope.
const HELD_ANGLE: f64 = 0.1;

/// Models, start and signal, in the number that a filter runs in.
pub struct System<T> {
    pub scanner: ParametricScanner<T>,
    pub readout: DemodulatedComb<T>,
    pub interval: T,
    /// The covariance that the process noise adds over one step.
    pub process_noise: Covariance<T, 2>,
    /// The variance of one sample.
    pub readout_variance: T,
    pub start_mean: [T; 2],
    pub start_covariance: Covariance<T, 2>,
    pub samples: Vec<Sample<T>>,
    /// Those of the mirror that a torque holds.
    pub held: Vec<HeldSample<T>>,
}

impl<T: Scalar> System<T> {
    /// With a simulated signal of `length` samples.
    pub fn simulated(length: usize) -> Self {
        let (samples, held) =
            (signal::simulated(&System::parts(), length), signal::held(&System::parts(), length));
        Self { samples, held, ..Self::parts() }
    }

    /// Without a signal. No number in it is known to the compiler.
    fn parts() -> Self {
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
        let readout = DemodulatedComb { comb, gain: of(-0.3574e12), offset: of(6.3945) };
        let density = NoiseDensity::none().on::<1>(of(ACCELERATION_DENSITY));
        let interval = of(INTERVAL);
        let process = Rk4::new(scanner, interval, &density, (&[of(0.0), of(0.0)], &of(0.0)));
        Self {
            scanner,
            readout,
            interval,
            process_noise: *process.noise().covariance(),
            readout_variance: of(READOUT_VARIANCE),
            start_mean: [of(0.12), of(0.0)],
            start_covariance: Covariance::from_standard_deviations([of(0.05), of(5e3)]),
            samples: Vec::new(),
            held: Vec::new(),
        }
    }

    /// One step as the published filters take it.
    pub fn euler(&self) -> Euler<ParametricScanner<T>, T, 2> {
        Euler::new(self.scanner, self.interval, self.process_noise)
    }

    /// The same step with its Jacobian by hand.
    pub fn euler_by_hand(&self) -> EulerByHand<T> {
        EulerByHand::new(self.scanner, self.interval, self.process_noise)
    }

    /// One step as the workbench takes it.
    pub fn runge_kutta(&self) -> Rk4<ParametricScanner<T>, T, 2> {
        let density = NoiseDensity::none().on::<1>(T::of(ACCELERATION_DENSITY));
        Rk4::new(self.scanner, self.interval, &density, (&[T::of(0.0), T::of(0.0)], &T::of(0.0)))
    }

    /// One exact step of the mirror that a torque holds.
    pub fn resonator(&self) -> LinearProcess<T, 2, 1> {
        self.scanner.resonator.exact(self.interval, T::of(ACCELERATION_DENSITY))
    }

    /// That mirror at the angle where it is held.
    pub fn operating_point(&self) -> OperatingPoint<T, 2, 1> {
        let at = (&[T::of(HELD_ANGLE), T::of(0.0)], &[T::of(0.0)]);
        OperatingPoint::of(&self.resonator(), (&self.readout, self.r()), at)
    }

    /// The filter with the constant gain of that point.
    pub fn settled(&self) -> FixedGain<T, 2, 1> {
        FixedGain::steady_state([T::of(HELD_ANGLE), T::of(0.0)], &self.operating_point())
            .expect("the angle is seen and moved")
    }

    /// The variance of one sample as the filters take it.
    pub fn r(&self) -> Covariance<T, 1> {
        Covariance::from_variances([self.readout_variance])
    }
}

/// What a filter leaves behind after the whole signal.
#[derive(Clone, Copy, Debug)]
pub struct Outcome<T> {
    pub mean: [T; 2],
    /// The lower triangle: P₀₀, P₁₀, P₁₁.
    pub covariance: [T; 3],
    /// None where a filter does not say.
    pub innovations: Option<Innovations<T>>,
}

/// What the innovations amount to; so that a filter has to compute them.
#[derive(Clone, Copy, Debug)]
pub struct Innovations<T> {
    /// The last residual.
    pub residual: T,
    /// Its variance S.
    pub variance: T,
    /// The sum of all normalised innovations squared.
    pub nis: T,
}

impl<T: Scalar> Innovations<T> {
    pub fn none() -> Self {
        Self { residual: T::of(0.0), variance: T::of(0.0), nis: T::of(0.0) }
    }

    /// With one more.
    #[inline(always)]
    pub fn add(&mut self, residual: T, variance: T, nis: T) {
        *self = Self { residual, variance, nis: self.nis + nis };
    }
}

/// A filter over the whole signal.
pub type Run<T> = fn(&System<T>) -> Result<Outcome<T>, FilterError>;
