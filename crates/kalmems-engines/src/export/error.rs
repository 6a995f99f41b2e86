//! Why a filter cannot be exported.

use crate::config::ConfigError;
use crate::recording::ReadError;
use kalmems_core::detect::DetectError;
use kalmems_store::OutputError;

/// Why a filter cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The experiment file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The source cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The detector's widths are none.
    #[error("the kernels of its detector: {0}")]
    Detect(#[from] DetectError),
    /// There is no such filter.
    #[error("there is no filter `{found}`; the experiment has: {}", known.join(", "))]
    NoFilter {
        /// What was asked for.
        found: String,
        /// The names of those that there are.
        known: Vec<String>,
    },
    /// No filter of this device can be exported.
    #[error(
        "no filter of the rig `{device}` can be exported; `kalmems expand` writes its device as equations, whose filters can"
    )]
    Device {
        /// The rig.
        device: &'static str,
    },
    /// This one cannot.
    #[error("the filter `{filter}` cannot be exported: {why}")]
    Filter {
        /// Its name.
        filter: String,
        /// What of it, and what can be done.
        why: String,
    },
    /// The recording has no usual interval.
    #[error(
        "{file} has less than two samples, and no sampling interval; give one, such as `--rate \"1 MHz\"`"
    )]
    NoInterval {
        /// The recording.
        file: String,
    },
    /// The recording is shorter than what is asked for.
    #[error(
        "{file}: of the first {asked} samples only {found} have all inputs and measurements; ask for fewer"
    )]
    Samples {
        /// The recording.
        file: String,
        /// How many are asked for.
        asked: usize,
        /// How many there are before the first that is missing.
        found: usize,
    },
    /// Its source is not the filter of the estimate.
    #[error(
        "the filter `{filter}` cannot be exported: in a rehearsal over the recording its source was {share:.2} claimed standard deviations of \
         `{state}` from the filter of `kalmems estimate` with the digits that serve best, and 0.02 is the most that passes; the claim is smaller than \
         what the numbers of the source resolve, or the source leaves out something that the filter has"
    )]
    Rehearsal {
        /// The filter.
        filter: String,
        /// The state that was farthest.
        state: String,
        /// How far, in claimed standard deviations.
        share: f64,
    },
    /// The samples of the recording belong to another interval.
    #[error("samples of the recording are for its own interval; leave `--rate` or `--samples` out")]
    SamplesOfAnotherRate,
}
