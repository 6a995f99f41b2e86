//! What the rig takes from an experiment file, in SI.

use crate::config::{ConfigError, Device, Entry, Estimate, Experiment, Fault, Peak, Sign, Values};
use crate::units::kind;
use kalmems_core::{Covariance, SigmaPoints};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use kalmems_models::readout::DemodulatedComb;

/// Device, noise and filter settings.
#[derive(Clone, Debug)]
pub struct Settings {
    /// How it moves.
    pub scanner: ParametricScanner<f64>,
    /// What is recorded of it.
    pub readout: DemodulatedComb<f64>,
    /// The variance of the recorded signal's noise per sample, in V².
    pub noise_variance: f64,
    /// The density of the angular acceleration's noise, in rad²/s³.
    pub acceleration_density: f64,
    /// How long a filter has to settle before it is scored, in s.
    pub skip_s: f64,
    /// Whether the first angle extreme after the settling time and the drive peak that follows it is a maximum;
    /// `None` leaves the sign as the filter started.
    pub first_peak_positive: Option<bool>,
    /// Where the model alone starts, if it is wanted.
    pub model: Option<[f64; 2]>,
    /// Where the extended Kalman filter starts, if it is wanted.
    pub ekf: Option<Start>,
    /// Where the unscented Kalman filter starts and how it draws its points, if it is wanted.
    pub ukf: Option<(Start, SigmaPoints<f64>)>,
}

/// The device alone.
#[derive(Clone, Copy, Debug)]
pub struct Hardware {
    /// How it moves.
    pub scanner: ParametricScanner<f64>,
    /// What is recorded of it.
    pub readout: DemodulatedComb<f64>,
    /// The variance of the recorded signal's noise per sample, in V².
    pub noise_variance: f64,
}

impl Hardware {
    /// Reads what the file says of the device.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let Device::SharedScanner(device) = &experiment.device else {
            let why = "this rig is for a `[device.shared_scanner]`".to_owned();
            return Err(experiment.error("device", Fault::Value { why }));
        };
        let comb = GaussianComb {
            nominal: device.comb.nominal_capacitance.si(),
            angular_width: device.comb.angular_width.si(),
            bias: device.comb.bias_capacitance.si(),
        };
        let carrier = if device.carrier.included_in_drive { 0.0 } else { device.carrier.amplitude.si() };
        Ok(Self {
            scanner: ParametricScanner {
                resonator: TorsionalResonator {
                    inertia: device.resonator.inertia.si(),
                    damping: device.resonator.damping.si(),
                    stiffness: device.resonator.stiffness.si(),
                },
                comb,
                carrier_mean_square: carrier * carrier / 2.0,
            },
            readout: DemodulatedComb {
                comb,
                gain: device.readout.gain.si(),
                offset: device.readout.offset.si(),
            },
            noise_variance: device.readout.noise_variance.si(),
        })
    }
}

/// A state and how well it is known.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    /// Angle in rad and rate in rad/s.
    pub mean: [f64; 2],
    /// Their covariance.
    pub covariance: Covariance<f64, 2>,
}

const fn states(sign: Sign) -> [Entry; 2] {
    [
        Entry { name: "angle", kind: &kind::ANGLE, sign },
        Entry { name: "rate", kind: &kind::ANGULAR_RATE, sign },
    ]
}

const NOISE: [Entry; 1] = [Entry {
    name: "angular_acceleration",
    kind: &kind::ANGULAR_ACCELERATION_DENSITY,
    sign: Sign::NotNegative,
}];

impl Settings {
    /// Reads and checks what the rig needs.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let Hardware { scanner, readout, noise_variance } = Hardware::of(experiment)?;
        let Some(estimate) = &experiment.estimate else {
            let remedy =
                "add the table `[estimate]` with `skip`, `process_noise` and at least one filter".to_owned();
            return Err(experiment.error("estimate", Fault::MissingKey { remedy }));
        };
        let [acceleration_density] =
            experiment.values("estimate.process_noise", &estimate.process_noise, NOISE)?;
        let start_of = |filter: &str, mean: &Values, sd: &Values| {
            let mean = start(experiment, filter, mean)?;
            let key = format!("estimate.{filter}.start_sd");
            let sd = experiment.values(key.as_str(), sd, states(Sign::Positive))?;
            Ok::<_, ConfigError>(Start { mean, covariance: Covariance::from_standard_deviations(sd) })
        };
        Ok(Self {
            scanner,
            readout,
            noise_variance,
            acceleration_density,
            skip_s: estimate.skip.si(),
            first_peak_positive: estimate.first_peak.map(|peak| peak == Peak::Positive),
            model: estimate.model.as_ref().map(|m| start(experiment, "model", &m.start)).transpose()?,
            ekf: estimate.ekf.as_ref().map(|e| start_of("ekf", &e.start, &e.start_sd)).transpose()?,
            ukf: (estimate.ukf.as_ref())
                .map(|u| {
                    let points = SigmaPoints { alpha: u.alpha, beta: u.beta, kappa: u.kappa };
                    start_of("ukf", &u.start, &u.start_sd).map(|start| (start, points))
                })
                .transpose()?,
        })
    }
}

/// The density of the angular acceleration's noise in rad²/s³, where the file describes filters.
pub fn acceleration_density(experiment: &Experiment) -> Result<Option<f64>, ConfigError> {
    let read = |estimate: &Estimate| {
        experiment.values("estimate.process_noise", &estimate.process_noise, NOISE).map(|[density]| density)
    };
    experiment.estimate.as_ref().map(read).transpose()
}

/// The start of one filter.
fn start(experiment: &Experiment, filter: &str, values: &Values) -> Result<[f64; 2], ConfigError> {
    state_at(experiment, &format!("estimate.{filter}.start"), values)
}

/// A state to start from; refused at exactly zero.
pub fn state_at(experiment: &Experiment, key: &str, values: &Values) -> Result<[f64; 2], ConfigError> {
    let mean = experiment.values(key, values, states(Sign::Any))?;
    if mean == [0.0, 0.0] {
        let why = "angle and rate are exactly 0; signal and torque are symmetric there, so that neither a filter \
                   nor the model would ever leave it; start from a small angle, such as `angle = \"1e-6 rad\"`"
            .to_owned();
        return Err(experiment.error(key, Fault::Value { why }));
    }
    Ok(mean)
}
