//! A gain that is constant but for the phase of a swing, of a device that is one angle and its rate.

use super::course::SegmentChannel;
use super::model::EquationModel;
use super::segment::EquationFilterTask;
use crate::estimate::driven::{SegmentDrive, TurningGain};
use crate::estimate::{AnyFilter, EstimateError, GainOf, MeanAndCovariance, Swing};
use kalmems_core::{Mat, Portable};
use kalmems_equations::EquationError;
use std::cell::RefCell;
use std::f64::consts::TAU;

impl EquationFilterTask<'_> {
    /// The state of the swing at the segment's beginning, and its time in s, that such a gain is for: as the first cycles show it, where the table says what
    /// a line of the signal means and the file states a start, which may be far off, and else where the filter starts.
    pub fn operating(&self, start: &[f64]) -> Vec<f64> {
        let Some(first_s) = self.data.time_s.first().copied() else { return start.to_vec() };
        let shown = self.filter.stated().and_then(|_| {
            let swing = swing_through((start, first_s), TAU * self.data.motion.frequency_hz)?;
            self.first_swing(&swing)
        });
        let state = shown.map_or_else(|| start.to_vec(), |swing| swing.at(first_s).to_vec());
        state.into_iter().chain([first_s]).collect()
    }

    /// The filter for the swing that it started with, in a state at a time in s.
    pub fn turning(
        &self,
        (gain, known, operating): (GainOf, &MeanAndCovariance, &[f64]),
        model: &EquationModel,
        channel: &SegmentChannel<'_>,
    ) -> Result<AnyFilter, EstimateError> {
        let (basics, own, data) = (&self.filter.basics, self.own, self.data);
        let wrong = |error: EquationError| basics.no_gain(&error);
        let (motion, readout) = (
            own.device.motion(&[]).map_err(wrong)?,
            own.device.readout(channel.measure, &[]).map_err(wrong)?,
        );
        let work = RefCell::new((motion.work(&own.values), readout.work(&own.values), Vec::new()));
        let linearised = |x: &[f64; 2], time_s: f64| {
            let (of_motion, of_readout, inputs) = &mut *work.borrow_mut();
            let row = data.time_s.partition_point(|t| *t < time_s).min(data.time_s.len().saturating_sub(1));
            let at = |input: &SegmentDrive<'_>| {
                input.first_sine().map_or(input.sample(row).0, |sine| sine.at(time_s))
            };
            inputs.clear();
            inputs.extend(data.inputs.iter().map(at));
            let (mut rates, mut jacobian, mut slopes) = ([0.0; 2], [0.0; 4], [0.0; 2]);
            motion.linearize(of_motion, x, inputs, &mut rates, &mut jacobian);
            readout.linearize(of_readout, x, inputs, &mut slopes);
            (Mat::from_fn(|i, j| jacobian[2 * i + j]), Mat([slopes]))
        };
        let densities = model.rate_densities();
        let density = |i: usize| densities.get(i).copied().unwrap_or(0.0);
        let noise = Mat::from_fn(|i, j| if i == j { density(i) } else { 0.0 });
        let [state @ .., first_s] = operating else {
            return Err(basics.no_gain(&"where it starts is not known"));
        };
        let (motion_hz, mean, first_s) = (data.motion.frequency_hz, known.gaussian::<2>().mean, *first_s);
        let Some(swing) = swing_through((state, first_s), TAU * motion_hz) else {
            return Err(basics.no_gain(
                &"it starts at rest, and its gain is for a swing; write `start = \"from_signal\"`",
            ));
        };
        let samples = (data.samples.interval_s, channel.variance);
        let over = (&[swing][..], [first_s, motion_hz.recip()]);
        let found = TurningGain::<2>::of((gain, mean), (&linearised, noise), over, samples);
        Ok(AnyFilter::this(found.map_err(|why| basics.no_gain(&why))?))
    }
}

/// The swing at a rate in rad/s through a state, an angle and its rate, at a time in s; `None` at rest.
fn swing_through((state, time_s): (&[f64], f64), rate: f64) -> Option<Swing> {
    let [angle, angular_rate, ..] = *state else { return None };
    let amplitude = angle.portable_hypot(angular_rate / rate);
    let phase = (rate * angle).portable_atan2(angular_rate) - rate * time_s;
    (amplitude > 0.0).then_some(Swing { rest: 0.0, amplitude, rate, phase })
}
