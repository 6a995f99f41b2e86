//! The experiment as it would be if a device differed from its table in one direction of its uncertainty.

use super::uncertainty::{Direction, exactly};
use super::{ConfigError, ConfigFault, Experiment, Key, put, written};
use std::sync::OnceLock;

/// The same experiment with a device that differs by one standard deviation in one direction of its uncertainty.
#[derive(Clone, Debug)]
pub struct VariedExperiment {
    /// The direction.
    pub direction: Direction,
    /// What a filter is told then; of this device nothing is uncertain.
    pub experiment: Experiment,
}

/// The varied experiments, once they are asked for. They say nothing about the experiment itself: all are equal.
#[derive(Debug, Default)]
pub(super) struct Variations(OnceLock<Vec<VariedExperiment>>);

impl Clone for Variations {
    /// A copy may be changed, and has variations of its own.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl PartialEq for Variations {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Experiment {
    /// The experiment in each direction of the device's uncertainty; none of a device that is stated as exact.
    pub fn varied(&self) -> Result<&[VariedExperiment], ConfigError> {
        if let Some(found) = self.variations.0.get() {
            return Ok(found);
        }
        let found = self.directions()?.into_iter().map(|direction| self.in_direction(direction));
        let found = found.collect::<Result<Vec<VariedExperiment>, ConfigError>>()?;
        Ok(self.variations.0.get_or_init(|| found))
    }

    fn in_direction(&self, direction: Direction) -> Result<VariedExperiment, ConfigError> {
        let unwritten = |why: String| self.error(Key::from("device"), ConfigFault::Value { why });
        let mut document = self.to_table().map_err(|e| unwritten(e.to_string()))?;
        exactly(&mut document);
        for (number, step) in &direction.steps {
            let (_, unit) = number.value.parts();
            let moved = (number.value.si() + step) / number.value.unit().factor();
            put(&mut document, &number.key, written(moved, unit))
                .map_err(|fault| self.error(number.key.clone(), fault))?;
        }
        let text = toml::to_string(&document).map_err(|e| unwritten(e.to_string()))?;
        let experiment = Self::parse(&text, self.path()).map_err(|error| {
            let why = format!(
                "with `{}` one standard deviation off: {}; state a smaller uncertainty",
                direction.name(),
                error.fault
            );
            self.error(
                direction.steps.first().map_or_else(Key::default, |(n, _)| n.key.clone()),
                ConfigFault::Value { why },
            )
        })?;
        let mut experiment = experiment.with_arrays(self.arrays()).sharing(self.beside());
        // A filter that has a number as a state starts with what was stated of it, as that of the device as it is stated does.
        experiment.was_uncertain = self.uncertain()?;
        Ok(VariedExperiment { direction, experiment })
    }
}
