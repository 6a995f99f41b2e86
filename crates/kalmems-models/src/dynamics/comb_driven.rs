//! A mirror that its comb pulls back towards the comb's plane.

use super::MirrorResonator;
use crate::capacitance::CombCurve;
use kalmems_core::{Dynamics, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// θ̈ + 2ζω_n·θ̇ + ω_n²·θ = −K_d·s(θ)·V², states [θ, θ̇], input V in V (Chen, dissertation, 2018, equations 66 to 68).
///
/// s is the form of the comb's curve, between −½ and ½ where it is logistic: the torque ½·dC/dθ·V² pulls towards the
/// comb's centre from either side, so that a voltage at twice the frequency of the motion can keep it going.
///
/// ```
/// use kalmems_core::Dynamics;
/// use kalmems_models::capacitance::{CombCurve, CurveShape};
/// use kalmems_models::dynamics::{CombDrivenMirror, MirrorResonator};
/// let mirror = CombDrivenMirror {
///     resonator: MirrorResonator { natural_rate: 3924.0, damping_ratio: 0.0066 },
///     comb: CombCurve { centre: 0.0, gain: 2.82e-3, steepness: 76.0, shape: CurveShape::Logistic },
///     drive_gain: 30.0,
/// };
/// let pull = |volts: f64| mirror.derivative(&[0.2_f64, 0.0], &volts)[1] - mirror.derivative(&[0.2, 0.0], &0.0)[1];
/// // Four times as much at twice the voltage, and half of K_d·V² where the fingers have left each other.
/// assert!((pull(60.0) / pull(30.0) - 4.0).abs() < 1e-9 && (pull(60.0) + 15.0 * 3600.0).abs() < 0.1);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct CombDrivenMirror<P> {
    /// The mechanics.
    pub resonator: MirrorResonator<P>,
    /// The curve of the driving comb; its gain does not enter.
    pub comb: CombCurve<P>,
    /// K_d in rad/s²/V²; 0 for a mirror that is never driven.
    pub drive_gain: P,
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for CombDrivenMirror<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 2], voltage: &T) -> [S; 2] {
        let pull = self.comb.form(x[0]) * -(self.drive_gain * voltage.sq());
        [x[1], self.resonator.acceleration(x[0], x[1], pull)]
    }

    /// The angle over which the comb's curve changes, and the rate of the free swing that goes so far.
    fn natural_scales(&self) -> [T; 2] {
        let angle = self.comb.steepness.recip();
        [angle, angle * self.resonator.natural_rate]
    }
}
