//! How much of a motion about the other axis a tilting plate's signal holds.

use kalmems_core::Dual;
use kalmems_core::Portable;
use kalmems_models::capacitance::TiltingPlate;
use std::f64::consts::TAU;

/// Samples of the period over which signals are compared.
const SAMPLES: usize = 1000;

/// A tilt about Y with some about X at the same frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OffAxisMotion {
    /// The amplitude about Y in rad.
    pub amplitude_rad: f64,
    /// The amplitude about X as a part of it.
    pub ratio: f64,
    /// By how much that about X is ahead, in rad.
    pub phase_rad: f64,
}

impl OffAxisMotion {
    /// R_off = 1 − E_y/ratio of the signal dC/dt of a plate, where E_y is the root mean square of what the motion about X
    /// changes, divided by that of the signal without it (Chen, dissertation, 2018, equations 56 and 57).
    ///
    /// That division is not printed, and without it R_off has a unit; with it Table 3.4 comes out at 10 and 50 %. To first
    /// order a plate that is symmetric about X has no part of the motion about X: what is left grows with the square of
    /// the ratio. Not a number where the plates touch.
    pub fn rejection(&self, plate: &TiltingPlate<f64>) -> f64 {
        let (mut changed, mut alone) = (0.0, 0.0);
        for k in 0..SAMPLES {
            let turn = TAU * k as f64 / SAMPLES as f64;
            // Rates in units of the frequency, which cancels.
            let at = |amplitude: f64, phase: f64| {
                [amplitude * (turn + phase).portable_sin(), amplitude * (turn + phase).portable_cos()]
            };
            let [angle_y, rate_y] = at(self.amplitude_rad, 0.0);
            let [angle_x, rate_x] = at(self.ratio * self.amplitude_rad, self.phase_rad);
            let slopes = plate
                .capacitance_of_both(Dual::<f64, 2>::variable(angle_x, 0), Dual::variable(angle_y, 1))
                .gradient();
            let single = plate.slope(angle_y) * rate_y;
            let dual = slopes[0] * rate_x + slopes[1] * rate_y;
            changed += (single - dual).powi(2);
            alone += single.powi(2);
        }
        1.0 - (changed / alone).sqrt() / self.ratio
    }
}
