//! What a record of a unit determines, in the shape that tables, JSON and the certificate share.

use super::outcome::UncertainEstimate;
use crate::metrology::{Budget, Distribution, Evaluation, Input};
use kalmems_figures::{Figure, TextTable};
use serde::Serialize;

/// A number that a record determines.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibratedQuantity {
    /// Its name, unique in the record, such as `accelerometer_scale_factor_x`.
    pub name: String,
    /// The unit of the estimate.
    pub unit: &'static str,
    /// The number with its uncertainty.
    #[serde(flatten)]
    pub estimate: UncertainEstimate,
    /// What its uncertainty is made of.
    pub budget: Vec<Input>,
    /// What the estimate is multiplied by in tables, and the unit of the product.
    #[serde(skip)]
    pub shown: (f64, &'static str),
}

/// A check of what was assumed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CertificateCheck {
    /// What is looked at.
    pub what: String,
    /// Whether it passes.
    pub passes: bool,
    /// What was found.
    pub found: String,
}

/// A record of a unit with what was found in it.
#[derive(Clone, Debug, Serialize)]
pub struct RecordOutcome {
    /// Which table of the calibration file asked for it: `positions`, `rates`, `temperature`.
    pub kind: &'static str,
    /// A heading.
    #[serde(skip)]
    pub title: String,
    /// How the numbers were found, for the certificate.
    #[serde(skip)]
    pub method: String,
    /// The numbers.
    pub quantities: Vec<CalibratedQuantity>,
    /// The parts of the record, row by row.
    #[serde(skip)]
    pub tables: Vec<TextTable>,
    /// Its pictures.
    #[serde(skip)]
    pub figures: Vec<Figure>,
    /// Whether what was assumed holds.
    #[serde(skip)]
    pub checks: Vec<CertificateCheck>,
    /// What is not determined, and why.
    pub not_observed: Vec<String>,
    /// What a reader must know.
    pub warnings: Vec<String>,
    /// The keys that a certificate needs and the file does not state.
    #[serde(skip)]
    pub not_stated: Vec<String>,
}

impl RecordOutcome {
    /// The estimate with this name.
    pub fn estimate(&self, name: &str) -> Option<&UncertainEstimate> {
        self.quantities.iter().find(|quantity| quantity.name == name).map(|quantity| &quantity.estimate)
    }
}

/// An input whose value is 0, by its size in the unit of the result.
pub(super) fn contribution(
    name: &str,
    standard_uncertainty: f64,
    degrees_of_freedom: f64,
    evaluation: Evaluation,
) -> Input {
    Input {
        name: name.to_owned(),
        unit: "",
        value: 0.0,
        standard_uncertainty,
        distribution: Distribution::Normal,
        degrees_of_freedom,
        evaluation,
        source: String::new(),
        sensitivity: 1.0,
    }
}

/// A number with its inputs, which are independent; the first one is what the record itself tells (type A).
pub(super) fn estimate(value: f64, inputs: &[Input]) -> UncertainEstimate {
    let of = |inputs: &[Input]| {
        let budget = Budget { inputs: inputs.to_vec(), correlations: Vec::new() };
        budget.combined(super::inputs::PROBABILITY)
    };
    UncertainEstimate::of(value, of(inputs.get(..1).unwrap_or_default()), of(inputs))
}
