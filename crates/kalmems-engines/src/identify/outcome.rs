//! What an identification says.

use super::{Material, TWO_SIDED};
use crate::config::Experiment;
use kalmems_figures::Figure;
use serde::Serialize;

/// A parameter with how well it is known.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Identified {
    /// In words, such as `stiffness k`.
    pub name: String,
    /// What the experiment states, in SI; `None` of what it has no key for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stated: Option<f64>,
    /// In SI.
    pub value: f64,
    /// In SI; infinite where the recording does not determine it.
    pub standard_error: f64,
    /// Where the truth lies 95 times in 100.
    pub interval: [f64; 2],
    /// The SI unit, empty for a ratio.
    pub unit: &'static str,
    /// The recording that it comes from.
    pub recording: String,
}

impl Identified {
    /// A parameter whose error is Gaussian.
    pub fn gaussian(
        name: &str,
        found: crate::fit::DerivedNumber,
        unit: &'static str,
        recording: &str,
    ) -> Self {
        let half = TWO_SIDED * found.deviation;
        Self {
            name: name.to_owned(),
            stated: None,
            value: found.value,
            standard_error: found.deviation,
            interval: [found.value - half, found.value + half],
            unit,
            recording: recording.to_owned(),
        }
    }
}

/// What the recordings do not tell, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Undetermined {
    /// In words.
    pub what: String,
    /// Why, and what would help.
    pub why: String,
}

/// Two parameters and the correlation of their errors.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Correlated {
    /// Both names.
    pub names: [String; 2],
    /// Between −1 and 1.
    pub correlation: f64,
    /// The recording whose fit has them.
    pub recording: String,
}

/// Parameters of a device, from the recordings of an experiment.
#[derive(Clone, Debug)]
pub struct Identification {
    /// The rig's name.
    pub rig: &'static str,
    /// What was found, in the order of the recordings.
    pub parameters: Vec<Identified>,
    /// What was not, and why.
    pub undetermined: Vec<Undetermined>,
    /// The pair of each fit whose errors hang together most.
    pub worst_pairs: Vec<Correlated>,
    /// What a reader must know before trusting a value.
    pub warnings: Vec<String>,
    /// What else was seen.
    pub notes: Vec<String>,
    /// Fits over data, residuals, profiles.
    pub figures: Vec<Figure>,
    /// The experiment with the found values in their places.
    pub experiment: Experiment,
    /// The recordings that it was made from.
    pub materials: Vec<Material>,
}

impl Identification {
    /// Of nothing yet.
    pub fn begun(rig: &'static str, experiment: &Experiment) -> Self {
        Self {
            rig,
            parameters: Vec::new(),
            undetermined: Vec::new(),
            worst_pairs: Vec::new(),
            warnings: Vec::new(),
            notes: Vec::new(),
            figures: Vec::new(),
            experiment: experiment.clone(),
            materials: Vec::new(),
        }
    }
}
