//! An accelerometer whose mechanics are not known exactly.

use super::SensedAcceleration;
use kalmems_core::{Dynamics, Over, Parameters, ParametricDynamics, Scalar};
use kalmems_macros::{Parameters, model};

/// A [`SensedAcceleration`] whose spring, damping and mass are off by constants that are states:
/// [x, ẋ, a, ȧ, δ_k, δ_b, δ_m], input v_F in V, with k·(1 + δ_k), b₀·(1 + δ_b) and m·(1 + δ_m).
///
/// For filters that consider the three uncertain. The density of the Brownian force stays that of the stated damping.
///
/// ```
/// use kalmems_core::Dynamics;
/// use kalmems_models::capacitance::DifferentialPlates;
/// use kalmems_models::dynamics::{
///     Accelerometer, GaussMarkov, ProofMass, SensedAcceleration, UncertainMechanics,
/// };
/// let plates = DifferentialPlates { area: 1.86e-6, gap: 2.3e-6, permittivity: 3.54e-11 };
/// let mass = ProofMass { mass: 4e-9, damping: 8e-4, squeezed: 0.0, spring: 3.0 };
/// let device = Accelerometer { mass, plates, carrier_mean_square: 0.18, bias: 0.1 };
/// let prior = GaussMarkov { rms: 9.8, rate: 314.0, damping_ratio: 0.7 };
/// let uncertain = UncertainMechanics { sensed: SensedAcceleration { device, prior } };
/// // Half the damping at twice the mass.
/// let moved = uncertain.derivative(&[0.0_f64, 1e-6, 2.0, 0.0, 0.0, -0.5, 1.0], &0.0);
/// assert!((moved[1] - (2.0 - 4e-4 * 1e-6 / 8e-9)).abs() < 1e-12);
/// assert_eq!(moved[4..], [0.0; 3]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct UncertainMechanics<P> {
    /// The instrument as it is stated.
    pub sensed: SensedAcceleration<P>,
}

#[model]
impl<T: Scalar> Dynamics<T, 7> for UncertainMechanics<T> {
    type Input = T;

    fn derivative<S: Over<T>>(&self, x: &[S; 7], feedback: &T) -> [S; 7] {
        let mut varied = self.sensed.map(|_, value| S::lift(value));
        let mass = &mut varied.device.mass;
        mass.spring = mass.spring + mass.spring * x[4];
        mass.damping = mass.damping + mass.damping * x[5];
        mass.mass = mass.mass + mass.mass * x[6];
        let [velocity, pushed, slope, curvature] =
            SensedAcceleration::<T>::derivative_of(&varied, &[x[0], x[1], x[2], x[3]], feedback);
        let constant = S::of(0.0);
        [velocity, pushed, slope, curvature, constant, constant, constant]
    }

    /// Those of what is stated; a deviation is a ratio.
    fn natural_scales(&self) -> [T; 7] {
        let [x, v, a, j] = Dynamics::<T, 4>::natural_scales(&self.sensed);
        let one = T::of(1.0);
        [x, v, a, j, one, one, one]
    }
}
