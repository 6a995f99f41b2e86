//! Observers by the poles of their error.

use crate::linalg::Lu;
use crate::notation::{matrix, sum, vector};
use crate::riccati::{RiccatiError, largest_row_sum, rounding};
use crate::{Dynamics, Mat, Measurement, Over, Scalar, discretize};
use core::fmt;

/// One or two eigenvalues of the error of an observer, so that their polynomial is real.
///
/// In 1/s (rad/s) for a continuous observer, where they lie left of zero; without a unit for a discrete one, where
/// they lie within the unit circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pole<T> {
    /// A real one.
    Real(T),
    /// Two: real ± i·imaginary.
    Pair {
        /// The real part of both.
        real: T,
        /// The imaginary part of one; the other has its opposite.
        imaginary: T,
    },
}

impl<T: Scalar> Pole<T> {
    /// e^{s·h}: a continuous pole s over one interval h.
    ///
    /// ```
    /// use kalmems_core::filter::Pole;
    /// assert_eq!(Pole::Real(-2.0_f64).sampled(0.5), Pole::Real((-1.0_f64).exp()));
    /// ```
    #[must_use]
    pub fn sampled(self, interval: T) -> Self {
        match self {
            Self::Real(real) => Self::Real((real * interval).exp()),
            Self::Pair { real, imaginary } => {
                let (size, angle) = ((real * interval).exp(), imaginary * interval);
                Self::Pair { real: size * angle.cos(), imaginary: size * angle.sin() }
            }
        }
    }

    /// The same in another unit of time.
    fn scaled(self, by: T) -> Self {
        match self {
            Self::Real(real) => Self::Real(real * by),
            Self::Pair { real, imaginary } => Self::Pair { real: real * by, imaginary: imaginary * by },
        }
    }

    /// How many eigenvalues it stands for.
    const fn count(&self) -> usize {
        match self {
            Self::Real(_) => 1,
            Self::Pair { .. } => 2,
        }
    }

    /// Its factor of the polynomial in A, times v.
    fn factor_times<const N: usize>(&self, a: &Mat<T, N, N>, v: &[T; N]) -> [T; N] {
        let av = a.times_vector(v);
        match *self {
            Self::Real(real) => vector!(|i| av[i] - real * v[i]),
            Self::Pair { real, imaginary } => {
                let aav: [T; N] = a.times_vector(&av);
                let square = real.sq() + imaginary.sq();
                vector!(|i| aav[i] - real.twice() * av[i] + square * v[i])
            }
        }
    }
}

/// Why there is no such observer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObserverError<T> {
    /// So many poles were given, and the system has as many as it has states.
    PoleCount(usize),
    /// A matrix or a pole holds something infinite or not a number.
    NonFinite,
    /// The measurement does not see the whole state.
    NotObservable {
        /// The condition number of the observability matrix; infinite where it has no inverse.
        condition: T,
    },
    /// The transition has no inverse, so that no gain on the innovation of a filter places the poles. A transition
    /// over an interval, e^{A·h}, always has one.
    SingularTransition,
    /// The poles were placed, but the covariance of the error does not settle: a pole lies on or outside the unit
    /// circle, or was not reached because of rounding.
    NoSteadyState(RiccatiError),
}

impl<T: fmt::Display> fmt::Display for ObserverError<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PoleCount(count) => write!(f, "{count} poles were given; there must be one for each state"),
            Self::NonFinite => f.write_str("a matrix or a pole is not finite"),
            Self::NotObservable { condition } => {
                write!(f, "the measurement does not see the whole state (condition {condition})")
            }
            Self::SingularTransition => f.write_str("the transition has no inverse"),
            Self::NoSteadyState(reason) => write!(f, "the error does not settle: {reason}"),
        }
    }
}

impl<T: fmt::Debug + fmt::Display> core::error::Error for ObserverError<T> {}

/// A gain that places poles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement<T, const N: usize> {
    /// L: the eigenvalues of A − L·H are the poles.
    pub gain: Mat<T, N, 1>,
    /// The condition number of the observability matrix (of row sums, with rows of size one, in balanced units):
    /// the gain has lost about as many digits as this has.
    pub condition: T,
}

/// The gain L for which A − L·H has these poles: L = p(A)·O⁻¹·[0 … 0 1]ᵀ with the polynomial p of the poles and
/// the rows H·Aⁱ of O (Ackermann, Regelungstechnik 20, 297, 1972; for the dual pair).
///
/// A is N × N. It is the matrix of a differential equation, and L in state per measurement and second, or the
/// transition over one interval, and L in state per measurement. The polynomial is applied factor by factor and
/// never expanded.
///
/// One output alone: with several, the poles leave the gain open. Use the gain of
/// [`discrete_riccati`](crate::riccati::discrete_riccati) there, which says what to do with the freedom. With many states, or
/// with poles far from those of A, pole placement is ill-conditioned whatever the method: look at the
/// [`condition`](Placement::condition).
///
/// ```
/// use kalmems_core::{Mat, filter::{Pole, place_poles}};
/// // A point mass whose position is seen: s² + l₁·s + l₂ = (s + 1)² + 2².
/// let (a, h) = (Mat([[0.0_f64, 1.0], [0.0, 0.0]]), Mat([[1.0, 0.0]]));
/// let placed = place_poles(&a, &h, &[Pole::Pair { real: -1.0, imaginary: 2.0 }])?;
/// assert_eq!(placed.gain, Mat([[2.0], [5.0]]));
/// # Ok::<(), kalmems_core::filter::ObserverError<f64>>(())
/// ```
pub fn place_poles<T: Scalar, const N: usize>(
    a: &Mat<T, N, N>,
    h: &Mat<T, 1, N>,
    poles: &[Pole<T>],
) -> Result<Placement<T, N>, ObserverError<T>> {
    let count = poles.iter().map(Pole::count).sum();
    if count != N {
        return Err(ObserverError::PoleCount(count));
    }
    if !a.is_finite() || !h.is_finite() {
        return Err(ObserverError::NonFinite);
    }
    // Balanced states, and a unit of time in which A is of size one: an eigenvalue of 10⁵/s would otherwise be
    // there to the power of N − 1.
    let scale = discretize::balance(a);
    let a: Mat<T, N, N> = matrix!(|i, j| a.0[i][j] * scale[j] / scale[i]);
    let size = largest_row_sum(&a);
    let rate = if size.gt(T::of(0.0)) { size } else { T::of(1.0) };
    let a = a.scaled(rate.recip());

    // O with rows of size one, and the size that its last row had.
    let mut row: [T; N] = vector!(|j| h.0[0][j] * scale[j]);
    let mut last = T::of(1.0);
    let mut observability = Mat::<T, N, N>::zero();
    for (i, normalised) in observability.0.iter_mut().enumerate() {
        if i > 0 {
            row = vector!(|j| sum!(N, |k| row[k] * a.0[k][j]));
        }
        let size = sum!(N, |j| row[j].abs());
        last = last * size;
        row = row.map(|entry| entry / size);
        *normalised = row;
    }
    let unobservable = ObserverError::NotObservable { condition: T::of(f64::INFINITY) };
    let inverse = Lu::of(&observability).ok_or(unobservable)?.inverse();
    let condition = largest_row_sum(&observability) * largest_row_sum(&inverse);
    if !(condition * rounding()).lt(T::of(1.0)) {
        return Err(ObserverError::NotObservable { condition });
    }

    let unit: [T; N] = vector!(|i| if i + 1 == N { last.recip() } else { T::of(0.0) });
    let mut gain: [T; N] = inverse.times_vector(&unit);
    for pole in poles {
        gain = pole.scaled(rate.recip()).factor_times(&a, &gain);
    }
    let gain = Mat(vector!(|i| [gain[i] * scale[i] * rate]));
    if gain.is_finite() { Ok(Placement { gain, condition }) } else { Err(ObserverError::NonFinite) }
}

/// An observer in continuous time: dx̂/dt = f(x̂, u) + L·(y − h(x̂)), driven by what drives the device and by
/// what is measured.
///
/// A differential equation as any other, to be integrated where the measurement is a signal rather than samples:
/// for a gain of [`place_poles`] or of [`kalman_bucy_gain`](crate::riccati::kalman_bucy_gain). The covariance of its error
/// follows from [`continuous_lyapunov`](crate::riccati::continuous_lyapunov) with the noise Q + L·R·Lᵀ.
///
/// ```
/// use kalmems_core::{Dynamics, LinearMeasurement, Mat, Over, Scalar};
/// use kalmems_core::filter::ContinuousObserver;
/// struct Decay;
/// impl<T: Scalar> Dynamics<T, 1> for Decay {
///     type Input = ();
///     fn derivative<S: Over<T>>(&self, x: &[S; 1], (): &()) -> [S; 1] {
///         [-x[0]]
///     }
/// }
/// let level = LinearMeasurement { matrix: Mat([[2.0]]) };
/// let observer = ContinuousObserver { dynamics: Decay, measurement: level, gain: Mat([[3.0]]) };
/// assert_eq!(observer.derivative(&[0.5], &((), [4.0])), [-0.5 + 3.0 * (4.0 - 1.0)]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ContinuousObserver<D, H, T, const N: usize, const M: usize> {
    /// f.
    pub dynamics: D,
    /// h.
    pub measurement: H,
    /// L, in state per measurement and second.
    pub gain: Mat<T, N, M>,
}

impl<T, D, H, const N: usize, const M: usize> Dynamics<T, N> for ContinuousObserver<D, H, T, N, M>
where
    T: Scalar,
    D: Dynamics<T, N>,
    H: Measurement<T, N, M>,
{
    type Input = (D::Input, [T; M]);

    #[inline(always)]
    fn derivative<S: Over<T>>(&self, x: &[S; N], (u, y): &(D::Input, [T; M])) -> [S; N] {
        let moved = self.dynamics.derivative(x, u);
        let predicted = self.measurement.predict(x);
        vector!(|i| moved[i] - sum!(M, |k| (predicted[k] - y[k]) * self.gain.0[i][k]))
    }
}
