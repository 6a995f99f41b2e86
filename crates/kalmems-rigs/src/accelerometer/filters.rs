//! What the rig takes from the tables of filters, in SI.

use super::uncertainty;
use crate::config::{
    ConfigError, ConfigFault, Estimate, ExpectedEntry, Experiment, FilterStart, FilterTable, Key, Method,
    Quantity, Sign,
};
use crate::estimate::{FilterBasics, StateName};
use crate::units::kind;
use std::collections::BTreeMap;

/// What one `[[estimate.filter]]` says of a filter of the accelerometer.
#[derive(Clone, Debug)]
pub struct AccelerometerFilterSettings {
    /// What every filter has; its name for people says where the acceleration is known.
    pub basics: FilterBasics,
    /// Whether the acceleration is an input: the states are then the displacement and the velocity alone.
    pub known_acceleration: bool,
    /// Displacement in m, velocity in m/s, acceleration in m/s² and its rate in m/s³ to start from, 0 where they come from the signal.
    pub start: [f64; 4],
    /// Their standard deviations, 0 for what claims none; with a start from the signal how far from rest they may be, 0 where the file
    /// does not say it.
    pub start_sd: [f64; 4],
    /// Whether the start comes from the signal.
    pub from_signal: bool,
    /// How far spring, damping and mass may be off what the device table says, relative to it: for those that consider
    /// that or choose among models.
    pub spread: [f64; 3],
    /// Over how long the variance of a sample is estimated, in s, where it is.
    pub noise_memory_s: Option<f64>,
}

/// Those of the filter that considers most.
pub const MOST_STATES: usize = 7;

/// The states, as trajectories name them.
const STATES: [StateName; MOST_STATES] = [
    ("displacement", "m", &kind::LENGTH),
    ("velocity", "m_per_s", &kind::VELOCITY),
    ("acceleration", "m_per_s2", &kind::ACCELERATION),
    ("jerk", "m_per_s3", &kind::JERK),
    ("spring_deviation", "1", &kind::RATIO),
    ("damping_deviation", "1", &kind::RATIO),
    ("mass_deviation", "1", &kind::RATIO),
];

/// Those that direct inversion gives.
pub const INVERTED: [StateName; 2] = [STATES[0], STATES[2]];

/// The first `N` states, as tables of values name them.
pub const fn entries<const N: usize>(sign: Sign) -> [ExpectedEntry; N] {
    const { assert!(N <= STATES.len(), "there are no more") };
    let mut entries = [ExpectedEntry::new("", &kind::RATIO, sign); N];
    let mut i = 0;
    while i < N {
        entries[i] = ExpectedEntry::new(STATES[i].0, STATES[i].2, sign);
        i += 1;
    }
    entries
}

impl AccelerometerFilterSettings {
    /// Reads and checks the filter at this place of the file.
    pub fn of(experiment: &Experiment, estimate: &Estimate, index: usize) -> Result<Self, ConfigError> {
        let filter = &estimate.filters[index];
        let at = Key::from("estimate").child("filter").index(index);
        let refuse = |name: &str, why: &str| {
            Err(experiment.error(at.clone().child(name), ConfigFault::Value { why: why.to_owned() }))
        };
        let unused =
            [("process_noise", !filter.process_noise.is_empty()), ("demodulator", filter.demodulator)];
        if let Some((name, _)) = unused.into_iter().find(|(_, given)| *given) {
            return refuse(name, "the accelerometer's filters have no such setting; leave it out");
        }
        let known = filter.known_acceleration;
        let inverts = filter.method == Method::DirectInversion;
        if known && inverts {
            return refuse("known_acceleration", "what is inverted is the acceleration; leave it out");
        }
        let values = |name: &str, values, sign| {
            let key = at.clone().child(name);
            if known {
                let [x, v] = experiment.values(key, values, entries::<2>(sign))?;
                return Ok([x, v, 0.0, 0.0]);
            }
            experiment.values(key, values, entries::<4>(sign))
        };
        let start = match &filter.start {
            Some(FilterStart::Values(start)) => Some(values("start", start, Sign::Any)?),
            Some(FilterStart::FromSignal) | None => None,
        };
        // An observer does not ask how uncertain its start is.
        let start_sd = if filter.method.claims() && !filter.start_sd.is_empty() {
            values("start_sd", &filter.start_sd, Sign::NotNegative)?
        } else {
            [0.0; 4]
        };
        let spread = uncertainty::spread(experiment, &at, filter)?;
        // What is uncertain is not tracked.
        let untracked = FilterTable { states: BTreeMap::new(), ..filter.clone() };
        let mut basics = FilterBasics::of(experiment, &at, &untracked, (&[], &[]))?;
        if known {
            basics.name.push_str(", acceleration known");
        }
        Ok(Self {
            basics,
            known_acceleration: known,
            from_signal: start.is_none() && !inverts,
            start: start.unwrap_or_default(),
            start_sd,
            spread,
            noise_memory_s: filter.noise_memory.as_ref().map(Quantity::si),
        })
    }
}

/// The names of the first states.
pub fn states(count: usize) -> &'static [StateName] {
    &STATES[..count.min(STATES.len())]
}
