//! The main job on recordings of any length, in memory that does not grow with them.

use super::{EvaluatedPart, RecordingOutcome, WorkflowError, evaluate, require};
use crate::config::{ConfigFault, Experiment, Key};
use crate::estimate::{
    EstimateError, RowsAround, SegmentEstimate, SegmentPart, StretchAnswer, StretchJudge, StretchSummary,
};
use crate::evaluate::{ReferenceError, ReferenceParts, ReferenceRecording, SegmentJudge};
use crate::progress::{Progress, Silent};
use crate::recording::{self, Finding, Instant, RecordingSource, Stretches};
use crate::{Estimator, Rig, Workbench};
use std::cell::Cell;
use std::ops::ControlFlow;
use std::path::Path;

/// New rows of a part.
pub const PART: usize = 1 << 16;

/// A recording of more rows than this is long: it is taken in parts.
pub const LONG: usize = 1 << 18;

/// What came of a part of a recording.
#[derive(Clone, Debug)]
pub struct PartOutcome {
    /// The recording, by its place among those that are estimated.
    pub index: usize,
    /// The part as a recording of one segment; without a digest of the file, which is not known before its end.
    pub outcome: RecordingOutcome,
    /// Whether the segment begins with it.
    pub begins: bool,
    /// Whether the segment ends with it.
    pub ends: bool,
}

/// What is known of a recording and its reference after the last part.
#[derive(Clone, Debug)]
pub struct WholeRecording {
    /// Its file.
    pub source: RecordingSource,
    /// What was found in it.
    pub diagnosis: Vec<Finding>,
    /// The same of its reference, where there is one.
    pub reference: Option<(RecordingSource, Vec<Finding>)>,
    /// What became of the stretches of records that were cut.
    pub stretches: StretchSummary,
}

/// Why the work on a long recording ended early.
#[derive(Debug)]
pub enum PartsError<E> {
    /// The work itself could not be done.
    Work(WorkflowError),
    /// What came of a part was not taken.
    Taken(E),
}

impl<E, W: Into<WorkflowError>> From<W> for PartsError<E> {
    fn from(error: W) -> Self {
        Self::Work(error.into())
    }
}

/// Whether a recording that the rig wants is too long to be held in memory, or, being no file, cannot be asked how long it
/// is.
pub fn is_long(workbench: &Workbench, experiment: &Experiment) -> Result<bool, WorkflowError> {
    let rig = workbench.rig(experiment)?;
    for index in rig.wanted(experiment)? {
        let described = experiment.recording(index)?;
        let path = experiment.resolve(&described.file);
        require(experiment, &described.file, Key::from("recording").index(index).child("file"))?;
        if !experiment.can_be_read(&described.file)
            || recording::has_more_rows(&path, &rig.layout(experiment, index)?, LONG as u64)?
        {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Estimates and evaluates every recording that the experiment's rig wants, part by part, and gives each to `taken`.
///
/// What the filters say of a sample is what [`estimate`](super::estimate) says of it; a smoother over the whole recording
/// knows one part ahead.
pub fn estimate_in_parts<E>(
    workbench: &Workbench,
    experiment: &Experiment,
    progress: &dyn Progress,
    taken: &mut dyn FnMut(PartOutcome) -> Result<(), E>,
) -> Result<Vec<WholeRecording>, PartsError<E>> {
    let rig = workbench.rig(experiment)?;
    let mut all = Vec::new();
    for (place, index) in rig.wanted(experiment)?.into_iter().enumerate() {
        let work = RecordingWork { experiment, rig, index, place, progress };
        all.push(work.run(taken)?);
    }
    Ok(all)
}

/// The work on one recording.
struct RecordingWork<'a> {
    experiment: &'a Experiment,
    rig: &'a dyn Rig,
    index: usize,
    place: usize,
    progress: &'a dyn Progress,
}

impl RecordingWork<'_> {
    fn run<E>(
        &self,
        taken: &mut dyn FnMut(PartOutcome) -> Result<(), E>,
    ) -> Result<WholeRecording, PartsError<E>> {
        let (experiment, index) = (self.experiment, self.index);
        let file = &experiment.recording(index)?.file;
        ReferenceRecording::check(experiment, index, &self.rig.reference(experiment)?)?;
        // A filter says nothing of its way through a part; how far the reading has come is what is told.
        let stopped = PartProgress { progress: self.progress, reached: Cell::new(0) };
        let mut estimator = self.rig.considering(experiment, index, &stopped)?;
        let around = recording::StretchSize { rows: PART, first: PART, before: 0, after: 1 };
        let layout = self.rig.layout(experiment, index)?;
        let mut stretches = Stretches::open(&experiment.resolve(file), &layout, around)?;
        // It is opened once the recording says where its times count from.
        let mut reference: Option<Option<ReferenceParts>> = None;
        let mut begun = false;
        let progress = self.progress;
        let mut hear = |done: u64, total: u64| {
            if !begun {
                progress.begin("estimating", total);
                begun = true;
            }
            stopped.reached.set(done);
            progress.reached(done)
        };
        let (mut any, mut judge, mut innovations) = (false, StretchJudge::default(), SegmentJudge::default());
        loop {
            if let Some(interval_s) = stretches.beginning(&mut hear)? {
                stretches.give(around_part(estimator.around(interval_s)));
            }
            let Some(stretch) = stretches.next(&mut hear)? else { break };
            let Some(segment) = stretch.recording.segments().first() else { continue };
            if !estimator.wants(&segment.label) {
                stretches.reuse(stretch);
                continue;
            }
            any = true;
            if stretch.begins {
                innovations = SegmentJudge::default();
            }
            let part = SegmentPart {
                recording: &stretch.recording,
                segment,
                fresh: stretch.fresh.clone(),
                begins: stretch.begins,
                ends: stretch.ends,
            };
            if !judge.leaves_out(&part)? {
                require_head(estimator.as_ref(), &part, file)?;
                let interval_s = part.segment.time.interval_s();
                let head = interval_s.map_or(0, |interval_s| estimator.around(interval_s).head);
                let answer = judge.attempt(&part, head, &mut |part| estimator.take(part))?;
                if let StretchAnswer::Refused { again: Some(rows), .. } = answer {
                    stretches.begin_again(rows);
                }
                if let StretchAnswer::Estimated(estimate) = answer {
                    let reference = match &mut reference {
                        Some(reference) => reference,
                        closed => closed.insert(self.reference(stretch.recording.origin())?),
                    };
                    let outcome = self.part(estimate, &part, reference.as_mut(), &mut innovations)?;
                    let (begins, ends) = (stretch.begins, stretch.ends);
                    taken(PartOutcome { index: self.place, outcome, begins, ends })
                        .map_err(PartsError::Taken)?;
                }
            }
            stretches.reuse(stretch);
        }
        if !any {
            let why = "no recording has a segment to estimate".to_owned();
            return Err(experiment.error("recording", ConfigFault::Value { why }).into());
        }
        let (source, diagnosis) = stretches.finish();
        estimator.conclude(&source.file, &diagnosis)?;
        let (reference, stretches) = (reference.flatten().map(ReferenceParts::finish), judge.finish()?);
        Ok(WholeRecording { source, diagnosis, reference, stretches })
    }

    fn reference(&self, origin: Instant) -> Result<Option<ReferenceParts>, ReferenceError> {
        let place = (self.index, origin);
        ReferenceParts::open(self.experiment, place, &self.rig.reference(self.experiment)?)
    }

    fn part(
        &self,
        estimate: SegmentEstimate,
        part: &SegmentPart,
        reference: Option<&mut ReferenceParts>,
        judge: &mut SegmentJudge,
    ) -> Result<RecordingOutcome, WorkflowError> {
        let ends = |pick: fn(&[f64]) -> Option<&f64>| {
            let times = estimate.trajectories.iter().filter_map(move |t| pick(&t.time_s).copied());
            times.collect::<Vec<f64>>()
        };
        let from_s = ends(<[f64]>::first).into_iter().fold(f64::INFINITY, f64::min);
        let to_s = ends(<[f64]>::last).into_iter().fold(f64::NEG_INFINITY, f64::max);
        let known: Option<ReferenceRecording> = match reference {
            Some(reference) => {
                reference.over(part.segment, from_s, to_s, &mut |_, _| ControlFlow::Continue(()))?
            }
            None => None,
        };
        let described = self.experiment.recording(self.index)?;
        let estimates = (vec![estimate], StretchSummary::default());
        let work = (part.recording.clone(), estimates, known);
        // Of a part it takes no time that anybody would see.
        let of_part = EvaluatedPart { judge, begins: part.begins, ends: part.ends };
        evaluate((self.rig, self.experiment), described, work, Some(of_part), &Silent)
    }
}

/// Stops the work on a part where the whole is stopped, and tells nothing of it.
struct PartProgress<'a> {
    progress: &'a dyn Progress,
    /// How far the whole has come.
    reached: Cell<u64>,
}

impl Progress for PartProgress<'_> {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, _: u64) -> ControlFlow<()> {
        self.progress.reached(self.reached.get())
    }
}

/// What an estimator is given of a segment at a time: a first part that holds what it needs of the beginning, and, where it
/// smooths, all of the part before.
fn around_part(RowsAround { head, before, after, smooths }: RowsAround) -> recording::StretchSize {
    let first = head.clamp(PART, RowsAround::LONGEST_HEAD);
    let before = before + if smooths { first } else { 0 };
    recording::StretchSize { rows: PART, first, before, after: after.max(1) }
}

/// Refuses a first part that is too short for the estimator although the segment goes on.
fn require_head(estimator: &dyn Estimator, part: &SegmentPart, file: &Path) -> Result<(), WorkflowError> {
    let Some(interval_s) = part.segment.time.interval_s() else { return Ok(()) };
    let needed = estimator.around(interval_s).head;
    if !part.begins || part.ends || part.fresh.len() >= needed {
        return Ok(());
    }
    let (place, held) = (file.display().to_string(), part.fresh.len());
    Err(EstimateError::LongStart { place, needed, held }.into())
}
