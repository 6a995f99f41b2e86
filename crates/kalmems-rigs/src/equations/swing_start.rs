//! A start at the oscillation that the first cycles of a signal show, which may be off by what the file says.

use super::filter_settings::following;
use super::filter_task::EquationFilterTask;
use crate::estimate::{EstimateError, MeanAndCovariance};

/// Cycles that are looked at.
const CYCLES: f64 = 2.0;

impl EquationFilterTask<'_> {
    /// What is known at the first sample of a filter that starts so; `None` of another one.
    pub fn start_by_swing(&self) -> Result<Option<MeanAndCovariance>, EstimateError> {
        let (data, own, motion_hz) = (self.data, self.own, self.data.motion.frequency_hz);
        let Some(sd) = self.filter.swing_sd() else { return Ok(None) };
        let none = |why: String| EstimateError::NoStart {
            place: data.place.to_owned(),
            filter: self.filter.basics.name.clone(),
            why,
        };
        let fresh = data.samples.fresh.clone();
        let first_s = data.time_s.get(fresh.start).copied().unwrap_or(data.start_s);
        let end = data.time_s.partition_point(|time_s| *time_s <= first_s + CYCLES / motion_hz);
        let rows = fresh.start..end.min(fresh.end);
        let channels = self.channels();
        let mut channels = channels.iter().filter_map(|place| data.channels.get(*place));
        let found = channels.find_map(|channel| {
            let of = self.filter.oscillations.iter().find(|of| of.measure == channel.measure)?;
            let signal = self.without_inputs(channel);
            let seen = (data.time_s.get(rows.clone())?, signal.get(rows.clone())?);
            let (swing, _) = of.swing(&mut of.work(&own.values), seen, motion_hz, None)?;
            Some((of.states, swing.at(first_s)))
        });
        let (states, at) = found.ok_or_else(|| {
            none("its first two cycles show no oscillation that the device could make".to_owned())
        })?;
        let mut stated = vec![None; own.rest.len()];
        states.into_iter().zip(at).for_each(|(state, at)| stated[state] = Some(at));
        let mean = own.started(&stated);
        let sd = following(own, &mean, sd.to_vec()).map_err(|state| {
            let (name, ..) = own.states()[state];
            none(format!("`start_sd` does not say how far off `{name}` may be"))
        })?;
        let parameters = self.filter.basics.parameters().iter().map(|tracked| (0.0, tracked.sd));
        Ok(Some(MeanAndCovariance::apart(mean.into_iter().zip(sd).chain(parameters))))
    }
}
