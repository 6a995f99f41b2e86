//! Every k-th sample.

use crate::notation::lower;
use crate::{Covariance, FilterError, Kalman, LinearMeasurement, LinearProcess, Scalar};
use core::fmt;
use core::num::NonZeroU32;

/// Counts samples: the first is used for a correction and every k-th after it; the others are predicted
/// through.
///
/// It is for measurements that cost more than they say. What it costs in accuracy says [`SteadyDecimation`]
/// for a linear filter. On a scanner of 64 samples a cycle one sample in eight makes the error 1.6 times as
/// large, and a tenth of the samples taken [on need](super::OnNeed) 1.3 times; but the covariance of
/// decimation is that of the error, where the one on need is larger (test
/// `fewer_corrections_of_the_scanner_cost_accuracy_and_not_honesty`). A vibration seen at every half of its
/// period is seen in one phase alone, and is estimated worse than with fewer samples.
///
/// ```
/// use core::num::NonZeroU32;
/// use kalmems_core::update::Decimation;
/// let mut third = Decimation::every(NonZeroU32::new(3).unwrap());
/// let due: [bool; 7] = std::array::from_fn(|_| third.due());
/// assert_eq!(due, [true, false, false, true, false, false, true]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Decimation {
    every: NonZeroU32,
    /// Samples still to be skipped.
    left: u32,
}

impl Decimation {
    /// Corrections at every `every`-th sample.
    pub const fn every(every: NonZeroU32) -> Self {
        Self { every, left: 0 }
    }

    /// Counts one sample; whether it is to be used.
    #[inline(always)]
    pub fn due(&mut self) -> bool {
        let due = self.left == 0;
        self.left = if due { self.every.get() - 1 } else { self.left.saturating_sub(1) };
        due
    }
}

/// The covariances between which a linear filter settles that corrects at every k-th step.
///
/// The limit of the periodic Riccati recursion P⁻ = Φ·P·Φᵀ + Q (k times), P⁺ = (I − K·H)·P⁻·(I − K·H)ᵀ +
/// K·R·Kᵀ, found by iterating it.
///
/// ```
/// use core::num::NonZeroU32;
/// use kalmems_core::update::SteadyDecimation;
/// use kalmems_core::{Covariance, LinearMeasurement, LinearProcess, Mat};
/// let walk = LinearProcess::<f64, 1, 0> {
///     transition: Mat::identity(),
///     input: Mat::zero(),
///     noise: Covariance::from_variances([0.5]).into(),
/// };
/// let level = LinearMeasurement { matrix: Mat([[1.0]]) };
/// let r = Covariance::from_variances([6.0]);
/// let of = |every| SteadyDecimation::of(&walk, &level, &r, NonZeroU32::new(every).unwrap(), 1e-14);
/// // Four steps add 2: p = 2/2 + √(2²/4 + 2·6) before a correction.
/// assert!((of(4)?.before.get(0, 0) - (1.0 + 13_f64.sqrt())).abs() < 1e-12);
/// assert!(of(4)?.mean.get(0, 0) > of(1)?.mean.get(0, 0));
/// # Ok::<(), kalmems_core::update::NotSteady>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct SteadyDecimation<T, const N: usize> {
    /// Just before a correction, where it is largest.
    pub before: Covariance<T, N>,
    /// Just after a correction.
    pub after: Covariance<T, N>,
    /// The mean over all samples, corrected or not: the mean square error of the filter's output.
    pub mean: Covariance<T, N>,
}

/// Why there is no steady state to tell of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotSteady {
    /// A step of the recursion was refused.
    Refused(FilterError),
    /// The variances still changed after [`SteadyDecimation::PERIODS`] corrections: something that cannot be
    /// seen grows.
    StillChanging,
}

impl fmt::Display for NotSteady {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(error) => write!(f, "a step of the recursion was refused: {error}"),
            Self::StillChanging => f.write_str("the variances do not settle"),
        }
    }
}

impl core::error::Error for NotSteady {}

impl From<FilterError> for NotSteady {
    fn from(error: FilterError) -> Self {
        Self::Refused(error)
    }
}

impl<T: Scalar, const N: usize> SteadyDecimation<T, N> {
    /// The corrections after which a recursion counts as not steady.
    pub const PERIODS: u32 = 1_000_000;

    /// Iterates the recursion from P = I until no variance changes by more than `tolerance` of itself over
    /// one period.
    pub fn of<const U: usize, const M: usize>(
        process: &LinearProcess<T, N, U>,
        measurement: &LinearMeasurement<T, N, M>,
        r: &Covariance<T, M>,
        every: NonZeroU32,
        tolerance: T,
    ) -> Result<Self, NotSteady> {
        let zeros = ([T::of(0.0); U], [T::of(0.0); M]);
        let start = Covariance::from_variances([T::of(1.0); N]);
        let mut filter = Kalman::new([T::of(0.0); N], start);
        let mut last = start;
        for _ in 0..Self::PERIODS {
            let mut before = last;
            let mut total = Covariance::zero();
            for step in 1..=every.get() {
                filter.predict(process, &zeros.0)?;
                before = *filter.covariance();
                if step < every.get() {
                    total = total.plus(&before);
                }
            }
            filter.update(measurement, &zeros.1, r)?;
            let after = *filter.covariance();
            let settled = (0..N).all(|i| {
                let (new, old) = (after.get(i, i), last.get(i, i));
                !(new - old).abs().gt(tolerance * new)
            });
            if settled {
                let total = total.plus(&after);
                let share = T::of(f64::from(every.get())).recip();
                let mean = lower!(|i, j| total.get(i, j) * share);
                return Ok(Self { before, after, mean });
            }
            last = after;
        }
        Err(NotSteady::StillChanging)
    }
}
