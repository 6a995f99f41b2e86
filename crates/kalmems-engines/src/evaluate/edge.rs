//! The angular rate of a stage, from how fast its edge moves.

use crate::config::Vibrometer;
use crate::signal::fit_sine;

/// ω = 2·v/w: what a vibrometer at the edge of a target of width w makes of a tilt about its middle; its output is G·v
/// and an offset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgeVelocity {
    /// G in V/(m/s).
    pub gain: f64,
    /// w in m.
    pub target_width: f64,
}

impl From<&Vibrometer> for EdgeVelocity {
    fn from(table: &Vibrometer) -> Self {
        Self { gain: table.gain.si(), target_width: table.target_width.si() }
    }
}

impl EdgeVelocity {
    /// ω in rad/s of one volt.
    pub fn rate_per_volt(&self) -> f64 {
        2.0 / (self.gain * self.target_width)
    }

    /// ω in rad/s at each sample, without the offset of the instrument.
    ///
    /// A stage that stays where it is turns by nothing on average, so that the constant part beside a sine through the
    /// record is the instrument's; a record of whole cycles is not needed. Where it holds no sine the mean is taken.
    pub fn rates(&self, time_s: &[f64], volts: &[f64], interval_s: f64) -> Vec<f64> {
        let sine = fit_sine(time_s, volts, interval_s);
        let offset = sine.map_or_else(|| mean(volts), |sine| sine.offset);
        volts.iter().map(|v| (v - offset) * self.rate_per_volt()).collect()
    }
}

fn mean(values: &[f64]) -> f64 {
    let finite = || values.iter().filter(|v| v.is_finite());
    finite().sum::<f64>() / finite().count().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use std::f64::consts::TAU;

    #[test]
    fn the_offset_of_the_instrument_is_no_rate() {
        let vibrometer = EdgeVelocity { gain: 50.0, target_width: 3e-3 };
        // 6.3 cycles, which do not average out.
        let time: Vec<f64> = (0..2300).map(|k| f64::from(k) * 1.6e-6).collect();
        let rate = |t: f64| 20.0 * (TAU * 1700.0 * t + 0.3).cos();
        let volts: Vec<f64> = time.iter().map(|t| 0.0123 + rate(*t) * 50.0 * 1.5e-3).collect();
        let found = vibrometer.rates(&time, &volts, 1.6e-6);
        for (t, found) in time.iter().zip(found) {
            assert_abs_diff_eq!(found, rate(*t), epsilon = 1e-6);
        }
    }
}
