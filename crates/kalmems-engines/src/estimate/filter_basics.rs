//! What the table of a filter says, whatever the device.

use super::gate::{FALSE_REJECTIONS, GateMode, UpdateLaw, largest_nis};
use super::tracked::{DeviceParameter, Tracked, tracked};
use super::{
    AnyFilter, EstimateError, FilterKind, GainOf, MOST_MODELS, MeanAndCovariance, Reacquisition,
    ReadoutState, StateName,
};
use crate::config::{
    ConfigError, ConfigFault, Experiment, FilterTable, Key, Method, OutlierGate, Quantity, Update, Values,
};
use kalmems_core::SigmaPoints;
use std::f64::consts::TAU;

/// What every filter has.
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
    /// The corner of the poles of an observer in rad/s, 0 where none are placed.
    pub observer_rate: f64,
    /// How far a smoother with a fixed lag looks ahead, in s, where one is wanted.
    pub lag_s: Option<f64>,
    /// Which samples it takes, and how.
    pub taking: GateMode,
    /// Whether it stays as it is where it has lost the signal.
    pub stays_lost: bool,
    /// How many steps it takes from one sample to the next, where that is stated.
    pub steps: Option<usize>,
    /// What is between sensor and recording as states, behind all others.
    pub readout: Vec<ReadoutState>,
}

impl FilterBasics {
    /// Reads and checks them; a deviation of 1 of each of the rig's parameters adds its scale.
    pub fn of(
        experiment: &Experiment,
        at: &Key,
        filter: &FilterTable,
        parameters: (&'static [DeviceParameter], &[f64]),
    ) -> Result<Self, ConfigError> {
        if filter.method.has_fixed_gain() && !filter.states.is_empty() {
            let why = "a gain for all times is that of the motion alone, with the device as it is stated; leave it out, or use `ekf`";
            return Err(
                experiment.error(at.clone().child("states"), ConfigFault::Value { why: why.to_owned() })
            );
        }
        let models = 3_usize.saturating_pow(u32::try_from(filter.states.len()).unwrap_or(u32::MAX));
        if filter.method == Method::Bank && models > MOST_MODELS {
            let why =
                format!("these are {models} models; at most {MOST_MODELS}, of three parameters, are built");
            return Err(experiment.error(at.clone().child("states"), ConfigFault::Value { why }));
        }
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
            observer_rate: filter.observer_bandwidth.as_ref().map_or(0.0, |bandwidth| TAU * bandwidth.si()),
            lag_s: filter.smooth_lag.as_ref().map(Quantity::si),
            taking: taking(experiment, filter),
            stays_lost: filter.stays_lost,
            steps: filter.steps.map(usize::from),
            readout: ReadoutState::of(experiment, at, filter)?,
        })
    }

    /// The parameters that are states: none of a bank, each of whose models has them as they are.
    pub fn parameters(&self) -> &[Tracked] {
        if self.method == Method::Bank { &[] } else { &self.tracked }
    }

    /// The gain that it has for all times, where it has one.
    pub fn gain(&self) -> Option<GainOf> {
        match self.method {
            Method::SteadyState => Some(GainOf::Settled),
            Method::KalmanBucy => Some(GainOf::Continuous),
            Method::Luenberger => Some(GainOf::Poles(self.observer_rate)),
            _ => None,
        }
    }

    /// It has no gain.
    pub fn no_gain(&self, why: &dyn std::fmt::Display) -> EstimateError {
        EstimateError::NoGain { filter: self.name.clone(), why: why.to_string() }
    }

    /// The names of its states, the parameters behind those of the motion.
    pub fn states(&self, motion: &[StateName]) -> Vec<StateName> {
        let parameters = self
            .parameters()
            .iter()
            .map(|Tracked { parameter, .. }| (parameter.name, parameter.unit, parameter.kind));
        motion.iter().copied().chain(parameters).collect()
    }

    /// The filter as it begins: with what it knew where another run left it, or with what `start` says.
    pub fn begin(
        &self,
        left: Option<MeanAndCovariance>,
        start: impl FnOnce() -> Result<MeanAndCovariance, EstimateError>,
    ) -> Result<AnyFilter, EstimateError> {
        let known = match left {
            Some(left) => left,
            None => start()?.with(self.readout.iter().map(ReadoutState::first)),
        };
        let states = known.mean.len();
        let (method, points) = (self.method, self.points);
        let kind =
            FilterKind { method, points, considered_from: states.saturating_sub(self.parameters().len()) };
        AnyFilter::of(kind, &known)
            .ok_or_else(|| EstimateError::TooManyStates { filter: self.name.clone(), states })
    }

    /// How it is started again where it has lost the signal of a motion of this frequency in Hz, on a segment that began at this time in s, by so many
    /// rows; `None` of one that is not: without a gate a filter takes each sample as it is told to, an observer forgets where it starts, the models
    /// of a bank are weighed by the same samples, and the model alone is corrected by none.
    pub fn reacquisition(&self, motion_hz: f64, start_s: f64, rows: usize) -> Option<Reacquisition> {
        let starts = !self.stays_lost
            && self.taking.largest_nis.is_some()
            && self.gain().is_none()
            && self.method != Method::Bank
            && self.method.claims();
        let from_s = start_s + self.taking.after_s * (1.0 - 1e-12);
        starts.then_some(Reacquisition { motion_hz, from_s, rows })
    }

    /// How many samples of this interval in s a smoother with a fixed lag looks ahead, where one is wanted.
    pub fn lag_samples(&self, interval_s: f64) -> Option<usize> {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // positive; beyond the segment is its end
        self.lag_s.map(|lag_s| (lag_s / interval_s).round() as usize)
    }
}

/// Which samples a filter takes, and how: one that claims nothing knows no outlier, and what a step by Euler's method claims leaves its own
/// error out, so that a gate has to be asked for.
fn taking(experiment: &Experiment, filter: &FilterTable) -> GateMode {
    let usual = Some(FALSE_REJECTIONS).filter(|_| filter.method != Method::EulerEkf);
    let false_rejections = filter.gate.map_or(usual, OutlierGate::false_rejections);
    let law = match filter.update {
        Update::Normal => UpdateLaw::Normal,
        Update::Huber => UpdateLaw::Huber(HUBER_BOUND),
        Update::StudentT => UpdateLaw::StudentT(filter.degrees_of_freedom.unwrap_or(STUDENT_FREEDOM)),
    };
    GateMode {
        largest_nis: false_rejections.filter(|_| filter.method.claims()).map(largest_nis),
        after_s: experiment.estimate.as_ref().map_or(0.0, |estimate| estimate.skip.si()),
        law,
    }
}

/// Where Huber's law leaves the normal one, in standard deviations: of normal noise its estimate is then 1/0.95 as uncertain in its variance as
/// the best one (Huber, Ann. Math. Statist. 35, 73, 1964).
const HUBER_BOUND: f64 = 1.345;

/// The degrees of freedom of Student's t, where the file does not say: between a distribution without a fourth moment and a normal one.
const STUDENT_FREEDOM: f64 = 4.0;

/// Refuses a demodulator's states in a filter of a device that has none; `why` also says what to do.
///
/// # Errors
/// Where the filter at this place of the file asks for them.
pub fn refuse_demodulator(
    experiment: &Experiment,
    (at, filter): (&Key, &FilterTable),
    why: &str,
) -> Result<(), ConfigError> {
    if !filter.demodulator {
        return Ok(());
    }
    let fault = ConfigFault::Value { why: why.to_owned() };
    Err(experiment.error(at.clone().child("demodulator"), fault))
}

/// Where the file has a filter's process noise, its own or that of all, and what it says.
///
/// # Errors
/// A density that is left to the recording, which is found before a filter is made.
pub fn process_noise<'a>(
    experiment: &'a Experiment,
    at: &Key,
    filter: &'a FilterTable,
) -> Result<(Key, &'a Values), ConfigError> {
    let shared = || experiment.estimate.as_ref().map(|estimate| &estimate.process_noise);
    let (key, table) = match shared() {
        Some(shared) if filter.process_noise.is_empty() => (Key::from("estimate.process_noise"), shared),
        _ => (at.clone().child("process_noise"), &filter.process_noise),
    };
    match table.known() {
        Ok(values) => Ok((key, values)),
        Err((name, fault)) => {
            Err(experiment.error(if name.is_empty() { key } else { key.child(name) }, fault))
        }
    }
}
