//! What the rig takes from the tables of filters, in SI.

use super::settings::{Hardware, state_at, states};
use crate::config::{
    ConfigError, Entry, Estimate, Experiment, Fault, Filter, Key, Method, Quantity, Sign, Start,
    TrackedState, Values,
};
use crate::estimate::StateName;
use crate::units::{Kind, kind};
use kalmems_core::SigmaPoints;
use kalmems_core::augmentation::{AddedState, Drift};

/// What a filter of one axis or two has.
#[derive(Clone, Debug)]
pub struct FilterBasics {
    /// Its name in files.
    pub key: String,
    /// Its name for people.
    pub name: String,
    /// How it estimates.
    pub method: Method,
    /// The parameters that are states, in the order in which the rig lists them.
    pub tracked: Vec<Tracked>,
    /// How sigma points are spread.
    pub points: SigmaPoints<f64>,
    /// Whether it is smoothed over the whole recording.
    pub smooth: bool,
    /// How far a smoother with a fixed lag looks ahead, in s, where one is wanted.
    pub lag_s: Option<f64>,
}

/// One filter of one axis.
#[derive(Clone, Debug)]
pub struct FilterSettings {
    /// What every filter has.
    pub basics: FilterBasics,
    /// Angle in rad and rate in rad/s to start from; `None` starts from the signal.
    pub start: Option<[f64; 2]>,
    /// Their standard deviations, 0 for what claims none.
    pub start_sd: [f64; 2],
    /// The standard deviation of each low-pass stage's first voltage, where the stages are states.
    pub demodulator_sd: Option<f64>,
    /// The density of the angular acceleration's noise, in rad²/s³.
    pub acceleration_density: f64,
}

/// A parameter that is a state.
#[derive(Clone, Copy, Debug)]
pub struct Tracked {
    /// Which.
    pub parameter: &'static Parameter,
    /// Its scale and drift.
    pub added: AddedState<f64>,
    /// Its first standard deviation.
    pub sd: f64,
}

/// A parameter of the device that can be a state. As one it is the deviation from what the device table says: of a
/// factor relative to it, of an offset in V.
#[derive(Debug)]
pub struct Parameter {
    /// Its name in the experiment file and in trajectories.
    pub name: &'static str,
    /// Its name in the model of the motion, if it is there.
    pub in_motion: Option<&'static str>,
    /// Its name in the model of the readout.
    pub in_readout: Option<&'static str>,
    /// Its name in the model of both with the demodulator's stages, where there is one.
    pub in_stages: Option<&'static str>,
    /// What its deviation is.
    pub kind: &'static Kind,
    /// The unit of that in column names.
    pub unit: &'static str,
    /// What its drift is.
    pub drift: &'static Kind,
}

impl Parameter {
    /// A factor of the motion, by its name there.
    pub const fn of_motion(
        name: &'static str,
        in_motion: &'static str,
        in_stages: Option<&'static str>,
    ) -> Self {
        let (kind, drift) = (&kind::RATIO, &kind::RATIO_DRIFT);
        Self { name, in_motion: Some(in_motion), in_readout: None, in_stages, kind, unit: "1", drift }
    }

    /// The readout's gain.
    pub const GAIN: Self = {
        let (in_readout, kind, drift) = (Some("gain"), &kind::RATIO, &kind::RATIO_DRIFT);
        Self { name: "gain", in_motion: None, in_readout, in_stages: in_readout, kind, unit: "1", drift }
    };

    /// The readout's offset.
    pub const OFFSET: Self = {
        let (in_readout, kind, drift) = (Some("offset"), &kind::VOLTAGE, &kind::VOLTAGE_DRIFT);
        Self { name: "offset", in_motion: None, in_readout, in_stages: in_readout, kind, unit: "V", drift }
    };
}

/// All of them, for one axis.
static PARAMETERS: [Parameter; 5] = [
    Parameter::of_motion(
        "stiffness",
        "scanner.resonator.stiffness",
        Some("device.scanner.resonator.stiffness"),
    ),
    Parameter::of_motion("damping", "scanner.resonator.damping", Some("device.scanner.resonator.damping")),
    Parameter::of_motion("drive_gain", "drive_gain", Some("device.drive_gain")),
    Parameter::GAIN,
    Parameter::OFFSET,
];

/// What a deviation of 1 adds to each of them.
fn scales(hardware: &Hardware) -> [f64; 5] {
    let resonator = &hardware.scanner.resonator;
    [resonator.stiffness, resonator.damping, 1.0, hardware.readout.gain, 1.0]
}

/// The states of the motion and of the demodulator, as trajectories name them.
const MOTION: [StateName; 4] = [
    ("angle", "rad", &kind::ANGLE),
    ("rate", "rad_per_s", &kind::ANGULAR_RATE),
    ("stage_1", "V", &kind::VOLTAGE),
    ("stage_2", "V", &kind::VOLTAGE),
];

const NOISE: [Entry; 1] =
    [Entry::new("angular_acceleration", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative)];

impl FilterBasics {
    /// Reads and checks them; a deviation of 1 of each of the rig's parameters adds its scale.
    pub fn of(
        experiment: &Experiment,
        at: &Key,
        filter: &Filter,
        parameters: (&'static [Parameter], &[f64]),
    ) -> Result<Self, ConfigError> {
        Ok(Self {
            key: filter.name.key(),
            name: filter.name.to_string(),
            method: filter.method,
            tracked: tracked(experiment, at, filter, parameters)?,
            points: SigmaPoints {
                alpha: filter.alpha.unwrap_or(1.0),
                beta: filter.beta.unwrap_or(2.0),
                kappa: filter.kappa.unwrap_or(1.0),
            },
            smooth: filter.smooth,
            lag_s: filter.smooth_lag.as_ref().map(Quantity::si),
        })
    }

    /// The names of its `N` states, the parameters behind those of the motion.
    pub fn states<const N: usize>(&self, motion: &[StateName]) -> [StateName; N] {
        let parameters = self
            .tracked
            .iter()
            .map(|Tracked { parameter, .. }| (parameter.name, parameter.unit, parameter.kind));
        let mut all = motion.iter().copied().chain(parameters);
        std::array::from_fn(|_| all.next().unwrap_or(("", "1", &kind::RATIO)))
    }
}

/// Where the file has a filter's process noise, its own or that of all, and what it says.
pub fn process_noise<'a>(estimate: &'a Estimate, at: &Key, filter: &'a Filter) -> (Key, &'a Values) {
    if filter.process_noise.is_empty() {
        (Key::from("estimate.process_noise"), &estimate.process_noise)
    } else {
        (at.clone().child("process_noise"), &filter.process_noise)
    }
}

impl FilterSettings {
    /// Reads and checks the filter at this place of the file.
    pub fn of(
        experiment: &Experiment,
        estimate: &Estimate,
        hardware: &Hardware,
        index: usize,
    ) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        if filter.method == Method::DirectInversion {
            let why = "the signal of a scanner is even in the angle and cannot be inverted; write `ekf`, `ukf`, \
                       `lock_in` or `model`";
            return Err(experiment.error(at.child("method"), Fault::Value { why: why.to_owned() }));
        }
        let start = match &filter.start {
            Some(Start::Values(values)) => Some(state_at(experiment, at.clone().child("start"), values)?),
            Some(Start::FromSignal) | None => None,
        };
        if filter.demodulator && hardware.poles.is_none() {
            let why = "the device's readout states no `poles`; add them, such as `poles = [\"31.35 kHz\", \
                       \"31.35 kHz\"]`, or leave `demodulator` out";
            return Err(experiment.error(at.child("demodulator"), Fault::Value { why: why.to_owned() }));
        }
        let (start_sd, demodulator_sd) = deviations(experiment, &at, filter)?;
        let (noise_key, noise) = process_noise(estimate, &at, filter);
        // The lock-in has no process; every other one has this noise, or for the model alone none.
        let [acceleration_density] =
            if filter.method.claims() { experiment.values(noise_key, noise, NOISE)? } else { [0.0] };
        let basics = FilterBasics::of(experiment, &at, filter, (&PARAMETERS, &scales(hardware)))?;
        Ok(Self { basics, start, start_sd, demodulator_sd, acceleration_density })
    }

    /// The names of its `N` states.
    pub fn states<const N: usize>(&self) -> [StateName; N] {
        self.basics.states(&MOTION[..if self.demodulator_sd.is_some() { 4 } else { 2 }])
    }
}

/// The standard deviations of the motion, and of the demodulator where it is a state.
fn deviations(
    experiment: &Experiment,
    at: &Key,
    filter: &Filter,
) -> Result<([f64; 2], Option<f64>), ConfigError> {
    let key = at.clone().child("start_sd");
    let [angle, rate] = states(Sign::Positive);
    if !filter.method.claims() {
        return Ok(([0.0; 2], filter.demodulator.then_some(0.0)));
    }
    if filter.demodulator {
        let stages = Entry::new("demodulator", &kind::VOLTAGE, Sign::Positive);
        let [angle, rate, volts] = experiment.values(key, &filter.start_sd, [angle, rate, stages])?;
        return Ok(([angle, rate], Some(volts)));
    }
    Ok((experiment.values(key, &filter.start_sd, [angle, rate])?, None))
}

/// The parameters that are states.
fn tracked(
    experiment: &Experiment,
    at: &Key,
    filter: &Filter,
    (parameters, scales): (&'static [Parameter], &[f64]),
) -> Result<Vec<Tracked>, ConfigError> {
    let at = at.clone().child("states");
    let known = || parameters.iter().map(|parameter| parameter.name);
    if let Some(name) = filter.states.keys().find(|name| known().all(|known| known != name.as_str())) {
        return Err(experiment.error(at.child(name), Fault::unknown_key(name, known())));
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
            return Err(experiment.error(key, Fault::Value { why }));
        }
        let added = AddedState { scale, drift: Drift::RandomWalk { density } };
        all.push(Tracked { parameter, added, sd });
    }
    Ok(all)
}
