//! What the signal determines of a device along a motion, before anything is recorded.

use super::simulation::EquationSimulation;
use super::{EquationsRig, EquationsTable, short};
use crate::Rig;
use crate::config::{Experiment, Quantity};
use crate::estimate::{StateSeries, Trajectory};
use crate::outlook::{Fact, OutlookTopic};
use crate::progress::Silent;
use crate::simulate::{ComputedRecording, SimulateError, described};
use kalmems_equations::Named;

/// Samples of the motion that are looked at.
const SAMPLES: f64 = 50_000.0;

/// A part of its first standard deviation above which a state is not told by the signal.
const NOT_TOLD: f64 = 0.9;

/// How well the filters of an experiment will know the states and the parameters along its simulated motion.
///
/// Each filter is led along the motion without noise, its own claims included: its covariance is then that about the true
/// motion, which for the extended filter is the recursive Cramér–Rao bound (Tichavský, Muravchik & Nehorai, IEEE Transactions on
/// Signal Processing 46, 1386, 1998). Nothing is said of an experiment without simulation or filters.
pub fn visibility(experiment: &Experiment) -> Result<Option<OutlookTopic>, SimulateError> {
    let mut quiet = experiment.clone();
    let (Some(simulate), Some(estimate)) = (&mut quiet.simulate, &mut quiet.estimate) else {
        return Ok(None);
    };
    simulate.noise = false;
    let most_s = SAMPLES / simulate.sampling_rate.si();
    if simulate.duration.si() > most_s
        && let Ok(shorter) = Quantity::of(most_s, "s")
    {
        simulate.duration = shorter;
    }
    for filter in &mut estimate.filters {
        filter.smooth = false;
        filter.smooth_lag = None;
    }
    let simulation = EquationSimulation::of(&quiet)?;
    let unwritten = ComputedRecording::of(&simulation, &Silent)?;
    let recorded = described(&quiet, &simulation);
    let rig = EquationsRig;
    let read = unwritten.recorded(&rig.layout(&recorded, 0)?);
    // What cannot be estimated is for the estimate to say.
    let Some(estimates) = read.ok().and_then(|read| rig.estimate(&recorded, 0, &read, &Silent).ok()) else {
        return Ok(None);
    };
    let trajectories = estimates.iter().flat_map(|estimate| &estimate.trajectories);
    let (_, device) = EquationsTable::of(experiment)?;
    let facts: Vec<Fact> =
        trajectories.filter_map(|trajectory| of_filter(trajectory, device.quantities())).collect();
    Ok((!facts.is_empty()).then_some(OutlookTopic { title: "What the signal determines", facts }))
}

/// What a filter knows of its states at the end; what follows from them is known by them.
fn of_filter(trajectory: &Trajectory, follow: &[Named]) -> Option<Fact> {
    let last_s = trajectory.time_s.last()?;
    let (mut told, mut untold, mut values) = (Vec::new(), Vec::new(), Vec::new());
    let is_state = |state: &&StateSeries| follow.iter().all(|named| *named.name != *state.name);
    for state in trajectory.states.iter().filter(is_state) {
        // A model alone claims nothing.
        let (first, last) = (*state.sd.first()?, *state.sd.last()?);
        if !last.is_finite() {
            return None;
        }
        values.push(last);
        let before =
            trajectory.parameters.iter().find(|prior| prior.name == state.name).map(|prior| prior.sd);
        let unit = if state.unit == "1" { String::new() } else { format!(" {}", state.kind.dimension) };
        let is_factor = trajectory.parameters.iter().any(|prior| prior.name == state.name && prior.is_factor);
        let size = |sd: f64| {
            if is_factor { format!("{} %", short(100.0 * sd)) } else { format!("{}{unit}", short(sd)) }
        };
        if last > NOT_TOLD * before.unwrap_or(first) {
            untold.push(format!("{} (± {})", state.name, size(last)));
        } else {
            let text = before.map_or_else(String::new, |before| format!(", from {} before", size(before)));
            told.push(format!("{} to {}{text}", state.name, size(last)));
        }
    }
    let mut text = format!("`{}` knows after {} s", trajectory.name, short(*last_s));
    text += &if told.is_empty() {
        " nothing more than before".to_owned()
    } else {
        format!(" {}", told.join("; "))
    };
    if !untold.is_empty() {
        text += &format!(". The signal does not tell {}", untold.join(", "));
    }
    Some(Fact { name: "standard_deviations_at_the_end", values, text: text + "." })
}
