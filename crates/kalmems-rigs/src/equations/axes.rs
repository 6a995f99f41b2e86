//! States that a drive moves each by a sine of its own, and these sines.

use super::oscillation::{OscillationTable, swinging};
use super::own_device::OwnDevice;
use super::table::EquationsTable;
use crate::config::{ConfigError, ConfigFault, Experiment, Key};
use crate::estimate::MotionRate;
use crate::estimate::driven::SegmentDrive;
use crate::signal::{Sine, fit_sine, fit_sine_at};
use kalmems_core::Portable;
use std::f64::consts::TAU;
use std::ops::Range;

/// A state that oscillates under a sine of its own.
#[derive(Clone, Copy, Debug)]
pub struct DrivenAxis {
    /// The state and its rate.
    pub states: [usize; 2],
    /// How fast it is free to move, in Hz.
    pub natural_hz: f64,
}

/// Sines that can be told apart in one input.
pub const MOST_AXES: usize = 2;
/// Cycles of the slowest motion, at which a recording's beginning shows the motion of each axis.
const WINDOW_CYCLES: f64 = 13.0;

impl DrivenAxis {
    /// The axes that the table of an oscillation names, where it names several; none else.
    pub fn named(
        experiment: &Experiment,
        table: &EquationsTable,
        own: &OwnDevice,
    ) -> Result<Vec<Self>, ConfigError> {
        let names = table.oscillation.as_ref().map_or(&[][..], OscillationTable::states);
        if names.len() < 2 {
            return Ok(Vec::new());
        }
        let refused = |why: String| {
            experiment.error(Key::from("device.equations.oscillation.of"), ConfigFault::Value { why })
        };
        if names.len() > MOST_AXES {
            return Err(refused(format!("{} states are named; expected {MOST_AXES} at most", names.len())));
        }
        let linear = own.linear_about(&own.rest);
        let of = |name: &String| {
            let states = swinging(own, table, name).map_err(refused)?;
            let [state, rate] = states;
            let per_angle = linear.get(rate * own.rest.len() + state);
            let natural_hz = per_angle.map_or(f64::NAN, |slope| (-slope).sqrt() / TAU);
            if natural_hz > 0.0 {
                return Ok(Self { states, natural_hz });
            }
            Err(refused(format!(
                "`{name}` does not oscillate by itself; of several states each is known by its frequency"
            )))
        };
        names.iter().map(of).collect()
    }
}

/// The sines that drive several states, one each: together one input, or each an input of its own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisSines {
    /// Of each axis, without an offset.
    pub sines: [Sine; MOST_AXES],
    /// The input that is their sum, and its offset; `None` where each is an input.
    sum: Option<(usize, f64)>,
    /// Whether the drive follows them in all samples that are known. Where it does not, the motions have no phase that they would have to keep.
    pub is_steady: bool,
}

/// Rows of inputs.
#[derive(Clone, Copy)]
pub struct InputRows<'a, 'b> {
    /// All of them.
    pub inputs: &'a [SegmentDrive<'b>],
    /// The usual interval between samples in s.
    pub interval_s: f64,
}

/// How long in s the beginning of a recording is looked at that shows the motion of each axis.
pub fn window_s(own: &OwnDevice) -> f64 {
    WINDOW_CYCLES / own.axes.iter().map(|axis| axis.natural_hz).fold(f64::INFINITY, f64::min)
}

impl AxisSines {
    /// The sines of several axes that the rows before a time in s follow, or those of the last of them, of a drive that changes before.
    pub fn first(own: &OwnDevice, rows: InputRows, until_s: f64) -> Option<Self> {
        let time_s = rows.inputs.first().filter(|_| !own.axes.is_empty())?.time_s();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
        let window = (window_s(own) / rows.interval_s).ceil() as usize;
        let end = time_s.partition_point(|t| *t < until_s).max(window).min(time_s.len());
        let last = end.saturating_sub(window)..end;
        let changes = || Some(Self { is_steady: false, ..Self::over(own, rows, last)? });
        Self::over(own, rows, 0..end).or_else(changes)
    }

    /// Those of all rows; the same as at first of a drive that changes.
    pub fn throughout(&self, own: &OwnDevice, rows: InputRows) -> Self {
        let all = rows.inputs.first().map_or(0..0, |input| 0..input.time_s().len());
        Self::over(own, rows, all).unwrap_or(Self { is_steady: false, ..*self })
    }

    /// The sines in some rows, each given to the axis whose resonance it is nearer to: `None` where two sines leave more than 2 % of the smaller one's
    /// amplitude, as another drive does.
    fn over(
        own: &OwnDevice,
        InputRows { inputs, interval_s }: InputRows,
        rows: Range<usize>,
    ) -> Option<Self> {
        let alone: Vec<(&Sine, bool)> = inputs
            .iter()
            .take(own.device.own_inputs())
            .filter_map(|input| Some((input.first_sine()?, input.sine().is_some())))
            .collect();
        let (sines, sum, is_steady) = if let [(first, one), (second, other)] = *alone {
            ([*first, *second], None, one && other)
        } else {
            let input = inputs.first()?;
            let (time_s, volts) = (input.time_s().get(rows.clone())?, input.volts().get(rows.clone())?);
            let fit = || two_sines(time_s, volts, interval_s).map_or_else(Vec::new, Vec::from);
            let [first, second, last] = input.fitted_sines(&rows, MOST_AXES, fit).try_into().ok()?;
            let smaller = first.amplitude.min(second.amplitude);
            if last.residual_rms >= 0.02 * smaller {
                return None;
            }
            ([first, second], Some((0, last.offset)), true)
        };
        let sines = sines.map(|sine| Sine { offset: 0.0, ..sine });
        let [x, y] = *own.axes else { return None };
        // ln(f/f_res): a sine is near to a resonance in proportion, not in Hz.
        let away = |sine: &Sine, axis: &DrivenAxis| {
            (sine.frequency_hz / (own.drive_cycles * axis.natural_hz)).portable_ln().abs()
        };
        let [first, second] = sines;
        let turned = away(&first, &x) + away(&second, &y) > away(&first, &y) + away(&second, &x);
        Some(Self { sines: if turned { [second, first] } else { sines }, sum, is_steady })
    }

    /// How fast each axis moves under them.
    pub fn motions(&self, own: &OwnDevice) -> [MotionRate; MOST_AXES] {
        self.sines.map(|sine| MotionRate {
            frequency_hz: sine.frequency_hz / own.drive_cycles,
            is_driven: self.is_steady,
        })
    }

    /// How fast the slowest axis moves under the first of them: what changes later drives a filter's start all the same.
    pub fn slowest(&self, own: &OwnDevice) -> MotionRate {
        let frequency_hz =
            self.motions(own).map(|motion| motion.frequency_hz).into_iter().fold(f64::INFINITY, f64::min);
        MotionRate { frequency_hz, is_driven: true }
    }

    /// What an input that is their sum is at a time in s.
    pub fn input_at(&self, place: usize, time_s: f64) -> Option<f64> {
        let (_, offset) = self.sum.filter(|(sum, _)| *sum == place)?;
        Some(offset + self.sines.iter().map(|sine| sine.at(time_s)).sum::<f64>())
    }
}

/// How often two sines are fitted in turns. What one leaks into the fit of the other falls with their distance times the length of the record, and by that
/// factor squared each time.
const TURNS: usize = 6;

/// Two sines fitted in turns, and the second once more at its frequency, with what both leave; `None` where a fit does not settle.
fn two_sines(time_s: &[f64], volts: &[f64], interval_s: f64) -> Option<[Sine; 3]> {
    let without = |sine: &Sine| -> Vec<f64> {
        time_s.iter().zip(volts).map(|(t, v)| v - (sine.at(*t) - sine.offset)).collect()
    };
    let mut first = fit_sine(time_s, volts, interval_s)?;
    let mut second = fit_sine(time_s, &without(&first), interval_s)?;
    for _ in 0..TURNS {
        first = fit_sine(time_s, &without(&second), interval_s)?;
        second = fit_sine(time_s, &without(&first), interval_s)?;
    }
    let last = fit_sine_at(time_s, &without(&first), second.frequency_hz)?;
    Some([first, second, last])
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn both_sines_are_found_in_either_order_of_size() {
        for (large, small) in [(90.0, 20.0), (20.0, 90.0)] {
            let time: Vec<f64> = (0..12_000).map(|i| f64::from(i) * 1e-6).collect();
            let volts = |t: f64| {
                85.0 + large * (TAU * 31_352.7 * t + 0.3).cos() + small * (TAU * 13_081.3 * t - 2.0).cos()
            };
            let v: Vec<f64> = time.iter().map(|t| volts(*t)).collect();
            let [mut first, mut second, last] = two_sines(&time, &v, 1e-6).unwrap();
            if first.frequency_hz < second.frequency_hz {
                std::mem::swap(&mut first, &mut second);
            }
            let expected = [(31_352.7, large, 0.3), (13_081.3, small, -2.0)];
            for (sine, (frequency, amplitude, phase)) in [first, second].iter().zip(expected) {
                assert_abs_diff_eq!(sine.frequency_hz, frequency, epsilon = 1e-3);
                assert_abs_diff_eq!(sine.amplitude, amplitude, epsilon = 1e-4);
                assert_abs_diff_eq!(sine.phase_rad, phase, epsilon = 1e-4);
            }
            assert_abs_diff_eq!(last.offset, 85.0, epsilon = 1e-4);
        }
    }
}
