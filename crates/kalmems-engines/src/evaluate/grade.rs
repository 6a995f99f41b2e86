//! How far an answer can be trusted, in one word.

use serde::Serialize;

/// How far an answer can be trusted; what is worse is greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Grade {
    /// Nothing was found that speaks against what the filter claims.
    Passes,
    /// The same, with something that a reader should know.
    PassesWithRemarks,
    /// A test finds what a filter that is right does not show; the errors may be larger than claimed.
    Doubtful,
    /// The answer is wrong, or its claim is wrong by a large factor.
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
            Self::Passes => "Nothing was found that speaks against what the filter claims.",
            Self::PassesWithRemarks => "Nothing speaks against what the filter claims, but read the remarks.",
            Self::Doubtful => {
                "The innovations show what those of a filter that is right do not: its errors may be larger than it claims."
            }
            Self::Failed => "The answer is wrong, or its claim is wrong by a large factor.",
            Self::NoEstimate => "The filter stopped, or lost the motion: its numbers are no estimate.",
        }
    }
}

impl std::fmt::Display for Grade {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.words())
    }
}
