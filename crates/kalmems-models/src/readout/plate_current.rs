//! The current of tilting plates under constant bias, as voltages.

use crate::capacitance::TiltingPlate;
use kalmems_core::{Dual, Mat, Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// y = η·dC/dt in V: a plate under a bias, its current made a voltage by a transimpedance amplifier (Chen,
/// dissertation, 2018, equations 28 to 30 and 47), on states that begin with [θ, θ̇].
///
/// η = −V_bias·R_s in V·Ω. The derivative by the state is η·[C″(θ)·θ̇, C′(θ)]; equation 50 leaves out the first, with
/// which a filter knows how the signal's slope turns with the angle.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::capacitance::StageLayout;
/// use kalmems_models::readout::PlateCurrent;
/// let [_, _, plate, _] = StageLayout::PUBLISHED.plates(19.2e-6, 8.8542e-12);
/// let channel = PlateCurrent { plate, gain: -2.40752e7 };
/// let ([volts], h) = channel.linearize(&[1e-3_f64, 20.0]);
/// assert!((h[(0, 1)] * 20.0 - volts).abs() < 1e-15);
/// let ahead = channel.voltage(1e-3 + 1e-7, 20.0) - channel.voltage(1e-3 - 1e-7, 20.0);
/// assert!((h[(0, 0)] / (ahead / 2e-7) - 1.0).abs() < 1e-7);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct PlateCurrent<P> {
    /// The plate.
    pub plate: TiltingPlate<P>,
    /// η in V·Ω.
    pub gain: P,
}

#[model]
impl<P: Scalar> PlateCurrent<P> {
    /// y in V at θ in rad and θ̇ in rad/s.
    pub fn voltage<S: Over<P>>(&self, angle: S, rate: S) -> S {
        self.plate.slope(angle) * rate * self.gain
    }

    /// y in V of a tilt about both axes: angles [θ_X, θ_Y] in rad and their rates in rad/s (equations 43 to 45).
    pub fn voltage_of_both(&self, angles: [P; 2], rates: [P; 2]) -> P {
        let [x, y] = Dual::<P, 2>::variables(&angles);
        let [by_x, by_y] = self.plate.capacitance_of_both(x, y).gradient();
        (by_x * rates[0] + by_y * rates[1]) * self.gain
    }

    /// y in V of a tilt about Y while the stage rises towards the stator: θ in rad, θ̇ in rad/s, z in m, ż in m/s.
    pub fn voltage_while_rising(&self, angle: P, rate: P, rise: P, rise_rate: P) -> P {
        let plate = TiltingPlate { gap: self.plate.gap - rise, ..self.plate };
        (plate.slope(angle) * rate - plate.by_gap(angle) * rise_rate) * self.gain
    }
}

#[model(parametric)]
impl<T: Scalar, const N: usize> Measurement<T, N, 1> for PlateCurrent<T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
        const { assert!(N >= 2, "the first states are the angle and its rate") };
        [self.voltage(x[0], x[1])]
    }

    fn depends(_: usize, state: usize) -> bool {
        state < 2
    }

    /// One derivative, where dual numbers of all states would carry `N`.
    fn linearize(&self, x: &[T; N]) -> ([T; 1], Mat<T, 1, N>) {
        const { assert!(N >= 2, "the first states are the angle and its rate") };
        let slope = self.plate.slope(Dual::<T, 1>::variable(x[0], 0));
        let per_rate = slope.value() * self.gain;
        let [curvature] = slope.gradient();
        let mut jacobian = Mat::zero();
        jacobian.0[0][0] = curvature * self.gain * x[1];
        jacobian.0[0][1] = per_rate;
        ([per_rate * x[1]], jacobian)
    }
}

/// `M` channels at once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlateCurrents<P, const M: usize> {
    /// One per channel.
    pub channels: [PlateCurrent<P>; M],
}

#[model]
impl<T: Scalar, const N: usize, const M: usize> Measurement<T, N, M> for PlateCurrents<T, M> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; M] {
        let mut y = [S::lift(T::of(0.0)); M];
        for (y, channel) in y.iter_mut().zip(&self.channels) {
            [*y] = channel.predict(x);
        }
        y
    }

    fn depends(_: usize, state: usize) -> bool {
        state < 2
    }

    fn linearize(&self, x: &[T; N]) -> ([T; M], Mat<T, M, N>) {
        let (mut y, mut jacobian) = ([T::of(0.0); M], Mat::zero());
        for ((y, row), channel) in y.iter_mut().zip(&mut jacobian.0).zip(&self.channels) {
            let ([volts], Mat([of_channel])) = channel.linearize(x);
            (*y, *row) = (volts, of_channel);
        }
        (y, jacobian)
    }
}

/// y₁ − y₂ in V: two channels of opposite motion read as a difference, which takes away what both have in common.
///
/// The dissertation tried it and found feedthrough left over, because the parasitics of the two differ (section 3.3.4);
/// what is left is the difference of their feedthroughs.
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct DifferentialCurrent<P> {
    /// What counts positive.
    pub positive: PlateCurrent<P>,
    /// What is subtracted.
    pub negative: PlateCurrent<P>,
}

#[model(parametric)]
impl<T: Scalar, const N: usize> Measurement<T, N, 1> for DifferentialCurrent<T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
        let ([positive], [negative]) = (self.positive.predict(x), self.negative.predict(x));
        [positive - negative]
    }

    fn depends(_: usize, state: usize) -> bool {
        state < 2
    }
}
