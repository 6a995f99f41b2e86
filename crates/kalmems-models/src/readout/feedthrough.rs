//! What of the drive reaches a readout beside the motion.

use kalmems_core::{Mat, Measurement, Over, Scalar};
use kalmems_macros::model;

/// y − R_s·C_ft·dV/dt: a readout of one voltage, and the current through the capacitance C_ft between drive and sense
/// electrodes, at one instant of the drive.
///
/// The drive is known and changes from sample to sample, so that this is made anew for each. C_ft is a constant, or one
/// of the states in units of a scale: C_ft = nominal + scale·x.
///
/// ```
/// use kalmems_core::{LinearMeasurement, Mat, Measurement};
/// use kalmems_models::readout::Feedthrough;
/// let rate = LinearMeasurement { matrix: Mat([[0.0, 2.0, 0.0]]) };
/// let state = Some((2, 0.1e-12));
/// let seen = Feedthrough { readout: &rate, current_gain: 1e7 * 2e5, capacitance: 0.2e-12, state };
/// // 0.2 pF and one tenth more, under 0.2 V/µs into 10 MΩ: 0.6 V less.
/// let ([volts], h) = seen.linearize(&[0.0, 1.0, 1.0]);
/// assert!((volts - 1.4_f64).abs() < 1e-12 && (h[(0, 2)] + 0.2).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Feedthrough<'a, H, T> {
    /// The readout.
    pub readout: &'a H,
    /// R_s·dV/dt in V/F.
    pub current_gain: T,
    /// C_ft in F, as it is known.
    pub capacitance: T,
    /// The state that stands for its deviation, and the scale of that in F; none where C_ft is trusted.
    pub state: Option<(usize, T)>,
}

#[model]
impl<H: Measurement<T, N, 1>, T: Scalar, const N: usize> Measurement<T, N, 1> for Feedthrough<'_, H, T> {
    fn predict<S: Over<T>>(&self, x: &[S; N]) -> [S; 1] {
        let [volts] = self.readout.predict(x);
        let known = volts - self.volts();
        [match self.deviation(N) {
            Some((state, gain)) => known - x[state] * gain,
            None => known,
        }]
    }

    fn linearize(&self, x: &[T; N]) -> ([T; 1], Mat<T, 1, N>) {
        let ([volts], mut jacobian) = self.readout.linearize(x);
        let mut volts = volts - self.volts();
        if let Some((state, gain)) = self.deviation(N) {
            volts = volts - x[state] * gain;
            jacobian.0[0][state] = jacobian.0[0][state] - gain;
        }
        ([volts], jacobian)
    }
}

#[model]
impl<H, T: Scalar> Feedthrough<'_, H, T> {
    /// What the capacitance as it is known takes from y, in V.
    pub fn volts(&self) -> T {
        self.capacitance * self.current_gain
    }

    /// The state, and what one of it takes from y in V, of so many states. A state that is not there is none.
    pub fn deviation(&self, states: usize) -> Option<(usize, T)> {
        self.state
            .filter(|(state, _)| *state < states)
            .map(|(state, scale)| (state, scale * self.current_gain))
    }
}
