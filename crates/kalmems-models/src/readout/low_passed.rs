//! A demodulated carrier behind the low-pass stages of its demodulator.

use super::AngleBefore;
use crate::dynamics::DriveGain;
use kalmems_core::{Dynamics, Mat, Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// A scanner whose signal y = a·C(θ) + b passes two first-order low-pass stages; states [θ, θ̇, u₁, u₂] in rad,
/// rad/s, V and V, input V in V.
///
/// u̇₁ = ω₁·(a·C(θ(t − τ)) + b − u₁) and u̇₂ = ω₂·(u₁ − u₂), both of gain 1 at rest; u₂ is recorded. τ is the
/// constant delay of what lies before the stages, such as a high-pass near its cut-off, or behind them: a
/// delay commutes with them. Here it costs the electrodes' law at one more angle, where the
/// stages taken back by τ would need an integration against their decay. The affine law of [`DemodulatedComb`](super::DemodulatedComb) holds for C
/// only where the motion is slow against ω₁ and ω₂. With two poles at the frequency of the signal (Chen et
/// al., shared electrodes, 2020, Figure 2 and Table I: about 41 kHz against 31 kHz) the signal lags by 75°,
/// and no constant delay stands for that.
///
/// ```
/// use kalmems_core::{Dynamics, Measurement};
/// use kalmems_models::capacitance::GaussianComb;
/// use kalmems_models::dynamics::{DriveGain, ParametricScanner, TorsionalResonator};
/// use kalmems_models::readout::{AngleBefore, LowPassedComb};
/// let scanner = ParametricScanner {
///     resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
///     comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
///     carrier_mean_square: 18.0,
/// };
/// let device = DriveGain { scanner, drive_gain: 1.0 };
/// let before = AngleBefore::none();
/// let model = LowPassedComb { device, before, gain: -0.3574e12, offset: 6.3945, poles: [2e5, 2e5] };
/// // At rest the stages settle at the affine law's voltage.
/// let settled: f64 = model.voltage(0.0);
/// let still = model.derivative(&[0.0, 0.0, settled, settled], &90.0);
/// assert_eq!((still[2], still[3]), (0.0, 0.0));
/// assert_eq!(model.predict(&[0.0, 0.0, 3.0, 2.0]), [2.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct LowPassedComb<P> {
    /// The scanner, and the electrodes that are read.
    pub device: DriveGain<P>,
    /// How late it is read.
    pub before: AngleBefore<P>,
    /// a in V/F.
    pub gain: P,
    /// b in V.
    pub offset: P,
    /// ω₁ and ω₂ in rad/s.
    pub poles: [P; 2],
}

#[model]
impl<P: Scalar> LowPassedComb<P> {
    /// a·C(θ) + b in V: what enters the first stage.
    pub fn voltage<S: Over<P>>(&self, angle: S) -> S {
        self.device.scanner.comb.capacitance(angle) * self.gain + self.offset
    }
}

#[model(parametric)]
impl<T: Scalar> Dynamics<T, 4> for LowPassedComb<T> {
    type Input = T;

    fn bends(i: usize) -> bool {
        i != 0
    }

    fn derivative<S: Over<T>>(&self, x: &[S; 4], voltage: &T) -> [S; 4] {
        let acceleration = self.device.scanner.acceleration(x[0], x[1], *voltage * self.device.drive_gain);
        // Without a delay the acceleration has computed the comb's law at this angle already, and it is not paid
        // for twice.
        let voltage = if self.before.is_none() {
            self.voltage(x[0])
        } else {
            self.voltage(self.before.angle(x[0], x[1], acceleration))
        };
        [x[1], acceleration, (voltage - x[2]) * self.poles[0], (x[2] - x[3]) * self.poles[1]]
    }

    /// Those of the scanner, and the largest change of the voltage that the electrodes can make.
    fn natural_scales(&self) -> [T; 4] {
        let [angle, rate] = self.device.scanner.natural_scales();
        let swing = (self.gain * self.device.scanner.comb.nominal).abs();
        [angle, rate, swing, swing]
    }
}

/// What is recorded: u₂. States behind the four, such as parameters, do not enter.
#[model]
impl<T: Scalar, const N: usize> Measurement<T, N, 1> for LowPassedComb<T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
        const { assert!(N >= 4, "the fourth state is what is recorded") };
        [x[3]]
    }

    fn depends(_: usize, state: usize) -> bool {
        state == 3
    }

    fn linearize(&self, x: &[T; N]) -> ([T; 1], Mat<T, 1, N>) {
        const { assert!(N >= 4, "the fourth state is what is recorded") };
        let mut jacobian = Mat::zero();
        jacobian.0[0][3] = T::of(1.0);
        ([x[3]], jacobian)
    }
}
