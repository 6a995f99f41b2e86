//! A scanner that is driven through the stiffness its own electrodes make.

use super::{TorsionalResonator, torque_slope};
use crate::capacitance::GaussianComb;
use kalmems_core::{Dual, Dynamics, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// J·θ̈ + b·θ̇ + k·θ = ½·C′(θ)·(V² + V_c²/2), states [θ, θ̇] in rad and rad/s, input V in V.
///
/// The torque of the comb vanishes at rest and pulls back towards it, so that the voltage modulates the
/// stiffness: the motion starts by itself, at half the frequency of V², where the modulation overcomes the
/// damping (Chen et al., shared electrodes, 2020, equations 8 and 9). With θ also −θ is a solution.
///
/// ```
/// use kalmems_core::Dynamics;
/// use kalmems_models::{capacitance::GaussianComb, dynamics::{ParametricScanner, TorsionalResonator}};
/// let scanner = ParametricScanner {
///     resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
///     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
///     carrier_mean_square: 18.0,
/// };
/// let there = scanner.derivative(&[0.1, 2.0], &60.0);
/// let mirrored = scanner.derivative(&[-0.1, -2.0], &60.0);
/// assert_eq!(there, mirrored.map(|d: f64| -d));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct ParametricScanner<P> {
    /// The mechanics.
    pub resonator: TorsionalResonator<P>,
    /// The electrodes.
    pub comb: GaussianComb<P>,
    /// V_c²/2 in V²: the mean square of a carrier that the drive signal does not show.
    pub carrier_mean_square: P,
}

#[model]
impl<P: Scalar> ParametricScanner<P> {
    /// θ̈ in rad/s² with V in V.
    pub fn acceleration<S: Over<P>>(&self, angle: S, rate: S, voltage: P) -> S {
        // ½·C′(θ)·V² is ½·C″(0)·V²·θ·overlap(θ): the electrodes are a second spring.
        let mean_square = self.carrier_mean_square.mac(voltage, voltage);
        let electrodes =
            torque_slope(self.comb.curvature_at_rest() * self.resonator.inertia.recip(), mean_square);
        let spring = self.resonator.square_rate();
        let alone = angle.alone();
        let pull = alone * Dual::lift(-spring).mac_by(self.comb.overlap(alone), electrodes);
        angle.chained(pull).mac_by(rate, -self.resonator.decay_rate())
    }
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for ParametricScanner<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 2], voltage: &T) -> [S; 2] {
        [x[1], self.acceleration(x[0], x[1], *voltage)]
    }

    /// The angle over which the comb's law changes, and the rate at which the free resonator swings that far.
    fn natural_scales(&self) -> [T; 2] {
        let angle = self.comb.angular_width;
        [angle, angle * self.resonator.natural_rate()]
    }
}
