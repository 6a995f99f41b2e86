//! A gain that is constant but for the phases of swings, of a device that is one angle and its rate or two of them.

use super::axes::window_s;
use super::course::SegmentChannel;
use super::filter_task::EquationFilterTask;
use super::model::EquationModel;
use crate::estimate::driven::{SegmentDrive, TurningGain};
use crate::estimate::{AnyFilter, EstimateError, GainOf, MeanAndCovariance, StateFilter, Swing};
use kalmems_core::{Mat, Portable};
use kalmems_equations::EquationError;
use std::cell::RefCell;
use std::f64::consts::TAU;

impl EquationFilterTask<'_> {
    /// The state of the swings at the segment's beginning, and its time in s, that such a gain is for: as the first cycles show them, where the table says what
    /// a line of the signal means and the file states a start, which may be far off, and else where the filter starts.
    pub fn operating(&self, start: &[f64]) -> Vec<f64> {
        let Some(first_s) = self.data.time_s.first().copied() else { return start.to_vec() };
        let shown = self.filter.stated().and_then(|_| {
            let stated = self.swings_through(start, first_s)?;
            self.first_swings(&stated).ok().flatten()
        });
        let at_first = |swings: Vec<Swing>| swings.iter().flat_map(|swing| swing.at(first_s)).collect();
        let state: Vec<f64> = shown.map_or_else(|| start.to_vec(), at_first);
        state.into_iter().chain([first_s]).collect()
    }

    /// The swings through a state at a time in s; `None` at rest.
    fn swings_through(&self, state: &[f64], time_s: f64) -> Option<Vec<Swing>> {
        let rates = self.motions_hz().into_iter().map(|hz| TAU * hz);
        state.chunks_exact(2).zip(rates).map(|(state, rate)| swing_through((state, time_s), rate)).collect()
    }

    /// The filter for the swings that it started with, in a state at a time in s: of one swing or two.
    pub fn turning(
        &self,
        started: (GainOf, &MeanAndCovariance, &[f64]),
        model: &EquationModel,
        channel: &SegmentChannel<'_>,
    ) -> Result<AnyFilter, EstimateError> {
        match self.own.swings() {
            1 => self.turning_of::<2>(started, model, channel),
            _ => self.turning_of::<4>(started, model, channel),
        }
    }

    fn turning_of<const N: usize>(
        &self,
        (gain, known, operating): (GainOf, &MeanAndCovariance, &[f64]),
        model: &EquationModel,
        channel: &SegmentChannel<'_>,
    ) -> Result<AnyFilter, EstimateError>
    where
        AnyFilter: From<Box<dyn StateFilter<N>>>,
    {
        let (basics, own, data) = (&self.filter.basics, self.own, self.data);
        let wrong = |error: EquationError| basics.no_gain(&error);
        let motion = &own.motion;
        let readout = own.device.readout(channel.measure, &[]).map_err(wrong)?;
        let work = RefCell::new((motion.work(&own.values), readout.work(&own.values), Vec::new()));
        let linearised = |x: &[f64; N], time_s: f64| {
            let (of_motion, of_readout, inputs) = &mut *work.borrow_mut();
            let row = data.time_s.partition_point(|t| *t < time_s).min(data.time_s.len().saturating_sub(1));
            let at = |(place, input): (usize, &SegmentDrive<'_>)| {
                let sum = data.sines.and_then(|sines| sines.input_at(place, time_s));
                let sine = || input.first_sine().map(|sine| sine.at(time_s));
                sum.or_else(sine).unwrap_or(input.sample(row).0)
            };
            inputs.clear();
            inputs.extend(data.inputs.iter().enumerate().map(at));
            let (mut rates, mut jacobian, mut slopes) = ([0.0; N], vec![0.0; N * N], [0.0; N]);
            motion.linearize(of_motion, x, inputs, &mut rates, &mut jacobian);
            readout.linearize(of_readout, x, inputs, &mut slopes);
            (Mat::from_fn(|i, j| jacobian[N * i + j]), Mat([slopes]))
        };
        let densities = model.rate_densities();
        let density = |i: usize| densities.get(i).copied().unwrap_or(0.0);
        let noise = Mat::from_fn(|i, j| if i == j { density(i) } else { 0.0 });
        let [state @ .., first_s] = operating else {
            return Err(basics.no_gain(&"where it starts is not known"));
        };
        let (mean, first_s) = (known.gaussian::<N>().mean, *first_s);
        let Some(swings) = self.swings_through(state, first_s) else {
            return Err(basics.no_gain(
                &"it starts at rest, and its gain is for a swing; write `start = \"from_signal\"`",
            ));
        };
        let samples = (data.samples.interval_s, channel.variance);
        // Whole cycles of all swings, as near as may be.
        let lasting_s = if own.axes.is_empty() { data.motion.frequency_hz.recip() } else { window_s(own) };
        let found = TurningGain::<N>::of(
            (gain, mean),
            (&linearised, noise),
            (&swings, [first_s, lasting_s]),
            samples,
        );
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
