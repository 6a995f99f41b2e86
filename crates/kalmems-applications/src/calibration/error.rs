//! Why there is no calibration.

use super::tone::ToneError;
use crate::config::ConfigError;
use crate::estimate::EstimateError;
use crate::fit::FitError;
use crate::recording::ReadError;

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The stated attitudes are not those of the positions that were found.
    #[error(
        "{place}: {stated} attitudes are stated, of directions that are not 0, and {found} positions at rest were found: state one for each, in their order"
    )]
    Attitudes {
        /// The file of the record, for messages.
        place: String,
        /// The number of attitudes in the calibration file.
        stated: usize,
        /// The number of positions that the record has.
        found: usize,
    },
    /// The calibration file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A file that it names cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A channel is clipped, or repeats another one.
    #[error(transparent)]
    Signal(#[from] EstimateError),
    /// A record cannot be used.
    #[error("{place}: {fault}")]
    Tone {
        /// The file and the record.
        place: String,
        /// What is wrong.
        fault: ToneError,
    },
    /// The gyroscope saw another motion.
    #[error(
        "record `{record}`: the gyroscope shows {shown_hz:.2} Hz by its nominal rate and {reference} {reference_hz:.2} Hz, \
         {off:+.3} % apart; expected within its `clock_tolerance` of {tolerance:.3} %: the records are of different motions \
         (exchange the file or `records`), or `rate` is not its nominal rate, or the tolerance is too small"
    )]
    Frequencies {
        /// The record.
        record: String,
        /// The reference.
        reference: String,
        /// By the gyroscope.
        shown_hz: f64,
        /// By the reference.
        reference_hz: f64,
        /// How far apart in %.
        off: f64,
        /// How far they may be in %.
        tolerance: f64,
    },
    /// The vibration is too fast for the gyroscope's rate.
    #[error(
        "record `{record}`: the vibration at {frequency_hz:.1} Hz is above half of the gyroscope's rate of {rate_hz:.1} Hz, where \
         its frequency is ambiguous; drive below that, or choose a faster output"
    )]
    Aliased {
        /// The record.
        record: String,
        /// Of the reference.
        frequency_hz: f64,
        /// The nominal rate.
        rate_hz: f64,
    },
    /// A record has no partner.
    #[error("{place} has no record `{record}`; it has {}; name those that both have in `records`", known.join(", "))]
    NoRecord {
        /// The record, as the calibration file names it.
        place: String,
        /// The record.
        record: String,
        /// Those that there are.
        known: Vec<String>,
    },
    /// The equations cannot be solved.
    #[error("condition `{condition}`, reference `{reference}`: {fault}")]
    Fit {
        /// The condition.
        condition: String,
        /// The reference.
        reference: String,
        /// What is wrong.
        fault: FitError,
    },
    /// No axis is common to both.
    #[error(
        "condition `{condition}`: the gyroscope has the axes {shown} and {reference} has {known}; expected an axis that both \
         have, and records that turn about it alone, or about several with phases that differ from record to record"
    )]
    NoCommonAxis {
        /// The condition.
        condition: String,
        /// The reference.
        reference: String,
        /// The gyroscope's axes.
        shown: String,
        /// The reference's axes.
        known: String,
    },
    /// The trials of a Monte Carlo method find no results.
    #[error(
        "monte_carlo: more than half of the trials have no matrix that fits their records; the records hardly tell it, so that trials say \
         nothing of its uncertainty: leave `[monte_carlo]` out, or take records with more motion"
    )]
    Trials,
    /// A record of positions has too few of them.
    #[error(
        "{place}: found {found} positions in which the unit is still for {shortest_s} s or longer; expected at least {expected}, in directions that \
         differ: rest longer in each, or state a shorter time as `positions.shortest`"
    )]
    Positions {
        /// The record, as the calibration file names it.
        place: String,
        /// How many were found.
        found: usize,
        /// The fewest that suffice.
        expected: usize,
        /// The shortest position in s.
        shortest_s: f64,
    },
    /// The equations of a record cannot be solved.
    #[error("{place}: the record gives no solution: {fault}; take one with rests or rates that differ more")]
    RecordFit {
        /// The record, as the calibration file names it.
        place: String,
        /// What is wrong.
        fault: FitError,
    },
    /// A record on a rate table has too few steps.
    #[error(
        "{place}: found {found} parts of {shortest_s} s or longer in which the table turns at a constant rate, with {rates} different rates; expected at \
         least {expected} with {expected_rates} rates of both signs: hold each rate longer, or state a shorter time as `shortest`"
    )]
    Steps {
        /// The record, as the calibration file names it.
        place: String,
        /// How many were found.
        found: usize,
        /// Rates that differ.
        rates: usize,
        /// The fewest that suffice.
        expected: usize,
        /// Rates that it takes.
        expected_rates: usize,
        /// The shortest step in s.
        shortest_s: f64,
    },
    /// A record of turns has too few of them.
    #[error(
        "{place}: found {found} turns with a rest of {shortest_s} s or longer before and after; expected at least {expected}: rest longer between them, or state \
         a shorter time as `shortest`"
    )]
    Turns {
        /// The record, as the calibration file names it.
        place: String,
        /// How many were found.
        found: usize,
        /// The fewest that suffice.
        expected: usize,
        /// The shortest rest in s.
        shortest_s: f64,
    },
    /// The record at rest is too short.
    #[error("{place}: found {samples} samples with a number; expected at least 64 without motion")]
    Rest {
        /// The file and column.
        place: String,
        /// How many.
        samples: usize,
    },
}

impl CalibrationError {
    /// Whether it was stopped from outside.
    pub const fn is_interruption(&self) -> bool {
        matches!(self, Self::Read(ReadError::Interrupted { .. }))
    }
}
