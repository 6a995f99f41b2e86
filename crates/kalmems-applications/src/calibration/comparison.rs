//! Whether two references of one condition agree.

use super::inputs::{FROM_DEVICE, FROM_SCATTER, OF_GYROSCOPE, OF_REFERENCE, OF_REPEATABILITY, PROBABILITY};
use super::matrix::effective_count;
use super::outcome::{CalibratedGyroscope, UncertaintyContribution};
use super::tone::AXES;
use crate::metrology::{Budget, Distribution, Evaluation, Input, coverage_factor};
use serde::Serialize;
use std::fmt;

/// With this probability references that are as their budgets say do not contradict each other.
const CONTRADICTION: f64 = 0.99;

/// Two scale factors of one gyroscope in one condition, by two references.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReferenceComparison {
    /// The condition.
    pub condition: String,
    /// The axis: 0 for x.
    pub axis: usize,
    /// The references.
    pub references: [String; 2],
    /// By how much the second scale factor is larger, in ppm of the first.
    pub difference_ppm: f64,
    /// The standard uncertainty of that, in ppm, without what both have in common: the gyroscope's noise, and errors that the file gives the
    /// same source.
    pub uncertainty_ppm: f64,
    /// The difference by its expanded uncertainty of 95 % (E_n of ISO/IEC 17043).
    pub normalised_error: f64,
    /// Whether it is larger than its expanded uncertainty of 99 %.
    pub contradict: bool,
    /// What nobody stated of either reference.
    pub not_stated: Vec<String>,
}

impl fmt::Display for ReferenceComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [first, second] = &self.references;
        write!(
            f,
            "condition `{}`: the references `{first}` and `{second}` contradict each other: the scale factor of {} by `{second}` is {:+.1} ppm \
             from that by `{first}`, {:.1} times the expanded uncertainty (95 %) of their difference",
            self.condition,
            AXES[self.axis],
            self.difference_ppm,
            self.normalised_error.abs()
        )?;
        if !self.not_stated.is_empty() {
            write!(f, "; not stated, and so in neither interval: {}", self.not_stated.join(", "))?;
        }
        f.write_str(
            "; at least one of both intervals is wrong: a parameter of an estimated motion that was trusted or is from another temperature, a \
             vibrometer's gain or lever arm",
        )
    }
}

/// All pairs of references of each condition that calibrate the same axis.
pub(super) fn compared_references(results: &[CalibratedGyroscope]) -> Vec<ReferenceComparison> {
    let mut comparisons = Vec::new();
    for (place, first) in results.iter().enumerate() {
        let others = results.iter().skip(place + 1);
        let same = others.filter(|other| other.condition == first.condition && other.main == first.main);
        comparisons.extend(same.map(|second| compared(first, second)));
    }
    comparisons
}

/// The relative contribution of an input to a scale factor, with its sign.
fn relative(input: &Input, value: f64) -> f64 {
    input.contribution() / value
}

/// Whether two inputs are one error: the noise of the same records, a number of the same device, or what has the same source.
fn is_shared(first: &Input, second: &Input) -> bool {
    let same_words = first.name == second.name && first.source == second.source;
    let named = first.evaluation == Evaluation::B && first.source != "stated";
    same_words && (first.name == OF_GYROSCOPE || named || first.source == FROM_DEVICE)
}

/// What the quotient of both scale factors scatters from record to record.
fn of_same_records(first: &CalibratedGyroscope, second: &CalibratedGyroscope) -> Option<Input> {
    let quotients: Vec<(f64, f64)> = first
        .records
        .iter()
        .filter_map(|record| {
            let other = second.records.iter().find(|other| other.record == record.record)?;
            Some((record.reference.powi(2), other.scale_factor / record.scale_factor - 1.0))
        })
        .collect();
    let freedom = effective_count(quotients.iter().map(|(weight, _)| *weight)) - 1.0;
    if quotients.len() < 2 || freedom < 0.5 {
        return None;
    }
    let all: f64 = quotients.iter().map(|(weight, _)| weight).sum();
    let mean = quotients.iter().map(|(weight, value)| weight * value).sum::<f64>() / all;
    let square: f64 = quotients.iter().map(|(weight, value)| (weight / all * (value - mean)).powi(2)).sum();
    let count = quotients.len() as f64;
    Some(Input {
        name: "differences of the records".to_owned(),
        unit: "1",
        value: 0.0,
        standard_uncertainty: (square * count / (count - 1.0)).sqrt(),
        distribution: Distribution::Normal,
        degrees_of_freedom: freedom,
        evaluation: Evaluation::A,
        source: FROM_SCATTER.to_owned(),
        sensitivity: 1.0,
    })
}

fn compared(first: &CalibratedGyroscope, second: &CalibratedGyroscope) -> ReferenceComparison {
    let [a, b] = [first, second].map(|result| result.scale_factor.value);
    let of = |result: &CalibratedGyroscope| -> Vec<Input> {
        result.budget.iter().filter_map(|part| part.input.clone()).collect()
    };
    let (mut own, mut others) = (of(first), of(second));
    let mut left: Vec<Input> = Vec::new();
    // The gyroscope's noise and what it changes from record to record are the same in both.
    if let Some(paired) = of_same_records(first, second) {
        let is_of_records =
            |input: &Input| [OF_GYROSCOPE, OF_REFERENCE, OF_REPEATABILITY].contains(&input.name.as_str());
        own.retain(|input| !is_of_records(input));
        others.retain(|input| !is_of_records(input));
        left.push(paired);
    }
    let mut keep = |input: &Input, part: f64| {
        left.push(Input { sensitivity: 1.0, standard_uncertainty: part.abs(), ..input.clone() });
    };
    for input in &own {
        let part = relative(input, a);
        match others.iter().position(|other| is_shared(input, other)) {
            // What they share shifts both.
            Some(place) => {
                let other = others.remove(place);
                keep(input, part - relative(&other, b));
            }
            None => keep(input, part),
        }
    }
    for input in &others {
        keep(input, relative(input, b));
    }
    let combined = Budget { inputs: left, correlations: Vec::new() }.combined(PROBABILITY);
    let difference = b / a - 1.0;
    let limit = coverage_factor(CONTRADICTION, combined.degrees_of_freedom) * combined.standard_uncertainty;
    let mut not_stated: Vec<String> = Vec::new();
    for result in [first, second] {
        let missing = result.budget.iter().filter(|part| part.ppm.is_none());
        not_stated.extend(
            missing
                .map(|UncertaintyContribution { source, .. }| format!("{source} of `{}`", result.reference)),
        );
    }
    ReferenceComparison {
        condition: first.condition.clone(),
        axis: first.main,
        references: [first.reference.clone(), second.reference.clone()],
        difference_ppm: 1e6 * difference,
        uncertainty_ppm: 1e6 * combined.standard_uncertainty,
        normalised_error: difference / combined.expanded_uncertainty.max(f64::MIN_POSITIVE),
        contradict: difference.abs() > limit,
        not_stated,
    }
}
