//! Models that stay functions of their own: compiled into every step of every filter, they would take most of the compiler's time.

use kalmems_core::{Covariance, Mat, NumericMeasurement, NumericProcess, ProcessNoise, Scalar};

/// A process or a sensor as it is, but for being inlined.
pub struct Apart<'a, Model>(pub &'a Model);

impl<T: Scalar, P: NumericProcess<T, N>, const N: usize> NumericProcess<T, N> for Apart<'_, P> {
    type Input = P::Input;

    #[inline(never)]
    fn moved(&self, x: &[T; N], u: &P::Input) -> [T; N] {
        self.0.moved(x, u)
    }

    #[inline(never)]
    fn linearized(&self, x: &[T; N], u: &P::Input) -> ([T; N], Mat<T, N, N>) {
        self.0.linearized(x, u)
    }

    fn noise_added(&self) -> &ProcessNoise<T, N> {
        self.0.noise_added()
    }

    #[inline(never)]
    fn spread(&self, f: &Mat<T, N, N>, p: &Covariance<T, N>) -> Covariance<T, N> {
        self.0.spread(f, p)
    }

    fn links(i: usize, j: usize) -> bool {
        P::links(i, j)
    }
}

impl<T: Scalar, H: NumericMeasurement<T, N, M>, const N: usize, const M: usize> NumericMeasurement<T, N, M>
    for Apart<'_, H>
{
    #[inline(never)]
    fn expected(&self, x: &[T; N]) -> [T; M] {
        self.0.expected(x)
    }

    #[inline(never)]
    fn linearized(&self, x: &[T; N]) -> ([T; M], Mat<T, M, N>) {
        self.0.linearized(x)
    }

    fn sees(i: usize, j: usize) -> bool {
        H::sees(i, j)
    }
}
