//! What is wanted: a filter as plain data.

use super::error::EmitError;
use crate::device::Device;
use crate::motion::MOST_STATES;

/// Words that cannot be the name of a module or of its file.
const RESERVED: [&str; 43] = [
    "as", "async", "await", "break", "const", "continue", "crate", "dyn", "else", "enum", "extern", "false",
    "fn", "for", "gen", "if", "impl", "in", "let", "loop", "main", "match", "mod", "move", "mut", "pub",
    "ref", "return", "self", "static", "struct", "super", "trait", "true", "try", "type", "unsafe", "use",
    "where", "while", "yield", "abstract", "std",
];

/// The language of the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmitLanguage {
    /// C99 with `math.h` where a device needs it.
    C,
    /// Rust without `std` and without any crate.
    Rust,
}

/// How a step is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepMethod {
    /// Euler's method: x′ = x + T·f(x, u), with the inputs at the start of the interval.
    Euler,
    /// The classical method of Runge and Kutta, with the inputs at the start, the middle and the end of the interval.
    RungeKutta,
}

/// The start of one of the device's states.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateStart {
    /// Its mean at the start in SI.
    pub mean: f64,
    /// The value in SI that the filter counts from, 0 for most states.
    ///
    /// A state that stays near a value other than 0, such as a distance or a frequency, keeps more digits where it is counted
    /// from that value. 0 for a cyclic state.
    pub origin: f64,
    /// A typical distance from the origin in SI; from the start and its standard deviation where `None`.
    pub typical: Option<f64>,
}

impl StateStart {
    /// A state that starts at this mean in SI and is counted from 0.
    pub fn at(mean: f64) -> Self {
        Self { mean, origin: 0.0, typical: None }
    }
}

/// A parameter that is a state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FreeParameter {
    /// Its place among the device's parameters.
    pub parameter: usize,
    /// Its mean at the start in SI, which it is counted from.
    pub start: f64,
    /// The unit in which it is counted in SI, such as its standard deviation at the start.
    pub scale: f64,
    /// The variance in SI² by which it walks in one interval.
    pub walk: f64,
}

/// A measurement that corrects the filter at each sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitMeasure {
    /// Its place among the device's measurements.
    pub measure: usize,
    /// The variance of one sample in its unit².
    pub variance: f64,
    /// The lowest and the highest value that the instrument shows, in SI: a sample at them or beyond is a gap.
    pub range: Option<[f64; 2]>,
}

/// An event that corrects the filter when its caller says how long before the sample it happened: its expression was zero then.
///
/// The expression is taken back along the motion by the first three terms of its series in time, inputs held as at the sample: what is
/// left out of a motion at ω is (ω·t)⁴/24 of its size, so that events are for times of a sample or a few.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitEvent {
    /// Its place among the device's events.
    pub event: usize,
    /// The variance of its expression in its unit².
    pub variance: f64,
}

/// Where the gain comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum EmitGain {
    /// From the covariance, which is carried along.
    Covariance,
    /// It has settled, for each measurement of the request.
    ///
    /// The corrections follow one another, so that the gain of a measurement is that behind the ones before it.
    Settled(Vec<SettledGain>),
}

/// A gain that has settled.
#[derive(Clone, Debug, PartialEq)]
pub struct SettledGain {
    /// What a measurement's innovation adds to each state, in SI.
    pub gain: Vec<f64>,
    /// The variance of that innovation, in the measurement's unit².
    pub variance: f64,
}

/// How the innovations of each measurement are watched.
///
/// A sample is rejected whose normalised innovation squared is above a bound, which grows with the median of those that were taken; where more than an
/// eighth of the last samples are beyond it, all are taken until less than a sixteenth are: as by the gate of an estimate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmitWatch {
    /// The largest normalised innovation squared of a sample that is one of the signal.
    pub largest_nis: f64,
    /// Whether a sample beyond the bound is left out. Without that it is counted alone.
    pub rejects: bool,
    /// Samples from the start on of which none is left out.
    pub settling: u32,
    /// How many samples the share of those beyond the bound and the mean of the normalised innovation squared go back. For an eighth of them a filter is
    /// lost before it begins again as at its start.
    pub memory: u32,
}

impl EmitWatch {
    /// Nothing is left out, and the filter never begins again.
    pub const COUNTS: Self = Self { largest_nis: 28.0, rejects: false, settling: 0, memory: 64 };
}

/// How many digits the source computes with. Functions such as `exp`, inputs and measurements always have 32 bits.
///
/// A sum or a product of 64 bits is a call of a library where a processor has none of its own, such as a Cortex-M4F.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EmitDigits {
    /// Numbers of 32 bits throughout.
    Single,
    /// The means, the rates and what is expected of a measurement have 64 bits; covariance and gain have 32.
    DoubleMean,
    /// Means, covariance and all that leads to them have 64 bits.
    Double,
    /// The first of the others with which the filter, rehearsed, comes within 10⁻⁵ of the states that are expected, relative to the largest value of
    /// each state, and within 0.02 of their claimed standard deviation; the nearest one where none does.
    AsNeeded,
}

/// One sample of a test, in SI.
#[derive(Clone, Debug, PartialEq)]
pub struct TestSample {
    /// The inputs at the start, the middle and the end of the interval before the sample. Euler's method takes the first; what
    /// measurements depend on is the last, as the input is at the sample.
    pub inputs: [Vec<f64>; 3],
    /// The measurements in the order of the request.
    pub measured: Vec<f64>,
    /// How long before the sample each event of the request happened, in s; `None` where it did not in the interval.
    pub events: Vec<Option<f64>>,
    /// The states that are expected behind the sample: predicted, corrected by the events and then by the measurements.
    pub expected: Vec<f64>,
    /// The standard deviations that the library's filter claims of them; none where they are not known.
    pub expected_sd: Vec<f64>,
}

/// How an input goes within the interval before a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InputCourse {
    /// Through its values at the start, the middle and the end.
    Between,
    /// It stays as it was at the start; at the end it is another one, of which the measurements tell.
    HeldAtStart,
    /// It stays at what is given for the middle; the measurements tell of that at the end.
    HeldAtMiddle,
}

/// Samples with the states that are expected, with which the source tests itself.
#[derive(Clone, Debug, PartialEq)]
pub struct TestVectors {
    /// The samples from the start on.
    pub samples: Vec<TestSample>,
    /// The largest difference from what is expected, relative to the largest expected size of each state.
    pub tolerance: f64,
}

/// A Kalman filter of a device that is wanted as source code.
///
/// The state vector is x = [states of the device, `free`]. All numbers are in SI; the filter computes in units of its own.
///
/// With f the rates, h a measurement and T the interval, each sample takes a step x⁻ = x + ∫f dt, P⁻ = F·P·Fᵀ + Q, and for each
/// measurement k = P⁻·hᵀ/(h·P⁻·hᵀ + R), x = x⁻ + k·(y − h(x⁻)), P = (1 − k·h)·P⁻·(1 − k·h)ᵀ + R·k·kᵀ.
#[derive(Clone, Debug, PartialEq)]
pub struct EmitRequest {
    /// What the names of files, types and functions begin with: a lower-case letter, and lower-case letters, digits and `_`.
    pub name: String,
    /// Lines for the head of each file, such as the name and the checksum of an experiment.
    pub heading: Vec<String>,
    /// T in s, over which one step of the method goes.
    pub interval_s: f64,
    /// Steps of the method from one sample to the next. In each the inputs go on a parabola through what is given at the start, the middle and the end
    /// of the interval between samples.
    pub parts: usize,
    /// How a step is integrated.
    pub method: StepMethod,
    /// The linear part of the step for [`StepMethod::RungeKutta`], ∂f/∂x of the device's states in SI, row by row, as at rest: it is followed
    /// exactly, as by [`Etdrk4`](kalmems_core::Etdrk4). None for Runge and Kutta's method itself.
    pub linear: Vec<f64>,
    /// The values of all parameters in SI and in the device's order; those of `free` are not used.
    pub parameters: Vec<f64>,
    /// The parameters that the program may change, by their places: they stand in a structure.
    pub adjustable: Vec<usize>,
    /// What identifies the experiment in that structure, such as the first four bytes of its digest.
    pub experiment: u32,
    /// The start of each state of the device.
    pub states: Vec<StateStart>,
    /// The covariance of the device's states and of the parameters that are states at the start in SI, row by row.
    pub start_covariance: Vec<f64>,
    /// Q of the device's states over one interval, row by row.
    pub process_noise: Vec<f64>,
    /// Parameters that are states, behind those of the device.
    pub free: Vec<FreeParameter>,
    /// What is measured at each sample, in the order of the corrections.
    pub measures: Vec<EmitMeasure>,
    /// Events that are measurements.
    pub events: Vec<EmitEvent>,
    /// How each input goes between two samples; `Between` of all where there are none.
    pub courses: Vec<InputCourse>,
    /// Where the gain comes from.
    pub gain: EmitGain,
    /// How many digits the source computes with.
    pub digits: EmitDigits,
    /// A step corrects by one sample in so many, and predicts alone between them.
    pub update_every: u32,
    /// How its innovations are watched.
    pub watch: EmitWatch,
    /// Whether the signals are the same for another motion, such as the mirrored one: a filter that has begun again may follow that.
    pub mirrored: bool,
    /// Samples over which the filter is rehearsed as the source computes; none without a rehearsal.
    pub rehearsal: Vec<TestSample>,
    /// Samples with which the source tests itself.
    pub vectors: Option<TestVectors>,
}

impl EmitRequest {
    /// How many states the filter has.
    pub(super) fn size(&self) -> usize {
        self.states.len() + self.free.len()
    }

    /// Whether a measurement has a range.
    pub(super) fn has_range(&self) -> bool {
        self.measures.iter().any(|measure| measure.range.is_some())
    }

    /// The interval between samples in s.
    pub(super) fn sampling_interval_s(&self) -> f64 {
        self.interval_s * self.parts as f64
    }

    /// Refuses what does not fit the device.
    pub(super) fn check(&self, device: &Device) -> Result<(), EmitError> {
        if RESERVED.contains(&self.name.as_str()) {
            return Err(EmitError::request(
                "name",
                &format!("`{}`", self.name),
                "a name that no language has",
            ));
        }
        let named = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if !(self.name.starts_with(|c: char| c.is_ascii_lowercase()) && self.name.chars().all(named)) {
            let expected = "a lower-case letter, and after it lower-case letters, digits and `_`";
            return Err(EmitError::request("name", &format!("`{}`", self.name), expected));
        }
        if !(self.interval_s > 0.0 && self.interval_s.is_finite()) {
            return Err(EmitError::request("interval_s", &self.interval_s, "a positive finite number"));
        }
        if self.update_every == 0 {
            return Err(EmitError::request("update_every", &self.update_every, "at least one sample"));
        }
        if self.parts == 0 {
            return Err(EmitError::request("parts", &self.parts, "at least one prediction of a sample"));
        }
        let states = device.states().len();
        count("states", self.states.len(), states)?;
        count("parameters", self.parameters.len(), device.parameters().len())?;
        count("start_covariance", self.start_covariance.len(), self.size() * self.size())?;
        count("process_noise", self.process_noise.len(), states * states)?;
        if self.size() > MOST_STATES {
            return Err(EmitError::request("free", &self.size(), format!("at most {MOST_STATES} states")));
        }
        self.check_places(device)?;
        let starts = self.states.iter().flat_map(|s| [s.mean, s.origin, s.typical.unwrap_or(1.0)]);
        finite("states", starts)?;
        finite("parameters", self.parameters.iter().copied())?;
        symmetric("start_covariance", &self.start_covariance, self.size())?;
        symmetric("process_noise", &self.process_noise, states)?;
        for free in &self.free {
            finite("free", [free.start, free.walk])?;
            positive("free", free.scale)?;
            if free.walk < 0.0 {
                return Err(EmitError::request("free", &free.walk, "no negative number"));
            }
        }
        let variances = self.measures.iter().map(|m| ("measures", m.variance));
        for (field, variance) in variances.chain(self.events.iter().map(|e| ("events", e.variance))) {
            positive(field, variance)?;
        }
        for [low, high] in self.measures.iter().filter_map(|measure| measure.range) {
            if low.partial_cmp(&high) != Some(std::cmp::Ordering::Less) {
                let found = format!("from {low} to {high}");
                return Err(EmitError::request("measures", &found, "a range that rises"));
            }
        }
        self.check_gain()?;
        self.check_vectors(device)
    }

    fn check_places(&self, device: &Device) -> Result<(), EmitError> {
        let parameters = device.parameters().len();
        let free = self.free.iter().map(|free| free.parameter);
        let mut known = vec![false; parameters];
        for place in free.chain(self.adjustable.iter().copied()) {
            match known.get_mut(place) {
                Some(known) if !*known => *known = true,
                Some(_) => return Err(EmitError::request("free", &place, "each parameter once")),
                None => {
                    let expected = format!("a place below {parameters}");
                    return Err(EmitError::request("free", &place, expected));
                }
            }
        }
        if self.measures.is_empty() {
            return Err(EmitError::request("measures", &"none", "at least one measurement"));
        }
        let measures = self.measures.iter().map(|m| ("measures", m.measure, device.measures().len()));
        let events = self.events.iter().map(|e| ("events", e.event, device.events().len()));
        for (field, place, limit) in measures.chain(events) {
            if place >= limit {
                return Err(EmitError::request(field, &place, format!("a place below {limit}")));
            }
        }
        Ok(())
    }

    fn check_gain(&self) -> Result<(), EmitError> {
        if let EmitGain::Settled(gains) = &self.gain {
            count("gain", gains.len(), self.measures.len())?;
            for SettledGain { gain, variance } in gains {
                count("gain", gain.len(), self.size())?;
                finite("gain", gain.iter().copied())?;
                positive("gain", *variance)?;
            }
            if !self.events.is_empty() {
                return Err(EmitError::request("events", &"a settled gain", "a gain from the covariance"));
            }
        }
        Ok(())
    }

    fn check_vectors(&self, device: &Device) -> Result<(), EmitError> {
        positive("watch", self.watch.largest_nis)?;
        if self.watch.memory == 0 {
            return Err(EmitError::request("watch", &self.watch.memory, "a memory of at least one sample"));
        }
        if self.digits == EmitDigits::AsNeeded && self.rehearsal.is_empty() {
            return Err(EmitError::request("rehearsal", &"no samples", "at least one sample"));
        }
        self.check_samples(device, "rehearsal", &self.rehearsal)?;
        let Some(vectors) = &self.vectors else { return Ok(()) };
        positive("vectors", vectors.tolerance)?;
        if vectors.samples.is_empty() {
            return Err(EmitError::request("vectors", &"no samples", "at least one sample"));
        }
        self.check_samples(device, "vectors", &vectors.samples)
    }

    fn check_samples(
        &self,
        device: &Device,
        field: &'static str,
        samples: &[TestSample],
    ) -> Result<(), EmitError> {
        for sample in samples {
            for inputs in &sample.inputs {
                count(field, inputs.len(), device.inputs().len())?;
                finite(field, inputs.iter().copied())?;
            }
            count(field, sample.measured.len(), self.measures.len())?;
            count(field, sample.events.len(), self.events.len())?;
            count(field, sample.expected.len(), self.size())?;
            let numbers = sample.measured.iter().chain(sample.events.iter().flatten());
            finite(field, numbers.chain(&sample.expected).copied())?;
        }
        Ok(())
    }
}

fn count(field: &'static str, found: usize, expected: usize) -> Result<(), EmitError> {
    if found == expected {
        return Ok(());
    }
    Err(EmitError::request(field, &format!("{found} numbers"), format!("{expected} numbers")))
}

fn finite(field: &'static str, values: impl IntoIterator<Item = f64>) -> Result<(), EmitError> {
    match values.into_iter().find(|value| !value.is_finite()) {
        Some(value) => Err(EmitError::request(field, &value, "finite numbers")),
        None => Ok(()),
    }
}

fn positive(field: &'static str, value: f64) -> Result<(), EmitError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(EmitError::request(field, &value, "a positive finite number"))
}

/// Finite, symmetric to rounding, and without a negative variance.
fn symmetric(field: &'static str, matrix: &[f64], size: usize) -> Result<(), EmitError> {
    finite(field, matrix.iter().copied())?;
    let at = |i: usize, j: usize| matrix.get(i * size + j).copied().unwrap_or_default();
    for i in 0..size {
        if at(i, i) < 0.0 {
            return Err(EmitError::request(field, &at(i, i), "no negative variance"));
        }
        for j in 0..i {
            if (at(i, j) - at(j, i)).abs() > 1e-9 * at(i, j).abs().max(at(j, i).abs()) {
                let found = format!("{} and {}", at(i, j), at(j, i));
                return Err(EmitError::request(field, &found, "a symmetric matrix"));
            }
        }
    }
    Ok(())
}
