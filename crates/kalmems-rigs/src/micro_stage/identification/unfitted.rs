//! What the fit of the waveforms takes as exact and is not: the sines that were taken off as feedthrough, and the motion by the vibrometer.

use super::waveform::{UNKNOWNS, WaveRecord, Waveforms, unknown};
use crate::equations::BiasOffRecord;
use crate::fit::Fit;
use crate::signal::Sine;
use kalmems_core::{Covariance, Portable};
use std::f64::consts::TAU;

/// What is known of the errors behind a record.
pub struct RecordErrors<'a> {
    /// The record with the bias off, and the electrodes that its signals are of; none where the harmonics tell the feedthrough.
    pub off: Option<&'a (BiasOffRecord, &'a [usize])>,
    /// The rate that the vibrometer shows.
    pub rate: Option<Sine>,
}

/// Adds their part to the covariance of a fit; nothing where the fit leaves something undetermined.
///
/// With δp = (JᵀWJ)⁻¹·JᵀW·δy for a small error δy of the signals: of each record and electrode a cosine and a sine of the drive's frequency, each of
/// the standard deviation of the sine that was fitted to the record with the bias off; and of all electrodes of a record together what a motion
/// makes of them that is larger or later than the vibrometer shows it. Gaps and gains by themselves come from the harmonics, which the sines leave
/// alone; but what they make of a small motion together, which is what the stage's scale factor rests on, comes from the fundamental.
pub fn with_unfitted_errors(
    fit: &mut Fit<UNKNOWNS>,
    waveforms: &Waveforms,
    electrodes: &[usize],
    errors: &[RecordErrors],
) {
    if !fit.undetermined.is_empty() {
        return;
    }
    let variance = fit.residual_deviation().powi(2);
    let mut whole = fit.covariance.to_full();
    for (record, errors) in waveforms.records.iter().zip(errors) {
        for error in right_hand_sides(fit, waveforms, (record, electrodes), errors) {
            let moves: [f64; UNKNOWNS] = std::array::from_fn(|i| {
                let row = (0..UNKNOWNS).map(|j| fit.covariance.get(i, j) * error[j]);
                row.sum::<f64>() / variance
            });
            for (row, by_row) in whole.0.iter_mut().zip(moves) {
                row.iter_mut().zip(moves).for_each(|(entry, by_column)| *entry += by_row * by_column);
            }
        }
    }
    fit.covariance = Covariance::from_lower(whole);
}

/// JᵀW·δy of each independent error of a record that is as large as its standard deviation.
fn right_hand_sides(
    fit: &Fit<UNKNOWNS>,
    waveforms: &Waveforms,
    (record, electrodes): (&WaveRecord, &[usize]),
    errors: &RecordErrors,
) -> Vec<[f64; UNKNOWNS]> {
    let sine_sd = |place: usize| {
        let (off, order) = errors.off?;
        let at = order.iter().position(|electrode| *electrode == electrodes[place])?;
        Some(off.sd_per_unit(at)? * record.drive.amplitude / waveforms.noise[place])
    };
    let sine_sds: Vec<f64> = (0..waveforms.plates.len()).map(|place| sine_sd(place).unwrap_or(0.0)).collect();
    // A motion that is so much larger, in parts, and so much later, in s, by the noise of the vibrometer.
    let [larger, later] = errors.rate.map_or([0.0; 2], |rate| {
        let relative = rate.component_sd(record.time_s.len()) / rate.amplitude;
        [relative * fit.parameters[unknown::SCALE], relative / (TAU * rate.frequency_hz)]
    });
    let turn = TAU * record.drive.frequency_hz;
    let mut of_sines = vec![[[0.0; UNKNOWNS]; 2]; sine_sds.len()];
    let mut of_motion = [[0.0; UNKNOWNS]; 2];
    waveforms.each_gradient(&fit.parameters, record, &mut |place, time_s, gradient| {
        let (sine, cosine) = (turn * time_s + record.drive.phase_rad).portable_sin_cos();
        let sines = of_sines[place].iter_mut().zip([cosine * sine_sds[place], sine * sine_sds[place]]);
        let motion =
            of_motion.iter_mut().zip([gradient[unknown::SCALE] * larger, gradient[unknown::DELAY] * later]);
        for (sum, error) in sines.chain(motion) {
            sum.iter_mut().zip(gradient).for_each(|(sum, by)| *sum += by * error);
        }
    });
    of_sines.into_iter().flatten().chain(of_motion).collect()
}
