//! The main job from end to end: each step is public, this calls them in order.

mod parts;

pub use parts::{LONG, PART, PartOutcome, PartsError, WholeRecording, estimate_in_parts, is_long};

use crate::config::{self, ConfigError, ConfigFault, Experiment, Key};
use crate::estimate::{EstimateError, SegmentEstimate, StretchSummary};
use crate::evaluate::{
    ErrorsByState, Judgement, MotionErrors, ReferenceError, ReferenceRecording, SegmentJudge, ValueState,
    evaluate_angles, evaluate_values,
};
use crate::progress::{Interruption, Progress, ReaderProgress};
use crate::recording::{ReadError, SampledRecording};
use crate::simulate::ComputedRecording;
use crate::{Rig, Workbench};
use std::path::Path;

/// What came of an experiment.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The experiment.
    pub experiment: Experiment,
    /// The rig's name.
    pub rig: &'static str,
    /// One per recording that was estimated.
    pub recordings: Vec<RecordingOutcome>,
}

/// What came of a recording.
#[derive(Clone, Debug)]
pub struct RecordingOutcome {
    /// Its name in the experiment, or that of its file.
    pub name: String,
    /// The recording.
    pub recording: SampledRecording,
    /// The reference, where the experiment names one.
    pub reference: Option<ReferenceRecording>,
    /// What the device's recorded input is called.
    pub input: &'static str,
    /// What it tells that is no angle; the first is what the device is for.
    pub values: &'static [ValueState],
    /// One per segment.
    pub segments: Vec<SegmentOutcome>,
    /// What became of the stretches of records that were cut.
    pub stretches: StretchSummary,
}

/// What came of a segment.
#[derive(Clone, Debug)]
pub struct SegmentOutcome {
    /// What the filters say.
    pub estimate: SegmentEstimate,
    /// How far each is from the reference; `None` where there is nothing to compare with.
    pub errors: Vec<Option<MotionErrors>>,
    /// How far each is from what the reference knows beside angles.
    pub values: Vec<ErrorsByState>,
    /// What each says for and against itself in the whole segment; none before its last part.
    pub judgements: Vec<Judgement>,
}

/// What can stop the job.
#[derive(Debug, thiserror::Error)]
pub enum WorkflowError {
    /// The experiment file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A recording is.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A recording cannot be estimated.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
    /// A reference cannot be read.
    #[error("{0}; without the table `[recording.reference]` the estimate is made all the same")]
    Reference(#[from] ReferenceError),
}

impl WorkflowError {
    /// Whether it was stopped from outside.
    pub fn is_interruption(&self) -> bool {
        matches!(
            self,
            Self::Read(ReadError::Interrupted { .. })
                | Self::Estimate(EstimateError::Interrupted)
                | Self::Reference(ReferenceError::Read(ReadError::Interrupted { .. }))
        )
    }
}

/// Reads, estimates and evaluates every recording that the experiment's rig wants.
///
/// All estimates of a recording are finished before its reference is opened.
pub fn estimate(
    workbench: &Workbench,
    experiment: &Experiment,
    progress: &dyn Progress,
) -> Result<Outcome, WorkflowError> {
    let rig = workbench.rig(experiment)?;
    let wanted = rig.wanted(experiment)?;
    // Before anything takes time: is all there that will be needed?
    for index in &wanted {
        let described = experiment.recording(*index)?;
        let key = Key::from("recording").index(*index);
        require(experiment, &described.file, key.clone().child("file"))?;
        if let Some(reference) = &described.reference {
            require(experiment, reference.file(described), key.child("reference").child("file"))?;
            ReferenceRecording::check(experiment, *index, &rig.reference(experiment)?)?;
        }
    }
    let mut recordings = Vec::new();
    for index in wanted {
        let described = experiment.recording(index)?;
        let file = experiment.resolve(&described.file);
        let mut reading = ReaderProgress::new(progress, "reading");
        let layout = rig.layout(experiment, index)?;
        let recording =
            SampledRecording::read_with(&file, &layout, &mut |done, total| reading.hear(done, total))?;
        let estimates = rig.estimate_stretches(experiment, index, &recording, progress)?;

        let mut reading = ReaderProgress::new(progress, "reading the reference");
        let reference = ReferenceRecording::read(
            experiment,
            (index, recording.origin()),
            &rig.reference(experiment)?,
            &mut |done, total| reading.hear(done, total),
        )?;
        let work = (recording, estimates, reference);
        recordings.push(evaluate((rig, experiment), described, work, None, progress)?);
    }
    if recordings.iter().all(|recording| recording.segments.is_empty()) {
        let why = "no recording has a segment to estimate".to_owned();
        return Err(experiment.error("recording", ConfigFault::Value { why }).into());
    }
    Ok(Outcome { experiment: experiment.clone(), rig: rig.name(), recordings })
}

/// Estimates and evaluates the one recording of an experiment that was simulated and not written.
///
/// The rig is given what was recorded; what is true is read only afterwards, and for the evaluation alone, as from
/// files.
pub fn estimate_computed(
    workbench: &Workbench,
    experiment: &Experiment,
    simulated: &ComputedRecording,
    progress: &dyn Progress,
) -> Result<Outcome, WorkflowError> {
    let rig = workbench.rig(experiment)?;
    let [index] = *rig.wanted(experiment)? else {
        let why = "a simulation stands for exactly one recording".to_owned();
        return Err(experiment.error("recording", ConfigFault::Value { why }).into());
    };
    let recording = simulated.recorded(&rig.layout(experiment, index)?)?;
    let estimates = rig.estimate_stretches(experiment, index, &recording, progress)?;
    let place = (index, recording.origin());
    let reference = ReferenceRecording::read_by(experiment, place, &rig.reference(experiment)?, |layout| {
        simulated.truth(layout)
    })?;
    let described = experiment.recording(index)?;
    let work = (recording, estimates, reference);
    let outcome = evaluate((rig, experiment), described, work, None, progress)?;
    Ok(Outcome { experiment: experiment.clone(), rig: rig.name(), recordings: vec![outcome] })
}

/// A part of a segment, of which the parts before were judged.
struct EvaluatedPart<'a> {
    judge: &'a mut SegmentJudge,
    /// Whether the segment begins and ends with it.
    begins: bool,
    ends: bool,
}

/// Said of a long recording.
const PARTS_OF_WHAT: &str = "The errors in equal parts of the duration, `parts`, are not given of a recording that is taken in \
                             parts: its duration is not known before its end.";

/// Compares what the filters say with the reference, and judges their innovations: of a part together with those of the parts before.
fn evaluate(
    (rig, experiment): (&dyn Rig, &Experiment),
    described: &config::Recording,
    (recording, (estimates, stretches), reference): (
        SampledRecording,
        (Vec<SegmentEstimate>, StretchSummary),
        Option<ReferenceRecording>,
    ),
    mut part: Option<EvaluatedPart<'_>>,
    progress: &dyn Progress,
) -> Result<RecordingOutcome, WorkflowError> {
    let is_whole = part.as_ref().is_none_or(|part| part.begins && part.ends);
    let stated = experiment.estimate.as_ref().and_then(|estimate| estimate.parts);
    let parts = stated.filter(|_| is_whole).unwrap_or(1);
    let samples =
        |estimate: &SegmentEstimate| estimate.trajectories.iter().map(|t| t.time_s.len()).sum::<usize>();
    let stop = Interruption::by(progress);
    progress.begin("evaluating", estimates.iter().map(samples).sum::<usize>() as u64);
    let mut segments = Vec::new();
    for mut estimate in estimates {
        if !is_whole && stated.is_some() {
            estimate.remarks.push(PARTS_OF_WHAT.to_owned());
        }
        let found = match &reference {
            Some(reference) => reference.angles_of(&estimate.segment)?,
            None => Vec::new(),
        };
        let judged = estimate.without_lost();
        let errors = evaluate_angles(&judged, &found, parts, &stop);
        let known = match &reference {
            Some(reference) => reference.values_of(&estimate.segment)?,
            None => Vec::new(),
        };
        let from_s = estimate.from_s();
        let values = judged.trajectories.iter().map(|t| evaluate_values(t, &known, from_s, &stop)).collect();
        let mut of_its_own = SegmentJudge::default();
        let (judge, ends) = match &mut part {
            Some(part) => (&mut *part.judge, part.ends),
            None => (&mut of_its_own, true),
        };
        judge.take(&judged, &stop);
        let judgements = if ends { judge.judgements(&judged) } else { Vec::new() };
        drop(judged);
        if stop.is_requested() {
            return Err(EstimateError::Interrupted.into());
        }
        segments.push(SegmentOutcome { estimate, errors, values, judgements });
    }
    let name = described.name.as_ref().map_or_else(|| recording.source().file.clone(), ToString::to_string);
    let (input, values) = (rig.input(), rig.values(experiment));
    Ok(RecordingOutcome { name, recording, reference, input, values, segments, stretches })
}

/// Refuses a file that is not there, where the experiment names it.
fn require(experiment: &Experiment, file: &Path, key: Key) -> Result<(), ConfigError> {
    if experiment.can_be_read(file) {
        return Ok(());
    }
    let path = experiment.resolve(file);
    // What is neither file nor folder, such as a pipe, is read as it comes.
    if path.exists() && !path.is_dir() {
        return Ok(());
    }
    let why = format!(
        "there is no file `{}`; give its path from the folder of the experiment file, or put it there",
        path.display()
    );
    Err(experiment.error(key, ConfigFault::Value { why }))
}
