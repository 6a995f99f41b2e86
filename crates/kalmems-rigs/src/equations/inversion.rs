//! The state that each sample means by itself, where a measurement is that of one state.

use super::segment::EquationFilterTask;
use super::settings::OwnDevice;
use crate::estimate::{StateName, Trajectory, inversion};
use kalmems_equations::{ProgramNumbers, ReadoutProgram};
use std::cell::RefCell;

/// Newton's steps for one sample, at most; a measurement that is straight takes one.
const STEPS: usize = 60;
/// A step is halved so often, at most, where it leads away.
const HALVINGS: usize = 40;
/// How near to the signal a state's measurement is, relative to its noise.
const NEAR: f64 = 1e-9;

/// A measurement that tells one state.
pub struct Inverse {
    readout: ReadoutProgram,
    /// The state.
    pub state: usize,
    /// Where the search begins, and the sign of the slope there.
    rest: Vec<f64>,
    rises: bool,
}

impl Inverse {
    /// Of a measurement, by its place; why there is none.
    pub fn of(own: &OwnDevice, measure: usize) -> Result<Self, String> {
        let named = |state: usize| own.device.states().get(state).map(|named| named.name.to_string());
        let readout = own.device.readout(measure, &[]).map_err(|error| error.to_string())?;
        let states: Vec<usize> = readout.sparsity().collect();
        let [state] = states[..] else {
            let names: Vec<String> = states.iter().filter_map(|state| named(*state)).collect();
            let of = if names.is_empty() { "no state".to_owned() } else { names.join(" and ") };
            return Err(format!("its measurement is one of {of}; the inversion needs one of a single state"));
        };
        if state >= own.device.own_states() {
            let name = named(state).unwrap_or_default();
            return Err(format!("its measurement is one of {name}, which a lag or a delay adds; use `ekf`"));
        }
        let mut slopes = vec![0.0; own.device.states().len()];
        let inputs = vec![0.0; own.device.inputs().len()];
        let at_rest = readout.linearize(&mut readout.work(&own.values), &own.rest, &inputs, &mut slopes);
        let slope = slopes.get(state).copied().unwrap_or(0.0);
        if !(at_rest.is_finite() && slope.is_finite() && slope != 0.0) {
            let name = named(state).unwrap_or_default();
            return Err(format!(
                "at rest its measurement does not change with {name}, so that a signal means two values of it; use `ekf`"
            ));
        }
        Ok(Self { readout, state, rest: own.rest.clone(), rises: slope > 0.0 })
    }

    /// The state that a signal means under inputs, and the slope there; `None` where the measurement does not reach the signal
    /// before it turns back.
    fn state_at(
        &self,
        work: &mut ProgramNumbers,
        inputs: &[f64],
        (signal, noise_sd): (f64, f64),
    ) -> Option<[f64; 2]> {
        let (mut x, mut slopes) = (self.rest.clone(), vec![0.0; self.rest.len()]);
        let mut read = |x: &[f64]| {
            let value = self.readout.linearize(work, x, inputs, &mut slopes);
            let slope = slopes.get(self.state).copied().unwrap_or(0.0);
            // Beyond a place where it turns back a signal means another value.
            ((slope > 0.0) == self.rises && slope != 0.0 && value.is_finite())
                .then_some([signal - value, slope])
        };
        let mut here = read(&x)?;
        for _ in 0..STEPS {
            let [left, slope] = here;
            if left.abs() <= NEAR * noise_sd {
                return Some([x[self.state], slope]);
            }
            let from = x[self.state];
            let mut step = left / slope;
            let mut next = None;
            for _ in 0..HALVINGS {
                x[self.state] = from + step;
                next = read(&x).filter(|[then, _]| then.abs() < left.abs());
                if next.is_some() {
                    break;
                }
                step *= 0.5;
            }
            let Some(next) = next else {
                // Nearer than that numbers do not come, or the measurement ends before the signal.
                x[self.state] = from;
                return (left.abs() <= 1e-3 * noise_sd).then_some([from, slope]);
            };
            here = next;
        }
        None
    }
}

impl EquationFilterTask<'_> {
    /// Each sample by itself: the state that its signal means, with what the noise of the signal makes of it. A signal that no state
    /// makes counts as a missing one.
    pub fn inversion(&self, inverse: &Inverse, states: &[StateName]) -> Option<Trajectory> {
        let place = self.channels().first().copied()?;
        let channel = self.data.channels.get(place)?;
        let state = *states.get(inverse.state)?;
        let noise_sd = channel.variance.sqrt();
        let work = RefCell::new(inverse.readout.work(&self.own.values));
        let rows = (self.data.time_s, channel.signal, &self.data.samples);
        let found = inversion(&self.filter.basics, rows, &[state], |k, signal| {
            if !signal.is_finite() {
                return None;
            }
            let inputs: Vec<f64> = self.data.inputs.iter().map(|input| input.sample(k).0).collect();
            let [value, slope] = inverse.state_at(&mut work.borrow_mut(), &inputs, (signal, noise_sd))?;
            let mut x = self.own.rest.clone();
            x[inverse.state] = value;
            let ratio =
                self.models.first().map_or(1.0, |model| model.noise_ratio(channel.measure, &x, &inputs));
            Some([(value, noise_sd * ratio.sqrt() / slope.abs())])
        });
        Some(found)
    }
}
