//! What an experiment states of the numbers that are sought.

use crate::config::{ConfigError, Experiment, cholesky};
use crate::diagnose::suspect::{NumberRole, Suspect};
use crate::fit::Innovations;

/// The distribution of the logarithms of factors before any recording: normal about 0, by the uncertainties and correlations that the file
/// states of its numbers.
#[derive(Clone, Debug)]
pub(in crate::diagnose) struct FactorPrior {
    /// Places among the suspects, with the relative standard uncertainty of each.
    stated: Vec<(usize, f64)>,
    /// The lower Cholesky factor of their correlations.
    root: Vec<Vec<f64>>,
}

impl FactorPrior {
    /// What the experiment states of these.
    pub(in crate::diagnose) fn of(
        experiment: &Experiment,
        suspects: &[Suspect],
    ) -> Result<Self, ConfigError> {
        let uncertain = experiment.uncertain()?;
        let number = |suspect: &Suspect| {
            let NumberRole::Factor(numbers) = &suspect.what else { return None };
            let key = &numbers.first()?.key;
            uncertain.iter().find(|number| number.key == *key)
        };
        let stated: Vec<(usize, f64)> = suspects
            .iter()
            .enumerate()
            .filter_map(|(place, suspect)| {
                let number = number(suspect)?;
                Some((place, (number.sd / number.value.si()).abs()))
            })
            .collect();
        let directions = experiment.directions()?;
        // Of independent directions: the covariance is the sum of the products of their steps.
        let step = |place: usize, direction: usize| {
            let key = number(&suspects[place]).map(|number| &number.key);
            let steps = directions.get(direction).map_or(&[][..], |direction| &direction.steps);
            let own = steps.iter().find(|(number, _)| Some(&number.key) == key);
            own.map_or(0.0, |(number, step)| step / number.value.si())
        };
        let covariance = |i: usize, j: usize| -> f64 {
            (0..directions.len()).map(|direction| step(i, direction) * step(j, direction)).sum()
        };
        let correlation: Vec<Vec<f64>> = stated
            .iter()
            .map(|(i, sd)| {
                let row = stated.iter();
                row.map(|(j, other)| if i == j { 1.0 } else { covariance(*i, *j) / (sd * other) }).collect()
            })
            .collect();
        let root = cholesky(&correlation).unwrap_or_default();
        Ok(Self { stated, root })
    }

    /// The stated relative standard uncertainty of one.
    pub(super) fn deviation(&self, place: usize) -> Option<f64> {
        self.stated.iter().find(|(own, _)| *own == place).map(|(_, sd)| *sd)
    }

    /// Adds what is stated to innovations, as one more of variance 1 for each independent error of what is stated.
    pub(super) fn append(&self, innovations: &mut Innovations, sizes: &[f64]) {
        let mut whitened: Vec<f64> = Vec::with_capacity(self.stated.len());
        for (row, (place, sd)) in self.root.iter().zip(&self.stated) {
            let own = sizes.get(*place).map_or(0.0, |size| size / sd);
            let known: f64 = row.iter().zip(&whitened).map(|(root, value)| root * value).sum();
            let pivot = row.get(whitened.len()).copied().unwrap_or(0.0);
            whitened.push(if pivot > 0.0 { (own - known) / pivot } else { 0.0 });
        }
        innovations.variance.extend(whitened.iter().map(|_| 1.0));
        innovations.value.extend(whitened);
    }
}
