//! The lock-in: amplitude and phase of the stage from the lines of its currents.

use super::course::StageChannel;
use crate::estimate::{Swing, amplitude_of_line, current_line};
use crate::signal::fit_sine_at;
use kalmems_core::Portable;
use kalmems_models::capacitance::TiltingPlate;
use std::f64::consts::{PI, TAU};

/// The swing θ = A·sin φ, φ = ω·t + ψ, that one window of some channels shows, for a motion of this frequency in Hz.
///
/// The current η·C′(θ)·θ̇ has its line at the motion's frequency at cos φ. Its size, the bending of C′ included, tells A; its phase
/// and its sign tell φ. Each channel gives one phasor A·e^{iψ}; they are averaged by what the noise of their samples leaves of
/// each. Channels that show no motion short of contact are passed over; `None` where all do.
pub fn swing<'a>(
    motion_hz: f64,
    time_s: &[f64],
    channels: impl Iterator<Item = StageChannel<'a>>,
) -> Option<Swing> {
    let rate = TAU * motion_hz;
    let (mut sum, mut weights) = ([0.0; 2], 0.0);
    for StageChannel { current, noise_variance, signal, .. } in channels {
        let Some(sine) = fit_sine_at(time_s, signal, motion_hz) else { continue };
        let line = |amplitude| current_line(|angle, rate| current.voltage(angle, rate), 1, rate, amplitude);
        let largest = SHORT_OF_CONTACT * contact(&current.plate);
        let limits = [largest / UNITS, largest];
        let Some(amplitude) = amplitude_of_line(sine.amplitude, limits, line) else { continue };
        let volts = line(amplitude);
        let phase = sine.phase_rad + if volts < 0.0 { PI } else { 0.0 };
        let weight = (volts / amplitude).powi(2) / noise_variance;
        sum = [
            sum[0] + weight * amplitude * phase.portable_cos(),
            sum[1] + weight * amplitude * phase.portable_sin(),
        ];
        weights += weight;
    }
    let amplitude = sum[0].portable_hypot(sum[1]) / weights;
    let swing = Swing { rest: 0.0, amplitude, rate, phase: sum[1].portable_atan2(sum[0]) };
    (weights > 0.0 && amplitude.is_finite()).then_some(swing)
}

/// The largest amplitude that is looked for, relative to contact.
const SHORT_OF_CONTACT: f64 = 0.99;
/// The search begins at this part of it.
const UNITS: f64 = 8.0;

/// The tilt at which the far edge of the plate touches, in rad.
fn contact(plate: &TiltingPlate<f64>) -> f64 {
    (plate.gap / plate.w1.abs().max(plate.w2.abs())).portable_atan()
}

#[cfg(test)]
mod tests {
    use super::*;
    use kalmems_models::capacitance::StageLayout;
    use kalmems_models::readout::PlateCurrent;

    /// Of channels on both sides, each computed sample by sample, with one of them missing.
    #[test]
    fn a_swing_is_found_again() {
        let motion_hz = 1700.0;
        let time_s: Vec<f64> = (0..400).map(|k| 2.0 + f64::from(k) / (400.0 * motion_hz)).collect();
        for (amplitude, phase) in [(1e-4, 0.3), (8e-3, -2.0)] {
            let truth = Swing { rest: 0.0, amplitude, rate: TAU * motion_hz, phase };
            let plates = StageLayout::PUBLISHED.plates(19.2e-6, 8.8542e-12);
            let currents = plates.map(|plate| PlateCurrent { plate, gain: -2.4e7 });
            let mut signals = currents.map(|current| {
                let voltage = |t: &f64| {
                    let [angle, rate] = truth.at(*t);
                    current.voltage(angle, rate)
                };
                time_s.iter().map(voltage).collect::<Vec<_>>()
            });
            signals[1].fill(f64::NAN);
            let channels = currents.into_iter().zip(&signals);
            let channels = channels.map(|(current, signal)| StageChannel {
                name: "",
                current,
                noise_variance: 1e-11,
                feedthrough_sd: 0.0,
                signal,
            });
            let found = swing(motion_hz, &time_s, channels).unwrap();
            for time_s in [2.0, 2.0003] {
                let ([x, _], [y, _]) = (found.at(time_s), truth.at(time_s));
                assert!((x - y).abs() < 1e-8 * amplitude, "{amplitude}: {x} {y}");
            }
        }
        assert_eq!(swing(motion_hz, &time_s, std::iter::empty()), None);
    }
}
