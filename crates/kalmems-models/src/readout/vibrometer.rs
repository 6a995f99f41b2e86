//! A laser vibrometer on a tilting stage.

use kalmems_core::{Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// y = G·(r·θ̇ + ż) + y₀ in V, on states that begin with [θ, θ̇]: the velocity of a point at the lever arm r from the
/// axis, G in V/(m/s) (Chen, dissertation, 2018, section 3.5).
///
/// What it shows is late; [`kalmems_core::Delayed`] with the stage's transition backwards is the same measurement that
/// much earlier. A rise of the whole stage, ż, cannot be told from a tilt by one beam.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::readout::EdgeVibrometer;
/// let vibrometer = EdgeVibrometer { gain: 50.0, lever_arm: 1.5e-3, bias: 0.0123 };
/// let [volts] = vibrometer.predict(&[0.0_f64, 20.0]);
/// assert!((vibrometer.rate(volts) - 20.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct EdgeVibrometer<P> {
    /// G in V/(m/s).
    pub gain: P,
    /// r in m: half of the width of what it looks at the edge of.
    pub lever_arm: P,
    /// y₀ in V.
    pub bias: P,
}

#[model]
impl<P: Scalar> EdgeVibrometer<P> {
    /// y in V at θ̇ in rad/s and ż in m/s.
    pub fn voltage<S: Over<P>>(&self, rate: S, rise_rate: S) -> S {
        (rate * self.lever_arm + rise_rate) * self.gain + self.bias
    }

    /// θ̇ in rad/s where nothing but the tilt moves.
    pub fn rate<S: Over<P>>(&self, volts: S) -> S {
        (volts - self.bias) * (self.gain * self.lever_arm).recip()
    }
}

#[model(parametric)]
impl<T: Scalar, const N: usize> Measurement<T, N, 1> for EdgeVibrometer<T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
        const { assert!(N >= 2, "the first states are the angle and its rate") };
        [self.voltage(x[1], S::lift(T::of(0.0)))]
    }

    fn depends(_: usize, state: usize) -> bool {
        state == 1
    }
}
