//! Whether what is claimed holds: verdicts, diagnoses, outliers, coverage.

mod coverage;
mod devices;
mod diagnose;
mod impairments;
mod losses;
mod outliers;
mod readouts;
mod starts;
mod verdict;
