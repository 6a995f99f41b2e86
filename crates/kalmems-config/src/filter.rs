//! What an experiment file says about one filter.

use super::error::shown;
use super::event::EventUse;
use super::kinds::{Frequency, Time, VoltageVariance};
use super::outliers::{OutlierGate, Update};
use super::process_noise::ProcessNoiseTable;
use super::quantity::Quantity;
use super::readout::ReadoutStates;
use super::sign::Positive;
use super::values::{AnyValue, Values};
use super::{ConfigFault, CrossingUse, Key, Variant};
use crate::inline_schema;
use schemars::{JsonSchema, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::BTreeMap;
use std::fmt;

/// One way of estimating the motion: a method, where it starts, and which states it tracks beside the motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(clippy::struct_excessive_bools)] // keys of a file
pub struct FilterTable {
    /// Its name in tables and pictures. Files are named after it, in lower case.
    pub name: FilterName,
    /// How it estimates.
    #[schemars(example = &"ekf")]
    pub method: Method,
    /// The first mean of each state, or the word `from_signal`, which it is if left out: the filter then starts from the states by which its
    /// first samples are likeliest; where `start_sd` is stated, one of the shared-electrode scanner or of the micro-stage from the
    /// amplitude and phase that the first cycles of the signal show. Not for `lock_in`, which has no start.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub start: Option<FilterStart>,
    /// The first standard deviation of each state, such as `{ angle = "0.15 rad", rate = "15e3 rad/s" }`. Not for
    /// `model` and `lock_in`, which claim none, and not needed with a start from the signal, which finds its own. There it says how far from
    /// rest a state may be, where that is known; of the shared-electrode scanner and the micro-stage how far the first swing may be off.
    #[serde(default, skip_serializing_if = "Values::is_empty")]
    #[schemars(example = start_sd())]
    pub start_sd: Values,
    /// About where the states are, of a device of one's own whose start comes from the signal: where its search begins, and, with
    /// `start_sd`, what is known of them before, such as `{ amplitude = "0.4 mm" }`. At rest where a state is left out.
    #[serde(default, skip_serializing_if = "Values::is_empty")]
    pub start_about: Values,
    /// The power density of the process noise by state; what `[estimate]` says if left out.
    #[serde(default, skip_serializing_if = "ProcessNoiseTable::is_empty")]
    pub process_noise: ProcessNoiseTable,
    /// Parameters of the device that are tracked as states, by their names, such as
    /// `{ stiffness = { start_sd = "1 %", drift = "1e-7 1/s" } }`. One that the device's table states with its uncertainty, such as
    /// `"1.1e-4 N m ± 1 %"`, starts with that where `start_sd` is left out: `{ stiffness = {} }`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub states: BTreeMap<String, TrackedNumber>,
    /// An offset, a scale and lines between the sensor and the recording that are states, such as
    /// `{ offset = { start_sd = "10 mV" }, lines = [{ frequency = "50 Hz", start_sd = "1 mV" }] }`; for a filter of one signal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readout: Option<ReadoutStates>,
    /// Whether the demodulator's two low-pass poles, which the device's readout states, are tracked as two states;
    /// false if left out.
    #[serde(default, skip_serializing_if = "is_false")]
    pub demodulator: bool,
    /// How a filter of a threshold-sensing scanner takes the signal; `full` if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub variant: Option<Variant>,
    /// The variance that a filter of a threshold-sensing scanner, or of a device of one's own, takes a sample of its one signal for; that of
    /// the noise if left out. A larger one leaves the angle to the crossings where the comb's curve is not known well.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1 V^2")]
    pub signal_variance: Option<Quantity<VoltageVariance, Positive>>,
    /// How a filter of a threshold-sensing scanner uses the crossings; not at all if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold: Option<CrossingUse>,
    /// The events of a device of one's own that correct the filter, by their names, each with how it is told of them:
    /// `{ crossing = {} }`; none if left out.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub events: BTreeMap<String, EventUse>,
    /// The electrodes whose signals a filter of the micro-stage takes, by name; all that the recording has if left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<String>,
    /// The same as `known = ["acceleration"]`: what an instrument that is to measure it cannot have. False if left out.
    #[serde(default, skip_serializing_if = "is_false")]
    pub known_acceleration: bool,
    /// States that the filter is given as inputs instead of estimating them, each from the channel of its name in the recording: the mean of
    /// both ends of each interval acts in it. What moves them is left out. For comparison with published results; none if left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub known: Vec<String>,
    /// Over how long the variance of a sample is estimated from the innovations, by recursive least squares that forget;
    /// it is the readout's if left out. For a filter of one signal.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"20 ms")]
    pub noise_memory: Option<Quantity<Time, Positive>>,
    /// How fast the error of the method `luenberger` decays: the corner of a Butterworth pattern of its poles; of a scanner, how fast
    /// the errors of amplitude and phase do.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"2 kHz")]
    pub observer_bandwidth: Option<Quantity<Frequency, Positive>>,
    /// How many steps the filter takes from each sample to the next, from 1 to 1024. If left out they are planned on the first 4096 samples
    /// of each segment, so that what they are off by stays below a fiftieth of the claimed standard deviation. It has no effect on a device
    /// whose step is exact or whose equations have kinks, and on `euler_ekf`.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "few_steps")]
    #[schemars(range(min = 1, max = 1024), example = &2)]
    pub steps: Option<u16>,
    /// Whether there is a smoothed trajectory as well, in which each sample has seen the whole recording; false if
    /// left out.
    #[serde(default, skip_serializing_if = "is_false")]
    pub smooth: bool,
    /// How far a smoothed trajectory may look ahead that could be had while samples arrive; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"64 us")]
    pub smooth_lag: Option<Quantity<Time, Positive>>,
    /// How probable it may be that a sample of a filter that is right is rejected as an outlier, from the settling time on, or `false`
    /// for a filter that takes every sample; 1e-7 if left out, and `false` for the method `euler_ekf`. Where more than an eighth of the samples are rejected for some time,
    /// all are taken again until the filter follows them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gate: Option<OutlierGate>,
    /// Whether a filter that has lost its signal stays as it is and is not started again from the signal. No key of a file: a search for what is wrong
    /// compares filters by their innovations, and asks for it.
    #[serde(skip)]
    pub stays_lost: bool,
    /// How a sample whose innovation is large is weighed; `normal` if left out. With the others the stated variance is that of the
    /// bulk of the noise, of which a part has heavier tails.
    #[serde(default, skip_serializing_if = "Update::is_normal")]
    #[schemars(example = &"huber")]
    pub update: Update,
    /// The degrees of freedom of the update `student_t`, above 2: fewer for heavier tails; 4 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "above_two")]
    #[schemars(extend("exclusiveMinimum" = 2))]
    pub degrees_of_freedom: Option<f64>,
    /// The spread of the sigma points of an unscented method; above 0, 1 if left out.
    ///
    /// With `n` states the points lie at `alpha * sqrt(n + kappa)` standard deviations. The defaults keep all
    /// weights of the mean above 0 for every `n`.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "above_zero")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub alpha: Option<f64>,
    /// What is known of the kurtosis, 2 for a Gaussian; 0 or more, 2 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "not_negative")]
    #[schemars(extend("minimum" = 0))]
    pub beta: Option<f64>,
    /// The second parameter of the spread; 0 or more, 1 if left out.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "not_negative")]
    #[schemars(extend("minimum" = 0))]
    pub kappa: Option<f64>,
}

/// How a filter estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// The model alone, without a measurement.
    Model,
    /// The extended Kalman filter.
    Ekf,
    /// The unscented Kalman filter.
    Ukf,
    /// The extended Kalman filter in square-root form.
    SquareRootEkf,
    /// The unscented Kalman filter in square-root form.
    SquareRootUkf,
    /// The extended Kalman filter that linearises each measurement again where it leads.
    IteratedEkf,
    /// The extended Kalman filter with Euler's method as its process: one step from sample to sample, by the drive at its
    /// start. For the states of the motion alone.
    EulerEkf,
    /// Amplitude and phase of the lines that the motion makes in the signal, cycle by cycle.
    LockIn,
    /// The extended Kalman filter that integrates its differential equation from sample to sample.
    HybridEkf,
    /// One gain for all times: that in which the Kalman filter settles. Of a device that swings it is constant in the frame that
    /// turns with the motion; so are the two below.
    SteadyState,
    /// One gain for all times: that of the continuous Kalman filter, with each sample, or what it says of the error, held until
    /// the next.
    KalmanBucy,
    /// One gain for all times: that which gives the error the poles of `observer_bandwidth`.
    Luenberger,
    /// Each sample by itself, the sensor's law inverted.
    DirectInversion,
    /// The extended Kalman filter that considers the parameters in `states` uncertain and estimates none of them
    /// (Schmidt's).
    ConsiderEkf,
    /// Extended Kalman filters side by side, weighed by their likelihood: each of the parameters in `states` as the device
    /// table has it, and off by its `start_sd` to both sides, in all combinations.
    Bank,
}

impl Method {
    /// The word in the file.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Model => "model",
            Self::Ekf => "ekf",
            Self::Ukf => "ukf",
            Self::SquareRootEkf => "square_root_ekf",
            Self::SquareRootUkf => "square_root_ukf",
            Self::IteratedEkf => "iterated_ekf",
            Self::EulerEkf => "euler_ekf",
            Self::LockIn => "lock_in",
            Self::HybridEkf => "hybrid_ekf",
            Self::SteadyState => "steady_state",
            Self::KalmanBucy => "kalman_bucy",
            Self::Luenberger => "luenberger",
            Self::DirectInversion => "direct_inversion",
            Self::ConsiderEkf => "consider_ekf",
            Self::Bank => "bank",
        }
    }

    /// Whether it draws sigma points.
    pub const fn is_unscented(self) -> bool {
        matches!(self, Self::Ukf | Self::SquareRootUkf)
    }

    /// Whether it has one gain for all times.
    pub const fn has_fixed_gain(self) -> bool {
        matches!(self, Self::SteadyState | Self::KalmanBucy | Self::Luenberger)
    }

    /// Whether it says how uncertain it is.
    pub const fn claims(self) -> bool {
        !matches!(self, Self::Model | Self::LockIn | Self::DirectInversion)
    }
}

/// A parameter of the device that is tracked as a state: how well it is known, and how it wanders.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrackedNumber {
    /// How far it may be off what the device table says: of a factor as a ratio, such as `"1 %"`, of an offset in
    /// its unit. If left out, the uncertainty that the device's table states of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1 %")]
    pub start_sd: Option<AnyValue>,
    /// By how much its variance grows per second; it is a constant if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1e-7 1/s")]
    pub drift: Option<AnyValue>,
}

/// What a readout adds that is tracked as a state: how large it may be, and how it wanders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrackedState {
    /// How large it may be: of a factor as a ratio, such as `"1 %"`, of an offset in its unit.
    #[schemars(example = &"1 %")]
    pub start_sd: AnyValue,
    /// By how much its variance grows per second; it is a constant if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1e-7 1/s")]
    pub drift: Option<AnyValue>,
}

/// Where a filter starts.
#[derive(Clone, Debug, PartialEq)]
pub enum FilterStart {
    /// At these values.
    Values(Values),
    /// At what the first cycles of the signal show.
    FromSignal,
}

/// The word for [`FilterStart::FromSignal`].
const FROM_SIGNAL: &str = "from_signal";

impl Serialize for FilterStart {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Values(values) => values.serialize(serializer),
            Self::FromSignal => serializer.serialize_str(FROM_SIGNAL),
        }
    }
}

impl<'de> Deserialize<'de> for FilterStart {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct FilterStartVisitor;
        impl<'de> Visitor<'de> for FilterStartVisitor {
            type Value = FilterStart;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "a table of values or the word `\"{FROM_SIGNAL}\"`")
            }

            fn visit_str<E: Error>(self, word: &str) -> Result<FilterStart, E> {
                if word == FROM_SIGNAL {
                    return Ok(FilterStart::FromSignal);
                }
                Err(E::custom(format!(
                    "`{}` is not a start; expected a table of values or the word `{FROM_SIGNAL}`",
                    shown(word)
                )))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<FilterStart, A::Error> {
                Values::deserialize(MapAccessDeserializer::new(map)).map(FilterStart::Values)
            }
        }
        deserializer.deserialize_any(FilterStartVisitor)
    }
}

inline_schema!(FilterStart, "Start", |generator| json_schema!({
    "anyOf": [generator.subschema_for::<Values>(), { "const": FROM_SIGNAL }],
    "examples": [{ "angle": "0.05 rad", "rate": "0 rad/s" }],
}));

/// The name of a filter: a few words on one line, with at least one letter or digit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct FilterName(String);

const LONGEST: usize = 40;

impl FilterName {
    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// The name as files have it: lower-case letters and digits with `_` between them.
    pub fn key(&self) -> String {
        let words = self.0.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
        words.collect::<Vec<_>>().join("_").to_ascii_lowercase()
    }
}

impl fmt::Display for FilterName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl From<FilterName> for String {
    fn from(name: FilterName) -> Self {
        name.0
    }
}

impl TryFrom<String> for FilterName {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        let is_short = name.chars().count() <= LONGEST && !name.chars().any(char::is_control);
        let named = Self(name);
        if is_short && !named.key().is_empty() {
            return Ok(named);
        }
        Err(format!(
            "`{}` cannot name a filter; expected up to {LONGEST} characters on one line, at least one of them of a-z \
             or 0-9, such as `EKF with stiffness`",
            shown(&named.0)
        ))
    }
}

inline_schema!(FilterName, "FilterName", |_| json_schema!({
    "type": "string",
    "pattern": "[A-Za-z0-9]",
    "maxLength": LONGEST,
    "examples": ["EKF"],
}));

impl FilterTable {
    /// The states that it is given as inputs, with the key that says so.
    pub fn known_states(&self) -> (&'static str, impl Iterator<Item = &str>) {
        let acceleration = self.known_acceleration.then_some("acceleration");
        let key = if self.known_acceleration { "known_acceleration" } else { "known" };
        (key, self.known.iter().map(String::as_str).chain(acceleration))
    }

    /// The same of the keys about samples that are no samples of the signal.
    fn check_taking(&self, at: &Key) -> Result<(), (Key, ConfigFault)> {
        let word = self.method.word();
        let refuse = |name: &str, why: String| Err((at.clone().child(name), ConfigFault::Value { why }));
        if !self.method.claims() && self.gate.is_some() {
            let why =
                format!("the method `{word}` expects no innovation that could be too large; leave it out");
            return refuse("gate", why);
        }
        let weighs = self.method.claims() && !self.method.has_fixed_gain() && self.method != Method::Bank;
        if !(weighs || self.update.is_normal()) {
            let why = format!("the method `{word}` cannot weigh a sample by its innovation; leave it out");
            return refuse("update", why);
        }
        if !self.update.is_normal() && self.noise_memory.is_some() {
            let why = "the variance of a sample is found by the innovations of normal noise; leave out one of the two";
            return refuse("update", why.to_owned());
        }
        if self.degrees_of_freedom.is_some() && self.update != Update::StudentT {
            let why = format!("the update `{}` has no degrees of freedom; leave it out", self.update.word());
            return refuse("degrees_of_freedom", why);
        }
        Ok(())
    }

    /// Whether it starts from the signal: where it says so, and where it says nothing.
    pub fn starts_from_signal(&self) -> bool {
        !matches!(self.start, Some(FilterStart::Values(_)))
    }

    /// What no single value can be blamed for, for the filter that stands at `at`.
    pub(super) fn check(&self, at: &Key) -> Result<(), (Key, ConfigFault)> {
        let word = self.method.word();
        let refuse = |name: &str, why: String| Err((at.clone().child(name), ConfigFault::Value { why }));
        let missing = |name: &str, remedy: &str| {
            Err((at.clone().child(name), ConfigFault::MissingKey { remedy: remedy.to_owned() }))
        };
        if matches!(self.method, Method::LockIn | Method::DirectInversion) && self.start.is_some() {
            return refuse("start", format!("the method `{word}` has no start; leave it out"));
        }
        if self.method.claims() {
            // A start from the signal may bring its own; the rig says.
            if self.start_sd.is_empty() && !self.starts_from_signal() {
                return missing(
                    "start_sd",
                    "write `start_sd` with a value for each state of the device, which `kalmems help device NAME` lists with an example",
                );
            }
        } else {
            let claims = [
                ("start_sd", !self.start_sd.is_empty()),
                ("process_noise", !self.process_noise.is_empty()),
                ("states", !self.states.is_empty()),
                ("noise_memory", self.noise_memory.is_some()),
                ("smooth", self.smooth),
                ("smooth_lag", self.smooth_lag.is_some()),
            ];
            if let Some((name, _)) = claims.into_iter().find(|(_, given)| *given) {
                let why =
                    format!("the method `{word}` claims no uncertainty and has no use for it; leave it out");
                return refuse(name, why);
            }
        }
        if self.method == Method::EulerEkf {
            let more = [("states", !self.states.is_empty()), ("demodulator", self.demodulator)];
            if let Some((name, _)) = more.into_iter().find(|(_, given)| *given) {
                let why = format!(
                    "the method `{word}` has the states of the motion alone; leave it out, or use `ekf`"
                );
                return refuse(name, why);
            }
        }
        if matches!(self.method, Method::ConsiderEkf | Method::Bank) && self.states.is_empty() {
            let remedy =
                "write which parameters may be off, such as `states = { mass = { start_sd = \"20 %\" } }`";
            return missing("states", remedy);
        }
        if self.method.has_fixed_gain() || matches!(self.method, Method::ConsiderEkf | Method::Bank) {
            let more = [("smooth", self.smooth), ("smooth_lag", self.smooth_lag.is_some())];
            if let Some((name, _)) = more.into_iter().find(|(_, given)| *given) {
                let why =
                    format!("the method `{word}` has no covariances that a smoother could use; leave it out");
                return refuse(name, why);
            }
        }
        let has_no_covariance = self.method.has_fixed_gain() || self.method == Method::Bank;
        if has_no_covariance && self.noise_memory.is_some() {
            let why = format!("the method `{word}` has gains for one variance of a sample; leave it out");
            return refuse("noise_memory", why);
        }
        if self.noise_memory.is_some() && (self.smooth || self.smooth_lag.is_some()) {
            let why =
                "a filter that finds the variance of a sample is not smoothed; leave out one of the two";
            return refuse("noise_memory", why.to_owned());
        }
        match (self.method == Method::Luenberger, self.observer_bandwidth.is_some()) {
            (true, false) => return missing("observer_bandwidth", "write `observer_bandwidth = \"2 kHz\"`"),
            (false, true) => {
                let why = format!("the method `{word}` places no poles; leave it out");
                return refuse("observer_bandwidth", why);
            }
            _ => {}
        }
        if let Some(readout) = &self.readout {
            readout.check(self.method, &at.clone().child("readout"))?;
        }
        self.check_taking(at)?;
        let points = [("alpha", self.alpha), ("beta", self.beta), ("kappa", self.kappa)];
        if let Some((name, _)) = points.into_iter().find(|(_, value)| value.is_some())
            && !self.method.is_unscented()
        {
            return refuse(name, format!("the method `{word}` draws no sigma points; leave it out"));
        }
        Ok(())
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_false(value: &bool) -> bool {
    !*value
}

/// A finite number for which this holds, of which a message says the rest of "is not a finite number".
fn number_where<'de, D: Deserializer<'de>>(
    deserializer: D,
    holds: fn(f64) -> bool,
    wanted: &str,
) -> Result<Option<f64>, D::Error> {
    let number = f64::deserialize(deserializer)?;
    if holds(number) && number.is_finite() {
        Ok(Some(number))
    } else {
        Err(D::Error::custom(format!("`{number}` is not a finite number {wanted}")))
    }
}

pub(super) fn above_zero<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    number_where(deserializer, |number| number > 0.0, "above 0; write one, such as `1`")
}

fn above_two<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    number_where(deserializer, |number| number > 2.0, "above 2; write one, such as `4`")
}

fn few_steps<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u16>, D::Error> {
    let steps = u16::deserialize(deserializer)?;
    if (1..=1024).contains(&steps) {
        Ok(Some(steps))
    } else {
        Err(D::Error::custom("it is a whole number from 1 to 1024; write one, such as `2`"))
    }
}

fn not_negative<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    number_where(deserializer, |number| number >= 0.0, "of 0 or more; write one, such as `1`")
}

fn start_sd() -> serde_json::Value {
    serde_json::json!({ "angle": "0.15 rad", "rate": "15e3 rad/s" })
}

#[cfg(test)]
mod tests {
    use super::FilterName;

    #[test]
    fn a_name_becomes_the_name_of_a_file() {
        for (name, key) in
            [("EKF", "ekf"), ("Model alone", "model_alone"), (" UKF, q = 1e8/2 ", "ukf_q_1e8_2")]
        {
            assert_eq!(FilterName::try_from(name.to_owned()).unwrap().key(), key);
        }
        for bad in ["", " ", "µ", "a\nb", &"x".repeat(41)] {
            assert!(FilterName::try_from(bad.to_owned()).is_err(), "{bad}");
        }
    }
}
