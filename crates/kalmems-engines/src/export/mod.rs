//! A filter of an experiment as source code for a microcontroller.
//!
//! What is exported computes in units of its own: an angle in units of the device's width, a time in samples and a
//! signal in standard deviations of its noise. The constants are derived in f64 from what the experiment says, as the
//! estimate derives them, and none is far from one, which suits f32; where one is exactly one, it costs nothing.

mod error;
mod project;
mod samples;
mod write;

pub use error::ExportError;
pub use samples::ExportSamples;
pub use write::{Exported, c_name, checksum, export, heading, place_of_filter, write_export};

use serde::Serialize;
use std::num::NonZeroU32;

/// The language of the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceLanguage {
    /// C99 without any library.
    C,
    /// Rust with `kalmems-core` and `kalmems-models`, without `std`.
    Rust,
}

/// What is wanted of an experiment.
#[derive(Clone, Debug)]
pub struct ExportRequest {
    /// The language.
    pub target: SourceLanguage,
    /// The filter's name or key.
    pub filter: String,
    /// The sampling interval in s; that of the experiment's first recording if `None`.
    pub interval_s: Option<f64>,
    /// Every how many samples the filter is corrected.
    pub update_every: NonZeroU32,
    /// How many samples of the first recording are written beside it, to try it with.
    pub samples: usize,
    /// Parameters that the program may change while it runs, of a device of one's own.
    pub adjustable: Vec<String>,
    /// How many digits the source computes with, of a device of one's own.
    pub digits: SourceDigits,
    /// Whether the samples of the whole first stretch of the recording come with it, to run the source over.
    pub verify: bool,
    /// What is to be said of it at the head of the source, besides where it is from.
    pub notes: Vec<String>,
}

/// What a step of a source takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct SourceCost {
    /// Sums, products, divisions, calls of functions and choices in numbers of 32 bits.
    pub in_32_bits: [usize; 5],
    /// The same in 64 bits.
    pub in_64_bits: [usize; 5],
    /// Means and entries of the covariance.
    pub numbers: usize,
    /// Measurements that correct it.
    pub measurements: usize,
    /// The size of the filter's structure in bytes.
    pub bytes: usize,
}

/// How many digits a source computes with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SourceDigits {
    /// Numbers of 32 bits, and of 64 where a rehearsal over the recording needs them to come within 10⁻⁵ of the library's filter.
    #[default]
    AsNeeded,
    /// Numbers of 32 bits.
    Single,
    /// Means and covariance in numbers of 64 bits.
    Double,
}

/// A filter that can be exported; what its source looks like is its rig's.
pub trait ExportableFilter {
    /// The source for what is asked.
    fn source(&self, task: &ExportTask<'_>) -> Result<FilterSource, ExportError>;
}

/// What a source is written for.
#[derive(Clone, Copy, Debug)]
pub struct ExportTask<'a> {
    /// The language.
    pub target: SourceLanguage,
    /// The filter's name.
    pub filter: &'a str,
    /// What names of files, types and functions begin with, a name that C takes.
    pub prefix: &'a str,
    /// The lines at the head of each file.
    pub heading: &'a [String],
    /// The sampling interval in s.
    pub interval_s: f64,
    /// Every how many samples the filter is corrected.
    pub update_every: NonZeroU32,
    /// The samples that are written beside it.
    pub samples: &'a ExportSamples,
}

/// The source of a filter.
#[derive(Clone, Debug)]
pub struct FilterSource {
    /// Names and contents of its files.
    pub files: Vec<(String, String)>,
}

/// Samples of a recording as the program that comes with a source reads them, and what the filter of the estimate makes of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SourceTrial {
    /// The numbers of each sample.
    pub given: Vec<Vec<f64>>,
    /// The names of the states.
    pub states: Vec<String>,
    /// The states in SI behind each sample, and the standard deviations that are claimed of them.
    pub expected: Vec<(Vec<f64>, Vec<f64>)>,
    /// The period of each state that comes round.
    pub periods: Vec<Option<f64>>,
}
