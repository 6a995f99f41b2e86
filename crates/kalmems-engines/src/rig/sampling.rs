//! How well the samples of a recording show the inputs between them.

use super::Rig;
use crate::config::Experiment;
use crate::estimate::driven::InterpolationLag;
use crate::outlook::{OutlookTopic, Recorded};
use crate::simulate::{Drive, drive_of};
use kalmems_core::Portable;
use std::f64::consts::TAU;

/// Samples that the polynomial of fifth order goes through.
const SAMPLES: u32 = 6;

/// An error in the middle between two samples, relative to the amplitude, from which on it is named as one that an estimate may show: that of
/// about 26 samples in a cycle, with which a filter of the scanner is still within its claim.
const SHOWS: f64 = 1e-6;

/// By how much the polynomial of fifth order through six samples is off in the middle between two samples of a sine at most, relative to its
/// amplitude; a lag of two samples has three of them on either side, one of one sample four before.
///
/// The polynomial gives Σ wⱼ·e^(iωdⱼ) of a rotating number of amplitude 1 that is 1 there, with Lagrange's weights wⱼ of the samples at the
/// distances dⱼ, in intervals, and the angle ω from sample to sample.
fn error_between_samples(samples_in_a_cycle: f64, lag: InterpolationLag) -> f64 {
    let angle = TAU / samples_in_a_cycle;
    let before = f64::from(SAMPLES - 1 - lag.samples().min(SAMPLES - 1));
    let place = |j: u32| f64::from(j) + 0.5 - before;
    let weight = |j: u32| -> f64 {
        let others = (0..SAMPLES).filter(|other| *other != j);
        others.map(|other| place(other) / (place(other) - place(j))).product()
    };
    let sum = |part: fn(f64) -> f64| (0..SAMPLES).map(|j| weight(j) * part(angle * place(j))).sum::<f64>();
    (1.0 - sum(f64::portable_cos)).portable_hypot(sum(f64::portable_sin))
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
        let mut text = format!(
            "`{input}` has {cycle:.1} samples in a cycle. In the middle between two of them the polynomial through six samples, which is \
             taken unless `interpolation` states another course, is off by {error:.1e} of its amplitude"
        );
        if error > SHOWS {
            let remedy =
                if lag.samples() > 1 { "" } else { ", wait for two samples (`interpolation_lag = 2`)" };
            text.push_str(&format!(
                ", which a filter of a sharp resonance may show as an error: sample at a higher rate{remedy}, or, of a steady drive of a device \
                 in equations, state `interpolation = \"sine\"`"
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
        // Leading terms: (1/2·3/2·5/2)² ω⁶/720, with four samples before (1/2·3/2)²·5/2·7/2·ω⁶/720, with five (1/2)²·3/2·5/2·7/2·9/2·ω⁶/720.
        let angle: f64 = TAU / 100.0;
        let [three, four, five] =
            [2, 1, 0].map(|lag| error_between_samples(100.0, InterpolationLag::waiting_for(lag)));
        assert!((three / (3.515_625 / 720.0 * angle.powi(6)) - 1.0).abs() < 0.02, "{three}");
        assert!((four / (4.921_875 / 720.0 * angle.powi(6)) - 1.0).abs() < 0.02, "{four}");
        assert!((five / (14.765_625 / 720.0 * angle.powi(6)) - 1.0).abs() < 0.03, "{five}");
    }
}
