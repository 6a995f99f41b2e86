//! A filter of an experiment as source code for a microcontroller.
//!
//! What is exported computes in units of its own: an angle in units of the device's width, a time in samples and a
//! signal in standard deviations of its noise. The constants are derived in f64 from what the experiment says, as the
//! estimate derives them, and none is far from one, which suits f32; where one is exactly one, it costs nothing.

mod c;
mod error;
mod rust;
mod samples;
mod scanner;
mod threshold;
mod write;

pub use error::ExportError;
pub use scanner::{Integration, ScannerFilter};
pub use threshold::{CrossingSettings, ThresholdFilter};
pub use write::{Exported, c_name, export, heading, place_of_filter, write_export};

use std::fmt::Display;
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

/// A filter that can be exported.
#[derive(Clone, Debug)]
pub enum ExportableFilter {
    /// That of a shared-electrode scanner.
    Scanner(ScannerFilter),
    /// That of a threshold-sensing scanner.
    Threshold(ThresholdFilter),
}

/// A number as both languages read it, the shortest that gives the same bits.
fn number(value: f64) -> String {
    format!("{value:?}")
}

/// What a filter of angle and rate in Rust tells.
const ANSWERS: &str = "    /// Angle and rate, in their units.
    #[inline(always)]
    pub fn mean(&self) -> [T; 2] {
        *self.filter.mean()
    }

    /// Their covariance, in their units.
    #[inline(always)]
    pub fn covariance(&self) -> Covariance<T, 2> {
        self.filter.covariance()
    }
";

/// A text with each `@name@` replaced.
fn fill(text: &str, values: &[(&str, &dyn Display)]) -> String {
    let one = |text: String, (name, value): &(&str, &dyn Display)| {
        text.replace(&format!("@{name}@"), &value.to_string())
    };
    values.iter().fold(text.to_owned(), one)
}
