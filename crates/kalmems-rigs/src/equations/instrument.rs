//! Instruments that show a quantity, such as a position detector: a simulation records them, and no filter takes them.

use super::names::{self, kind_of};
use super::ordered::OfElement;
use super::own_device::OwnDevice;
use super::table::EquationsTable;
use crate::config::kinds::Time;
use crate::config::{AnyValue, ConfigError, ConfigFault, Experiment, Key, Quantity, Sign};
use crate::signal::hermite;
use crate::simulate::{Drive, SimulatedColumn, WhiteNoise};
use kalmems_core::Nodes;
use kalmems_equations::{EquationError, Motion, Named, ProgramNumbers, Reading, VectorElement};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// An instrument: what it shows, how well, and how late.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstrumentTable {
    /// The quantity that it shows.
    pub of: String,
    /// The standard deviation of a sample of it.
    pub sd: AnyValue,
    /// How much later than the motion it shows that, below 0 if the signal is the later one; 0 s if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.1 ms")]
    pub delay: Option<Quantity<Time>>,
}

impl OfElement for InstrumentTable {
    fn of_element(&self, element: &VectorElement) -> Result<Self, String> {
        Ok(Self { of: self.of.of_element(element)?, ..self.clone() })
    }
}

/// The same of a device that is simulated.
pub struct ShownQuantity {
    name: String,
    /// The place of the quantity.
    quantity: usize,
    sd: f64,
    /// By how many samples it is late.
    late: f64,
}

/// The instruments of an experiment's device, whose simulation has samples of this interval in s and lasts so many of them.
pub fn instruments(
    experiment: &Experiment,
    (table, own): (&EquationsTable, &OwnDevice),
    (interval_s, samples): (f64, u64),
) -> Result<Vec<ShownQuantity>, ConfigError> {
    let quantities = own.device.quantities();
    let one = |(name, stated): (&str, &InstrumentTable)| {
        let at = Key::from("device.equations.instruments").child(name);
        let Some(quantity) = quantities.iter().position(|named| *named.name == *stated.of) else {
            let known = quantities.iter().map(|named| &*named.name);
            return Err(experiment.error(at.child("of"), ConfigFault::unknown_word(&stated.of, known)));
        };
        let kind = kind_of(&quantities[quantity]);
        let sd = experiment.value(at.clone().child("sd"), &stated.sd, kind, Sign::NotNegative)?;
        let late = stated.delay.as_ref().map_or(0.0, Quantity::si) / interval_s;
        if late.abs() > samples as f64 {
            let why = "the instrument is later than the recording is long".to_owned();
            return Err(experiment.error(at.child("delay"), ConfigFault::Value { why }));
        }
        Ok(ShownQuantity { name: name.to_owned(), quantity, sd, late })
    };
    table.instruments.iter().map(one).collect()
}

/// The columns that they are recorded in.
pub fn columns(own: &OwnDevice, instruments: &[ShownQuantity]) -> Vec<SimulatedColumn> {
    let named = instruments.iter().map(|instrument| {
        let shown = &own.device.quantities()[instrument.quantity];
        Named { name: instrument.name.as_str().into(), ..shown.clone() }
    });
    names::channels(&named.collect::<Vec<_>>())
}

/// States and inputs at whole samples around the one that instruments show.
pub struct InstrumentHistory {
    instruments: Vec<(f64, f64, Reading, WhiteNoise)>,
    /// Samples before the present one and behind it that are needed.
    reach: [usize; 2],
    motion: Motion,
    work: ProgramNumbers,
    interval_s: f64,
    /// State, its rates, and inputs, sample by sample.
    kept: VecDeque<[Vec<f64>; 3]>,
}

impl InstrumentHistory {
    /// With a stream of random numbers for each instrument, and no noise where that is left out; `None` without an instrument.
    pub fn of(
        own: &OwnDevice,
        instruments: &[ShownQuantity],
        (noises, has_noise): (Vec<WhiteNoise>, bool),
        interval_s: f64,
    ) -> Result<Option<Self>, EquationError> {
        if instruments.is_empty() {
            return Ok(None);
        }
        let one = |(instrument, noise): (&ShownQuantity, WhiteNoise)| {
            let reading = Reading::new(own.device.quantity(instrument.quantity, &[])?, &own.values);
            let sd = if has_noise { instrument.sd } else { 0.0 };
            Ok((instrument.late, sd, reading, noise))
        };
        let lates = || instruments.iter().map(|instrument| instrument.late);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // not negative, and bounded by the recording
        let whole = |late: f64| if late > 0.0 { late.ceil() as usize + 1 } else { 0 };
        let reach = [lates().map(whole).max(), lates().map(|late| whole(-late)).max()];
        let motion = own.motion.clone();
        Ok(Some(Self {
            instruments: instruments.iter().zip(noises).map(one).collect::<Result<_, EquationError>>()?,
            reach: reach.map(Option::unwrap_or_default),
            work: motion.work(&own.values),
            motion,
            interval_s,
            kept: VecDeque::new(),
        }))
    }

    /// Samples before the recording, and behind its end, that are looked at.
    pub fn reach(&self) -> [u64; 2] {
        self.reach.map(|samples| samples as u64)
    }

    /// States and inputs of the samples that are kept, for another history to go on from.
    pub fn past(&self) -> Vec<[Vec<f64>; 2]> {
        self.kept.iter().map(|[state, _, inputs]| [state.clone(), inputs.clone()]).collect()
    }

    /// The next sample.
    pub fn push(&mut self, state: &[f64], inputs: &[f64]) {
        let mut rates = vec![0.0; state.len()];
        self.motion.rates(&mut self.work, state, inputs, &mut rates);
        self.kept.push_back([state.to_vec(), rates, inputs.to_vec()]);
        if self.kept.len() > self.reach[0] + self.reach[1] + 1 {
            self.kept.pop_front();
        }
    }

    /// So many samples before a start at a time in s, of a motion that went on as it does until then, in so many steps each.
    pub fn push_before(
        &mut self,
        (start, start_s): (&[f64], f64),
        (samples, steps): (u64, u64),
        drives: &[Drive],
    ) {
        let step_s = -self.interval_s / steps as f64;
        let tables = self.motion.runge_kutta(step_s);
        let (mut state, mut next) = (start.to_vec(), start.to_vec());
        let mut found = Vec::new();
        for step in 0..samples * steps {
            let from_s = start_s + step as f64 * step_s;
            let inputs = [0.0, 0.5, 1.0].map(|part| {
                drives.iter().map(|drive| drive.at(from_s + part * step_s)).collect::<Vec<f64>>()
            });
            let nodes = Nodes { start: &inputs[0][..], middle: &inputs[1][..], end: &inputs[2][..] };
            self.motion.step(&mut self.work, &state, &nodes, &tables, &mut next);
            std::mem::swap(&mut state, &mut next);
            if (step + 1).is_multiple_of(steps) {
                let [_, _, inputs] = inputs;
                found.push((state.clone(), inputs));
            }
        }
        for (state, inputs) in found.into_iter().rev() {
            self.push(&state, &inputs);
        }
    }

    /// What they show of the sample that is as many before the last one as are needed behind it.
    pub fn show(&mut self, to: &mut [f64]) {
        let Self { instruments, reach, interval_s, kept, .. } = self;
        let mut state = Vec::new();
        for (to, (late, sd, reading, noise)) in to.iter_mut().zip(instruments) {
            let place = reach[0] as f64 - *late;
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            // within the samples that are kept
            let before = (place.max(0.0) as usize).min(kept.len().saturating_sub(1));
            let after = (before + 1).min(kept.len().saturating_sub(1));
            let ([x, rates, inputs], [next, next_rates, _]) = (&kept[before], &kept[after]);
            state.clear();
            let part = place - before as f64;
            let ends = x.iter().zip(rates).zip(next.iter().zip(next_rates));
            state.extend(ends.map(|((x, rate), (next, next_rate))| {
                if part == 0.0 { *x } else { hermite((*x, *rate), (*next, *next_rate), *interval_s, part) }
            }));
            *to = reading.read(&state, inputs) + *sd * noise.sample();
        }
    }
}
