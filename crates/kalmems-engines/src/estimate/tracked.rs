//! Parameters of a device that are states of a filter.

use super::TrackedPrior;
use crate::config::{ConfigError, ConfigFault, Experiment, FilterTable, Key, Method, Sign, TrackedNumber};
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

    /// Its standard deviation at first as a state of a filter: what the filter's table says at this key, or else what the device's table states
    /// of the numbers that stand for it.
    ///
    /// # Errors
    /// A value of another kind, and a state of which neither table says how far it may be off.
    pub fn start_sd(
        &self,
        experiment: &Experiment,
        key: &Key,
        state: &TrackedNumber,
    ) -> Result<f64, ConfigError> {
        let key = key.clone().child("start_sd");
        if let Some(stated) = &state.start_sd {
            return experiment.value(key, stated, self.kind, Sign::Positive);
        }
        self.stated_sd(experiment)?.ok_or_else(|| {
            let own = "write how far it may be off, such as `start_sd = \"1 %\"`";
            let remedy = match self.written.first() {
                Some((number, _)) => format!(
                    "{own}, or state the uncertainty of `{number}` in the device's table, such as `± 1 %`, which is taken where `start_sd` is \
                     left out"
                ),
                None => own.to_owned(),
            };
            experiment.error(key, ConfigFault::MissingKey { remedy })
        })
    }

    /// The same by the device's table alone: of a factor as a ratio; `None` where it states no uncertainty. Where several numbers stand for it
    /// the largest is taken.
    pub fn stated_sd(&self, experiment: &Experiment) -> Result<Option<f64>, ConfigError> {
        let stated = experiment.stated_uncertain()?;
        let each = self.written.iter().flat_map(|(pattern, power)| {
            let own = stated.iter().filter(|number| is_at(&number.name, pattern));
            own.map(|number| {
                let size = if self.is_factor() { number.value.si().abs() } else { 1.0 };
                number.sd / (size * f64::from(power.abs()))
            })
        });
        Ok(each.filter(|sd| sd.is_finite()).max_by(f64::total_cmp))
    }

    /// The same, which the model of both in one depends on under this name.
    #[must_use]
    pub const fn in_whole(self, name: &'static str) -> Self {
        Self { in_whole: Some(name), ..self }
    }
}

/// Whether a key is one of those that a pattern stands for, in which `*` is any name.
pub(crate) fn is_at(key: &str, pattern: &str) -> bool {
    let (key, pattern): (Vec<&str>, Vec<&str>) = (key.split('.').collect(), pattern.split('.').collect());
    key.len() == pattern.len() && key.iter().zip(&pattern).all(|(own, other)| *other == "*" || own == other)
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
        let Some(state) = filter.states.get(parameter.name) else { continue };
        let key = at.clone().child(parameter.name);
        let density = match &state.drift {
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
        let sd = parameter.start_sd(experiment, &key, state)?;
        if filter.method == Method::Bank {
            require_constant(experiment, &key, (parameter, sd, density))?;
        }
        let added = AddedState { scale, drift: Drift::RandomWalk { density } };
        all.push(Tracked { parameter, added, sd });
    }
    Ok(all)
}

/// Refuses a parameter whose models would not be those of a bank: one that drifts, and a factor that may be 0.
fn require_constant(
    experiment: &Experiment,
    key: &Key,
    (parameter, sd, density): (&DeviceParameter, f64, f64),
) -> Result<(), ConfigError> {
    let refuse = |name: &str, why: &str| {
        Err(experiment.error(key.clone().child(name), ConfigFault::Value { why: why.to_owned() }))
    };
    if density > 0.0 {
        return refuse("drift", "of each model of a bank the parameter is a constant; leave it out");
    }
    if parameter.is_factor() && sd >= 1.0 {
        return refuse(
            "start_sd",
            "a parameter that is off by all of itself may be 0; write less than 100 %",
        );
    }
    Ok(())
}
