//! The filter of a threshold-sensing scanner and its detector, for a microcontroller.

// Made by kalmems 0.1.0 with `kalmems export`; not to be edited.
// Experiment `threshold_scanner`, sha256 d058834e39d7d1f1ca77fab91b398f706b0f1b3f922caae6d34f46076fc5c6fc, filter `Hybrid`.
// Sampling interval 2.0000000000002655e-6 s, corrected by every sample.

use kalmems_core::detect::{CubicFit, DetectError, Detector, SlopeKernel, Threshold, angle_at, angle_variance};
use kalmems_core::update::Always;
use kalmems_core::{Covariance, Ekf, Filter, FilterError, LinearProcess, Mat, Scalar};
use kalmems_models::capacitance::{CombCurve, CurveShape};
use kalmems_models::readout::CurrentReadout;

/// The unit of the angle in rad.
pub const ANGLE_UNIT_RAD: f64 = 0.01834862385321101;
/// The unit of the rate in rad/s.
pub const RATE_UNIT_RAD_PER_S: f64 = 9174.311926604287;
/// What a signal of 1 V is, in standard deviations of its noise.
pub const PER_VOLT: f64 = 22.988505747126435;
/// How many samples after it happened a crossing is known.
pub const LOOK_AHEAD: usize = Finder::<f64>::LOOK_AHEAD;

/// What finds crossings.
type Finder<T> = Detector<T, 60, 150, 336>;

/// One step over one interval, and its noise.
#[inline(always)]
pub fn process<T: Scalar<Mask = bool>>() -> LinearProcess<T, 2, 0> {
    let of = T::of;
    LinearProcess {
        transition: Mat([[of(0.9999687030664928), of(0.9999373518726024)], [of(-6.259245101946826e-5), of(0.9998642740215946)]]),
        input: Mat([[], []]),
        noise: Covariance::from_lower(Mat([[of(3.7683108518370163e-11), of(0.0)], [of(5.652271524991622e-11), of(1.1304543067400899e-10)]])).into(),
    }
}

/// What is read, in standard deviations of its noise.
#[inline(always)]
pub fn readout<T: Scalar>() -> CurrentReadout<T> {
    let of = T::of;
    let comb = CombCurve {
        centre: of(0.41964999999999997),
        gain: of(653.8015395970871),
        steepness: of(1.0),
        shape: CurveShape::Logistic,
    };
    CurrentReadout { comb, offset: of(0.0) }
}

/// The detector and the filter on their way.
#[derive(Clone, Copy, Debug)]
pub struct Estimator<T: Scalar> {
    finder: Finder<T>,
    fit: CubicFit<T, 90>,
    filter: Ekf<T, 2>,
    crossings: u32,
}

impl<T: Scalar<Mask = bool>> Estimator<T> {
    /// Before the first sample.
    pub fn new() -> Result<Self, DetectError> {
        let of = T::of;
        let kernel = SlopeKernel::new(14.999999999998009)?;
        let threshold = Threshold::fixed(kernel.noise_deviation(of(1.0)) * of(4.0));
        let start = Covariance::from_standard_deviations([of(0.27249999999999996), of(0.0021800000000002893)]);
        Ok(Self {
            finder: Finder::new(kernel, threshold, of(1.0)),
            fit: CubicFit::new(29.999999999996017)?,
            filter: Ekf::new([of(-5.558999999999999), of(0.045017000000005976)], start),
            crossings: 0,
        })
    }

    /// Goes on to the next sample, a signal in V; the first is at the start.
    #[inline(always)]
    pub fn step(&mut self, signal_v: T, is_first: bool) -> Result<(), FilterError> {
        let signal = signal_v * T::of(PER_VOLT);
        if !is_first {
            self.filter.predict(&process(), &[])?;
        }
        if self.finder.push(signal).is_some() {
            self.cross()?;
        }
        self.filter.update(&readout(), &[signal], &Covariance::from_variances([T::of(1.0)])).map(drop)
    }

    /// Corrects by a crossing that is known now, where the signal has a zero there.
    #[inline(never)]
    fn cross(&mut self) -> Result<(), FilterError> {
        let of = T::of;
        let Some(crossing) = self.finder.crossing(&self.fit, of(0.0)) else { return Ok(()) };
        let free = Mat([[of(0.0), of(1.0)], [of(-6.259637256499136e-5), of(-0.00010443558759218092)]]);
        let past = angle_at(&free, of(211.0) - crossing.displacement);
        // y′ = h′·ω² where h is 0.
        let rate = (crossing.slope.abs() * of(0.006118064516129844)).sqrt();
        let variance = angle_variance(crossing.timing_variance, rate, of(1.0)) + of(2.97025e-7);
        self.crossings += 1;
        self.filter
            .update_where(&past, &[of(0.20165)], &Covariance::from_variances([variance]), &Always)
            .map(drop)
    }

    /// How many crossings there were.
    #[inline(always)]
    pub fn crossings(&self) -> u32 {
        self.crossings
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
