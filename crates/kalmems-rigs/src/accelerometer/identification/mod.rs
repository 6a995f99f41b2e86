//! The instrument's parameters from a recording of its own: those under which the innovations are most likely.
//!
//! The acceleration is unknown throughout: it is a state of stated bandwidth, and how large it was is sought with the
//! rest. What tells spring, damping and mass is the answer to the feedback, best to one with a dither of known tones.

mod figures;
mod likelihood;
mod messages;
mod profile;
mod proposal;
mod record;
mod search;
mod visibility;

use super::data::AccelerometerSegment;
use super::feedback;
use super::pull_in;
use super::settings::AccelerometerHardware;
use crate::accelerometer::device::AccelerometerTable;
use crate::config::Experiment;
use crate::fit::DerivedNumber;
use crate::identify::{
    Entries, Identification, IdentifyError, LikelihoodSolution, NumberStatus, TWO_SIDED, Whiteness, exact,
    joint_number_statuses,
};
use crate::progress::{Progress, Silent};
use kalmems_core::Scalar;
use likelihood::{Likelihood, forgotten_after, unknown};
use profile::{Ends, profiles};
use proposal::proposal;
use record::IdentificationRecord;
use search::{LikelihoodMaximum, LikelihoodSearchError, search, search_from};
use std::f64::consts::TAU;
use visibility::{Visibility, visibility};

/// What the recording gave.
struct AccelerometerOutcome {
    found: LikelihoodMaximum,
    /// Where the logarithms may lie, from their likeliest values.
    ends: [Ends; unknown::COUNT],
    /// Of spring, damping and mass.
    visibility: [Visibility; 3],
    whiteness: Whiteness,
    /// What of each unknown can be put into its place.
    standings: Vec<NumberStatus>,
    /// What the experiment said of each unknown, in SI.
    stated: [f64; unknown::COUNT],
}

/// A parameter known worse than this, relative to itself, is not put into the experiment.
const WORTH_SETTING: f64 = 0.1;

/// The standard deviation of which an interval is one of 95 %.
fn spread([low, high]: &Ends) -> f64 {
    0.5 * (high - low) / TWO_SIDED
}

/// What of each unknown can be put into its place.
fn told(
    likelihood: &Likelihood,
    found: &LikelihoodMaximum,
    ends: &[Ends; unknown::COUNT],
    progress: &dyn Progress,
) -> Result<Vec<NumberStatus>, LikelihoodSearchError> {
    let likeliest = LikelihoodSolution {
        at: &found.logs,
        spread: &|i| spread(&ends[i]),
        is_told: &|i| !found.at_bound[i] && spread(&ends[i]) < WORTH_SETTING,
        correlation: &|i, j| found.correlation(i, j),
    };
    joint_number_statuses(&likeliest, |kept| {
        let kept: [bool; unknown::COUNT] = std::array::from_fn(|i| kept[i]);
        let start = std::array::from_fn(|i| if kept[i] { 0.0 } else { found.logs[i] });
        Ok(search_from(likelihood, start, kept, progress)?.logs.to_vec())
    })
}

impl AccelerometerOutcome {
    /// In SI.
    fn value(&self, index: usize) -> f64 {
        self.stated[index] * Scalar::exp(self.found.logs[index])
    }

    /// Relative to the value; infinite for what the recording does not tell, be it for another's sake.
    fn deviation(&self, index: usize) -> f64 {
        match self.standings[index] {
            NumberStatus::DependsOn(other) if self.deviation(other).is_infinite() => f64::INFINITY,
            NumberStatus::Undetermined if self.found.at_bound[index] => f64::INFINITY,
            _ => spread(&self.ends[index]),
        }
    }

    fn is_known(&self, index: usize) -> bool {
        self.standings[index] == NumberStatus::Determined
    }
}

/// Identifies the instrument from the experiment's recording.
pub fn identify(experiment: &Experiment, progress: &dyn Progress) -> Result<Identification, IdentifyError> {
    let hardware = AccelerometerHardware::of(experiment)?;
    let record = IdentificationRecord::read(experiment, hardware.has_feedback, progress)?;
    let data = record.data();
    let unfit = |why: String| record.material.unfit(why);
    pull_in::require_free(&hardware, &data, &record.signal_column, &record.material.name)
        .map_err(|why| unfit(why.to_string()))?;
    feedback::require_right(&hardware, &data, &record.feedback_column, &record.material.name)
        .map_err(|why| unfit(why.to_string()))?;
    let forgotten = forgotten_after(&hardware, data.interval_s)
        .map_err(|why| unfit(LikelihoodSearchError::from(why).to_string()))?;
    if data.signal.len() < 2 * forgotten {
        return Err(unfit(format!(
            "it has {} samples, and a filter forgets its start after {forgotten}; expected twice as many at least",
            data.signal.len()
        )));
    }
    let likelihood = Likelihood { hardware: &hardware, data: &data, forgotten };
    let refused = |why: LikelihoodSearchError| match why {
        LikelihoodSearchError::Interrupted => IdentifyError::Interrupted,
        why @ LikelihoodSearchError::Likelihood(_) => unfit(why.to_string()),
    };
    progress.begin("searching the likeliest numbers", 0);
    let found = search(&likelihood, progress).map_err(refused)?;
    let visibility = visibility(&likelihood, &found.logs)
        .map_err(|why| unfit(LikelihoodSearchError::from(why).to_string()))?;
    let mass = &hardware.sensed.device.mass;
    let ends = profiles(&likelihood, &found, progress).map_err(refused)?;
    let standings = told(&likelihood, &found, &ends, progress).map_err(refused)?;
    let outcome = AccelerometerOutcome {
        standings,
        whiteness: Whiteness::of(&found.innovations),
        stated: [
            mass.spring,
            mass.damping,
            mass.mass,
            hardware.noise_variance,
            hardware.sensed.prior.rms,
            hardware.sensed.prior.rate / TAU,
        ],
        found,
        ends,
        visibility,
    };
    let mut identification = Identification {
        figures: vec![figures::of(&outcome)],
        ..Identification::begun("accelerometer", experiment)
    };
    messages::of(&mut identification, &record, &outcome);
    apply(&mut identification.experiment, &outcome)?;
    if MECHANICS.iter().any(|(_, place)| !outcome.is_known(*place)) {
        progress.begin("simulating another recording", 0);
        let like = (data.interval_s, data.signal.len());
        if let Some(there) = proposal(&identification.experiment, like, progress).map_err(refused)? {
            identification.notes.push(messages::proposed(&there, &outcome));
        }
    }
    identification.materials.push(record.material);
    Ok(identification)
}

/// ln p of the recording under the likeliest of all mechanics, noises and accelerations; `None` where there is no such search.
pub fn most_likely_with(hardware: &AccelerometerHardware, data: &AccelerometerSegment) -> Option<f64> {
    let forgotten = forgotten_after(hardware, data.interval_s).ok()?;
    if data.signal.len() < 2 * forgotten {
        return None;
    }
    search(&Likelihood { hardware, data, forgotten }, &Silent).ok().map(|found| found.log_likelihood)
}

/// Puts what is known well enough into the device table.
fn apply(experiment: &mut Experiment, outcome: &AccelerometerOutcome) -> Result<(), IdentifyError> {
    let mut device = (*experiment.device::<AccelerometerTable>()?).clone();
    let mut entries = Entries::default();
    let of = |index: usize| {
        let value = outcome.value(index);
        DerivedNumber { value, deviation: (value * outcome.deviation(index)).abs() }
    };
    let known = |index: usize| outcome.is_known(index);
    let mass = &mut device.proof_mass;
    if known(unknown::SPRING) {
        entries.set(experiment, (SPRING, &mut mass.spring), of(unknown::SPRING), "N/m")?;
    }
    if known(unknown::DAMPING) {
        entries.set(experiment, (DAMPING, &mut mass.damping), of(unknown::DAMPING), "N s/m")?;
    }
    if known(unknown::MASS) {
        entries.set(experiment, (MASS, &mut mass.mass), of(unknown::MASS), "kg")?;
    }
    if known(unknown::NOISE) {
        let place = ("readout.noise_variance", &mut device.readout.noise_variance);
        entries.set(experiment, place, exact(outcome.value(unknown::NOISE)), "V^2")?;
    }
    if known(unknown::ACCELERATION) {
        // How large the acceleration usually is says how much a filter smooths, and nothing of the instrument.
        let place = ("acceleration.rms", &mut device.acceleration.rms);
        entries.set(experiment, place, exact(outcome.value(unknown::ACCELERATION)), "m/s^2")?;
    }
    let c = &outcome.found.covariance;
    let (names, places): (Vec<&str>, Vec<usize>) = MECHANICS.into_iter().unzip();
    entries.correlate_all(&names, &|i, j| c.get(places[i], places[j]));
    experiment.set_device(device);
    entries.write(experiment);
    Ok(())
}

/// Keys below the device's table.
const SPRING: &str = "proof_mass.spring";
const DAMPING: &str = "proof_mass.damping";
const MASS: &str = "proof_mass.mass";

/// What is told of the proof mass, by these keys, and its place in the search.
const MECHANICS: [(&str, usize); 3] =
    [(SPRING, unknown::SPRING), (DAMPING, unknown::DAMPING), (MASS, unknown::MASS)];
