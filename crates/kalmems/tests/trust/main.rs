//! Whether what is claimed holds: verdicts, diagnoses, outliers, coverage.

mod clipping;
mod coverage;
mod devices;
mod diagnose;
mod impairments;
mod input_faults;
mod judgement;
mod losses;
mod motions;
mod outliers;
#[path = "../parts/mod.rs"]
mod parts;
mod piston_motions;
mod process_noise;
mod readouts;
mod side_by_side;
mod smoothed;
mod starts;
mod verdict;
