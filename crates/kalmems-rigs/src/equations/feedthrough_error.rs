//! What the noise of the record with the bias off makes of an estimated motion.

use super::course::EquationSegment;
use super::feedthrough::TakenOff;
use super::own_device::OwnDevice;
use crate::estimate::{Contribution, StateSeries, Trajectory};
use crate::recording::OF_RECORD;
use kalmems_core::Portable;
use std::f64::consts::TAU;
use std::ops::Range;
use std::sync::Arc;

/// An error of an oscillation with the input's frequency, which all samples of a record have in common.
///
/// A filter takes the sine that is wrong in a signal y = a·x + c·ẋ + … for motion. Its channels have the weights of their information, w ∝ |c + a/iω|²/R
/// with the variance R of a sample, so that independent errors with the standard deviations s of each component make one of the rate with
/// ρ = √Σ(w·s/|c + a/iω|)², and one of the state with ρ/ω. That is to first order, at rest.
pub struct FeedthroughError<'a> {
    /// The names of the state that oscillates and of its rate, and by what of the latter's answer its errors are divided.
    states: [&'static str; 2],
    scale: f64,
    /// ρ for each unit of the input, of each of its two components.
    rate_per_unit: f64,
    taken_off: &'a TakenOff,
}

impl<'a> FeedthroughError<'a> {
    /// Of the channels of a filter; `None` where nothing was taken off that has noise, or the table does not say what oscillates.
    pub fn of(
        own: &OwnDevice,
        taken_off: &'a TakenOff,
        (data, channels): (&EquationSegment<'_>, &[usize]),
    ) -> Option<Self> {
        let of_channel = |place: &usize| taken_off.sd.get(*place).is_some_and(|sd| *sd > 0.0);
        let [state, rate] = own.feedthrough.as_ref()?.oscillates?;
        if !channels.iter().any(of_channel) || data.motion.frequency_hz.is_nan() {
            return None;
        }
        let turn = TAU * data.motion.frequency_hz;
        let inputs = vec![0.0; own.device.inputs().len()];
        let mut known = Vec::new();
        for place in channels {
            let (channel, sd) = (data.channels.get(*place)?, *taken_off.sd.get(*place)?);
            let readout = own.device.readout(channel.measure, &[]).ok()?;
            let mut slopes = vec![0.0; own.rest.len()];
            readout.linearize(&mut readout.work(&own.values), &own.rest, &inputs, &mut slopes);
            let per_rate = slopes[rate].portable_hypot(slopes[state] / turn);
            known.push((per_rate, per_rate * per_rate / channel.variance, sd));
        }
        let all: f64 = known.iter().map(|(_, information, _)| information).sum();
        let square: f64 =
            known.iter().map(|(per_rate, information, sd)| (information / all * sd / per_rate).powi(2)).sum();
        let names = own.states();
        let scale = own.corrections.iter().find(|correction| correction.state == rate);
        (square > 0.0 && square.is_finite()).then(|| Self {
            states: [names[state].0, names[rate].0],
            scale: scale.map_or(1.0, |correction| correction.scale),
            rate_per_unit: square.sqrt(),
            taken_off,
        })
    }

    /// Puts it into the claims of an answer.
    pub fn widen(&self, trajectory: &mut Trajectory, time_s: &[f64]) {
        if !trajectory.claims() {
            return;
        }
        let sines = &self.taken_off.sines;
        let mut moved = [[Vec::new(), Vec::new()], [Vec::new(), Vec::new()]];
        for at_s in &trajectory.time_s {
            let begun = |rows: &Range<usize>| time_s.get(rows.start).is_some_and(|from_s| from_s <= at_s);
            let sine = sines.iter().rev().find(|(rows, _)| begun(rows)).or(sines.first());
            let Some((_, sine)) = sine else { return };
            let (turn, error) = (TAU * sine.frequency_hz, self.rate_per_unit * sine.amplitude);
            let (sine, cosine) = (turn * at_s + sine.phase_rad).portable_sin_cos();
            for ([state, rate], [of_state, of_rate]) in
                moved.iter_mut().zip([[sine, cosine], [-cosine, sine]])
            {
                state.push(error / turn * of_state);
                rate.push(error / self.scale * of_rate);
            }
        }
        let name: Arc<str> = format!("{OF_RECORD}feedthrough").into();
        let nothing = vec![0.0; trajectory.time_s.len()];
        let contribution = |parts: [Vec<f64>; 2]| {
            let mut parts = self.states.into_iter().zip(parts).collect::<Vec<_>>();
            let of_state = |state: &StateSeries| {
                let known = parts.iter_mut().find(|(name, _)| *name == state.name);
                known.map_or_else(|| nothing.clone(), |(_, part)| std::mem::take(part))
            };
            let states = trajectory.states.iter().map(of_state).collect();
            Contribution { name: Arc::clone(&name), states, told: [0.0, 1.0] }
        };
        let contributions = moved.map(contribution).to_vec();
        trajectory.widen(contributions);
    }
}
