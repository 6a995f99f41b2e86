//! The recording that determines the mechanics where this one does not: with a dither on the feedback.

use super::super::data::AccelerometerSegment;
use super::super::settings::AccelerometerHardware;
use super::super::simulation::{AccelerometerSimulation, feedback};
use super::likelihood::{Likelihood, forgotten_after};
use super::search::{LikelihoodSearchError, search};
use super::{MECHANICS, WORTH_SETTING};
use crate::config::{Experiment, Simulate};
use crate::inspect::quantity;
use crate::progress::Progress;
use crate::simulate::Simulation;
use std::ops::ControlFlow;

/// A recording with a dither.
pub struct DitherProposal {
    /// What is proposed, in words.
    pub what: String,
    /// The relative standard errors that it leaves of spring, damping and mass.
    pub deviations: [f64; MECHANICS.len()],
    /// The table `[simulate]` of it.
    pub simulate: String,
}

/// The tones of a dither, and the lowest of them where the sampling has room for it.
const TONES: u32 = 16;
const LOWEST_HZ: f64 = 200.0;

/// The highest tone, over the sampling rate.
const HIGHEST: f64 = 0.4;

/// Root mean squares of dithers over the bias of the plates, from the smallest on.
const SIZES: [f64; 3] = [0.003, 0.01, 0.03];

/// Steps of the integration for each sample.
const STEPS: f64 = 10.0;

/// The smallest dither under which a recording as long as this one determines all of the mechanics, by Fisher's information of a simulated one;
/// `None` without a feedback that can have a dither, and where none of them determines all.
pub fn proposal(
    experiment: &Experiment,
    (interval_s, samples): (f64, usize),
    progress: &dyn Progress,
) -> Result<Option<DitherProposal>, LikelihoodSearchError> {
    let Some(feedback) = feedback(experiment) else { return Ok(None) };
    // The digits of what a person would write.
    let short = |value: f64| format!("{value:.3e}").parse().unwrap_or(value);
    let (rate_hz, duration_s) = (short(1.0 / interval_s), short(samples as f64 * interval_s));
    let highest_hz: f64 = short(HIGHEST * rate_hz);
    let lowest_hz = LOWEST_HZ.min(short(0.01 * highest_hz));
    for size in SIZES {
        let rms = short(size * feedback.bias.si());
        let simulate = format!(
            "[simulate]\nduration = \"{duration_s} s\"\nsampling_rate = \"{rate_hz} Hz\"\nintegration_rate = \"{} Hz\"\n\
             start = {{ displacement = \"0 m\", velocity = \"0 m/s\" }}\nseed = 1\n\n\
             [simulate.dither]\nrms = \"{rms} V\"\nfrom = \"{lowest_hz} Hz\"\nto = \"{highest_hz} Hz\"\ntones = {TONES}\n\n\
             [simulate.drive.acceleration]\n",
            STEPS * rate_hz
        );
        let Some(deviations) = deviations(experiment, &simulate, progress)? else { return Ok(None) };
        if deviations.iter().all(|deviation| *deviation < WORTH_SETTING) {
            let what = format!(
                "a dither of {TONES} tones from {} to {} on the feedback, {} rms in all, over {}",
                quantity(lowest_hz, "Hz"),
                quantity(highest_hz, "Hz"),
                quantity(rms, "V"),
                quantity(duration_s, "s")
            );
            return Ok(Some(DitherProposal { what, deviations, simulate }));
        }
    }
    Ok(None)
}

/// The standard errors of spring, damping and mass from such a recording of the device as it is described, each relative to the number; `None`
/// of one that cannot be simulated.
fn deviations(
    experiment: &Experiment,
    simulate: &str,
    progress: &dyn Progress,
) -> Result<Option<[f64; MECHANICS.len()]>, LikelihoodSearchError> {
    let mut described = experiment.clone();
    let Ok(simulate) = Simulate::parse(simulate, experiment.path()) else { return Ok(None) };
    described.simulate = Some(simulate);
    let (Ok(simulation), Ok(hardware)) =
        (AccelerometerSimulation::of(&described), AccelerometerHardware::of(&described))
    else {
        return Ok(None);
    };
    let (mut time_s, mut feedback, mut signal) = (Vec::new(), Vec::new(), Vec::new());
    let simulated = simulation.run(&mut |sample| {
        if let [applied, output, ..] = sample.recorded {
            time_s.push(sample.time_s);
            feedback.push(*applied);
            signal.push(*output);
        }
        ControlFlow::Continue(())
    });
    let (Ok(()), [first, second, ..]) = (simulated, time_s.as_slice()) else { return Ok(None) };
    let data = AccelerometerSegment {
        interval_s: second - first,
        time_s: &time_s,
        signal: &signal,
        feedback: Some(&feedback),
    };
    let forgotten = forgotten_after(&hardware, data.interval_s)?;
    if signal.len() < 2 * forgotten {
        return Ok(None);
    }
    let found = search(&Likelihood { hardware: &hardware, data: &data, forgotten }, progress)?;
    Ok(Some(MECHANICS.map(|(_, place)| found.covariance.standard_deviation(place))))
}
