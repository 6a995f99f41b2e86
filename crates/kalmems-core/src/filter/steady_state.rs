//! Filters whose gain does not change.

use super::gaussian::Refusal;
use super::observer::{ObserverError, Pole, place_poles};
use super::{Gaussian, Innovation};
use crate::linalg::Lu;
use crate::notation::{finite, matrix, sum, vector};
use crate::riccati::{RiccatiError, discrete_lyapunov, discrete_riccati, kalman_gain};
use crate::{Covariance, FilterError, Mat, NumericMeasurement, NumericProcess, Scalar};

/// A linear, or linearised, system: what a constant gain is computed from.
#[derive(Clone, Copy, Debug)]
pub struct OperatingPoint<T, const N: usize, const M: usize> {
    /// F: how the state moves over one interval.
    pub transition: Mat<T, N, N>,
    /// H: what the measurement sees of it.
    pub observation: Mat<T, M, N>,
    /// Q: the covariance that the noise adds over one interval.
    pub process_noise: Covariance<T, N>,
    /// R: the covariance of the measurement's noise.
    pub measurement_noise: Covariance<T, M>,
}

impl<T: Scalar, const N: usize, const M: usize> OperatingPoint<T, N, M> {
    /// Any process and measurement, linearised at a state and an input.
    pub fn of<P: NumericProcess<T, N>, H: NumericMeasurement<T, N, M>>(
        process: &P,
        (measurement, measurement_noise): (&H, Covariance<T, M>),
        (x, u): (&[T; N], &P::Input),
    ) -> Self {
        Self {
            transition: process.linearized(x, u).1,
            observation: measurement.linearized(x).1,
            process_noise: *process.noise_added().covariance(),
            measurement_noise,
        }
    }
}

/// A filter with one gain for all times: x̂ = x̂⁻ + K·(y − h(x̂⁻)).
///
/// There are several ways to a gain: the one in which a Kalman filter settles
/// ([`steady_state`](Self::steady_state)), the poles that the error shall have
/// ([`luenberger`](Self::luenberger)), or any other ([`from_gain`](Self::from_gain)). A step moves the mean alone,
/// through any [`Process`](crate::Process) and [`Measurement`](crate::Measurement), nonlinear ones too: the gain is then right near the
/// [`OperatingPoint`] that it was computed at.
///
/// The covariances are those in which the error of this gain settles at that point, whether it is optimal or
/// not: P = (I − K·H)·(F·P·Fᵀ + Q)·(I − K·H)ᵀ + K·R·Kᵀ. They do not say how far off the start is, nor do they
/// grow where measurements are missing.
///
/// It is no [`Filter`](super::Filter): that trait takes a measurement of any size and noise with each update, and
/// this gain is for one size and one noise. Its `predict` and `update` have the same form otherwise.
///
/// ```
/// use kalmems_core::{Covariance, FixedGain, LinearMeasurement, LinearProcess, Mat, OperatingPoint};
/// // A level that walks at random, seen with noise: q = 1, r = 2, so that p⁻ = 2 and K = ½.
/// let walk = LinearProcess::<f64, 1, 0> {
///     transition: Mat::identity(),
///     input: Mat::zero(),
///     noise: Covariance::from_variances([1.0]).into(),
/// };
/// let level = LinearMeasurement { matrix: Mat([[1.0]]) };
/// let noise = Covariance::from_variances([2.0]);
/// let point = OperatingPoint::of(&walk, (&level, noise), (&[0.0], &[]));
/// let mut filter = FixedGain::steady_state([0.0], &point)?;
/// assert!((filter.predicted_covariance().get(0, 0) - 2.0).abs() < 1e-14);
/// assert!((filter.filtered_covariance().get(0, 0) - 1.0).abs() < 1e-14);
/// filter.predict(&walk, &[])?;
/// let innovation = filter.update(&level, &[3.0])?;
/// assert!((innovation.nis - 9.0 / 4.0).abs() < 1e-14);
/// assert!((filter.mean()[0] - 1.5).abs() < 1e-14);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct FixedGain<T, const N: usize, const M: usize> {
    mean: [T; N],
    gain: Mat<T, N, M>,
    predicted: Covariance<T, N>,
    filtered: Covariance<T, N>,
    innovation: Covariance<T, M>,
}

impl<T: Scalar, const N: usize, const M: usize> FixedGain<T, N, M> {
    /// The gain in which the Kalman filter of this system settles: of all constant gains the one with the least
    /// variance of every state.
    pub fn steady_state(mean: [T; N], point: &OperatingPoint<T, N, M>) -> Result<Self, RiccatiError> {
        let (h, r) = (&point.observation, &point.measurement_noise);
        let predicted = discrete_riccati(&point.transition, h, &point.process_noise, r)?;
        Ok(Self::with(mean, kalman_gain(&predicted, h, r), predicted, point))
    }

    /// Any gain K, in state per measurement. It is refused where the error would not decay.
    ///
    /// Where the noise is zero the covariances are, and the innovations have no
    /// [`nis`](Innovation::nis).
    pub fn from_gain(
        mean: [T; N],
        gain: Mat<T, N, M>,
        point: &OperatingPoint<T, N, M>,
    ) -> Result<Self, RiccatiError> {
        // P⁻ = F·((I − K·H)·P⁻·(I − K·H)ᵀ + K·R·Kᵀ)·Fᵀ + Q.
        let closed = point.transition.times(&remaining(&gain, &point.observation));
        let noise = point.measurement_noise.transformed(&point.transition.times(&gain));
        let predicted = discrete_lyapunov(&closed, &noise.plus(&point.process_noise))?;
        Ok(Self::with(mean, gain, predicted, point))
    }

    fn with(
        mean: [T; N],
        gain: Mat<T, N, M>,
        predicted: Covariance<T, N>,
        point: &OperatingPoint<T, N, M>,
    ) -> Self {
        let (h, r) = (&point.observation, &point.measurement_noise);
        Self {
            mean,
            gain,
            predicted,
            filtered: predicted.transformed(&remaining(&gain, h)).plus(&r.transformed(&gain)),
            innovation: predicted.transformed(h).plus(r),
        }
    }
}

impl<T: Scalar, const N: usize> FixedGain<T, N, 1> {
    /// A Luenberger observer: the gain that gives the error these `N` poles in the plane of z.
    ///
    /// The error of the prediction moves with F − L·H, L = F·K, and so does that of the correction with
    /// (I − K·H)·F, which has the same eigenvalues. See [`place_poles`] for what can be placed; a pole of a
    /// continuous observer is brought to one interval by [`Pole::sampled`].
    ///
    /// ```
    /// use kalmems_core::{Covariance, FixedGain, Mat, OperatingPoint};
    /// use kalmems_core::filter::Pole;
    /// let point = OperatingPoint {
    ///     transition: Mat([[1.0, 0.1], [0.0, 1.0]]),
    ///     observation: Mat([[1.0, 0.0]]),
    ///     process_noise: Covariance::zero(),
    ///     measurement_noise: Covariance::from_variances([1e-4]),
    /// };
    /// let poles = [Pole::Pair { real: 0.6, imaginary: 0.2 }];
    /// let observer = FixedGain::luenberger([0.0, 0.0], &poles, &point)?;
    /// // It is noisier the faster it is.
    /// let fast = FixedGain::luenberger([0.0, 0.0], &[Pole::Real(0.1), Pole::Real(0.2)], &point)?;
    /// let deviation = |o: &FixedGain<f64, 2, 1>| o.filtered_covariance().standard_deviation(1);
    /// assert!(deviation(&fast) > 2.0 * deviation(&observer));
    /// # Ok::<(), kalmems_core::filter::ObserverError<f64>>(())
    /// ```
    pub fn luenberger(
        mean: [T; N],
        poles: &[Pole<T>],
        point: &OperatingPoint<T, N, 1>,
    ) -> Result<Self, ObserverError<T>> {
        let placed = place_poles(&point.transition, &point.observation, poles)?;
        let lu = Lu::of(&point.transition).ok_or(ObserverError::SingularTransition)?;
        Self::from_gain(mean, lu.solve(&placed.gain), point).map_err(ObserverError::NoSteadyState)
    }
}

impl<T: Scalar, const N: usize, const M: usize> FixedGain<T, N, M> {
    /// The mean of the state.
    #[inline(always)]
    pub const fn mean(&self) -> &[T; N] {
        &self.mean
    }

    /// K.
    #[inline(always)]
    pub const fn gain(&self) -> &Mat<T, N, M> {
        &self.gain
    }

    /// P⁻: the covariance of the error after a prediction, once it has settled.
    #[inline(always)]
    pub const fn predicted_covariance(&self) -> &Covariance<T, N> {
        &self.predicted
    }

    /// P: the covariance of the error after a correction, once it has settled.
    #[inline(always)]
    pub const fn filtered_covariance(&self) -> &Covariance<T, N> {
        &self.filtered
    }

    /// The estimate after a correction, with the covariance in which it settles.
    #[inline(always)]
    pub const fn filtered(&self) -> Gaussian<T, N> {
        Gaussian { mean: self.mean, covariance: self.filtered }
    }

    /// Moves the mean by one step: f(x, u).
    #[inline(always)]
    pub fn predict<P: NumericProcess<T, N>>(&mut self, process: &P, u: &P::Input) -> Result<(), FilterError> {
        let next = process.moved(&self.mean, u);
        self.take(&next, Refusal::none)
    }

    /// Corrects the mean with a measurement `y`.
    #[inline(always)]
    pub fn update<H: NumericMeasurement<T, N, M>>(
        &mut self,
        measurement: &H,
        y: &[T; M],
    ) -> Result<Innovation<T, M>, FilterError> {
        let predicted = measurement.expected(&self.mean);
        // The factors, and the NIS, cost nothing where nobody looks at them.
        let (mut innovation, _) = Innovation::new(y, &predicted, self.innovation);
        let next = vector!(|i| self.mean[i] + sum!(M, |k| self.gain.0[i][k] * innovation.residual[k]));
        self.take(&next, || Refusal::of_measurement(y))?;
        innovation.taken = true;
        Ok(innovation)
    }

    /// Takes a mean where it is finite. A measurement that is not finite makes a mean that is not, so that its own check is left to where
    /// the reason is asked for.
    #[inline(always)]
    fn take(&mut self, next: &[T; N], reason: impl Fn() -> Refusal) -> Result<(), FilterError> {
        if !finite(next) {
            return Refusal { state: true, ..reason() }.to_error();
        }
        self.mean = *next;
        Ok(())
    }
}

/// I − K·H.
fn remaining<T: Scalar, const N: usize, const M: usize>(
    gain: &Mat<T, N, M>,
    h: &Mat<T, M, N>,
) -> Mat<T, N, N> {
    let seen = gain.times(h);
    matrix!(|i, j| T::of(if i == j { 1.0 } else { 0.0 }) - seen.0[i][j])
}
