//! Whether what is claimed holds: verdicts, diagnoses, outliers, coverage.

mod coverage;
mod devices;
mod diagnose;
mod outliers;
mod verdict;
