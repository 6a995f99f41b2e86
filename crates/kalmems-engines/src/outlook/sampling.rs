//! How well the samples of a recording show the inputs between them.

use super::{OutlookTopic, Recorded};
use crate::config::Experiment;
use crate::estimate::driven::InterpolationLag;
use crate::rig::Rig;
use crate::simulate::{Drive, drive_of};
use std::f64::consts::TAU;

/// The weights of the samples on one side, from the nearest on, in the middle between two: of the polynomial of fifth order through six of
/// them, and of the cubic through four.
const QUINTIC: [f64; 3] = [150.0 / 256.0, -25.0 / 256.0, 3.0 / 256.0];
const CUBIC: [f64; 2] = [9.0 / 16.0, -1.0 / 16.0];

/// An error in the middle between two samples, relative to the amplitude, from which on it is named as one that an estimate shows: a filter
/// of a sharp resonance has been off by its claimed standard deviation at it.
const SHOWS: f64 = 1e-6;

/// By how much the polynomial through the samples around it is off in the middle between two samples of a sine at most, relative to its
/// amplitude.
///
/// At the middle of a cosine's half wave the polynomial gives 2 Σ wⱼ cos((j + ½)ω) with the angle ω from sample to sample, and the true
/// value is 1; elsewhere the error is that times the value.
pub fn error_between_samples(samples_in_a_cycle: f64, lag: InterpolationLag) -> f64 {
    let angle = TAU / samples_in_a_cycle;
    let weights = if lag.samples() > 1 { &QUINTIC[..] } else { &CUBIC[..] };
    let each = weights.iter().zip(0_u32..);
    (1.0 - each.map(|(weight, j)| 2.0 * weight * ((f64::from(j) + 0.5) * angle).cos()).sum::<f64>()).abs()
}

/// What is said of the sampling of each input that follows a sine, in the first recording or in the simulation that an experiment describes;
/// `None` where there is no such input.
pub fn sampling(rig: &dyn Rig, experiment: &Experiment) -> Option<OutlookTopic> {
    let lag = InterpolationLag::of(experiment);
    let mut topic = OutlookTopic::new("Sampling");
    let recorded = rig.channels(experiment).inputs.into_iter().map(|input| {
        let found = Recorded::of_input(experiment, &input);
        (input, found.rate_hz, found.drive)
    });
    let simulated = experiment.simulate.iter().filter_map(|simulate| {
        let (drive, _) = drive_of(experiment, simulate).ok()?;
        Some((rig.input().to_owned(), Some(simulate.sampling_rate.si()), Some(drive)))
    });
    let is_recorded = !experiment.recordings.is_empty();
    let all: Vec<_> = if is_recorded { recorded.collect() } else { simulated.collect() };
    for (input, rate_hz, drive) in all {
        let Some((rate_hz, Drive::Sine { frequency_hz, .. })) = rate_hz.zip(drive) else { continue };
        let cycle = rate_hz / frequency_hz;
        let error = error_between_samples(cycle, lag);
        let points = if lag.samples() > 1 { "six" } else { "four" };
        let mut text = format!(
            "`{input}` has {cycle:.1} samples in a cycle. In the middle between two of them the polynomial through {points} samples is off by \
             {error:.1e} of its amplitude"
        );
        if error > SHOWS {
            let remedy =
                if lag.samples() > 1 { "" } else { ", wait for two samples (`interpolation_lag = 2`)" };
            text.push_str(&format!(
                ", which a filter of a sharp resonance may show as an error: sample at a higher rate{remedy}"
            ));
        }
        text.push('.');
        topic = topic.with("samples_in_a_cycle_and_error_between", [cycle, error], text);
    }
    (!topic.facts.is_empty()).then_some(topic)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_that_of_lagranges_polynomial() {
        // Leading terms: (1/2·3/2·5/2)² ω⁶/720 and (1/2·3/2)² ω⁴/24.
        let angle: f64 = TAU / 100.0;
        let [six, four] = [2, 1].map(|lag| error_between_samples(100.0, InterpolationLag::waiting_for(lag)));
        assert!((six / (3.515_625 / 720.0 * angle.powi(6)) - 1.0).abs() < 0.02, "{six}");
        assert!((four / (0.5625 / 24.0 * angle.powi(4)) - 1.0).abs() < 0.02, "{four}");
    }
}
