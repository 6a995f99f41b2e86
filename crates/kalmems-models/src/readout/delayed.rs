//! A demodulated carrier that is late.

use super::{AngleBefore, DemodulatedComb};
use crate::capacitance::GaussianComb;
use crate::dynamics::TorsionalResonator;
use kalmems_core::{Dual, Mat, Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// y = a·C(θ(t − τ)) + b in V, on states that begin with θ in rad and θ̇ in rad/s.
///
/// [`DemodulatedComb`] of the angle a constant time ago. A measurement does not know the drive, so that the
/// acceleration in [`AngleBefore`] is that of the resonator alone, θ̈ = −ω₀²θ − (b/J)θ̇: θ(t − τ) = p·θ +
/// r·θ̇ with p = 1 − c·ω₀² and r = −(s + c·b/J). What the electrodes add to the stiffness, a few percent,
/// enters with τ²: 10⁻⁴ of the amplitude at 1.2 µs. [`LowPassedComb`](super::LowPassedComb), which has the
/// drive, has no such error.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::dynamics::TorsionalResonator;
/// use kalmems_models::{capacitance::GaussianComb, readout::{DelayedComb, DemodulatedComb}};
/// let resonator = TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 };
/// let comb = GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 };
/// let at_once = DemodulatedComb { comb, gain: -0.3574e12, offset: 6.3945 };
/// let late = DelayedComb::of(&at_once, 1e-6, &resonator);
/// // On its way up through 0.1 rad at 2000 rad/s it was 0.098 rad a microsecond ago, less half a²·τ² of the spring.
/// let [volts] = late.predict(&[0.1_f64, 2e3]);
/// assert!((volts - at_once.voltage(0.1 - 2e-3 - 0.5 * 0.1 * 9.565e9 * 1e-12)).abs() < 1e-4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct DelayedComb<P> {
    /// The electrodes.
    pub comb: GaussianComb<P>,
    /// a in V/F.
    pub gain: P,
    /// b in V.
    pub offset: P,
    /// p: the share of θ in θ(t − τ).
    pub by_angle: P,
    /// r in s: that of θ̇.
    pub by_rate: P,
}

#[model]
impl<T: Scalar> DelayedComb<T> {
    /// The readout `delay` in s late, on a device with this resonator.
    pub fn of(readout: &DemodulatedComb<T>, delay: T, resonator: &TorsionalResonator<T>) -> Self {
        let before = AngleBefore::of(delay, resonator);
        let one = T::of(1.0);
        Self {
            comb: readout.comb,
            gain: readout.gain,
            offset: readout.offset,
            by_angle: before.angle(one, T::of(0.0), -resonator.square_rate()),
            by_rate: before.angle(T::of(0.0), one, -resonator.braking(one)),
        }
    }

    /// y in V of the angle that was.
    fn voltage<S: Over<T>>(&self, before: S) -> S {
        self.comb.capacitance(before) * self.gain + self.offset
    }
}

#[model(parametric)]
impl<T: Scalar, const N: usize> Measurement<T, N, 1> for DelayedComb<T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
        const { assert!(N >= 2, "the first states are the angle and its rate") };
        [self.voltage(x[0] * self.by_angle + x[1] * self.by_rate)]
    }

    fn depends(_: usize, state: usize) -> bool {
        state <= 1
    }

    /// One derivative, where dual numbers of all states would carry `N`.
    fn linearize(&self, x: &[T; N]) -> ([T; 1], Mat<T, 1, N>) {
        const { assert!(N >= 2, "the first states are the angle and its rate") };
        let before = x[0] * self.by_angle + x[1] * self.by_rate;
        let y = self.voltage(Dual::<T, 1>::variable(before, 0));
        let [slope] = y.gradient();
        let mut jacobian = Mat::zero();
        jacobian.0[0][0] = slope * self.by_angle;
        jacobian.0[0][1] = slope * self.by_rate;
        ([y.value()], jacobian)
    }
}
