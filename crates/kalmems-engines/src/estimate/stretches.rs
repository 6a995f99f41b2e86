//! Stretches of a record, of which not every one has to be estimated.

use super::{EstimateError, SegmentPart};
use crate::recording::{SampledRecording, Segment};
use serde::Serialize;

/// What is known of the stretches of the records that were estimated.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StretchSummary {
    /// How often a record was cut: behind a gap that is too long to be predicted over, or where its clock goes back.
    pub restarts: usize,
    /// How often rows were not estimated: those of a stretch, or its first ones, at which no filter could begin.
    pub left_out: usize,
    /// The first of them.
    pub first_left_out: Vec<SkippedStretch>,
}

/// Rows that were not estimated: a stretch, or its first ones.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SkippedStretch {
    /// The label of its record.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub label: String,
    /// Which stretch of the record it is, counted from 1.
    pub stretch: usize,
    /// When they began, in s.
    pub start_s: f64,
    /// How many there are.
    pub samples: usize,
    /// Why the first of them were not.
    pub why: String,
}

/// Those left out that are named; the others are counted.
const NAMED: usize = 16;

impl StretchSummary {
    /// Whether there is something to tell.
    pub const fn is_empty(&self) -> bool {
        self.restarts == 0 && self.left_out == 0
    }
}

/// Rows from a refused beginning to the next one that is tried, at least and at most, and as a share of those that were refused.
const FIRST_STEP: usize = 1024;
const LONGEST_STEP: usize = 1 << 16;
const STEP_SHARE: usize = 4;

/// What becomes of the new rows of a part.
#[derive(Debug)]
pub enum StretchAnswer<T> {
    /// They are estimated.
    Estimated(T),
    /// They are not, for this reason. The stretch begins anew so many rows behind the first of them; never where nothing more of it can be
    /// estimated.
    Refused {
        /// Why.
        why: String,
        /// After as many.
        again: Option<usize>,
    },
}

/// Decides what becomes of rows that cannot be estimated: a beginning that is refused is tried again with later rows, and what is left of a stretch
/// is left out where no later beginning is accepted. Some of each record has to be estimated, if not all of its stretches, and not each from its
/// first row on. Samples that arrive are under no such rule.
#[derive(Debug, Default)]
pub struct StretchJudge {
    summary: StretchSummary,
    /// Whether samples arrive.
    is_live: bool,
    /// The present stretch: rows that were refused at its beginning, and the entry of these among those left out.
    tried: usize,
    present: Option<SkippedStretch>,
    next: NextRows,
    record: RecordTally,
}

/// What the rows are that come next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum NextRows {
    /// Those of another stretch, or further ones of the present one.
    #[default]
    Follow,
    /// Those of a later beginning of the present stretch.
    BeginAgain,
    /// Further ones of a stretch that is left out.
    LeftOut,
}

/// The present record.
#[derive(Debug, Default)]
struct RecordTally {
    /// Whether some of it was estimated, and why the first rows of it were not that were refused.
    estimated: bool,
    error: Option<EstimateError>,
}

impl StretchJudge {
    /// Of samples that arrive, of which none has to be estimated.
    pub fn of_arriving() -> Self {
        Self { is_live: true, ..Self::default() }
    }

    /// Whether a part belongs to a stretch that is left out; it comes before the estimator is asked. An error is that of the record before it.
    pub fn leaves_out(&mut self, part: &SegmentPart) -> Result<bool, EstimateError> {
        let begins_again = part.begins && self.begins_again();
        if begins_again {
            self.next = NextRows::Follow;
        } else if part.begins {
            self.end_stretch();
            if part.segment.stretch.number > 1 {
                self.summary.restarts += 1;
            } else {
                self.end_record()?;
            }
        }
        let is_left_out = self.next == NextRows::LeftOut;
        if is_left_out {
            self.leave_out(part, part.fresh.len(), None);
        }
        Ok(is_left_out)
    }

    /// Whether the next beginning is a later one of the present stretch.
    pub const fn begins_again(&self) -> bool {
        matches!(self.next, NextRows::BeginAgain)
    }

    /// Takes what an estimator says of a part, of which the first one of a stretch has so many rows at least.
    pub fn attempt<T>(
        &mut self,
        part: &SegmentPart,
        head: usize,
        take: &mut dyn FnMut(&SegmentPart) -> Result<T, EstimateError>,
    ) -> Result<StretchAnswer<T>, EstimateError> {
        let error = match take(part) {
            Ok(answer) => {
                self.end_stretch();
                self.record.estimated = true;
                return Ok(StretchAnswer::Estimated(answer));
            }
            Err(error) if error.is_of_the_samples() && (part.begins || self.is_live) => error,
            Err(error) => return Err(error),
        };
        let rows = part.fresh.len();
        // Where the first rows alone are accepted, later ones are what refuses the stretch: no later beginning would go round them.
        let head = part.fresh.start..part.fresh.start + head.min(rows);
        let beginning = SegmentPart { fresh: head, ends: false, ..part.clone() };
        let begins_later = !part.begins || beginning.fresh.len() == rows || take(&beginning).is_err();
        // How many rows a part has that is refused within a stretch follows from what has arrived.
        let step = if part.begins { self.step() } else { self.step().min(rows) };
        // Of a record that is too short, less is no better.
        let is_over = part.ends && (step >= rows || (part.begins && error.is_of_too_few()));
        let again = Some(step).filter(|_| begins_later && !is_over);
        let why = error.to_string();
        self.leave_out(part, again.unwrap_or(rows), Some(&why));
        self.tried += step;
        self.next = match again {
            Some(_) => NextRows::BeginAgain,
            None if part.ends => NextRows::Follow,
            None => NextRows::LeftOut,
        };
        self.record.error.get_or_insert(error);
        Ok(StretchAnswer::Refused { why, again })
    }

    /// Rows to the next beginning that is tried.
    fn step(&self) -> usize {
        (self.tried / STEP_SHARE).next_multiple_of(FIRST_STEP).clamp(FIRST_STEP, LONGEST_STEP)
    }

    fn leave_out(&mut self, part: &SegmentPart, rows: usize, why: Option<&str>) {
        let Segment { label, stretch, time, .. } = part.segment;
        let present = self.present.get_or_insert_with(|| SkippedStretch {
            label: label.clone(),
            stretch: stretch.number,
            start_s: time.at(part.fresh.start),
            samples: 0,
            why: why.unwrap_or_default().to_owned(),
        });
        present.samples += rows;
    }

    /// What was left out until now is all of it.
    fn end_stretch(&mut self) {
        (self.tried, self.next) = (0, NextRows::Follow);
        let Some(left_out) = self.present.take() else { return };
        self.summary.left_out += 1;
        if self.summary.first_left_out.len() < NAMED {
            self.summary.first_left_out.push(left_out);
        }
    }

    /// The record is over; refused where nothing of it was estimated.
    fn end_record(&mut self) -> Result<(), EstimateError> {
        let RecordTally { estimated, error } = std::mem::take(&mut self.record);
        error.filter(|_| !(estimated || self.is_live)).map_or(Ok(()), Err)
    }

    /// What is known of all of them, at the end; refused where the last record could not be estimated.
    pub fn finish(mut self) -> Result<StretchSummary, EstimateError> {
        self.end_stretch();
        self.end_record()?;
        Ok(self.summary)
    }
}

/// What is said of a segment that is held in memory, from the first row on at which it is accepted; a recording in parts begins with so many rows.
pub fn of_whole_segment<T>(
    judge: &mut StretchJudge,
    (recording, segment): (&SampledRecording, &Segment),
    head: usize,
    take: &mut dyn FnMut(&SegmentPart) -> Result<T, EstimateError>,
) -> Result<Option<T>, EstimateError> {
    let mut rows = 0..segment.time.len();
    loop {
        let piece = segment.part(&rows);
        let part = SegmentPart::whole(recording, &piece);
        if judge.leaves_out(&part)? {
            return Ok(None);
        }
        match judge.attempt(&part, head, take)? {
            StretchAnswer::Estimated(answer) => return Ok(Some(answer)),
            StretchAnswer::Refused { again: Some(step), .. } => rows.start += step,
            StretchAnswer::Refused { again: None, .. } => return Ok(None),
        }
    }
}
