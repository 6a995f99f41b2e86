//! One demodulated signal of two combs.

use crate::capacitance::GaussianComb;
use kalmems_core::{Dual, Mat, Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// y = a·(C_x(θ_x) + C_y(θ_y)) + b in V, on states that begin with [θ_x, θ̇_x, θ_y].
///
/// Both combs depend on one electrode, so that the carrier sees the sum of their capacitances (the readout is that of
/// [`DemodulatedComb`](super::DemodulatedComb)). What does not move, the parasitic capacitance of the leads too, is
/// part of either comb's bias or of b. y is even in each angle: the sign of neither motion can be known from it.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::{capacitance::GaussianComb, readout::TwoAxisComb};
/// let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 4.0e-12 };
/// let readout = TwoAxisComb { x: comb, y: comb, gain: -0.3574e12, offset: 6.3945 };
/// let [at_rest] = readout.predict(&[0.0_f64, 0.0, 0.0, 0.0]);
/// assert!((at_rest - (6.3945 - 0.3574 * 19.42)).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct TwoAxisComb<P> {
    /// The electrodes of the first axis.
    pub x: GaussianComb<P>,
    /// Those of the second.
    pub y: GaussianComb<P>,
    /// a in V/F.
    pub gain: P,
    /// b in V.
    pub offset: P,
}

#[model]
impl<T: Scalar> TwoAxisComb<T> {
    /// What one comb adds to y, in V.
    fn share<S: Over<T>>(&self, comb: &GaussianComb<T>, angle: S) -> S {
        comb.capacitance(angle) * self.gain
    }
}

#[model(parametric)]
impl<T: Scalar, const N: usize> Measurement<T, N, 1> for TwoAxisComb<T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
        const { assert!(N >= 3, "the first and the third state are the angles") };
        [self.share(&self.x, x[0]) + self.share(&self.y, x[2]) + self.offset]
    }

    fn depends(_: usize, state: usize) -> bool {
        state == 0 || state == 2
    }

    /// One derivative per comb, where dual numbers of all states would carry `N`.
    fn linearize(&self, x: &[T; N]) -> ([T; 1], Mat<T, 1, N>) {
        const { assert!(N >= 3, "the first and the third state are the angles") };
        let of_x = self.share(&self.x, Dual::<T, 1>::variable(x[0], 0));
        let of_y = self.share(&self.y, Dual::<T, 1>::variable(x[2], 0));
        let mut jacobian = Mat::zero();
        [jacobian.0[0][0]] = of_x.gradient();
        [jacobian.0[0][2]] = of_y.gradient();
        ([of_x.value() + of_y.value() + self.offset], jacobian)
    }
}
