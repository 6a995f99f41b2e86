//! A scanner behind an amplifier whose gain is not known well.

use super::ParametricScanner;
use kalmems_core::{Dynamics, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// A [`ParametricScanner`] that sees g·V of the voltage V that was recorded; states [θ, θ̇].
///
/// g stands for all that scales the drive alike: the amplifier, and the electrodes' part in the torque of the drive,
/// which is proportional to g². The carrier is not scaled.
///
/// ```
/// use kalmems_core::Dynamics;
/// use kalmems_models::capacitance::GaussianComb;
/// use kalmems_models::dynamics::{DriveGain, ParametricScanner, TorsionalResonator};
/// let scanner = ParametricScanner {
///     resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
///     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
///     carrier_mean_square: 18.0,
/// };
/// let amplified = DriveGain { scanner, drive_gain: 1.5 };
/// assert_eq!(amplified.derivative(&[0.1, 2.0], &60.0), scanner.derivative(&[0.1, 2.0_f64], &90.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct DriveGain<P> {
    /// The scanner.
    pub scanner: ParametricScanner<P>,
    /// g, 1 where the recorded voltage is that of the electrodes.
    pub drive_gain: P,
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for DriveGain<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 2], voltage: &T) -> [S; 2] {
        [x[1], self.scanner.acceleration(x[0], x[1], *voltage * self.drive_gain)]
    }

    fn natural_scales(&self) -> [T; 2] {
        self.scanner.natural_scales()
    }
}
