//! Parameters of a device that are states of a filter.

use super::TrackedPrior;
use crate::config::{ConfigError, ConfigFault, Experiment, FilterTable, Key, Sign, TrackedState};
use crate::units::{Kind, kind};
use kalmems_core::Parameters;
use kalmems_core::augmentation::{AddedState, Drift};

/// A parameter that is a state.
#[derive(Clone, Copy, Debug)]
pub struct Tracked {
    /// Which.
    pub parameter: &'static DeviceParameter,
    /// Its scale and drift.
    pub added: AddedState<f64>,
    /// Its first standard deviation.
    pub sd: f64,
}

impl Tracked {
    /// What is known of it before.
    pub(super) fn prior(&self) -> TrackedPrior {
        let drift = match self.added.drift {
            Drift::RandomWalk { density } => density,
            Drift::GaussMarkov { .. } => 0.0,
        };
        let is_factor = self.parameter.is_factor();
        TrackedPrior { name: self.parameter.name, sd: self.sd, drift, is_factor }
    }
}

/// A parameter of the device that can be a state. As one it is the deviation from what the device table says: of a
/// factor relative to it, of an offset in V.
#[derive(Clone, Debug, PartialEq)]
pub struct DeviceParameter {
    /// Its name in the experiment file and in trajectories.
    pub name: &'static str,
    /// Its name in the model of the motion, if it is there.
    pub in_motion: Option<&'static str>,
    /// Its name in the model of the readout.
    pub in_readout: Option<&'static str>,
    /// Its name in the model of both in one, of a readout that has states of its own.
    pub in_whole: Option<&'static str>,
    /// What its deviation is.
    pub kind: &'static Kind,
    /// The unit of that in column names.
    pub unit: &'static str,
    /// What its drift is.
    pub drift: &'static Kind,
    /// The keys of the device's table that stand for it, as `resonator.stiffness`: a factor multiplies each by its power, and what
    /// is no factor is added. `*` stands for every entry of a table. The first one is always there; one that is left out in the
    /// file is left alone.
    pub written: &'static [(&'static str, i32)],
}

impl DeviceParameter {
    /// A factor, relative to what the device table says.
    pub const fn factor(name: &'static str) -> Self {
        Self::new(name, (&kind::RATIO, "1", &kind::RATIO_DRIFT))
    }

    /// A voltage.
    pub const fn volts(name: &'static str) -> Self {
        Self::new(name, (&kind::VOLTAGE, "V", &kind::VOLTAGE_DRIFT))
    }

    /// A capacitance.
    pub const fn farads(name: &'static str) -> Self {
        Self::new(name, (&kind::CAPACITANCE, "F", &kind::CAPACITANCE_DRIFT))
    }

    /// A length.
    pub const fn metres(name: &'static str) -> Self {
        Self::new(name, (&kind::LENGTH, "m", &kind::LENGTH_DRIFT))
    }

    const fn new(
        name: &'static str,
        (kind, unit, drift): (&'static Kind, &'static str, &'static Kind),
    ) -> Self {
        Self { name, in_motion: None, in_readout: None, in_whole: None, kind, unit, drift, written: &[] }
    }

    /// What a deviation of 1 adds to it in these models of motion and readout: of a factor, its value there; else one of its
    /// unit.
    pub fn scale<D: Parameters<f64>, H: Parameters<f64>>(&self, motion: &D, readout: &H) -> f64 {
        if self.unit != "1" {
            return 1.0;
        }
        let in_motion = self.in_motion.and_then(D::index_of).and_then(|index| motion.value(index));
        let in_readout = self.in_readout.and_then(H::index_of).and_then(|index| readout.value(index));
        in_motion.or(in_readout).unwrap_or(1.0)
    }

    /// The same, which the motion depends on under this name.
    #[must_use]
    pub const fn in_motion(self, name: &'static str) -> Self {
        Self { in_motion: Some(name), ..self }
    }

    /// The same, which the readout depends on under this name.
    #[must_use]
    pub const fn in_readout(self, name: &'static str) -> Self {
        Self { in_readout: Some(name), ..self }
    }

    /// The same, for which these keys of the device's table stand.
    #[must_use]
    pub const fn written(self, keys: &'static [(&'static str, i32)]) -> Self {
        Self { written: keys, ..self }
    }

    /// Whether it is a factor on what the device's table says.
    pub fn is_factor(&self) -> bool {
        *self.kind == kind::RATIO
    }

    /// The same, which the model of both in one depends on under this name.
    #[must_use]
    pub const fn in_whole(self, name: &'static str) -> Self {
        Self { in_whole: Some(name), ..self }
    }
}

/// The parameters that are states.
pub(super) fn tracked(
    experiment: &Experiment,
    at: &Key,
    filter: &FilterTable,
    (parameters, scales): (&'static [DeviceParameter], &[f64]),
) -> Result<Vec<Tracked>, ConfigError> {
    let at = at.clone().child("states");
    let known = || parameters.iter().map(|parameter| parameter.name);
    if let Some(name) = filter.states.keys().find(|name| known().all(|known| known != name.as_str())) {
        return Err(experiment.error(at.child(name), ConfigFault::unknown_key(name, known())));
    }
    let mut all = Vec::new();
    for (parameter, &scale) in parameters.iter().zip(scales) {
        let Some(TrackedState { start_sd, drift }) = filter.states.get(parameter.name) else { continue };
        let key = at.clone().child(parameter.name);
        let sd = experiment.value(key.clone().child("start_sd"), start_sd, parameter.kind, Sign::Positive)?;
        let density = match drift {
            Some(drift) => {
                experiment.value(key.clone().child("drift"), drift, parameter.drift, Sign::NotNegative)?
            }
            None => 0.0,
        };
        if scale == 0.0 {
            let name = parameter.name;
            let why = format!(
                "the device's {name} is 0, of which no other {name} is a multiple; give the device one above 0"
            );
            return Err(experiment.error(key, ConfigFault::Value { why }));
        }
        let added = AddedState { scale, drift: Drift::RandomWalk { density } };
        all.push(Tracked { parameter, added, sd });
    }
    Ok(all)
}
