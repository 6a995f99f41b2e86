//! A detector that squares.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// v_out = a_d·v + b_d·v²: a diode's current to second order (Chen et al., shared electrodes, 2020, equation 23).
///
/// ```
/// use kalmems_models::circuit::SquareLaw;
/// assert_eq!(SquareLaw { linear: 0.5, square: 2.0 }.voltage(3.0), 19.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct SquareLaw<P> {
    /// a_d, a ratio.
    pub linear: P,
    /// b_d in 1/V.
    pub square: P,
}

#[model]
impl<P: Scalar> SquareLaw<P> {
    /// v_out in V of v in V.
    pub fn voltage<S: Over<P>>(&self, v: S) -> S {
        v * self.linear + v.sq() * self.square
    }
}
