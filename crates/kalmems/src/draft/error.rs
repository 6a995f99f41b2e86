//! Why there is no draft.

use super::Question;
use crate::config::ConfigError;
use crate::inspect::UnitlessTime;
use crate::recording::ReadError;
use crate::simulate::SimulateError;
use std::fmt;
use std::path::PathBuf;

/// Why there is no draft of an experiment file.
#[derive(Debug, thiserror::Error)]
pub enum DraftError {
    /// No device of this name has a template.
    #[error(
        "found the device `{found}`; expected one of {}; `kalmems new --list` describes them",
        named(known)
    )]
    Device {
        /// The name.
        found: String,
        /// Those that have one.
        known: Vec<&'static str>,
    },
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The recording cannot be used as it is.
    #[error("`{file}` cannot be used as a recording as it is; `kalmems inspect {file}` says why", file = file.display())]
    Unusable {
        /// The file.
        file: PathBuf,
    },
    /// The recording has no column of times, and no rate is stated.
    #[error("`{}` has no column of times; state the sampling rate, such as `--rate \"1 MHz\"`", file.display())]
    NoTime {
        /// The file.
        file: PathBuf,
    },
    /// A column may be the time, but nothing says its unit.
    #[error("`{}`: {}", file.display(), Unitless(found))]
    TimeWithoutUnit {
        /// The file.
        file: PathBuf,
        /// The column.
        found: UnitlessTime,
    },
    /// A column of times is stated that the recording does not have.
    #[error("`{}` has no column `{found}` with times; its other columns are {}", file.display(), named(known))]
    TimeColumn {
        /// The file.
        file: PathBuf,
        /// What was stated.
        found: String,
        /// Those that it has.
        known: Vec<String>,
    },
    /// A number is stated that the device does not have, or that may be several of its numbers.
    #[error("{}", number(found, several, known))]
    Number {
        /// What was stated.
        found: String,
        /// Those that it may be.
        several: Vec<String>,
        /// Those that the device has.
        known: Vec<String>,
    },
    /// The experiment with the stated numbers is refused.
    #[error("{}: {}", .0.place.key, .0.fault)]
    Experiment(Box<ConfigError>),
    /// A channel is stated that the device does not have.
    #[error("found the channel `{found}`; the device has {}", named(known))]
    Meaning {
        /// What was stated.
        found: String,
        /// Those that it has.
        known: Vec<&'static str>,
    },
    /// A column is stated that the recording does not have.
    #[error(
        "`{meaning}` is assigned to the column `{found}`, which does not exist; the recording has {}",
        named(known)
    )]
    Column {
        /// The channel.
        meaning: String,
        /// What was stated.
        found: String,
        /// Those that it has.
        known: Vec<String>,
    },
    /// A template cannot be simulated.
    #[error(transparent)]
    Simulation(SimulateError),
    /// It is not known which column is what.
    #[error("{}", Questions(.0))]
    Open(Vec<Question>),
}

/// Names one after the other, in marks.
fn named(names: &[impl fmt::Display]) -> String {
    let marked: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match marked.split_last() {
        None => "none".to_owned(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
    }
}

/// Why a stated number has no place.
fn number(found: &str, several: &[String], known: &[String]) -> String {
    if several.is_empty() {
        format!("found the number `{found}`; the device has {}", named(known))
    } else {
        format!("found the number `{found}`, which may be {}; write more of its key", named(several))
    }
}

/// A column that may be the time, with what to state for each unit that it may be in.
struct Unitless<'a>(&'a UnitlessTime);

impl fmt::Display for Unitless<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let column = &self.0.column;
        write!(f, "{} State its unit:", self.0.sentence())?;
        for unit in self.0.units() {
            let rate = self.0.rate_in(unit).unwrap_or_default();
            write!(f, "\n  `--time {column}={unit}` if the samples follow each other at {rate}")?;
        }
        write!(f, "\nIf it is not the time, state the sampling rate, such as `--rate \"1 MHz\"`")
    }
}

struct Questions<'a>(&'a [Question]);

impl fmt::Display for Questions<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, question) in self.0.iter().enumerate() {
            let joint = if index == 0 { "" } else { "\n" };
            let Question { file, meaning, what, candidates } = question;
            if candidates.is_empty() {
                write!(
                    f,
                    "{joint}`{file}`: no column can be `{meaning}`, {what}: no remaining column has its unit"
                )?;
            } else {
                let (columns, first) = (named(candidates), &candidates[0]);
                write!(
                    f,
                    "{joint}`{file}`: `{meaning}`, {what}, may be {columns}; state which, such as `--channel {meaning}={first}`"
                )?;
            }
        }
        Ok(())
    }
}
