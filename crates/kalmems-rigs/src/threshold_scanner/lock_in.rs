//! The lock-in: amplitude and phase of a mirror from the lines of its comb's current.

use crate::estimate::{Swing, amplitude_of_line, current_line};
use crate::signal::least_squares;
use kalmems_core::Portable;
use kalmems_models::capacitance::CombCurve;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The swing θ = A·sin φ, φ = ω·t + ψ, that one window of the signal h(θ)·θ̇ shows, for a motion of this frequency in Hz.
///
/// h changes its sign where the comb is passed, so that the largest line of the signal is at 2φ: its size tells A, its
/// phase tells φ but for π. The sign of the motion is in the line at φ, which a comb makes whose centre is not at rest;
/// it is taken from the first window, and later on it is that which is nearer to the swing before. Amplitudes are found where
/// the line at 2φ grows with them, up to a right angle. The signal's offset does not enter, the gain does.
pub fn swing(
    comb: &CombCurve<f64>,
    motion_hz: f64,
    (time_s, signal): (&[f64], &[f64]),
    before: Option<&Swing>,
) -> Option<Swing> {
    let middle = time_s.first()?.midpoint(*time_s.last()?);
    let rate = TAU * motion_hz;
    let [_, c1, s1, c2, s2] = least_squares(time_s, signal, |t| {
        let turned = rate * (t - middle);
        let ((s1, c1), (s2, c2)) = (turned.portable_sin_cos(), (2.0 * turned).portable_sin_cos());
        [1.0, c1, s1, c2, s2]
    })?;
    let line = |harmonic: u32, amplitude: f64| {
        current_line(|angle, rate| comb.sensitivity(angle) * rate, harmonic, rate, amplitude)
    };
    let unit = comb.steepness.recip();
    let amplitude =
        amplitude_of_line(c2.portable_hypot(s2), [unit, FRAC_PI_2], |amplitude| line(2, amplitude))?;
    // With ψ at the middle of the window, L₂·sin 2φ is L₂·sin 2ψ along the cosine and L₂·cos 2ψ along the sine.
    let sign = line(2, amplitude).signum();
    let mut phase = 0.5 * (sign * c2).portable_atan2(sign * s2);
    // L₁·cos φ is L₁·cos ψ along the cosine and −L₁·sin ψ along the sine.
    if line(1, amplitude) * (c1 * phase.portable_cos() - s1 * phase.portable_sin()) < 0.0 {
        phase += PI;
    }
    Some(Swing { rest: 0.0, amplitude, rate, phase: phase - rate * middle }.nearest_to(before))
}

#[cfg(test)]
mod tests {
    use super::*;
    use kalmems_models::capacitance::CurveShape;

    /// A motion whose signal is computed sample by sample is found again, its sign included.
    #[test]
    fn a_swing_is_found_again() {
        let (motion_hz, interval_s) = (625.0, 2e-6);
        for shape in [CurveShape::Logistic, CurveShape::Gaussian] {
            // A Gaussian comb is left altogether by a large motion.
            let amplitude = if shape == CurveShape::Logistic { 0.15 } else { 0.012 };
            for (gain, phase) in [(2.82e-3, 0.4), (2.82e-3, 3.4), (-2.82e-3, 2.0)] {
                let comb = CombCurve { centre: 3.7e-3, gain, steepness: 76.0, shape };
                let truth = Swing { rest: 0.0, amplitude, rate: TAU * motion_hz, phase };
                let time_s: Vec<f64> = (0..800).map(|k| 0.01 + f64::from(k) * interval_s).collect();
                let current = |t: &f64| {
                    let [angle, rate] = truth.at(*t);
                    comb.sensitivity(angle) * rate + 0.02
                };
                let signal: Vec<f64> = time_s.iter().map(current).collect();
                let found = swing(&comb, motion_hz, (&time_s, &signal), None).unwrap();
                assert!((found.amplitude / amplitude - 1.0).abs() < 1e-9, "{shape:?} {}", found.amplitude);
                for time_s in [0.01, 0.0104, 0.0109] {
                    let ([x, _], [y, _]) = (found.at(time_s), truth.at(time_s));
                    assert!((x - y).abs() < 1e-8 * amplitude, "{shape:?} {gain} {phase}: {x} {y}");
                }
            }
        }
    }
}
