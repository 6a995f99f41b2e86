//! The filters that an experiment file asks for, and where each starts.

use crate::config::{ConfigError, Entry, Estimate, Experiment, Fault, Sign, Values};
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

/// The filters that are wanted.
#[derive(Clone, Debug, Default)]
pub struct Filters {
    /// The model alone.
    pub model: Option<Start>,
    /// The extended Kalman filter.
    pub ekf: Option<Start>,
    /// The unscented Kalman filter, and how it draws its points.
    pub ukf: Option<(Start, SigmaPoints<f64>)>,
}

/// Where a filter starts.
#[derive(Clone, Copy, Debug)]
pub enum Start {
    /// Where the first samples of the signal say that the axes are.
    Signal {
        /// How long those are, in s.
        window_s: f64,
    },
    /// At a given state.
    Given {
        /// The state.
        mean: [f64; 4],
        /// How well it is known.
        covariance: Covariance<f64, 4>,
    },
}

impl Filters {
    /// Reads and checks them.
    pub fn of(experiment: &Experiment, estimate: &Estimate) -> Result<Self, ConfigError> {
        Ok(Self {
            model: (estimate.model.as_ref())
                .map(|m| start(experiment, "estimate.model", (&m.start, None)))
                .transpose()?,
            ekf: (estimate.ekf.as_ref())
                .map(|e| start(experiment, "estimate.ekf", (&e.start, Some(&e.start_sd))))
                .transpose()?,
            ukf: (estimate.ukf.as_ref())
                .map(|u| {
                    let points = SigmaPoints { alpha: u.alpha, beta: u.beta, kappa: u.kappa };
                    start(experiment, "estimate.ukf", (&u.start, Some(&u.start_sd))).map(|s| (s, points))
                })
                .transpose()?,
        })
    }
}

/// `start = { window = "2 ms" }` takes the start from the signal, and `start_sd` with it.
fn start(
    experiment: &Experiment,
    key: &str,
    (mean, sd): (&Values, Option<&Values>),
) -> Result<Start, ConfigError> {
    let (start_key, sd_key) = (format!("{key}.start"), format!("{key}.start_sd"));
    if mean.contains_key("window") {
        let window = Entry::new("window", &kind::TIME, Sign::Positive);
        let [window_s] = experiment.values(start_key.as_str(), mean, [window])?;
        if let Some((name, _)) = sd.and_then(|sd| sd.iter().next()) {
            let why = "a start from the signal brings its own standard deviations; write `start_sd = {}`"
                .to_owned();
            return Err(
                experiment.error(crate::config::Key::from(sd_key.as_str()).child(name), Fault::Value { why })
            );
        }
        return Ok(Start::Signal { window_s });
    }
    let mean = experiment.values(start_key.as_str(), mean, four(Sign::Any))?;
    for (axis, name) in [(0, "x"), (2, "y")] {
        if mean[axis..axis + 2] == [0.0, 0.0] {
            let why = format!(
                "angle and rate of {name} are exactly 0; signal and torque are symmetric there, so that neither a \
                 filter nor the model would ever leave it; start from a small angle, such as `angle_{name} = \
                 \"1e-6 rad\"`, or from the signal, `start = {{ window = \"2 ms\" }}`"
            );
            return Err(experiment.error(start_key.as_str(), Fault::Value { why }));
        }
    }
    let covariance = match sd {
        Some(sd) => Covariance::from_standard_deviations(experiment.values(
            sd_key.as_str(),
            sd,
            four(Sign::Positive),
        )?),
        None => Covariance::zero(),
    };
    Ok(Start::Given { mean, covariance })
}
