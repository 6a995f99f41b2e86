//! How much a diagnosis may do.

use super::bench::TrialBench;
use super::trial::DiagnosisTrial;

/// How much work a diagnosis may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiagnosisEffort {
    /// No more than about twenty estimates; it says what it leaves out.
    Usual,
    /// No cause is begun after so many rows were filtered; what is left out is said.
    Rows(u64),
    /// All that it knows.
    Thorough,
}

/// Estimates whose work the search of a usual diagnosis may take. What is left of twenty is for the sizes of the causes by all blocks and for trying the
/// advice.
const ESTIMATES: f64 = 17.0;

/// What an estimate does besides filtering, in rows of a filter of one state that takes one step from each sample to the next.
const BESIDES: f64 = 1.7e6;

impl DiagnosisEffort {
    /// The rows that may be filtered. They are counted instead of measuring a time, so that a diagnosis gives the same on every machine.
    pub(super) fn rows(
        self,
        bench: &TrialBench,
        base: &DiagnosisTrial,
        (filters, steps): (usize, usize),
    ) -> u64 {
        let states = base.states.max(1) as f64;
        let besides = BESIDES / (states * states * steps.max(1) as f64);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturating; a number of rows
        match self {
            Self::Usual => (ESTIMATES * (filters as f64 * bench.extent().0 as f64 + besides)) as u64,
            Self::Rows(rows) => rows,
            Self::Thorough => u64::MAX,
        }
    }
}
