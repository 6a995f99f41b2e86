//! How filters of a sine start from the signal, and its lock-in.

use super::course::EquationCourse;
use super::filter_task::EquationFilterTask;
use super::model::EquationModel;
use super::names;
use super::sine::{FoundSine, QuantitySine};
use crate::estimate::{
    BatchStart, EstimateError, FilterPast, LockInWindows, NoBatchStart, SampleSelection, StartAgain,
    StartSearch, StatePrior, Swing, Trajectory, batch_start_with, lock_in, start_again_from_signal,
};
use crate::signal::{fit_sine_at, white_noise_variance};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::ops::Range;

/// How fast an amplitude is taken to drift at first, as a part of it per s.
const DRIFT_PER_S: f64 = 0.3 / 60.0;
/// What a start may leave of the noise's mean square, by the larger of the stated noise and of what neighbouring samples show: a window of 400
/// samples varies by 7 %, a start that is none leaves thousands.
const POOR: f64 = 4.0;

impl EquationFilterTask<'_> {
    /// What is sought where a sine is known nearly.
    fn near(&self, sine: &QuantitySine, found: &FoundSine, mut prior: Vec<StatePrior>) -> StartSearch {
        let amplitude = found.of_roles[0];
        if let Some(rate) =
            sine.amplitude_rate.and_then(|rate| prior.get_mut(rate)).filter(|rate| rate.sd.is_none())
        {
            rate.sd = Some(DRIFT_PER_S * amplitude.abs());
        }
        let mut near: Vec<f64> = prior.iter().map(|prior| prior.mean).collect();
        for (state, value) in sine.roles().iter().zip(found.of_roles) {
            near[*state] = value;
        }
        let periods = self.own.device.periods(&self.own.values).unwrap_or_default();
        StartSearch { prior, periods, near: Some(near), ..StartSearch::default() }
    }

    /// The start of one of the filter's models from the signal.
    pub fn start_of_sine(
        &self,
        sine: &QuantitySine,
        (model, channels, steps): (&EquationModel, &[usize], usize),
    ) -> Result<Option<BatchStart>, EstimateError> {
        let Some(prior) = self.filter.prior() else { return Ok(None) };
        let SampleSelection { fresh, interval_s, .. } = &self.data.samples;
        let none = |why: String| EstimateError::NoStart {
            place: self.data.place.to_owned(),
            filter: self.filter.basics.name.clone(),
            why,
        };
        let seen = self.channel_of(sine, channels);
        let (measured, signal) =
            seen.ok_or_else(|| none("none of its channels tells the motion".to_owned()))?;
        let rows = (&self.data.time_s[fresh.clone()], &signal[fresh.clone()]);
        let known_hz = Some(self.data.motion.frequency_hz).filter(|_| self.data.motion.is_driven);
        let found = sine.find(self.own, rows, measured, (*interval_s, known_hz)).ok_or_else(|| {
            none(format!(
                "its first samples show no oscillation of the {}; a longer settling time (`estimate.skip`) gives a slow motion more of them",
                sine.name(self.own)
            ))
        })?;
        let search = self.near(sine, &found, prior);
        // A constant gain forgets a start as slowly as a settled filter does: it takes what the whole settling time says.
        let settled = || {
            let until_s = self.data.start_s + self.skip_s;
            self.data.time_s.partition_point(|time_s| *time_s < until_s).clamp(fresh.start, fresh.end)
                - fresh.start
        };
        let count = if self.filter.basics.gain().is_some() { settled().max(found.end) } else { found.end };
        let rows = fresh.start..fresh.start + count;
        let mut course = EquationCourse::new(model, (self.data, &self.own.between), (channels, &[]), steps);
        let start = batch_start_with(&mut course, rows.clone(), &search, &self.filter.basics.readout);
        let start = start.map_err(|why| none(self.told(&why)))?;
        let shown = white_noise_variance(&signal[rows]).unwrap_or(0.0) / (measured.1 * measured.1);
        if start.mean_square > POOR * shown.max(1.0) {
            return Err(none(format!(
                "the best sinusoidal motion leaves {:.3} times the stated noise in its first samples; the noise, the device or the motion are \
                 not as described",
                start.mean_square
            )));
        }
        Ok(Some(start))
    }

    fn told(&self, why: &NoBatchStart) -> String {
        let states = self.filter.basics.states(self.own.states());
        match why {
            NoBatchStart::Undetermined(lost) => {
                let names = lost.iter().filter_map(|place| states.get(*place));
                let names: Vec<String> = names.map(|(name, ..)| format!("`{name}`")).collect();
                format!(
                    "its first samples do not tell {}; say in `start_sd` how far off that may be",
                    names.join(" and ")
                )
            }
            _ => "no sinusoidal motion fits its first samples".to_owned(),
        }
    }

    /// The first of these channels that reads the quantity: its measurement with the standard deviation of its noise, and its samples.
    fn channel_of(&self, sine: &QuantitySine, channels: &[usize]) -> Option<((usize, f64), &[f64])> {
        let mut known = channels.iter().filter_map(|place| self.data.channels.get(*place));
        let channel = known.find(|channel| sine.inverse(channel.measure).is_some())?;
        Some(((channel.measure, channel.variance.sqrt()), channel.signal))
    }

    /// How a filter of a sine is started again where it has lost the signal.
    pub fn start_sine_again<'b>(
        &'b self,
        sine: &'b QuantitySine,
        (model, channels, steps): (&'b EquationModel, &'b [usize], usize),
    ) -> Option<StartAgain<'b>> {
        let basics = &self.filter.basics;
        let interval_s = self.data.samples.interval_s;
        let rows = QuantitySine::rows_again(self.data.motion.frequency_hz, interval_s);
        let rule = basics.reacquisition(self.data.motion.frequency_hz, self.data.start_s, rows)?;
        Some(StartAgain::by(rule, move |rows: Range<usize>, _| {
            let (measured, signal) = self.channel_of(sine, channels)?;
            let seen = (self.data.time_s.get(rows.clone())?, signal.get(rows.clone())?);
            let found = sine.find(self.own, seen, measured, (interval_s, None))?;
            let search = self.near(sine, &found, self.filter.prior_of_a_later_start());
            let mut course =
                EquationCourse::new(model, (self.data, &self.own.between), (channels, &[]), steps);
            start_again_from_signal(&mut course, rows, &search, &basics.readout)
        }))
    }

    /// Cycle by cycle of the motion a sine through what the samples mean.
    pub fn lock_in_of_sine(
        &self,
        sine: &QuantitySine,
        past: &mut FilterPast,
    ) -> Result<Trajectory, EstimateError> {
        let channels = self.channels();
        let (Some((measured, signal)), [Some(quantity), Some(rate)]) =
            (self.channel_of(sine, &channels), sine.quantities)
        else {
            let (place, filter) = (self.data.place.to_owned(), self.filter.basics.name.clone());
            let why = "none of its channels tells the motion, or the table `sine` names no `rate`".to_owned();
            return Err(EstimateError::NoStart { place, filter, why });
        };
        let motion_hz = self.data.motion.frequency_hz;
        let windows = LockInWindows {
            time_s: self.data.time_s,
            signals: &[signal],
            samples: &self.data.samples,
            start_s: self.data.start_s,
            length_s: motion_hz.recip(),
        };
        let detect = |time_s: &[f64], signals: &[&[f64]], _: &[Swing]| {
            let values = sine.values(self.own, measured, signals.first()?)?;
            let found = fit_sine_at(time_s, &values, motion_hz)?;
            let (rest, amplitude) = (found.offset, found.amplitude);
            Some(vec![Swing { rest, amplitude, rate: TAU * motion_hz, phase: found.phase_rad + FRAC_PI_2 }])
        };
        let named = names::quantities(&self.own.device);
        let states: Vec<_> = [quantity, rate].iter().filter_map(|place| named.get(*place).copied()).collect();
        Ok(lock_in((&self.filter.basics, past), &windows, &states, detect))
    }
}
