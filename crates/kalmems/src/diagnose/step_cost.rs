//! What the integration step of a filter costs at the rate of a recording, before anything is estimated of it.

use super::bench::{TestedRows, TrialBench};
use crate::config::{Experiment, Key, put};
use crate::evaluate::StepErrors;
use crate::inspect::quantity;
use crate::outlook::OutlookTopic;
use crate::progress::Progress;
use crate::rigs::Workbench;
use crate::simulate::{ComputedRecording, described};
use kalmems_figures::significant;
use toml::Value;

/// Rows behind the settling time, of which the second half is later than what the steps are planned on.
const ROWS: TestedRows = TestedRows(8192);

/// What the integration step costs the first filter of an experiment whose innovations are white when it is right, by the beginning of its first
/// recording or of its simulation; `None` where its steps are exact or those of a published method, and where it cannot be run.
pub fn step_cost(
    workbench: &Workbench,
    experiment: &Experiment,
    progress: &dyn Progress,
) -> Option<OutlookTopic> {
    let bench = if experiment.recordings.is_empty() {
        of_simulation(workbench, experiment, progress)?
    } else {
        TrialBench::of(workbench, experiment, None).ok()?.with_files(ROWS, progress).ok()?
    };
    let (planned, motion_hz) = bench.step_errors(None)?;
    let one = planned.steps_per_sample.filter(|steps| *steps > 1).and_then(|_| bench.step_errors(Some(1)));
    let one = one.map(|(one, _)| one);
    let (rows, lasts_s) = bench.extent();
    let rate_hz = match bench.samples(&bench.signal) {
        Some((_, interval_s)) => interval_s.recip(),
        None => rows as f64 / lasts_s,
    };
    let percent = |errors: &StepErrors| format!("{} %", significant(100.0 * errors.error));
    let (steps, help) = match planned.steps_per_sample {
        Some(1) => ("1 step".to_owned(), ", or state a larger number of `steps` for the filter"),
        Some(steps) => (format!("{steps} steps"), ", or state a larger number of `steps` for the filter"),
        None => ("up to 64 steps, as kinks of the equations need them,".to_owned(), ""),
    };
    let in_a_cycle = rate_hz / motion_hz;
    let in_a_cycle = if in_a_cycle.is_finite() {
        format!(", {in_a_cycle:.1} samples in a cycle of the motion,")
    } else {
        String::new()
    };
    let mut text = format!(
        "At {}{in_a_cycle} `{}` takes {steps} from each sample to the next; over {rows} samples the error of the steps is {} of the standard deviation that it \
         claims",
        quantity(rate_hz, "Hz"),
        bench.filter_name,
        percent(&planned),
    );
    if let Some(one) = &one {
        text += &format!(", and that of one step {}", percent(one));
    }
    if planned.is_remarkable() {
        text += &format!(": sample at a higher rate{help}");
    }
    text += ".";
    let topic = OutlookTopic::new("Integration");
    Some(match planned.steps_per_sample {
        Some(steps) => {
            let values = [steps as f64, planned.error, one.unwrap_or(planned).error];
            topic.with("steps_their_error_and_that_of_one", values, text)
        }
        None => topic.with("error_of_steps_through_kinks", [planned.error], text),
    })
}

/// By the beginning of a simulation.
fn of_simulation<'a>(
    workbench: &'a Workbench,
    experiment: &Experiment,
    progress: &dyn Progress,
) -> Option<TrialBench<'a>> {
    let simulate = experiment.simulate.as_ref()?;
    let skip_s = experiment.estimate.as_ref()?.skip.si();
    let lasts_s = (skip_s + ROWS.0 as f64 / simulate.sampling_rate.si()).min(simulate.duration.si());
    let mut document = super::document::document(experiment).ok()?;
    put(&mut document, &Key::from("simulate.duration"), Value::String(format!("{lasts_s:e} s"))).ok()?;
    let short = workbench.parse(&toml::to_string(&document).ok()?, experiment.path()).ok()?;
    let simulation = workbench.rig(&short).ok()?.simulate(&short).ok()?;
    let computed = ComputedRecording::of(&*simulation, progress).ok()?;
    let short = described(&short, &*simulation);
    let rig = workbench.rig(&short).ok()?;
    let index = *rig.wanted(&short).ok()?.first()?;
    let recording = computed.recorded(&rig.layout(&short, index).ok()?).ok()?;
    TrialBench::of(workbench, &short, None).ok()?.with_recording(recording).ok()
}
