//! What inputs add to a measurement where the device is at rest, as a current through a capacitance does that passes them on.

use super::model::EquationModel;
use super::own_device::OwnDevice;
use crate::estimate::Sensor;
use crate::estimate::driven::SegmentDrive;
use crate::signal::sample_slopes;
use kalmems_equations::{MOST_STATES, Reading};

/// That of a measurement which depends on inputs.
pub struct InputPart {
    reading: Reading,
    rest: Vec<f64>,
    /// The measurement at rest without an input.
    at_rest: f64,
    inputs: Vec<f64>,
}

impl InputPart {
    /// Of a measurement, by its place; `None` where inputs add nothing to it.
    pub fn of(own: &OwnDevice, measure: usize) -> Option<Self> {
        let reading = Reading::new(own.device.readout(measure, &[]).ok()?, &own.values);
        let inputs = vec![0.0; own.device.inputs().len()];
        let mut part = Self { reading, rest: own.rest.clone(), at_rest: 0.0, inputs };
        part.at_rest = part.value();
        let depends = (0..part.inputs.len()).any(|input| {
            part.inputs.fill(0.0);
            part.inputs[input] = 1.0;
            part.value() != 0.0
        });
        depends.then_some(part)
    }

    fn value(&mut self) -> f64 {
        self.reading.read(&self.rest, &self.inputs) - self.at_rest
    }

    /// At each of the first so many rows of a part; not a number where an input bends. Rates of inputs are those of the samples next to each, and of
    /// no sine, so that they are the same wherever a part ends.
    pub fn taken_off(
        &mut self,
        own: &OwnDevice,
        (time_s, inputs, bends): (&[f64], &[SegmentDrive<'_>], &[usize]),
        (signal, interval_s): (&[f64], f64),
    ) -> Vec<f64> {
        let stated = own.device.own_inputs();
        let rated = own.device.rated_inputs().iter().filter_map(|of| inputs.get(*of));
        let rates: Vec<Vec<f64>> =
            rated.map(|input| sample_slopes(time_s, |k| input.sample(k).0, interval_s)).collect();
        let one = |(k, y): (usize, &f64)| {
            if bends.binary_search(&k).is_ok() {
                return f64::NAN;
            }
            self.inputs.clear();
            self.inputs.extend(inputs.iter().take(stated).map(|input| input.sample(k).0));
            self.inputs.extend(rates.iter().map(|rates| rates[k]));
            y - self.value()
        };
        signal.iter().enumerate().map(one).collect()
    }

    /// The rows at which an input whose rate is needed bends so sharply, as where its power is cut off, that what it adds is not known to so much: its
    /// slope jumps there as it does nowhere near.
    pub fn bends(
        &mut self,
        own: &OwnDevice,
        (time_s, inputs): (&[f64], &[SegmentDrive<'_>]),
        least: f64,
    ) -> Vec<usize> {
        let (rated, stated) = (own.device.rated_inputs(), own.device.own_inputs());
        let mut found = Vec::new();
        for (place, input) in
            rated.iter().enumerate().filter_map(|(place, of)| Some((place, inputs.get(*of)?)))
        {
            let slope = |from: usize| {
                let [before, after] = [from, from + 1].map(|k| input.sample(k).0);
                (after - before) / (time_s[from + 1] - time_s[from])
            };
            let jump = |k: usize| slope(k) - slope(k - 1);
            let last = time_s.len().saturating_sub(1);
            for k in 1..last {
                let near = [k.checked_sub(NEAR), Some(k + NEAR)].into_iter().flatten();
                let near = near.filter(|k| (1..last).contains(k)).map(|k| jump(k).abs());
                if jump(k).abs() <= SHARPER * near.fold(0.0, f64::max) {
                    continue;
                }
                self.inputs.clear();
                self.inputs.extend(inputs.iter().map(|input| input.sample(k).0));
                let [before, after] = [slope(k - 1), slope(k)].map(|slope| {
                    if let Some(rate) = self.inputs.get_mut(stated + place) {
                        *rate = slope;
                    }
                    self.value()
                });
                if (after - before).abs() > least {
                    found.push(k);
                }
            }
        }
        found
    }
}

/// How much more an input's slope jumps at a bend than so many samples before it and behind it.
const SHARPER: f64 = 3.0;
const NEAR: usize = 2;

/// How much more of a measurement at rest its inputs add for each state of a model: of parameters that are states, as that of a feedthrough.
pub fn input_part_slopes(model: &EquationModel, measure: usize, inputs: &[f64], slopes: &mut [f64]) {
    let (rest, none) = (model.rest(), [0.0; MOST_STATES]);
    let mut without = [0.0; MOST_STATES];
    let (Some(without), Some(none)) = (without.get_mut(..slopes.len()), none.get(..inputs.len())) else {
        return;
    };
    let mut at = [0.0; MOST_STATES];
    let moving = model.moving().min(rest.len());
    at[..moving].copy_from_slice(&rest[..moving]);
    let Some(at) = at.get(..slopes.len()) else { return };
    model.sensor(measure, none).linearize(at, without);
    model.sensor(measure, inputs).linearize(at, slopes);
    for (slope, without) in slopes.iter_mut().zip(without.iter()) {
        *slope -= without;
    }
}
