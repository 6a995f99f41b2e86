//! What estimated states were found to be wrong by, which is taken back.

use super::names;
use super::ordered::{OfElement, Ordered};
use crate::config::kinds::Ratio;
use crate::config::{AnyValue, ConfigError, ConfigFault, Experiment, Key, Positive, Quantity, Sign};
use crate::estimate::Trajectory;
use kalmems_equations::{Device, VectorElement};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The line that an estimated state was found to follow: `scale` times the true one and `bias`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CorrectionTable {
    /// The scale factor.
    pub scale: Quantity<Ratio, Positive>,
    /// The bias.
    pub bias: AnyValue,
}

impl OfElement for CorrectionTable {
    fn of_element(&self, _: &VectorElement) -> Result<Self, String> {
        Ok(self.clone())
    }
}

/// The same of a device's state.
#[derive(Clone, Copy, Debug)]
pub struct StateCorrection {
    /// The state.
    pub state: usize,
    name: &'static str,
    /// The scale factor.
    pub scale: f64,
    bias: f64,
}

impl StateCorrection {
    /// Those of an experiment's device.
    pub fn of(
        experiment: &Experiment,
        corrections: &Ordered<CorrectionTable>,
        device: &Device,
    ) -> Result<Vec<Self>, ConfigError> {
        let entries = names::entries(device);
        let one = |(name, stated): (&str, &CorrectionTable)| {
            let at = Key::from("device.equations.correction").child(name);
            let Some(state) = entries.iter().position(|entry| entry.name == name) else {
                let known = entries.iter().map(|entry| entry.name);
                return Err(experiment.error(at, ConfigFault::unknown_key(name, known)));
            };
            let bias = experiment.value(at.child("bias"), &stated.bias, entries[state].kind, Sign::Any)?;
            Ok(Self { state, name: entries[state].name, scale: stated.scale.si(), bias })
        };
        corrections.iter().map(one).collect()
    }

    /// Takes it back.
    pub fn apply(&self, trajectory: &mut Trajectory) {
        for state in trajectory.states.iter_mut().filter(|state| state.name == self.name) {
            state.mean.iter_mut().for_each(|x| *x = (*x - self.bias) / self.scale);
            state.sd.iter_mut().for_each(|sd| *sd /= self.scale);
        }
    }
}
