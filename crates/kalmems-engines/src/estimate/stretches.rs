//! Stretches of a record, of which not every one has to be estimated.

use super::{EstimateError, SegmentPart};
use crate::recording::Segment;
use serde::Serialize;

/// What is known of the stretches of the records that were estimated.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StretchSummary {
    /// How often a record was cut: behind a gap that is too long to be predicted over, or where its clock goes back.
    pub restarts: usize,
    /// How many stretches of cut records were not estimated.
    pub left_out: usize,
    /// The first of them.
    pub first_left_out: Vec<SkippedStretch>,
}

/// A stretch that was not estimated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SkippedStretch {
    /// The label of its record.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub label: String,
    /// Which stretch of the record it is, counted from 1.
    pub stretch: usize,
    /// When it began, in s.
    pub start_s: f64,
    /// How many samples it has; those of its first part where it is taken in parts.
    pub samples: usize,
    /// Why it was not estimated.
    pub why: String,
}

/// Those left out that are named; the others are counted.
const NAMED: usize = 16;

impl StretchSummary {
    /// Whether there is something to tell.
    pub const fn is_empty(&self) -> bool {
        self.restarts == 0
    }
}

/// Decides which stretches may be left out: those of a record of several whose samples do not suffice, as long as some
/// stretch can be estimated. A record in one piece has to be estimated.
#[derive(Debug, Default)]
pub struct StretchJudge {
    summary: StretchSummary,
    /// What was left out first, and why.
    first: Option<EstimateError>,
    /// The first stretch of a record that could not be estimated, while it is not known whether others follow.
    pending: Option<(String, SkippedStretch, EstimateError)>,
    /// Whether the present stretch is left out.
    leaving_out: bool,
    estimated: bool,
}

impl StretchJudge {
    /// Whether a part belongs to a stretch that is left out; it comes before the estimator is asked. An error is that of a
    /// record in one piece before it.
    pub fn leaves_out(&mut self, part: &SegmentPart) -> Result<bool, EstimateError> {
        if part.begins {
            self.leaving_out = false;
            self.begin(part.segment)?;
        }
        Ok(self.leaving_out)
    }

    fn begin(&mut self, segment: &Segment) -> Result<(), EstimateError> {
        let follows = segment.stretch.number > 1;
        self.summary.restarts += usize::from(follows);
        match self.pending.take() {
            Some((label, left_out, error)) if follows && label == segment.label => {
                self.leave_out(left_out, error);
                Ok(())
            }
            Some((_, _, error)) => Err(error),
            None => Ok(()),
        }
    }

    /// Takes what an estimator says of a part: `None` where its stretch is left out.
    pub fn judge<T>(
        &mut self,
        part: &SegmentPart,
        answer: Result<T, EstimateError>,
    ) -> Result<Option<T>, EstimateError> {
        let error = match answer {
            Ok(answer) => {
                self.estimated = true;
                return Ok(Some(answer));
            }
            Err(error) if error.is_of_the_samples() && part.begins => error,
            Err(error) => return Err(error),
        };
        let Segment { label, stretch, time, .. } = part.segment;
        let left_out = SkippedStretch {
            label: label.clone(),
            stretch: stretch.number,
            start_s: time.at(part.fresh.start),
            samples: part.fresh.len(),
            why: error.to_string(),
        };
        if stretch.number > 1 {
            self.leave_out(left_out, error);
        } else if part.ends {
            self.pending = Some((label.clone(), left_out, error));
        } else {
            return Err(error);
        }
        self.leaving_out = true;
        Ok(None)
    }

    fn leave_out(&mut self, left_out: SkippedStretch, error: EstimateError) {
        self.summary.left_out += 1;
        if self.summary.first_left_out.len() < NAMED {
            self.summary.first_left_out.push(left_out);
        }
        self.first.get_or_insert(error);
    }

    /// What is known of the stretches until now.
    pub const fn summary(&self) -> &StretchSummary {
        &self.summary
    }

    /// What is known of all of them, at the end; refused where none could be estimated.
    pub fn finish(self) -> Result<StretchSummary, EstimateError> {
        match (self.pending, self.first) {
            (Some((_, _, error)), _) => Err(error),
            (None, Some(error)) if !self.estimated => Err(error),
            _ => Ok(self.summary),
        }
    }
}
