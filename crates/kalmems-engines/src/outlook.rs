//! What can be said of a device and its drive before anything is recorded.
//!
//! A rig makes it of an experiment file ([`Rig::outlook`](crate::rig::Rig::outlook)); `kalmems inspect` prints it.

mod recorded;

pub use recorded::Recorded;

use crate::config::Experiment;
use crate::simulate::{StabilityMap, SteadyMotion, Sweeps};
use kalmems_figures::with_short_numbers;
use serde::{Serialize, Serializer};
use std::fmt::Write as _;

/// All that is said, and the numbers behind it.
#[derive(Clone, Debug, Serialize)]
pub struct Outlook {
    /// The experiment's name.
    pub experiment: String,
    /// The device table.
    pub device: &'static str,
    /// In the order in which they are read.
    pub topics: Vec<OutlookTopic>,
    /// The amplitude over the drive's frequency, where there is a motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub response: Option<AmplitudeResponse>,
    /// Where a motion starts by itself, where the drive repeats.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<SmallMotionGrowth>,
    /// Responses and noise over frequency, for an instrument that measures by following.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frequencies: Vec<AtFrequency>,
    /// What the signal determines over the amplitude of the motion.
    pub information: Vec<AmplitudeDeviations>,
}

/// Facts that belong together.
#[derive(Clone, Debug, Serialize)]
pub struct OutlookTopic {
    /// Its heading.
    pub title: &'static str,
    /// One sentence each.
    pub facts: Vec<Fact>,
}

/// A sentence and its numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fact {
    /// What it is about, with the unit of the numbers: `resonance_hz`.
    pub name: &'static str,
    /// In the unit of the name; `null` in JSON where there is none.
    #[serde(serialize_with = "finite")]
    pub values: Vec<f64>,
    /// In words.
    pub text: String,
}

/// Amplitudes in rad over the drive's frequency.
#[derive(Clone, Debug, Serialize)]
pub struct AmplitudeResponse {
    /// By integration.
    pub sweeps: Sweeps,
    /// By harmonic balance, with the motions that no sweep finds.
    pub balance: Vec<SteadyMotion>,
}

/// Growth of a small motion over the drive's frequency and size.
#[derive(Clone, Debug, Serialize)]
pub struct SmallMotionGrowth {
    /// By integration over one period.
    pub map: StabilityMap,
    /// The largest voltage of the drive at factor 1.
    pub peak_volts: f64,
    /// For each factor the edges of the tongue to first order in the pump depth, where it is above its threshold.
    pub tongue_hz: Vec<Option<[f64; 2]>>,
}

/// Standard deviations from a stated time of recording at one amplitude, in rad.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AmplitudeDeviations {
    /// The amplitude of the motion in rad.
    pub amplitude: f64,
    /// Of the phase, in rad of the motion.
    pub phase_sd: f64,
    /// Of the amplitude with gain and offset known.
    pub amplitude_sd: f64,
    /// Of the amplitude with gain and offset estimated beside it.
    pub amplitude_sd_free: f64,
}

/// What an instrument does at one frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AtFrequency {
    /// In Hz.
    pub frequency_hz: f64,
    /// The output for what is measured, in V/(m/s²).
    pub response: f64,
    /// Its phase in rad.
    pub phase: f64,
    /// The output without the loop.
    pub open_response: f64,
    /// Its phase in rad.
    pub open_phase: f64,
    /// The loop gain; 0 where there is no loop.
    pub loop_gain: f64,
    /// By how much the loop amplifies a disturbance.
    pub sensitivity: f64,
    /// The noise at the input that is the molecules', in (m/s²)/√Hz, one-sided.
    pub brownian: f64,
    /// The noise at the input that is the readout's, in (m/s²)/√Hz, one-sided; `None` where its density is not known.
    pub readout: Option<f64>,
}

impl OutlookTopic {
    /// Without facts yet.
    pub fn new(title: &'static str) -> Self {
        Self { title, facts: Vec::new() }
    }

    /// Adds a fact. Numbers of too many digits to count get an exponent in its sentence.
    #[must_use]
    pub fn with(mut self, name: &'static str, values: impl Into<Vec<f64>>, text: impl Into<String>) -> Self {
        let text = with_short_numbers(&text.into());
        self.facts.push(Fact { name, values: values.into(), text });
        self
    }
}

impl Outlook {
    /// These topics of the device of an experiment, without pictures.
    pub fn of(experiment: &Experiment, device: &'static str, topics: Vec<OutlookTopic>) -> Self {
        Self {
            experiment: experiment.name.to_string(),
            device,
            topics,
            response: None,
            start: None,
            frequencies: Vec::new(),
            information: Vec::new(),
        }
    }

    /// A fact by its name.
    pub fn fact(&self, name: &str) -> Option<&Fact> {
        self.topics.iter().flat_map(|topic| &topic.facts).find(|fact| fact.name == name)
    }

    /// In words.
    pub fn to_text(&self) -> String {
        let mut text = format!("{}: {}\n", self.experiment, self.device);
        for topic in &self.topics {
            let _ = writeln!(text, "\n{}", topic.title);
            for fact in &topic.facts {
                let _ = writeln!(text, "  {}", fact.text);
            }
        }
        text
    }
}

fn finite<S: Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter().map(|value| value.is_finite().then_some(*value)))
}
