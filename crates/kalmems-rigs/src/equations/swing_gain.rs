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
        let [angle, angular_rate, first_s] = operating[..] else {
            return Err(basics.no_gain(&"where it starts is not known"));
        };
        let (motion_hz, mean) = (data.motion.frequency_hz, known.gaussian::<2>().mean);
        let rate = TAU * motion_hz;
        let amplitude = angle.portable_hypot(angular_rate / rate);
        if amplitude == 0.0 {
            return Err(basics.no_gain(
                &"it starts at rest, and its gain is for a swing; write `start = \"from_signal\"`",
            ));
        }
        let phase = (rate * angle).portable_atan2(angular_rate) - rate * first_s;
        let swing = Swing { rest: 0.0, amplitude, rate, phase };
        let samples = (data.samples.interval_s, channel.variance);
        let over = (&[swing][..], [first_s, motion_hz.recip()]);
        let found = TurningGain::<2>::of((gain, mean), (&linearised, noise), over, samples);
        Ok(AnyFilter::this(found.map_err(|why| basics.no_gain(&why))?))
    }
}
