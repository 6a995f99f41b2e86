//! What can go wrong when a recording is read.

use super::plan::unreadable;
use super::{Finding, FindingKind, Purpose, Severity};
use kalmems_figures::number;
use kalmems_formats::FormatError;
use std::fmt::Write as _;
use std::io;
use std::path::Path;

/// Findings that a message lists; a file of another kind could have thousands.
const LISTED: usize = 20;

/// Why a recording was not read, or what it does not have.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be opened or read.
    #[error("cannot read `{file}`: {source}")]
    Io {
        /// The path as given.
        file: String,
        /// What the system says.
        source: io::Error,
    },
    /// The format of the file is not read, or the file is damaged.
    #[error("cannot read `{file}`: {source}")]
    Format {
        /// The path as given.
        file: String,
        /// What is wrong with it.
        source: Box<FormatError>,
    },
    /// The rate of a clock without a time column is no rate.
    #[error(
        "`{file}`: a clock with a rate of {} Hz that starts at {} s is none; \
         expected a finite rate above 0 and a finite start",
        number(*rate_hz), number(*start_s)
    )]
    Clock {
        /// The path as given.
        file: String,
        /// The rate as given.
        rate_hz: f64,
        /// The start as given.
        start_s: f64,
    },
    /// The file was read to its end, and at least one finding makes it unusable.
    #[error("{} cannot be used as a recording:{}", origin(file, findings), list(findings))]
    Unusable {
        /// The path as given.
        file: String,
        /// Everything found, what makes it unusable first.
        findings: Vec<Finding>,
    },
    /// A column was asked for that was not read.
    #[error("the recording `{file}` has no column `{column}`; {hint}")]
    NoColumn {
        /// The file's name.
        file: String,
        /// The column that was asked for.
        column: String,
        /// The nearest name, or what there is.
        hint: String,
    },
    /// A column is of another kind than it is used for.
    #[error("the column `{column}` of `{file}` is in `{unit}`; expected {expected}: {remedy}")]
    Kind {
        /// The file's name.
        file: String,
        /// The column.
        column: String,
        /// Its unit as it stands there.
        unit: String,
        /// The kind that was expected.
        expected: String,
        /// What to do.
        remedy: &'static str,
    },
    /// Stopped from outside.
    #[error("reading `{file}` was interrupted")]
    Interrupted {
        /// The path as given.
        file: String,
    },
}

impl ReadError {
    /// What went wrong with a format.
    pub(crate) fn of_format(path: &Path, source: FormatError) -> Self {
        let file = path.display().to_string();
        match source {
            FormatError::Io(source) => Self::Io { file, source },
            source => Self::Format { file, source: Box::new(source) },
        }
    }

    /// The same with what follows from its findings for another purpose than an estimate.
    #[must_use]
    pub fn read_for(self, purpose: Purpose) -> Self {
        match self {
            Self::Unusable { file, findings } => {
                let findings = findings.into_iter().map(|finding| finding.read_for(purpose)).collect();
                Self::Unusable { file, findings }
            }
            other => other,
        }
    }

    /// A text below whose line of names no column holds numbers.
    pub(crate) fn without_numbers(path: &Path, line: usize) -> Self {
        let detail = "there is no column of numbers below its first line".to_owned();
        Self::Unusable {
            file: path.display().to_string(),
            findings: unreadable(FindingKind::HeaderOnly, line, detail),
        }
    }
}

/// The file, or the arrays that were given in place of it.
fn origin(file: &str, findings: &[Finding]) -> String {
    let of_arrays = findings.iter().any(|finding| finding.in_arrays);
    format!("{}`{file}`", if of_arrays { "the arrays in place of " } else { "" })
}

fn list(findings: &[Finding]) -> String {
    // Writing to a string cannot fail.
    let mut text = String::new();
    for finding in findings.iter().take(LISTED) {
        let note = if finding.severity() == Severity::Note { "note: " } else { "" };
        let _ = write!(text, "\n  {note}{finding}");
    }
    if findings.len() > LISTED {
        let _ = write!(text, "\n  and {} more findings", findings.len() - LISTED);
    }
    text
}

/// The nearest of the names, or all of them where none is near.
pub(super) fn hint<'a>(wanted: &str, names: impl Iterator<Item = &'a str> + Clone) -> String {
    let lower = wanted.to_lowercase();
    let mut best: Option<(f64, &str)> = None;
    for name in names.clone() {
        let likeness = strsim::normalized_damerau_levenshtein(&lower, &name.to_lowercase());
        if likeness >= 0.5 && best.is_none_or(|(other, _)| likeness > other) {
            best = Some((likeness, name));
        }
    }
    if let Some((_, name)) = best {
        return format!("did you mean `{name}`?");
    }
    let all: Vec<String> = names.map(|name| format!("`{name}`")).collect();
    if all.is_empty() { "there are no columns".to_owned() } else { format!("there are {}", all.join(", ")) }
}
