//! How far an estimate can be trusted, in one word.

use serde::{Deserialize, Serialize};

/// How far an estimate can be trusted; a worse grade is greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grade {
    /// No test contradicts the estimate or its claimed standard deviation.
    Passes,
    /// No test contradicts them, and there is a remark that a reader should know.
    PassesWithRemarks,
    /// A test finds in the innovations what those of a filter with the true model do not show; the errors may be larger than claimed.
    Doubtful,
    /// The estimate is wrong, or its claimed standard deviation is wrong by a large factor.
    Failed,
    /// The filter stopped, or lost the motion.
    NoEstimate,
}

impl Grade {
    /// In a few words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Passes => "passes",
            Self::PassesWithRemarks => "passes with remarks",
            Self::Doubtful => "doubtful",
            Self::Failed => "failed",
            Self::NoEstimate => "no estimate",
        }
    }

    /// What it means.
    pub const fn sentence(self) -> &'static str {
        match self {
            Self::Passes => "No test contradicts the estimate or its claimed standard deviation.",
            Self::PassesWithRemarks => {
                "No test contradicts the estimate or its claimed standard deviation; the remarks say what a reader should know."
            }
            Self::Doubtful => {
                "The innovations show what those of a filter with a true model do not show: the errors may be larger than the claimed standard deviations."
            }
            Self::Failed => {
                "The estimate is wrong, or its claimed standard deviation is wrong by a large factor."
            }
            Self::NoEstimate => {
                "The filter stopped, or lost the motion: its numbers are no estimate of the motion."
            }
        }
    }
}

impl std::fmt::Display for Grade {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.words())
    }
}
