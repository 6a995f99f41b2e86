//! The filter of a shared-electrode scanner by Euler's method, with the numbers of `examples/shared_scanner/microcontroller.toml`.

use kalmems_core::{Covariance, Ekf, Euler, Filter, FilterError, Mat, ProcessNoise, Scalar};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;

/// The unit of the angle in rad.
pub const ANGLE_UNIT_RAD: f64 = 0.2;
/// The unit of the rate in rad/s.
pub const RATE_UNIT_RAD_PER_S: f64 = 199999.99999997346;
/// What a signal of 1 V is, in standard deviations of its noise.
pub const PER_VOLT: f64 = 72.16878364870321;

/// How it moves, the angle in its unit and the time in samples.
#[inline(always)]
pub fn scanner<T: Scalar>() -> ParametricScanner<T> {
    let of = T::of;
    ParametricScanner {
        resonator: TorsionalResonator { inertia: of(1.0), damping: of(0.0005173913043478948), stiffness: of(0.009593913043480808) },
        comb: GaussianComb { nominal: of(1.2413043478264162e-8), angular_width: of(1.0), bias: of(-0.0) },
        carrier_mean_square: of(18.0),
    }
}

/// One step over one interval, and its noise; what drives it is the voltage at the start of the interval.
#[inline(always)]
pub fn process<T: Scalar>() -> Euler<ParametricScanner<T>, T, 2> {
    let of = T::of;
    // With its root, which this filter does not read: found here, it would be found anew with each step.
    let covariance = Mat([[of(8.314131679767854e-10), of(0.0)], [of(1.2453630744504138e-9), of(2.4907323409663304e-9)]]);
    let root = Mat([[of(2.88342360394165e-5), of(0.0)], [of(4.319043073476954e-5), of(2.5006379864174764e-5)]]);
    let noise = ProcessNoise::with_root(covariance, root);
    Euler::new(scanner(), of(1.0), noise)
}

/// What is read, in standard deviations of its noise.
#[inline(always)]
pub fn readout<T: Scalar>() -> DemodulatedComb<T> {
    let of = T::of;
    let comb = GaussianComb { nominal: of(1.0), angular_width: of(1.0), bias: of(-0.0) };
    DemodulatedComb { comb, gain: of(-147.27873390622565), offset: of(208.9686101691372) }
}

/// The filter on its way.
#[derive(Clone, Copy, Debug)]
pub struct Estimator<T> {
    filter: Ekf<T, 2>,
}

impl<T: Scalar> Estimator<T> {
    /// Before the first sample.
    #[inline(always)]
    pub fn new() -> Self {
        let of = T::of;
        let start = Covariance::from_standard_deviations([of(0.7499999999999999), of(0.07500000000000995)]);
        Self { filter: Ekf::new([of(0.25), of(0.0)], start) }
    }

    /// Corrects by the first sample, in V.
    #[inline(always)]
    pub fn begin(&mut self, signal_v: T) -> Result<(), FilterError> {
        self.filter.update(&readout(), &[signal_v * T::of(PER_VOLT)], &one()).map(drop)
    }

    /// Goes on to the next sample: the drive in V at the start of the interval, the signal in V at its end.
    #[inline(always)]
    pub fn step(&mut self, drive: &T, signal_v: T) -> Result<(), FilterError> {
        let seen = [signal_v * T::of(PER_VOLT)];
        self.filter.step((&process(), drive), (&readout(), &seen, &one())).map(drop)
    }

    /// Angle and rate, in their units.
    #[inline(always)]
    pub fn mean(&self) -> [T; 2] {
        *self.filter.mean()
    }

    /// Their covariance, in their units.
    #[inline(always)]
    pub fn covariance(&self) -> Covariance<T, 2> {
        self.filter.covariance()
    }
}

impl<T: Scalar> Default for Estimator<T> {
    fn default() -> Self {
        Self::new()
    }
}

/// The variance of the signal in its unit.
#[inline(always)]
fn one<T: Scalar>() -> Covariance<T, 1> {
    Covariance::from_variances([T::of(1.0)])
}
