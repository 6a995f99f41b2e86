//! Whether an experiment is better with what was found than it was before.

use kalmems::config::Experiment;
use kalmems::estimate::EstimateError;
use kalmems::identify::{Identification, Identified};
use kalmems::progress::Silent;
use kalmems::results::Metrics;
use kalmems::rigs::published;
use kalmems::workflow::{self, WorkflowError};

/// The error of a quantity by the experiment's first filter, root mean square in SI, or that of its angle in degrees; infinite where there is no
/// estimate: the start from the signal is refused, there is no crossing, the filter stops, or the signal is lost.
pub fn error(experiment: &Experiment, quantity: &str) -> f64 {
    let outcome = match workflow::estimate(published(), experiment, &Silent) {
        Ok(outcome) => outcome,
        Err(WorkflowError::Estimate(EstimateError::NoStart { .. } | EstimateError::NoCrossing { .. })) => {
            return f64::INFINITY;
        }
        Err(other) => panic!("{other}"),
    };
    let metrics = Metrics::of(&outcome);
    let first = metrics.estimators().next().unwrap();
    if let Some(values) = first.values.get(quantity) {
        return values.rmse;
    }
    let errors = first.errors.as_ref();
    errors.map_or(f64::INFINITY, |errors| errors.angle.rmse_deg)
}

/// The error after over that before; 1 where there was no estimate and is none.
pub fn ratio(after: f64, before: f64) -> f64 {
    if after == before { 1.0 } else { after / before }
}

/// The parameter with a name that begins so.
pub fn named<'a>(found: &'a Identification, name: &str) -> &'a Identified {
    let own = found.parameters.iter().find(|parameter| parameter.name.starts_with(name));
    own.unwrap_or_else(|| {
        panic!("{name}: {:?}", found.parameters.iter().map(|p| &p.name).collect::<Vec<_>>())
    })
}

/// What became of the estimates of a rig, laboratory by laboratory.
#[derive(Default)]
pub struct Harm(Vec<f64>);

impl Harm {
    /// Takes errors after over those before of several recordings, and prints them.
    pub fn take(&mut self, words: &str, mut ratios: Vec<f64>) {
        ratios.sort_by(f64::total_cmp);
        let harmed = ratios.iter().filter(|ratio| **ratio > 1.1).count();
        let unchanged = ratios.iter().filter(|ratio| (**ratio - 1.0).abs() < 1e-9).count();
        println!(
            "{words}: error after over before, {} recordings: median {:.3}, largest {:.4?}; unchanged {unchanged}, above 1.1 {harmed}",
            ratios.len(),
            ratios[ratios.len() / 2],
            &ratios[ratios.len().saturating_sub(3)..]
        );
        self.0.extend(ratios);
    }

    /// In all but one of 60 recordings the error grows by no more than a tenth.
    pub fn judge(&self) {
        let harmed = self.0.iter().filter(|ratio| ratio.is_nan() || **ratio > 1.1).count();
        assert!(harmed <= (self.0.len() / 60).max(1), "{harmed} of {}: {:?}", self.0.len(), self.0);
    }
}
