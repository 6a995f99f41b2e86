//! What the rig takes from the tables of filters, in SI.

use super::hardware::Hardware;
use super::settings::{state_at, states};
use crate::config::{
    Applied, ConfigError, Entry, Estimate, Experiment, Fault, Filter, Key, Method, Quantity, Sign, Start,
    Timing, TrackedState, Variant,
};
use crate::estimate::StateName;
use crate::units::{Kind, kind};
use kalmems_core::augmentation::{AddedState, Drift};

/// One filter.
#[derive(Clone, Debug)]
pub struct FilterSettings {
    /// Its name in files.
    pub key: String,
    /// Its name for people.
    pub name: String,
    /// Whether it is the model alone, and no filter.
    pub is_model: bool,
    /// How it takes the signal.
    pub variant: Variant,
    /// The variance of a sample that it reckons with, in V².
    pub signal_variance: f64,
    /// How it uses the crossings, if it does.
    pub threshold: Option<ThresholdSettings>,
    /// Angle in rad and rate in rad/s to start from.
    pub start: [f64; 2],
    /// Their standard deviations, 0 for the model alone.
    pub start_sd: [f64; 2],
    /// The density of the angular acceleration's noise, in rad²/s³.
    pub acceleration_density: f64,
    /// The parameters that are states, in the order of [`PARAMETERS`].
    pub tracked: Vec<Tracked>,
    /// Whether it is smoothed over the whole recording.
    pub smooth: bool,
    /// How far a smoother with a fixed lag looks ahead, in s, where one is wanted.
    pub lag_s: Option<f64>,
}

/// How a filter uses the crossings.
#[derive(Clone, Copy, Debug)]
pub struct ThresholdSettings {
    /// Where in time a crossing lies.
    pub timing: Timing,
    /// When the filter is told.
    pub applied: Applied,
    /// How long after a crossing it is told late, in s; `None` for as long as the detector takes.
    pub lag_s: Option<f64>,
    /// The angle in rad.
    pub angle: f64,
    /// Its standard deviation in rad; `None` takes that which follows from the crossing's time.
    pub angle_sd: Option<f64>,
    /// The largest normalised innovation squared that is believed.
    pub gate_nis: f64,
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
    /// Its name in the model of the readout, if it is there.
    pub in_readout: Option<&'static str>,
    /// What its deviation is.
    pub kind: &'static Kind,
    /// The unit of that in column names.
    pub unit: &'static str,
    /// What its drift is.
    pub drift: &'static Kind,
    /// Its value as the device table has it, which a deviation of 1 adds.
    pub scale: fn(&Hardware) -> f64,
}

const fn factor(
    name: &'static str,
    in_motion: Option<&'static str>,
    in_readout: Option<&'static str>,
    scale: fn(&Hardware) -> f64,
) -> Parameter {
    let (kind, drift) = (&kind::RATIO, &kind::RATIO_DRIFT);
    Parameter { name, in_motion, in_readout, kind, unit: "1", drift, scale }
}

/// The name of the capacitance that the drive reaches the signal through.
pub const FEEDTHROUGH: &str = "feedthrough";

/// All of them.
pub static PARAMETERS: [Parameter; 4] = [
    factor("gain", None, Some("comb.gain"), |hardware| hardware.readout.comb.gain),
    Parameter {
        name: "offset",
        in_motion: None,
        in_readout: Some("offset"),
        kind: &kind::VOLTAGE,
        unit: "V",
        drift: &kind::VOLTAGE_DRIFT,
        scale: |_| 1.0,
    },
    factor("natural_frequency", Some("resonator.natural_rate"), None, |hardware| {
        hardware.mirror.resonator.natural_rate
    }),
    factor(FEEDTHROUGH, None, None, |hardware| hardware.feedthrough),
];

/// The states of the motion, as trajectories name them.
const MOTION: [StateName; 2] = [("angle", "rad", &kind::ANGLE), ("rate", "rad_per_s", &kind::ANGULAR_RATE)];

const NOISE: [Entry; 1] =
    [Entry::new("angular_acceleration", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative)];

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
        let refuse = |name: &str, why: &str| {
            Err(experiment.error(at.clone().child(name), Fault::Value { why: why.to_owned() }))
        };
        let is_model = filter.method == Method::Model;
        if !is_model && filter.method != Method::Ekf {
            return refuse("method", "this device has the methods `ekf` and `model`; write one of them");
        }
        if filter.demodulator {
            return refuse("demodulator", "this device has no demodulator; leave it out");
        }
        let Some(Start::Values(start)) = &filter.start else {
            return refuse(
                "start",
                "expected values, such as `{ angle = \"-0.1 rad\", rate = \"400 rad/s\" }`",
            );
        };
        let variant = filter.variant.unwrap_or_default();
        if is_model
            && (filter.variant.is_some() || filter.threshold.is_some() || filter.signal_variance.is_some())
        {
            return refuse(
                "method",
                "the model alone takes no notice of the signal; leave `variant`, `signal_variance` and `threshold` out",
            );
        }
        if let Some(threshold) = &filter.threshold
            && threshold.lag.is_some()
            && threshold.applied == Applied::InPlace
        {
            let why =
                "a filter that is told in place has no lag; leave it out, or write `applied = \"late\"`";
            let key = at.clone().child("threshold").child("lag");
            return Err(experiment.error(key, Fault::Value { why: why.to_owned() }));
        }
        if variant == Variant::Literal && !filter.states.is_empty() {
            return refuse("states", "the variant `literal` has the published states alone; leave it out");
        }
        if variant == Variant::TimingOnly && filter.threshold.is_none() {
            return refuse(
                "variant",
                "`timing_only` uses the crossings alone; add `threshold = { gate = 4 }`",
            );
        }
        let start_sd = if is_model {
            [0.0; 2]
        } else {
            experiment.values(at.clone().child("start_sd"), &filter.start_sd, states(Sign::Positive))?
        };
        let (noise_key, noise) = if filter.process_noise.is_empty() {
            (Key::from("estimate.process_noise"), &estimate.process_noise)
        } else {
            (at.clone().child("process_noise"), &filter.process_noise)
        };
        let [acceleration_density] =
            if is_model { [0.0] } else { experiment.values(noise_key, noise, NOISE)? };
        Ok(Self {
            key: filter.name.key(),
            name: filter.name.to_string(),
            is_model,
            variant,
            signal_variance: filter.signal_variance.as_ref().map_or(hardware.noise_variance, Quantity::si),
            threshold: filter.threshold.as_ref().map(|threshold| ThresholdSettings {
                timing: threshold.timing,
                applied: threshold.applied,
                lag_s: threshold.lag.as_ref().map(Quantity::si),
                angle: threshold.angle.as_ref().map_or(hardware.readout.comb.centre, Quantity::si),
                angle_sd: threshold.angle_sd.as_ref().map(Quantity::si),
                gate_nis: threshold.gate.map_or(f64::INFINITY, |sds| sds * sds),
            }),
            start: state_at(experiment, at.clone().child("start"), start)?,
            start_sd,
            acceleration_density,
            tracked: tracked(experiment, &at, filter, hardware)?,
            smooth: filter.smooth,
            lag_s: filter.smooth_lag.as_ref().map(Quantity::si),
        })
    }

    /// The names of its `N` states.
    pub fn states<const N: usize>(&self) -> [StateName; N] {
        std::array::from_fn(|i| match self.tracked.get(i.wrapping_sub(MOTION.len())) {
            Some(Tracked { parameter, .. }) => (parameter.name, parameter.unit, parameter.kind),
            None => MOTION[i.min(MOTION.len() - 1)],
        })
    }

    /// The first mean and standard deviation of each of its `N` states.
    pub fn start<const N: usize>(&self) -> ([f64; N], [f64; N]) {
        let motion = self.start.into_iter().zip(self.start_sd);
        let mut all = motion.chain(self.tracked.iter().map(|tracked| (0.0, tracked.sd)));
        let states: [(f64, f64); N] = std::array::from_fn(|_| all.next().unwrap_or((0.0, 0.0)));
        (states.map(|(mean, _)| mean), states.map(|(_, sd)| sd))
    }
}

/// The parameters that are states.
fn tracked(
    experiment: &Experiment,
    at: &Key,
    filter: &Filter,
    hardware: &Hardware,
) -> Result<Vec<Tracked>, ConfigError> {
    let at = at.clone().child("states");
    let known = || PARAMETERS.iter().map(|parameter| parameter.name);
    if let Some(name) = filter.states.keys().find(|name| known().all(|known| known != name.as_str())) {
        return Err(experiment.error(at.child(name), Fault::unknown_key(name, known())));
    }
    let mut all = Vec::new();
    for parameter in &PARAMETERS {
        let Some(TrackedState { start_sd, drift }) = filter.states.get(parameter.name) else { continue };
        let key = at.clone().child(parameter.name);
        let sd = experiment.value(key.clone().child("start_sd"), start_sd, parameter.kind, Sign::Positive)?;
        let density = match drift {
            Some(drift) => {
                experiment.value(key.clone().child("drift"), drift, parameter.drift, Sign::NotNegative)?
            }
            None => 0.0,
        };
        let scale = (parameter.scale)(hardware);
        if scale == 0.0 {
            let name = parameter.name;
            let why = format!(
                "the device's {name} is 0, of which no other {name} is a multiple; give the device one above 0"
            );
            return Err(experiment.error(key, Fault::Value { why }));
        }
        all.push(Tracked {
            parameter,
            added: AddedState { scale, drift: Drift::RandomWalk { density } },
            sd,
        });
    }
    Ok(all)
}
