//! What a sensor says of the state.

use crate::process::derivatives;
use crate::{Dual, Mat, Over, Scalar};

/// A measurement y = h(x) + v of `M` numbers on a state of `N`.
///
/// It is a type of its own, apart from the filter: one filter takes measurements of different sizes at
/// different times, an event that comes now and then among them. Its noise is given with each update, because
/// it may change from sample to sample.
///
/// ```
/// use kalmems_core::{Measurement, Over, Scalar};
/// /// The angle seen through its sine.
/// struct Sine;
/// impl<T: Scalar> Measurement<T, 1, 1> for Sine {
///     fn predict<S: Over<T>>(&self, x: &[S; 1]) -> [S; 1] {
///         [x[0].sin()]
///     }
/// }
/// let (y, h) = Sine.linearize(&[0.5_f64]);
/// assert_eq!(y, [0.5_f64.sin()]);
/// assert_eq!(h[(0, 0)], 0.5_f64.cos());
/// ```
pub trait Measurement<T: Scalar, const N: usize, const M: usize> {
    /// h(x).
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; M];

    /// Whether component `i` may depend on state `j`; where not, ∂h_i/∂x_j is zero at every point.
    ///
    /// A compiler may not drop a product with a zero. A filter leaves these out, so that a sensor of one of five
    /// states costs little more than one of a single state. Must not depend on anything but its arguments.
    #[inline(always)]
    fn depends(i: usize, j: usize) -> bool {
        let _ = (i, j);
        true
    }

    /// h(x) and ∂h/∂x, by dual numbers unless a model has something better.
    #[inline(always)]
    fn linearize(&self, x: &[T; N]) -> ([T; M], Mat<T, M, N>) {
        derivatives(&self.predict(&Dual::variables(x)))
    }
}

/// A measurement as a filter meets it: by its numbers alone.
///
/// Every [`Measurement`] is one. A sensor that is made when the program runs implements this; see
/// [`NumericProcess`](crate::NumericProcess).
pub trait NumericMeasurement<T: Scalar, const N: usize, const M: usize> {
    /// h(x).
    fn expected(&self, x: &[T; N]) -> [T; M];

    /// h(x) and ∂h/∂x.
    fn linearized(&self, x: &[T; N]) -> ([T; M], Mat<T, M, N>);

    /// Whether component `i` may depend on state `j`; see [`Measurement::depends`].
    #[inline(always)]
    fn sees(i: usize, j: usize) -> bool {
        let _ = (i, j);
        true
    }
}

impl<T: Scalar, H: Measurement<T, N, M>, const N: usize, const M: usize> NumericMeasurement<T, N, M> for H {
    #[inline(always)]
    fn expected(&self, x: &[T; N]) -> [T; M] {
        self.predict(x)
    }

    #[inline(always)]
    fn linearized(&self, x: &[T; N]) -> ([T; M], Mat<T, M, N>) {
        self.linearize(x)
    }

    #[inline(always)]
    fn sees(i: usize, j: usize) -> bool {
        H::depends(i, j)
    }
}

/// y = H·x + v.
#[derive(Clone, Copy, Debug)]
pub struct LinearMeasurement<T, const N: usize, const M: usize> {
    /// H.
    pub matrix: Mat<T, M, N>,
}

impl<T: Scalar, const N: usize, const M: usize> Measurement<T, N, M> for LinearMeasurement<T, N, M> {
    #[inline(always)]
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; M] {
        self.matrix.times_vector(x)
    }
    #[inline(always)]
    fn linearize(&self, x: &[T; N]) -> ([T; M], Mat<T, M, N>) {
        (self.matrix.times_vector(x), self.matrix)
    }
}

/// A measurement about the past: y = h(Φ(−τ)·x) + v, with the state as it was when an event happened.
///
/// Exact for a linear process without noise over τ; for a small τ it is a good approximation otherwise. A
/// detector that finds a crossing some samples late hands it over this way.
///
/// ```
/// use kalmems_core::{Delayed, LinearMeasurement, Mat, Measurement};
/// let position = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
/// // Constant velocity, 0.5 s ago.
/// let past = Delayed { measurement: position, back: Mat([[1.0, -0.5], [0.0, 1.0]]) };
/// assert_eq!(past.predict(&[3.0, 2.0]), [2.0]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Delayed<H, T, const N: usize> {
    /// h.
    pub measurement: H,
    /// Φ(−τ), from [`discretize`](crate::discretize::discretize) with a negative interval.
    pub back: Mat<T, N, N>,
}

impl<T: Scalar, H: Measurement<T, N, M>, const N: usize, const M: usize> Measurement<T, N, M>
    for Delayed<H, T, N>
{
    #[inline(always)]
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; M] {
        self.measurement.predict(&self.back.times_vector(x))
    }
}
