//! What the tests of innovations find in a stream, of the last samples and not of all there ever were.

use crate::estimate::SegmentEstimate;
use crate::evaluate::{InnovationTest, SegmentJudge};
use crate::progress::Interruption;

/// Innovations that are judged together; what a fault of now adds to more of them is too little to be seen.
const WINDOW: f64 = 1_048_576.0;

/// From so many on what is found stands for itself; until then that of the window before does.
const ENOUGH: f64 = WINDOW / 8.0;

/// Judges the filters of a stream window by window.
#[derive(Default)]
pub(super) struct StreamJudge {
    now: SegmentJudge,
    /// What failed in the window before, of each filter by its key.
    before: Vec<(String, Vec<InnovationTest>)>,
}

impl StreamJudge {
    /// Begins anew with a stretch of samples.
    pub(super) fn begin(&mut self) {
        *self = Self::default();
    }

    pub(super) fn take(&mut self, estimate: &SegmentEstimate) {
        self.now.take(&estimate.without_lost(), &Interruption::never());
        if self.now.count() >= WINDOW {
            let all = estimate.trajectories.iter().map(|t| (t.key.clone(), failing(&self.now, &t.key)));
            self.before = all.collect();
            self.now = SegmentJudge::default();
        }
    }

    /// What fails of a filter.
    pub(super) fn failing(&self, key: &str) -> Vec<InnovationTest> {
        let before = self.before.iter().find(|(own, _)| own == key);
        match before {
            Some((_, failing)) if self.now.count() < ENOUGH => failing.clone(),
            _ => failing(&self.now, key),
        }
    }
}

fn failing(judge: &SegmentJudge, key: &str) -> Vec<InnovationTest> {
    let tests = judge.of(key).map_or_else(Vec::new, |judgement| judgement.tests);
    tests.iter().filter(|found| found.fails()).map(|found| found.test).collect()
}
