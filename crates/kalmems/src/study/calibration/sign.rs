//! The sign of the motion of each run, for devices whose signal does not tell it.

use crate::config::{Estimate, Experiment, ExtremeSign};
use crate::evaluate::{ReferenceMotion, ReferenceRecording};
use crate::rigs::Workbench;
use crate::signal::extremes_of_rate;
use crate::simulate::ComputedRecording;
use crate::workflow::WorkflowError;

/// Gives the signs that an experiment states (`estimate.first_peak`, `estimate.first_peak_y`) those of the simulated motion.
///
/// Where the signal is even in the angle, the sign of the motion is calibrated for each device (it is no claim of a filter). The
/// runs of a calibration have a device each, and a device that was drawn far from what the experiment says may move with the other
/// sign against its drive. A sign that the experiment does not state stays unstated; one whose motion has no turning point after the
/// settling time stays as it was written.
pub(in super::super) fn state_signs(
    workbench: &Workbench,
    told: &mut Experiment,
    simulated: &ComputedRecording,
) -> Result<(), WorkflowError> {
    let states_a_sign = |own: &Estimate| own.first_peak.is_some() || own.first_peak_y.is_some();
    if !told.estimate.as_ref().is_some_and(states_a_sign) {
        return Ok(());
    }
    let rig = workbench.rig(told)?;
    // More than one recording is refused where the run is estimated.
    let Some(index) = rig.wanted(told)?.first().copied() else { return Ok(()) };
    let recording = simulated.recorded(&rig.layout(told, index)?)?;
    let from_s = rig.signs_from_s(told, index, &recording)?;
    let place = (index, recording.origin());
    let truth =
        ReferenceRecording::read_by(told, place, &rig.reference(told)?, |layout| simulated.truth(layout))?;
    let (Some(truth), Some(segment)) = (truth, recording.segments().first()) else { return Ok(()) };
    let motions = truth.angles_of(segment)?;
    let angles = rig.angles(told);
    let first_peak = |axis: usize| {
        let (states, from_s) = (angles.get(axis)?, from_s.get(axis)?);
        first_peak(motions.iter().find(|motion| motion.states == *states)?, *from_s)
    };
    if let Some(own) = &mut told.estimate {
        for (axis, stated) in [&mut own.first_peak, &mut own.first_peak_y].into_iter().enumerate() {
            if let (Some(stated), Some(found)) = (stated, first_peak(axis)) {
                *stated = found;
            }
        }
    }
    Ok(())
}

/// The sign of the first turning point of a motion from a time in s on.
fn first_peak(motion: &ReferenceMotion, from_s: f64) -> Option<ExtremeSign> {
    let from = motion.time_s.partition_point(|t| *t < from_s);
    let (time_s, rate) = (motion.time_s.get(from..)?, motion.rate.as_deref()?.get(from..)?);
    let first = extremes_of_rate(time_s, rate).first().map(|extreme| extreme.maximum)?;
    Some(if first { ExtremeSign::Positive } else { ExtremeSign::Negative })
}
