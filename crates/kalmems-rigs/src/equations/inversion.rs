//! What each sample means by itself, where a measurement is that of one state or of one quantity.

use super::filter_task::EquationFilterTask;
use super::held_source::HeldSource;
use super::names;
use super::own_device::OwnDevice;
use super::range::QuantityRange;
use crate::estimate::{StateName, Trajectory, inversion};
use kalmems_equations::{ProgramNumbers, ReadoutProgram};
use std::cell::RefCell;

/// Newton's steps for one sample, at most; a measurement that is straight takes one.
const STEPS: usize = 60;
/// A step is halved so often, at most, where it leads away.
const HALVINGS: usize = 40;
/// How near to the signal a state's measurement is, relative to its noise.
const NEAR: f64 = 1e-9;

/// Powers of ten of a state's unit at which a measurement is looked at that is not finite at rest, such as that of a plate that touches.
const DECADES: std::ops::RangeInclusive<i32> = -15..=9;
/// How nearly the slopes of a measurement are those of the quantity that it is said to read, relative to their size.
const PARALLEL: f64 = 1e-9;

/// A measurement that tells one state, or one quantity that several states make together.
pub struct Inverse {
    readout: ReadoutProgram,
    /// The state that is moved until the measurement is the signal.
    state: usize,
    /// The quantity that the measurement reads, by its place, where that is not the state itself.
    quantity: Option<(usize, ReadoutProgram)>,
    /// What holds the state where it is, where one other state does.
    source: Option<HeldSource>,
    /// Where the others are.
    rest: Vec<f64>,
    /// Where the search may begin, with what is measured there: at rest, or where the measurement is finite.
    begins: Vec<[f64; 2]>,
}

impl Inverse {
    /// Of a measurement, by its place; why there is none.
    pub fn of(own: &OwnDevice, measure: usize) -> Result<Self, String> {
        let named = |state: usize| own.device.states().get(state).map(|named| named.name.to_string());
        let readout = own.device.readout(measure, &[]).map_err(|error| error.to_string())?;
        let states: Vec<usize> = readout.sparsity().collect();
        if let Some(lag) = states.iter().find(|state| **state >= own.device.own_states()) {
            let name = named(*lag).unwrap_or_default();
            return Err(format!("its measurement is one of {name}, which a lag or a delay adds; use `ekf`"));
        }
        let (state, quantity) = match states[..] {
            [state] => (state, None),
            [] => {
                return Err("its measurement is one of no state; the inversion needs one of a single state"
                    .to_owned());
            }
            [state, ..] => {
                let read = quantity_read(own, (&readout, &states)).ok_or_else(|| {
                    let names: Vec<String> = states.iter().filter_map(|state| named(*state)).collect();
                    format!(
                        "its measurement is one of {}; the inversion needs one of a single state, or of one of the `quantities`",
                        names.join(" and ")
                    )
                })?;
                (state, Some(read))
            }
        };
        let range =
            quantity.as_ref().and_then(|(place, _)| own.ranges.iter().find(|range| range.quantity == *place));
        let begins = begins(own, &readout, (state, range));
        if begins.is_empty() {
            let name = named(state).unwrap_or_default();
            return Err(format!(
                "at rest its measurement does not change with {name}, so that a signal means two values of it; use `ekf`"
            ));
        }
        let source = if quantity.is_none() { HeldSource::of(own, state) } else { None };
        Ok(Self { readout, state, quantity, source, rest: own.rest.clone(), begins })
    }

    /// What it works on, with these values of all parameters: the measurement, and the quantity that it reads.
    pub fn work(&self, values: &[f64]) -> InverseNumbers {
        InverseNumbers {
            readout: self.readout.work(values),
            quantity: self.quantity.as_ref().map(|(_, quantity)| quantity.work(values)),
            source: self.source.as_ref().map(|source| source.work(values)),
        }
    }

    /// The quantity that it tells, by its place, where that is no state.
    pub fn quantity(&self) -> Option<usize> {
        self.quantity.as_ref().map(|(place, _)| *place)
    }

    /// What a signal means under inputs: the value of the state or the quantity, the slope of the measurement by it, and the states there; `None`
    /// where the measurement does not reach the signal before it turns back.
    pub fn value_at(
        &self,
        work: &mut InverseNumbers,
        inputs: &[f64],
        signal: (f64, f64),
    ) -> Option<([f64; 2], Vec<f64>)> {
        let (x, slope) = self.state_at(&mut work.readout, inputs, signal)?;
        let Some(((_, quantity), work)) = self.quantity.as_ref().zip(work.quantity.as_mut()) else {
            return Some(([x[self.state], slope], x));
        };
        let mut slopes = vec![0.0; x.len()];
        let value = quantity.linearize(work, &x, inputs, &mut slopes);
        Some(([value, slope / slopes[self.state]], x))
    }

    /// The states, of which one is moved until the measurement is the signal, and the slope there.
    fn state_at(
        &self,
        work: &mut ProgramNumbers,
        inputs: &[f64],
        (signal, noise_sd): (f64, f64),
    ) -> Option<(Vec<f64>, f64)> {
        let (mut x, mut slopes) = (self.rest.clone(), vec![0.0; self.rest.len()]);
        let off = |[_, value]: &[f64; 2]| (signal - value).abs();
        x[self.state] = self.begins.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?[0];
        let mut rises = None;
        let mut read = |x: &[f64]| {
            let value = self.readout.linearize(work, x, inputs, &mut slopes);
            let slope = slopes.get(self.state).copied().unwrap_or(0.0);
            // Beyond a place where it turns back a signal means another value.
            let same = *rises.get_or_insert(slope > 0.0) == (slope > 0.0);
            (same && slope != 0.0 && value.is_finite()).then_some([signal - value, slope])
        };
        let mut here = read(&x)?;
        for _ in 0..STEPS {
            let [left, slope] = here;
            if left.abs() <= NEAR * noise_sd {
                return Some((x, slope));
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
                return (left.abs() <= 1e-3 * noise_sd).then_some((x, slope));
            };
            here = next;
        }
        None
    }
}

/// What an inversion works on.
pub struct InverseNumbers {
    readout: ProgramNumbers,
    quantity: Option<ProgramNumbers>,
    source: Option<ProgramNumbers>,
}

/// A measurement at values of one state, the others being at rest: what is measured where it is finite and changes with the state.
fn seen_at<'a>(
    own: &'a OwnDevice,
    readout: &'a ReadoutProgram,
    state: usize,
) -> impl FnMut(f64) -> Option<[f64; 2]> + 'a {
    let (mut work, mut slopes) = (readout.work(&own.values), vec![0.0; own.rest.len()]);
    let inputs = vec![0.0; own.device.inputs().len()];
    move |value| {
        let mut x = own.rest.clone();
        x[state] = value;
        let measured = readout.linearize(&mut work, &x, &inputs, &mut slopes);
        let slope = slopes[state];
        (measured.is_finite() && slope.is_finite() && slope != 0.0).then_some([value, measured])
    }
}

/// Decades of a state's unit, of both signs.
fn decades() -> impl Iterator<Item = f64> {
    DECADES.flat_map(|k| [1.0, -1.0].map(|sign| sign * power_of_ten(k)))
}

/// Where the search for a state may begin, with what is measured there: at rest; or, where a measurement is not finite at rest or its quantity is
/// described for some values, at decades of the state's unit that are among these. A measurement that turns back at rest means two values.
fn begins(
    own: &OwnDevice,
    readout: &ReadoutProgram,
    (state, range): (usize, Option<&QuantityRange>),
) -> Vec<[f64; 2]> {
    let mut at = seen_at(own, readout, state);
    if let Some(range) = range {
        return range
            .inner()
            .chain(decades())
            .filter(|value| range.left(*value).is_none())
            .filter_map(at)
            .collect();
    }
    if let Some(rest) = own.rest.get(state).and_then(|rest| at(*rest)) {
        return vec![rest];
    }
    let inputs = vec![0.0; own.device.inputs().len()];
    if readout.read(&mut readout.work(&own.values), &own.rest, &inputs).is_finite() {
        return Vec::new();
    }
    decades().filter_map(at).collect()
}

fn power_of_ten(k: i32) -> f64 {
    let positive = (0..k.unsigned_abs()).fold(1.0, |power, _| power * 10.0);
    if k < 0 { 1.0 / positive } else { positive }
}

/// The quantity that a measurement of several states reads, so that it is a function of that alone, where there is one: its slopes are those of the
/// quantity times one number, wherever they are looked at.
fn quantity_read(
    own: &OwnDevice,
    (readout, states): (&ReadoutProgram, &[usize]),
) -> Option<(usize, ReadoutProgram)> {
    /// Parts of a state's size that have nothing in common.
    const PARTS: [f64; 7] = [0.37, -0.61, 0.83, 0.23, -0.47, 0.71, -0.19];
    let first = states.first().copied()?;
    let inputs = vec![0.0; own.device.inputs().len()];
    let unit = |state: usize| own.device.states().get(state).map(|named| named.unit.dimension());
    let rest = own.rest.get(first).copied();
    let places: Vec<Vec<f64>> = rest
        .into_iter()
        .chain(decades())
        .filter_map(seen_at(own, readout, first))
        .flat_map(|[value, _]| (0..3).map(move |shift| (value, shift)))
        .map(|(value, shift)| {
            let size =
                |state: usize| if value != 0.0 && unit(state) == unit(first) { value.abs() } else { 1.0 };
            let moved = |state: usize| PARTS[(state + shift) % PARTS.len()] * size(state);
            let mut x: Vec<f64> = own.rest.iter().enumerate().map(|(i, rest)| rest + moved(i)).collect();
            x[first] = value;
            x
        })
        .collect();
    (0..own.device.quantities().len()).find_map(|place| {
        let quantity = own.device.quantity(place, &[]).ok()?;
        if quantity.sparsity().collect::<Vec<_>>() != states {
            return None;
        }
        let (mut of_readout, mut of_quantity) = (vec![0.0; own.rest.len()], vec![0.0; own.rest.len()]);
        let mut seen = 0;
        for x in &places {
            let read = readout.linearize(&mut readout.work(&own.values), x, &inputs, &mut of_readout);
            let value = quantity.linearize(&mut quantity.work(&own.values), x, &inputs, &mut of_quantity);
            if !(read.is_finite() && value.is_finite() && of_readout.iter().all(|slope| slope.is_finite())) {
                continue;
            }
            seen += 1;
            let is_parallel = states.iter().all(|state| {
                let (a, b) =
                    (of_readout[*state] * of_quantity[first], of_readout[first] * of_quantity[*state]);
                (a - b).abs() <= PARALLEL * (a.abs() + b.abs())
            });
            if !is_parallel {
                return None;
            }
        }
        (seen > 0).then_some((place, quantity))
    })
}

impl EquationFilterTask<'_> {
    /// Each sample by itself: what its signal means, with what the noise of the signal makes of it. A signal that no state makes counts as a
    /// missing one.
    pub fn inversion(&self, inverse: &Inverse, states: &[StateName]) -> Option<Trajectory> {
        let place = self.channels().first().copied()?;
        let channel = self.data.channels.get(place)?;
        let answer = match inverse.quantity() {
            Some(quantity) => names::quantities(&self.own.device).get(quantity).copied(),
            None => states.get(inverse.state).copied(),
        }?;
        let noise_sd = channel.variance.sqrt();
        let work = RefCell::new(inverse.work(&self.own.values));
        let rows = (self.data.time_s, channel.signal, &self.data.samples);
        let tell = |k: usize, signal: f64| {
            if !signal.is_finite() {
                return None;
            }
            let (mut inputs, mut work) = (Vec::new(), work.borrow_mut());
            self.data.inputs_at(k, &mut inputs);
            let ([value, slope], x) = inverse.value_at(&mut work, &inputs, (signal, noise_sd))?;
            let ratio =
                self.models.first().map_or(1.0, |model| model.noise_ratio(channel.measure, &x, &inputs));
            Some(((value, noise_sd * ratio.sqrt() / slope.abs()), x))
        };
        let basics = &self.filter.basics;
        let Some(source) = &inverse.source else {
            return Some(inversion(basics, rows, &[answer], |k, signal| Some([tell(k, signal)?.0])));
        };
        let held = states.get(source.state()).copied()?;
        let found = inversion(basics, rows, &[answer, held], |k, signal| {
            let ((value, sd), mut x) = tell(k, signal)?;
            // What acted until the sample, and not from there on.
            let acted = self.data.inputs.iter().zip(&self.own.between);
            let inputs: Vec<f64> = acted
                .map(|(input, between)| if k == 0 { input.sample(k).0 } else { between.nodes(input, k).end })
                .collect();
            let [source, slope] = source.value_at(work.borrow_mut().source.as_mut()?, &mut x, &inputs)?;
            Some([(value, sd), (source, sd * slope.abs())])
        });
        Some(found)
    }
}
