//! From continuous time to intervals that come as they may.

use super::stepper::{AsGiven, runge_kutta};
use super::{Dynamics, LinearProcess, Nodes, Process, ProcessNoise, jacobian};
use crate::{Covariance, Mat, NoiseDensity, Over, Scalar};
use core::fmt;

/// Why there is no process over this interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntervalError {
    /// The interval is infinite or not a number.
    NonFinite,
    /// The interval is negative: the sample is older than the state. Noise has no way back; see
    /// [`Delayed`](crate::Delayed) for a measurement about the past.
    Negative,
    /// The interval takes more than a million steps.
    TooLong,
    /// The longest step that was asked for is not a positive finite number.
    Step,
}

impl fmt::Display for IntervalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NonFinite => "the interval is not a finite number",
            Self::Negative => "the interval is negative",
            Self::TooLong => "the interval takes more than a million steps",
            Self::Step => "the longest step is not a positive finite number",
        })
    }
}

impl core::error::Error for IntervalError {}

/// An interval that time can run over; zero is one.
fn checked(interval: f64) -> Result<f64, IntervalError> {
    if !interval.is_finite() {
        Err(IntervalError::NonFinite)
    } else if interval < 0.0 {
        Err(IntervalError::Negative)
    } else {
        Ok(interval)
    }
}

/// Makes processes over intervals of any length: the prediction of a continuous–discrete ("hybrid") filter.
///
/// The mean follows ẋ = f(x, u) by Runge–Kutta steps of fourth order that are no longer than stated, the
/// sensitivity Φ by dual numbers through all of their stages. The noise covariance
/// Q = ∫ Φ(t₁, s)·D·Φ(t₁, s)ᵀ ds is linearised along the trajectory, by Simpson's rule over each two steps: positive
/// semi-definite by construction, because all of its weights are positive, and of fourth order as the mean is.
/// With F·P·Fᵀ + Q that solves Ṗ = A·P + P·Aᵀ + D with the Jacobian A at the moving mean (Jazwinski, Stochastic
/// Processes and Filtering Theory, 1970, section 9.3), and P stays positive semi-definite for any step.
///
/// What it makes is a [`Process`] for any filter. An explicit method needs steps shorter than about 2.7 over the
/// fastest decay; where that is too short and the system linear, [`ContinuousLinear`] has no such bound.
///
/// Time is in seconds from the start of the interval, and is `f64` for every kind of number.
///
/// ```
/// use kalmems_core::{ContinuousDiscrete, Covariance, Dynamics, Ekf, Filter, NoiseDensity, Over, Scalar};
/// /// x = [angle, rate] of a pendulum, driven by a torque.
/// struct Pendulum;
/// impl<T: Scalar> Dynamics<T, 2> for Pendulum {
///     type Input = T;
///     fn derivative<S: Over<T>>(&self, x: &[S; 2], torque: &T) -> [S; 2] {
///         [x[1], S::lift(*torque) - x[0].sin()]
///     }
/// }
/// let maker = ContinuousDiscrete::new(Pendulum, NoiseDensity::none().on::<1>(1e-4), 0.05)?;
/// let mut filter = Ekf::new([1.0, 0.0], Covariance::from_variances([1e-4, 1e-4]));
/// for interval in [0.31, 0.02, 1.7] {
///     let process = maker.over(interval, filter.mean(), |t: f64| 0.1 * t.cos())?;
///     filter.predict(&process, &())?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ContinuousDiscrete<D, T, const N: usize> {
    dynamics: D,
    density: NoiseDensity<T, N>,
    longest_step: f64,
}

/// The most steps over one interval.
const MOST_STEPS: f64 = 1e6;

impl<T: Scalar, D: Dynamics<T, N>, const N: usize> ContinuousDiscrete<D, T, N> {
    /// Dynamics with their noise, and the longest step in seconds.
    pub fn new(dynamics: D, density: NoiseDensity<T, N>, longest_step: f64) -> Result<Self, IntervalError> {
        if longest_step.is_finite() && longest_step > 0.0 {
            Ok(Self { dynamics, density, longest_step })
        } else {
            Err(IntervalError::Step)
        }
    }

    /// The process over `interval` seconds, its noise linearised along the trajectory that starts at `from` (the
    /// filter's mean), with an input as a function of the time since the start of the interval.
    ///
    /// Over no time at all nothing moves: two sensors may have been read at one instant. A negative interval, one
    /// that is not finite and one of more than a million steps are refused.
    #[inline(always)]
    pub fn over<I: Fn(f64) -> D::Input>(
        &self,
        interval: f64,
        from: &[T; N],
        input: I,
    ) -> Result<Propagation<'_, D, I, T, N>, IntervalError> {
        let pairs = libm::ceil(checked(interval)? / (2.0 * self.longest_step)).max(1.0);
        if pairs > MOST_STEPS / 2.0 {
            return Err(IntervalError::TooLong);
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 1 and half a million
        let mut propagation = Propagation {
            dynamics: &self.dynamics,
            input,
            pairs: pairs as u32,
            step: interval / (2.0 * pairs),
            noise: ProcessNoise::none(),
            from: *from,
            to: *from,
            transition: Mat::identity(),
        };
        let (to, transition, noise) = propagation.linearized(from, &self.density);
        (propagation.to, propagation.transition, propagation.noise) = (to, transition, noise.into());
        Ok(propagation)
    }
}

/// The step of a [`ContinuousDiscrete`] over one interval.
#[derive(Clone, Copy, Debug)]
pub struct Propagation<'a, D, I, T, const N: usize> {
    dynamics: &'a D,
    input: I,
    /// Of steps: Simpson's rule takes two.
    pairs: u32,
    step: f64,
    noise: ProcessNoise<T, N>,
    /// Where it was linearised, where that leads, and the Jacobian.
    from: [T; N],
    to: [T; N],
    transition: Mat<T, N, N>,
}

impl<T, D, I, const N: usize> Propagation<'_, D, I, T, N>
where
    T: Scalar,
    D: Dynamics<T, N>,
    I: Fn(f64) -> D::Input,
{
    /// One Runge–Kutta step from the time `t`.
    #[inline(always)]
    fn advance<S: Over<T>>(&self, x: &[S; N], t: f64) -> [S; N] {
        let u = Nodes {
            start: (self.input)(t),
            middle: (self.input)(t + self.step / 2.0),
            end: (self.input)(t + self.step),
        };
        runge_kutta(T::of(self.step), x, &u, &AsGiven::<T, D>::new(self.dynamics))
    }

    /// Where `x` goes, the Jacobian, and the noise.
    #[inline(always)]
    fn linearized(
        &self,
        x: &[T; N],
        density: &NoiseDensity<T, N>,
    ) -> ([T; N], Mat<T, N, N>, Covariance<T, N>) {
        let density = density.matrix();
        let weigh = |by: f64| Covariance::<T, N>::lower(|i, j| density.get(i, j) * T::of(by));
        // Simpson over two steps: one part at each end, four in the middle.
        let (one, four) = (weigh(self.step / 3.0), weigh(self.step * 4.0 / 3.0));
        let (mut x, mut transition, mut noise) = (*x, Mat::identity(), Covariance::zero());
        for pair in 0..self.pairs {
            let t = 2.0 * f64::from(pair) * self.step;
            let (middle, first) = jacobian(&x, |x| self.advance(x, t));
            let (end, second) = jacobian(&middle, |x| self.advance(x, t + self.step));
            let both = second.times(&first);
            noise = noise.plus(&one).transformed(&both).plus(&four.transformed(&second)).plus(&one);
            transition = both.times(&transition);
            x = end;
        }
        (x, transition, noise)
    }
}

impl<T, D, I, const N: usize> Process<T, N> for Propagation<'_, D, I, T, N>
where
    T: Scalar,
    D: Dynamics<T, N>,
    I: Fn(f64) -> D::Input,
{
    /// The input came with the interval.
    type Input = ();

    #[inline(always)]
    fn step<S: Over<T>>(&self, x: &[S; N], (): &()) -> [S; N] {
        let mut x = *x;
        for pair in 0..self.pairs {
            let t = 2.0 * f64::from(pair) * self.step;
            let middle = self.advance(&x, t);
            x = self.advance(&middle, t + self.step);
        }
        x
    }

    #[inline(always)]
    fn noise(&self) -> &ProcessNoise<T, N> {
        &self.noise
    }

    /// Known already where it was made; computed the same way elsewhere.
    #[inline(always)]
    fn linearize(&self, x: &[T; N], (): &()) -> ([T; N], Mat<T, N, N>) {
        let mut elsewhere = false;
        for (x, from) in x.iter().zip(&self.from) {
            elsewhere = elsewhere | x.lt(*from) | x.gt(*from) | !x.is_finite();
        }
        if elsewhere {
            let (to, transition, _) = self.linearized(x, &NoiseDensity::none());
            (to, transition)
        } else {
            (self.to, self.transition)
        }
    }
}

/// Makes exact processes of a linear differential equation ẋ = A·x + B·u + w over intervals of any length.
///
/// The step is [`LinearProcess::exact`], however stiff the system and however long the interval. Where an interval
/// repeats, to the bit, the last process is used again.
///
/// ```
/// use kalmems_core::{ContinuousLinear, Mat, NoiseDensity};
/// let relaxation = (Mat([[-1e6]]), Mat([[1e6]]));
/// let mut maker = ContinuousLinear::new(relaxation.0, relaxation.1, NoiseDensity::none().on::<0>(2.0));
/// let process = maker.over(1.0)?;
/// assert_eq!(process.transition, Mat([[0.0]]));
/// let variance: f64 = process.noise.covariance().get(0, 0);
/// assert!((variance - 1e-6).abs() < 1e-18);
/// assert!(maker.over(-1.0).is_err());
/// # Ok::<(), kalmems_core::IntervalError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ContinuousLinear<T, const N: usize, const U: usize> {
    system: Mat<T, N, N>,
    input: Mat<T, N, U>,
    density: NoiseDensity<T, N>,
    interval: f64,
    process: LinearProcess<T, N, U>,
}

impl<T: Scalar, const N: usize, const U: usize> ContinuousLinear<T, N, U> {
    /// A, B and the noise.
    pub fn new(system: Mat<T, N, N>, input: Mat<T, N, U>, density: NoiseDensity<T, N>) -> Self {
        let process = LinearProcess::exact(&system, &input, &density, T::of(0.0));
        Self { system, input, density, interval: 0.0, process }
    }

    /// The process over `interval` seconds with a held input.
    ///
    /// Over no time at all nothing moves. A negative interval, and one that is not finite, is refused.
    pub fn over(&mut self, interval: f64) -> Result<&LinearProcess<T, N, U>, IntervalError> {
        if checked(interval)? != self.interval {
            self.process = LinearProcess::exact(&self.system, &self.input, &self.density, T::of(interval));
            self.interval = interval;
        }
        Ok(&self.process)
    }
}
