//! Simulation-based calibration: whether what filters claim holds over many devices that are as they are told.
//!
//! In each run the truth is drawn from what a filter holds as uncertain: every parameter that it has as a state from the prior
//! that the experiment states, and what the study draws for the truth; the noise has a seed of its own. Over the runs the
//! verdict may fail as seldom as it says, a claim covers as many errors as it says, and the rank of the truth in the
//! posterior distribution, Φ((truth − estimate)/sd), is distributed uniformly (Talts, Betancourt, Simpson, Vehtari & Gelman,
//! "Validating Bayesian inference algorithms with simulation-based calibration", 2018).
//!
//! Filters that state different priors are different statements about the device: each group of filters with the same priors has
//! runs of its own, in which the truth is drawn from theirs.

mod claim;
mod device;
mod judged;
mod pictures;
mod plan;
mod prior;
mod share;
mod sign;
mod summary;
mod tables;
mod uniformity;

pub use claim::{ClaimCalibration, ClaimFinding, CoverageLevel};
pub(super) use judged::{RunClaims, judged};
pub(super) use pictures::figures;
pub(super) use plan::Groups;
pub(super) use prior::DrawnDeviation;
pub use share::Share;
pub(super) use sign::state_signs;
pub use summary::{FilterCalibration, GradeCount, StudyCalibrationSummary, TestCount};
pub(super) use tables::{long_table, page_tables};
pub use uniformity::Uniformity;
