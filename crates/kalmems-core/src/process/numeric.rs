//! A process as a filter meets it.

use super::{Process, ProcessNoise};
use crate::{Covariance, Mat, Scalar};

/// A step x′ = f(x, u) + w as a filter meets it: by its numbers alone.
///
/// Every [`Process`] is one, with a Jacobian by dual numbers. A model that is made when the program runs has no
/// function of any kind of number, but can say what a step and its Jacobian are; it implements this.
///
/// ```
/// use kalmems_core::{Covariance, Ekf, Filter, Mat, NumericProcess, ProcessNoise};
/// /// A table of what becomes of a state, read from a file.
/// struct Table(Vec<[f64; 2]>, ProcessNoise<f64, 1>);
/// impl NumericProcess<f64, 1> for Table {
///     type Input = usize;
///     fn moved(&self, x: &[f64; 1], row: &usize) -> [f64; 1] {
///         let [start, slope] = self.0[*row];
///         [start + slope * x[0]]
///     }
///     fn linearized(&self, x: &[f64; 1], row: &usize) -> ([f64; 1], Mat<f64, 1, 1>) {
///         (self.moved(x, row), Mat([[self.0[*row][1]]]))
///     }
///     fn noise_added(&self) -> &ProcessNoise<f64, 1> {
///         &self.1
///     }
/// }
/// let mut filter = Ekf::new([2.0], Covariance::from_variances([1.0]));
/// filter.predict(&Table(vec![[1.0, 3.0]], ProcessNoise::none()), &0)?;
/// assert_eq!((filter.mean()[0], filter.covariance().get(0, 0)), (7.0, 9.0));
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
pub trait NumericProcess<T: Scalar, const N: usize> {
    /// What drives it over the interval.
    type Input: Copy;

    /// f(x, u).
    fn moved(&self, x: &[T; N], u: &Self::Input) -> [T; N];

    /// f(x, u) and ∂f/∂x.
    fn linearized(&self, x: &[T; N], u: &Self::Input) -> ([T; N], Mat<T, N, N>);

    /// The covariance of w.
    fn noise_added(&self) -> &ProcessNoise<T, N>;

    /// F·P·Fᵀ with F = ∂f/∂x. A model that knows which entries of F are always zero can leave them out.
    #[inline(always)]
    fn spread(&self, f: &Mat<T, N, N>, p: &Covariance<T, N>) -> Covariance<T, N> {
        p.transformed(f)
    }

    /// Whether component `i` of f may depend on state `j`, likewise; see [`Process::depends`].
    #[inline(always)]
    fn links(i: usize, j: usize) -> bool {
        let _ = (i, j);
        true
    }
}

impl<T: Scalar, P: Process<T, N>, const N: usize> NumericProcess<T, N> for P {
    type Input = P::Input;

    #[inline(always)]
    fn moved(&self, x: &[T; N], u: &P::Input) -> [T; N] {
        self.step(x, u)
    }

    #[inline(always)]
    fn linearized(&self, x: &[T; N], u: &P::Input) -> ([T; N], Mat<T, N, N>) {
        self.linearize(x, u)
    }

    #[inline(always)]
    fn noise_added(&self) -> &ProcessNoise<T, N> {
        self.noise()
    }

    #[inline(always)]
    fn spread(&self, f: &Mat<T, N, N>, p: &Covariance<T, N>) -> Covariance<T, N> {
        p.transformed_where(f, P::depends)
    }

    #[inline(always)]
    fn links(i: usize, j: usize) -> bool {
        P::depends(i, j)
    }
}
