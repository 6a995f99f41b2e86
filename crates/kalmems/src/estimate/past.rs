//! What is kept of a segment from one part of it to the next.

use super::Trajectory;
use super::driven::DrivePast;
use super::lock::LockJudge;
use crate::signal::extremes_of_rate;
use std::any::Any;

/// What is kept of a segment.
#[derive(Default)]
pub struct Past {
    /// When the segment began, in s.
    pub start_s: f64,
    /// What is kept of its drive.
    pub drive: DrivePast,
    /// What the rig itself keeps.
    pub rig: Slot,
    filters: Vec<FilterPast>,
}

impl Past {
    /// Of a segment that begins at this time in s.
    pub fn from(start_s: f64) -> Self {
        Self { start_s, ..Self::default() }
    }

    /// What is kept of a filter, by its place in the list.
    pub fn filter(&mut self, index: usize) -> &mut FilterPast {
        while self.filters.len() <= index {
            self.filters.push(FilterPast::default());
        }
        &mut self.filters[index]
    }
}

/// Room for something whose type its owner alone knows.
#[derive(Default)]
pub struct Slot(Option<Box<dyn Any + Send>>);

impl Slot {
    /// Takes it out; `None` where there is nothing of this type.
    pub fn take<T: Any>(&mut self) -> Option<Box<T>> {
        self.0.take()?.downcast().ok()
    }

    /// Puts it there.
    pub fn put<T: Any + Send>(&mut self, kept: Box<T>) {
        self.0 = Some(kept);
    }
}

/// What is kept of one filter.
#[derive(Default)]
pub struct FilterPast {
    /// The filter on its way.
    pub run: Slot,
    /// What its way keeps.
    pub course: Slot,
    /// One per answer.
    answers: Vec<AnswerPast>,
}

/// What is kept of one answer of a filter.
#[derive(Default)]
pub(crate) struct AnswerPast {
    pub(crate) judge: LockJudge,
    /// Whether the motion of each axis is mirrored, once that is known.
    mirrored: Vec<Option<bool>>,
}

impl FilterPast {
    pub(crate) fn answer(&mut self, index: usize) -> &mut AnswerPast {
        while self.answers.len() <= index {
            self.answers.push(AnswerPast::default());
        }
        &mut self.answers[index]
    }
}

impl AnswerPast {
    /// Gives the motion whose angle and rate begin at `first` the sign of its first turning point after the drive's peak.
    ///
    /// θ → −θ is an exact symmetry of plant and sensor, and the filters keep it: had the filter started mirrored, its
    /// answer would be the mirrored one to the last bit. So the answer is mirrored, and says so. The voltages of the
    /// demodulator and the parameters are the same in both. What came before the turning point was seen is mirrored with
    /// it as far as it is part of the same piece.
    pub(crate) fn orient(&mut self, trajectory: &mut Trajectory, first: usize, positive: bool, peak_s: f64) {
        let axis = first / 2;
        if self.mirrored.len() <= axis {
            self.mirrored.resize(axis + 1, None);
        }
        if self.mirrored[axis].is_none() {
            let from = trajectory.time_s.partition_point(|t| *t < peak_s);
            let rates = &trajectory.states[first + 1].mean[from..];
            let extremes = extremes_of_rate(&trajectory.time_s[from..], rates);
            self.mirrored[axis] = extremes.first().map(|extreme| extreme.maximum != positive);
        }
        if self.mirrored[axis] == Some(true) {
            trajectory.mirrored = true;
            for mean in trajectory.states[first..first + 2].iter_mut().flat_map(|state| &mut state.mean) {
                *mean = -*mean;
            }
        }
    }
}
