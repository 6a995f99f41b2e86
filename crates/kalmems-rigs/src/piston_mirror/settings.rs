//! What the rig takes from an experiment file, in SI.

use super::mechanics::Mechanics;
use super::phasor::STATES;
use super::plates::{COEFFICIENTS, Plates};
use crate::StateDensity;
use crate::config::{
    CYCLES, ConfigError, ConfigFault, Estimate, ExpectedEntry, Experiment, FilterStart, FilterTable, Key,
    Method, Quantity, Sign,
};
use crate::estimate::{DeviceParameter, FilterBasics, process_noise, refuse_demodulator};
use crate::piston_mirror::device::PistonMirror;
use crate::units::{Kind, kind};

/// What an experiment says of a piston mirror and of its filters, checked and in SI.
#[derive(Clone, Debug)]
pub struct PistonSettings {
    /// The device.
    pub hardware: PistonHardware,
    /// How long a filter has to settle before it is scored, in s.
    pub skip_s: f64,
    /// The filters, in the order of the file.
    pub filters: Vec<PistonFilterSettings>,
}

/// The mirror: its capacitance over the distance, the noise of the readout, and its mechanics where they are described.
#[derive(Clone, Copy, Debug)]
pub struct PistonHardware {
    /// C(d).
    pub plates: Plates,
    /// The one-sided density of the capacitance's noise in F/√Hz.
    pub noise_density: f64,
    /// The bandwidth before the sampling in Hz, where it is stated.
    pub bandwidth_hz: Option<f64>,
    /// Between which distances in m C(d) was fitted; without limit where the file does not say.
    pub table_m: [f64; 2],
    /// Mechanics and drive, where the file has them.
    pub mechanics: Option<Mechanics>,
}

/// What one `[[estimate.filter]]` says of a filter.
#[derive(Clone, Debug)]
pub struct PistonFilterSettings {
    /// What every filter has.
    pub basics: FilterBasics,
    /// Its states and where they start.
    pub motion: MotionKnowledge,
}

impl PistonFilterSettings {
    /// Whether harmonics of the motion are states.
    pub fn has_harmonics(&self) -> bool {
        self.basics.tracked.iter().any(|tracked| HARMONICS.contains(&tracked.parameter.name))
    }
}

/// The amplitudes of the second and third harmonic of the motion, by cos 2φ, sin 2φ, cos 3φ and sin 3φ, as states.
pub const HARMONICS: [&str; 4] =
    ["second_harmonic_cosine", "second_harmonic_sine", "third_harmonic_cosine", "third_harmonic_sine"];

/// What can be a state beside the motion of a sine: the gain of the readout on all that varies with the distance, a capacitance beside the plates,
/// and harmonics of the motion.
pub static PARAMETERS: [DeviceParameter; 6] = [
    DeviceParameter::factor("gain").in_readout("gain").written(&[
        ("capacitance.coefficients[1]", 1),
        ("capacitance.coefficients[2]", 1),
        ("capacitance.coefficients[3]", 1),
        ("capacitance.coefficients[4]", 1),
        ("capacitance.coefficients[5]", 1),
        ("capacitance.coefficients[6]", 1),
        ("capacitance.coefficients[7]", 1),
        ("capacitance.coefficients[8]", 1),
    ]),
    DeviceParameter::farads("stray_capacitance")
        .in_readout("stray")
        .written(&[("capacitance.coefficients[0]", 1)]),
    DeviceParameter::metres(HARMONICS[0]).in_readout("harmonics.0"),
    DeviceParameter::metres(HARMONICS[1]).in_readout("harmonics.1"),
    DeviceParameter::metres(HARMONICS[2]).in_readout("harmonics.2"),
    DeviceParameter::metres(HARMONICS[3]).in_readout("harmonics.3"),
];

/// What a filter knows of the motion.
#[derive(Clone, Copy, Debug)]
pub enum MotionKnowledge {
    /// Nothing: each capacitance is inverted by itself, or the distances of a cycle are taken together.
    None,
    /// [A, f, φ] about a known rest position.
    Steady {
        /// The densities of A and f in m²/s and Hz²/s.
        density: [f64; 2],
        /// Mean and standard deviation of the states and the rest position; `None` starts from the signal.
        start: Option<([f64; 3], [f64; 3], f64)>,
    },
    /// [A, f, φ, d₀, Ȧ].
    Drifting {
        /// The densities of f, d₀ and Ȧ in Hz²/s, m²/s and m²/s³.
        density: [f64; 3],
        /// Mean and standard deviation; `None` starts from the signal.
        start: Option<([f64; 5], [f64; 5])>,
    },
}

impl PistonHardware {
    /// Reads what the file says of the device.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let device = experiment.device::<PistonMirror>()?;
        let given = &device.capacitance.coefficients;
        if given.len() > COEFFICIENTS {
            let why = format!(
                "found {} coefficients; at most {COEFFICIENTS}, for the powers 0 to {}, are built; fit the capacitance \
                 with fewer",
                given.len(),
                COEFFICIENTS - 1
            );
            return Err(
                experiment.error("device.piston_mirror.capacitance.coefficients", ConfigFault::Value { why })
            );
        }
        let coefficients = std::array::from_fn(|k| given.get(k).map_or(0.0, Quantity::si));
        Ok(Self {
            plates: Plates { reference_distance: device.capacitance.reference_distance.si(), coefficients },
            noise_density: device.readout.noise_density.si(),
            bandwidth_hz: device.readout.bandwidth.as_ref().map(Quantity::si),
            table_m: [
                device.capacitance.nearest.as_ref().map_or(0.0, Quantity::si),
                device.capacitance.farthest.as_ref().map_or(f64::INFINITY, Quantity::si),
            ],
            mechanics: device.mirror.as_ref().map(Mechanics::of),
        })
    }

    /// The variance of one sample in F²: the density's square times half the sampling rate, or times the bandwidth where
    /// that is larger, because what lies beyond half the sampling rate is folded into the samples.
    pub fn noise_variance(&self, interval_s: f64) -> f64 {
        let half_rate = 0.5 / interval_s;
        self.noise_density * self.noise_density * self.bandwidth_hz.map_or(half_rate, |b| b.max(half_rate))
    }
}

impl PistonSettings {
    /// How long a swing of the mirror takes in s, as far as the file says it: by its mechanics, or by the start of a filter.
    /// Where both are left to the signal, the settling time stands for as many swings as a gap may last that is predicted
    /// over.
    pub fn cycle_s(experiment: &Experiment) -> Result<f64, ConfigError> {
        let settings = Self::of(experiment)?;
        let started = settings.filters.iter().find_map(|filter| match filter.motion {
            MotionKnowledge::Steady { start, .. } => start.map(|([_, hz, _], ..)| hz),
            MotionKnowledge::Drifting { start, .. } => start.map(|([_, hz, ..], _)| hz),
            MotionKnowledge::None => None,
        });
        let known_hz = settings.hardware.mechanics.map(|mechanics| mechanics.resonance_hz).or(started);
        let settling_s = if settings.skip_s > 0.0 { settings.skip_s } else { 1.0 };
        Ok(known_hz.map_or(settling_s / CYCLES, |hz| 1.0 / hz))
    }

    /// Reads and checks what the rig needs.
    pub fn of(experiment: &Experiment) -> Result<Self, ConfigError> {
        let hardware = PistonHardware::of(experiment)?;
        let Some(estimate) = &experiment.estimate else {
            let remedy = "add the table `[estimate]` with `skip`, `process_noise` and at least one `[[estimate.filter]]`";
            return Err(experiment.error("estimate", ConfigFault::MissingKey { remedy: remedy.to_owned() }));
        };
        let filters = (0..estimate.filters.len()).map(|i| PistonFilterSettings::of(experiment, estimate, i));
        Ok(Self { hardware, skip_s: estimate.skip.si(), filters: filters.collect::<Result<_, _>>()? })
    }
}

impl PistonFilterSettings {
    /// Reads and checks the filter at this place of the file.
    fn of(experiment: &Experiment, estimate: &Estimate, index: usize) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        let refuse = |name: &str, why: &str| {
            Err(experiment.error(at.clone().child(name), ConfigFault::Value { why: why.to_owned() }))
        };
        refuse_demodulator(
            experiment,
            (&at, filter),
            "a piston mirror's filter has no such states; leave it out",
        )?;
        let motion = match filter.method {
            Method::DirectInversion | Method::LockIn => MotionKnowledge::None,
            _ => motion(experiment, filter, &at)?,
        };
        let drifts = matches!(motion, MotionKnowledge::Drifting { .. });
        if filter.method.has_fixed_gain() && !drifts {
            let why = "a phase-locked loop has the rest position and the rate of the amplitude as states; give its \
                       `process_noise` an `amplitude_rate`";
            return refuse("method", why);
        }
        if !filter.states.is_empty() && !drifts {
            let why = "what is off in the readout moves the rest position, which a filter of three states holds; give its \
                       `process_noise` an `amplitude_rate`";
            return refuse("states", why);
        }
        let basics = FilterBasics::of(experiment, &at, filter, (&PARAMETERS, &[1.0; 6]))?;
        Ok(Self { basics, motion })
    }
}

/// A density that makes the filter one of five states.
const AMPLITUDE_RATE: &str = "amplitude_rate";

const FREQUENCY: StateDensity =
    walk(("frequency", &kind::FREQUENCY_DRIFT), ("the frequency of the motion", "Hz"));

/// What wanders with five states, and with three.
const DRIFTING: [StateDensity; 3] = [
    FREQUENCY,
    walk(("offset", &kind::LENGTH_DRIFT), ("the rest position", "m")),
    walk((AMPLITUDE_RATE, &kind::VELOCITY_DRIFT), ("the rate of the amplitude", "m/s")),
];
const STEADY: [StateDensity; 2] =
    [walk(("amplitude", &kind::LENGTH_DRIFT), ("the amplitude", "m")), FREQUENCY];

const fn walk(
    (name, kind): (&'static str, &'static Kind),
    (wanders, unit): (&'static str, &'static str),
) -> StateDensity {
    StateDensity { entry: ExpectedEntry::new(name, kind, Sign::NotNegative), wanders, unit }
}

/// The densities that the filters of an experiment know: those of five states where a table names the rate of the amplitude, or
/// leaves all to the recording.
pub fn densities(experiment: &Experiment) -> Vec<StateDensity> {
    let tables = experiment.estimate.iter().flat_map(|estimate| {
        let own = estimate.filters.iter().map(|filter| &filter.process_noise);
        own.chain([&estimate.process_noise])
    });
    let mut known: Vec<StateDensity> = Vec::new();
    for table in tables.filter(|table| !table.is_empty()) {
        let five = table.is_left_open() || table.names(AMPLITUDE_RATE);
        let own = if five { &DRIFTING[..] } else { &STEADY[..] };
        known.extend(
            own.iter().filter(|one| known.iter().all(|k| k.entry.name != one.entry.name)).collect::<Vec<_>>(),
        );
    }
    known
}

/// The states of a filter: five where its process noise has an `amplitude_rate`, else three.
fn motion(experiment: &Experiment, filter: &FilterTable, at: &Key) -> Result<MotionKnowledge, ConfigError> {
    let (noise_key, noise) = process_noise(experiment, at, filter)?;
    let [start_key, sd_key] = ["start", "start_sd"].map(|name| at.clone().child(name));
    let given = match &filter.start {
        Some(FilterStart::Values(values)) => Some(values),
        Some(FilterStart::FromSignal) | None => None,
    };
    if given.is_none() && !filter.start_sd.is_empty() {
        let why = "a start from the signal brings its own; leave it out".to_owned();
        return Err(experiment.error(sd_key, ConfigFault::Value { why }));
    }
    let [amplitude, frequency, phase, offset, rate] =
        STATES.map(|(name, _, kind)| move |sign| ExpectedEntry { name, kind, sign });
    if noise.contains_key(AMPLITUDE_RATE) {
        let entries = DRIFTING.map(|density| density.entry);
        let density = experiment.values(noise_key, noise, entries)?;
        let five = |mean: bool| {
            let positive = Sign::Positive;
            let any = if mean { Sign::Any } else { positive };
            [amplitude(positive), frequency(positive), phase(any), offset(positive), rate(any)]
        };
        let start = given.map(|values| {
            let mean = experiment.values(start_key, values, five(true))?;
            let claims = filter.method.claims();
            let sd = || experiment.values(sd_key, &filter.start_sd, five(false));
            Ok::<_, ConfigError>((mean, if claims { sd()? } else { [0.0; 5] }))
        });
        return Ok(MotionKnowledge::Drifting { density, start: start.transpose()? });
    }
    let entries = STEADY.map(|density| density.entry);
    let density = experiment.values(noise_key, noise, entries)?;
    let start = given.map(|values| {
        let positive = Sign::Positive;
        let entries = [amplitude(positive), frequency(positive), phase(Sign::Any), offset(positive)];
        let [a, f, p, rest] = experiment.values(start_key, values, entries)?;
        let entries = [amplitude(positive), frequency(positive), phase(positive)];
        let sd = || experiment.values(sd_key, &filter.start_sd, entries);
        Ok::<_, ConfigError>(([a, f, p], if filter.method.claims() { sd()? } else { [0.0; 3] }, rest))
    });
    Ok(MotionKnowledge::Steady { density, start: start.transpose()? })
}
