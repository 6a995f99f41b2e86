//! Whether what is claimed holds: verdicts, diagnoses, outliers, coverage.

mod coverage;
mod devices;
mod diagnose;
mod impairments;
mod outliers;
mod readouts;
mod starts;
mod verdict;
