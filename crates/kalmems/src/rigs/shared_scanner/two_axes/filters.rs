//! The filters that an experiment file asks for, and where each starts.

use crate::config::{self, ConfigError, Entry, Estimate, Experiment, Fault, Filter, Key, Method, Sign};
use crate::units::{Kind, kind};
use kalmems_core::{Covariance, SigmaPoints};

/// The states: name, unit in column names, kind.
pub const STATES: [(&str, &str, &Kind); 4] = [
    ("angle_x", "rad", &kind::ANGLE),
    ("rate_x", "rad_per_s", &kind::ANGULAR_RATE),
    ("angle_y", "rad", &kind::ANGLE),
    ("rate_y", "rad_per_s", &kind::ANGULAR_RATE),
];

/// The states as entries of a table of values.
pub fn four(sign: Sign) -> [Entry; 4] {
    STATES.map(|(name, _, kind)| Entry { name, kind, sign })
}

/// One filter.
#[derive(Clone, Debug)]
pub struct FilterSettings {
    /// Its name in files.
    pub key: String,
    /// Its name for people.
    pub name: String,
    /// How it estimates.
    pub method: Method,
    /// Where it starts.
    pub start: Start,
    /// The densities of the angular accelerations' noise of x and y, in rad²/s³.
    pub acceleration_density: [f64; 2],
    /// How sigma points are spread.
    pub points: SigmaPoints<f64>,
}

/// Where a filter starts.
#[derive(Clone, Copy, Debug)]
pub enum Start {
    /// Where the first samples of the signal say that the axes are.
    Signal,
    /// At a given state.
    Given {
        /// The state.
        mean: [f64; 4],
        /// How well it is known.
        covariance: Covariance<f64, 4>,
    },
}

const NOISE: [Entry; 2] = [
    Entry::new("angular_acceleration_x", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative),
    Entry::new("angular_acceleration_y", &kind::ANGULAR_ACCELERATION_DENSITY, Sign::NotNegative),
];

impl FilterSettings {
    /// Reads and checks the filter at this place of the file.
    pub fn of(experiment: &Experiment, estimate: &Estimate, index: usize) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        let refuse = |name: &str, why: &str| {
            Err(experiment.error(at.clone().child(name), Fault::Value { why: why.to_owned() }))
        };
        if filter.method.is_literal() || matches!(filter.method, Method::LockIn | Method::SquareRootUkf) {
            return refuse("method", "this method is for one axis; with two write `ekf`, `ukf` or `model`");
        }
        let more = [
            ("states", !filter.states.is_empty()),
            ("demodulator", filter.demodulator),
            ("smooth", filter.smooth),
            ("smooth_lag", filter.smooth_lag.is_some()),
        ];
        if let Some((name, _)) = more.into_iter().find(|(_, given)| *given) {
            return refuse(name, "with two axes a filter tracks both motions alone, online; leave it out");
        }
        let (noise_key, noise) = if filter.process_noise.is_empty() {
            (Key::from("estimate.process_noise"), &estimate.process_noise)
        } else {
            (at.clone().child("process_noise"), &filter.process_noise)
        };
        Ok(Self {
            key: filter.name.key(),
            name: filter.name.to_string(),
            method: filter.method,
            start: start(experiment, &at, filter)?,
            acceleration_density: experiment.values(noise_key, noise, NOISE)?,
            points: SigmaPoints {
                alpha: filter.alpha.unwrap_or(1.0),
                beta: filter.beta.unwrap_or(2.0),
                kappa: filter.kappa.unwrap_or(1.0),
            },
        })
    }
}

/// A start from the signal brings its own standard deviations.
fn start(experiment: &Experiment, at: &Key, filter: &Filter) -> Result<Start, ConfigError> {
    let (start_key, sd_key) = (at.clone().child("start"), at.clone().child("start_sd"));
    let Some(config::Start::Values(values)) = &filter.start else {
        if let Some((name, _)) = filter.start_sd.iter().next() {
            let why = "a start from the signal brings its own standard deviations; leave `start_sd` out";
            return Err(experiment.error(sd_key.child(name), Fault::Value { why: why.to_owned() }));
        }
        return Ok(Start::Signal);
    };
    let mean = experiment.values(start_key.clone(), values, four(Sign::Any))?;
    for (axis, name) in [(0, "x"), (2, "y")] {
        if mean[axis..axis + 2] == [0.0, 0.0] {
            let why = format!(
                "angle and rate of {name} are exactly 0; signal and torque are symmetric there, so that neither a \
                 filter nor the model would ever leave it; start from a small angle, such as `angle_{name} = \
                 \"1e-6 rad\"`, or from the signal, `start = \"from_signal\"`"
            );
            return Err(experiment.error(start_key, Fault::Value { why }));
        }
    }
    let covariance = if filter.method.claims() {
        let sd = experiment.values(sd_key, &filter.start_sd, four(Sign::Positive))?;
        Covariance::from_standard_deviations(sd)
    } else {
        Covariance::zero()
    };
    Ok(Start::Given { mean, covariance })
}
