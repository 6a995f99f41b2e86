//! Whether the lines that a diagnosis would print serve the estimate: on rows that had no part in finding them, and by a reference.

use super::bench::TrialBench;
use super::paste::pasted;
use super::report::Diagnosis;
use super::stop::StopFlag;
use crate::config::Experiment;
use crate::evaluate::CycleEvidence;
use crate::inspect::quantity;
use crate::rigs::Workbench;
use crate::workflow::{Outcome, estimate, is_long};
use kalmems_figures::significant;

/// How many times as large as before the error against a reference may be with lines that are printed: chance is less than that.
const NO_WORSE: f64 = 1.05;

/// By how much less likely, ln p, the rows that a diagnosis did not look at may be with them: a chance of one in e¹⁰.
const LESS_LIKELY: f64 = 10.0;

/// Takes the lines of each cause out of a diagnosis with which the estimate of whole recordings is worse; `gains` are what the rows that were looked
/// at gain by each, ln p. Nothing is tried on recordings that are long or not in files.
pub(super) fn withhold_what_is_worse(
    (workbench, experiment): (&Workbench, &Experiment),
    found: &mut Diagnosis,
    gains: &[f64],
    stop: &StopFlag,
) {
    let run = |told: &Experiment| WholeRun::of(workbench, (told, &found.filter), stop);
    let Some(before) = run(experiment) else { return };
    let of_lines = |cause: &super::CauseReport| {
        let text = pasted(experiment, cause).filter(|_| !cause.edits.is_empty())?;
        run(&workbench.parse(&text, experiment.path()).ok()?)
    };
    let after: Vec<Option<WholeRun>> = found.causes.iter().map(of_lines).collect();
    let first = after.iter().flatten().next().map(|run| run.cycle.clone());
    found.cycles = first.into_iter().flat_map(|after| [before.cycle.clone(), after]).flatten().collect();
    for ((cause, after), gain) in found.causes.iter_mut().zip(after).zip(gains) {
        cause.withheld = after.and_then(|after| before.worse(&after, *gain));
        if cause.withheld.is_some() {
            cause.edits.clear();
            cause.states.clear();
        }
    }
}

/// What the filter says of whole recordings.
struct WholeRun {
    /// Σ ln p of what comes after the settling times, as densities.
    density: f64,
    /// The root mean square error of the answer against the reference with its unit, where there is one.
    error: Option<(f64, &'static str)>,
    /// The innovations of the first segment over the cycle of the motion, if it has one.
    cycle: Option<CycleEvidence>,
}

impl WholeRun {
    fn of(workbench: &Workbench, (told, filter): (&Experiment, &str), stop: &StopFlag) -> Option<Self> {
        let told = TrialBench::of(workbench, told, Some(filter)).ok()?.experiment;
        if is_long(workbench, &told).ok()? {
            return None;
        }
        let outcome = estimate(workbench, &told, stop).ok()?;
        let mut density = 0.0;
        for segment in outcome.recordings.iter().flat_map(|recording| &recording.segments) {
            let estimate = segment.estimate.without_lost();
            let trajectory = estimate.trajectories.first()?;
            stop.count(trajectory.time_s.len());
            let scored = trajectory.scored_after(estimate.start_s, estimate.skip_s);
            density += trajectory.consistency(scored)?.log_likelihood;
        }
        let first = outcome.recordings.first().and_then(|recording| recording.segments.first());
        let evidence = first.and_then(|segment| segment.judgements.first()?.evidence.as_ref());
        let cycle = evidence.and_then(|evidence| evidence.cycles.first()).cloned();
        Some(Self { density, error: error(&outcome), cycle })
    }

    /// Why lines with which it would be `after` are not to be written, where they are not.
    fn worse(&self, after: &Self, gain: f64) -> Option<String> {
        if let (Some((before, unit)), Some((error, _))) = (self.error, after.error)
            && error > NO_WORSE * before
        {
            let shown = |error: f64| quantity(significant(error).parse().unwrap_or(error), unit);
            return Some(format!(
                "nothing of it is to be written: the error against the reference would be {} in place of {}",
                shown(error),
                shown(before)
            ));
        }
        let elsewhere = after.density - self.density - gain;
        (elsewhere < -LESS_LIKELY).then(|| {
            format!(
                "nothing of it is to be written: the rows after those that were looked at would be less likely (ln p falls by {:.0})",
                -elsewhere
            )
        })
    }
}

/// The error of the answer, over all segments.
fn error(outcome: &Outcome) -> Option<(f64, &'static str)> {
    let (mut squares, mut samples, mut unit) = (0.0, 0.0, None);
    for recording in &outcome.recordings {
        let answer = recording.values.first().map(|value| value.name);
        for segment in &recording.segments {
            let of_value = answer.and_then(|name| segment.values.first()?.get(name));
            let of_value = of_value.map(|errors| (errors.rmse, errors.samples, errors.unit));
            let angle = segment.errors.first().and_then(Option::as_ref).map(|errors| &errors.angle);
            let found = of_value.or_else(|| angle.map(|errors| (errors.rmse_deg, errors.samples, "deg")));
            if let Some((rmse, count, of)) = found {
                squares += rmse * rmse * count as f64;
                samples += count as f64;
                unit = Some(of);
            }
        }
    }
    unit.map(|unit| ((squares / samples).sqrt(), unit))
}
