//! A mirror that turns about two axes, both driven by one voltage.

use super::ParametricScanner;
use kalmems_core::{Dynamics, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// Two parametric scanners under one voltage, the inner one carried by the outer; states [θ_x, θ̇_x, θ_y, θ̇_y] in rad
/// and rad/s, input V in V.
///
/// x is the mirror within its gimbal, y the gimbal with the mirror. Each follows Chen et al., shared electrodes, 2020,
/// equations 8 and 9, with its own comb and with the same V², so that whatever one axis is driven with acts on the
/// other too. The mirror's inertia about the gimbal's axis changes with its own tilt: with
/// L = ½·J_x·θ̇_x² + ½·(J_y + ΔJ·sin²θ_x)·θ̇_y² − potentials, Lagrange's equations are
///
/// θ̈_x = a_x + (ΔJ/J_x)·sinθ_x·cosθ_x·θ̇_y²,
/// θ̈_y = (a_y − 2·(ΔJ/J_y)·sinθ_x·cosθ_x·θ̇_x·θ̇_y)/(1 + (ΔJ/J_y)·sin²θ_x),
///
/// where a_x and a_y are the accelerations of the axes alone. With any solution also that with one of the angles
/// mirrored is one: θ_x → −θ_x and θ_y → −θ_y are two exact symmetries.
///
/// ```
/// use kalmems_core::Dynamics;
/// use kalmems_models::{capacitance::GaussianComb, dynamics::{ParametricScanner, TorsionalResonator, TwoAxisScanner}};
/// let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
/// let resonator = TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 };
/// let x = ParametricScanner { resonator, comb, carrier_mean_square: 18.0 };
/// let y = ParametricScanner { resonator: TorsionalResonator { inertia: 6.0e-14, ..resonator }, ..x };
/// let mirror = TwoAxisScanner { x, y, gimbal_inertia: 0.0 };
/// let [_, a_x, _, a_y] = mirror.derivative(&[0.1, 2.0, -0.05, 7.0], &60.0_f64);
/// assert_eq!([a_x, a_y], [x.acceleration(0.1, 2.0, 60.0), y.acceleration(-0.05, 7.0, 60.0)]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct TwoAxisScanner<P> {
    /// The mirror about its own axis.
    pub x: ParametricScanner<P>,
    /// The gimbal with the mirror in it, at θ_x = 0.
    pub y: ParametricScanner<P>,
    /// ΔJ in kg·m²: what the inertia about the gimbal's axis gains as the mirror turns by a right angle. For a thin
    /// flat mirror it is J_x; 0 leaves the axes to meet in the voltage alone.
    pub gimbal_inertia: P,
}

#[model]
impl<P: Scalar> TwoAxisScanner<P> {
    /// [θ̈_x, θ̈_y] in rad/s² with V in V.
    pub fn accelerations<S: Over<P>>(&self, x: &[S; 4], voltage: P) -> [S; 2] {
        let alone = [self.x.acceleration(x[0], x[1], voltage), self.y.acceleration(x[2], x[3], voltage)];
        let (sine, cosine) = (x[0].sin(), x[0].cos());
        let swing = sine * cosine;
        let of_mirror = self.gimbal_inertia * self.x.resonator.inertia.recip();
        let of_gimbal = self.gimbal_inertia * self.y.resonator.inertia.recip();
        let carried = x[3].sq() * swing * of_mirror;
        let slowed = x[1] * x[3] * swing.twice() * of_gimbal;
        let heavier = sine.sq() * of_gimbal + P::of(1.0);
        [alone[0] + carried, (alone[1] - slowed) * heavier.recip()]
    }

    /// Kinetic energy and that of the springs, in J; the electrodes' is not in it.
    pub fn energy(&self, x: &[P; 4]) -> P {
        let gained = self.gimbal_inertia * x[0].sin().sq();
        self.x.resonator.energy(x[0], x[1])
            + self.y.resonator.energy(x[2], x[3])
            + (gained * x[3].sq()).half()
    }
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 4> for TwoAxisScanner<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        !i.is_multiple_of(2)
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 4], voltage: &T) -> [S; 4] {
        let [of_x, of_y] = self.accelerations(x, *voltage);
        [x[1], of_x, x[3], of_y]
    }

    /// Those of each axis alone.
    fn natural_scales(&self) -> [T; 4] {
        let [angle_x, rate_x] = self.x.natural_scales();
        let [angle_y, rate_y] = self.y.natural_scales();
        [angle_x, rate_x, angle_y, rate_y]
    }
}

/// A [`TwoAxisScanner`] that sees g·V of the voltage V that was recorded, as [`DriveGain`](super::DriveGain) does for one
/// axis.
///
/// ```
/// use kalmems_core::Dynamics;
/// use kalmems_models::capacitance::GaussianComb;
/// use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator, TwoAxisDriveGain, TwoAxisScanner};
/// let axis = ParametricScanner {
///     resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
///     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
///     carrier_mean_square: 18.0,
/// };
/// let scanner = TwoAxisScanner { x: axis, y: axis, gimbal_inertia: 1.15e-14 };
/// let amplified = TwoAxisDriveGain { scanner, drive_gain: 1.5 };
/// let state = [0.1, 2.0, -0.05, 7.0];
/// assert_eq!(amplified.derivative(&state, &60.0), scanner.derivative(&state, &90.0_f64));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct TwoAxisDriveGain<P> {
    /// The scanner.
    pub scanner: TwoAxisScanner<P>,
    /// g, 1 where the recorded voltage is that of the electrodes.
    pub drive_gain: P,
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 4> for TwoAxisDriveGain<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        !i.is_multiple_of(2)
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 4], voltage: &T) -> [S; 4] {
        let [of_x, of_y] = self.scanner.accelerations(x, *voltage * self.drive_gain);
        [x[1], of_x, x[3], of_y]
    }

    fn natural_scales(&self) -> [T; 4] {
        self.scanner.natural_scales()
    }
}
