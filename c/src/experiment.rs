//! Experiments.

use crate::error::{Failure, KalmemsError, guarded, or, or_null};
use crate::recording::KalmemsRecording;
use crate::text::{at, at_or_none};
use kalmems::array_experiment::ArrayExperiment;
use std::ffi::c_char;
use std::path::Path;

/// An experiment with the recordings that were given for it.
pub struct KalmemsExperiment {
    given: ArrayExperiment,
}

impl KalmemsExperiment {
    /// A copy for an estimate, which leaves this one as it is. Arrays are shared.
    pub fn given(&self) -> ArrayExperiment {
        self.given.clone()
    }
}

/// The experiment of a file; null with an error where it cannot be read. What is wrong in it is said by the estimate, which reads all of it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_experiment_open(
    path: *const c_char,
    error: *mut *mut KalmemsError,
) -> *mut KalmemsExperiment {
    let made = guarded(|| {
        // SAFETY: as the crate says of all functions.
        let path = Path::new(unsafe { at(path, "the path of the experiment") }?);
        let source = kalmems::config::Source::load(path)?;
        let given = ArrayExperiment::new(&source.text, path)?;
        Ok(Box::into_raw(Box::new(KalmemsExperiment { given })))
    });
    or_null(made, error)
}

/// The experiment of a text in TOML; `path` is where it stands or would stand, and names of files in it are sought beside that.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_experiment_parse(
    text: *const c_char,
    path: *const c_char,
    error: *mut *mut KalmemsError,
) -> *mut KalmemsExperiment {
    let made = guarded(|| {
        // SAFETY: as the crate says of all functions.
        let (text, path) =
            unsafe { (at(text, "the text of the experiment")?, at(path, "the path of the experiment")?) };
        let given = ArrayExperiment::new(text, Path::new(path))?;
        Ok(Box::into_raw(Box::new(KalmemsExperiment { given })))
    });
    or_null(made, error)
}

/// Puts a recording in the place of the file of a recording of the experiment: that of the name or the role `of`; where `of` is null the only
/// one, else the only one of the role `test`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_experiment_give(
    experiment: *mut KalmemsExperiment,
    of: *const c_char,
    recording: *const KalmemsRecording,
    error: *mut *mut KalmemsError,
) -> bool {
    // SAFETY: as the crate says of all functions.
    or(guarded(|| unsafe { give(experiment, of, recording, ArrayExperiment::recording) }), false, error)
}

/// Puts a recording in the place of the file of a reference; which one, as with `kalmems_experiment_give`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_experiment_give_reference(
    experiment: *mut KalmemsExperiment,
    of: *const c_char,
    recording: *const KalmemsRecording,
    error: *mut *mut KalmemsError,
) -> bool {
    // SAFETY: as the crate says of all functions.
    or(guarded(|| unsafe { give(experiment, of, recording, ArrayExperiment::reference) }), false, error)
}

/// How arrays get into an experiment.
type Giving = fn(
    &mut ArrayExperiment,
    Option<&str>,
    &kalmems::array_experiment::ArrayRecording,
) -> Result<(), kalmems::config::ConfigError>;

unsafe fn give(
    experiment: *mut KalmemsExperiment,
    of: *const c_char,
    recording: *const KalmemsRecording,
    giving: Giving,
) -> Result<bool, Failure> {
    // SAFETY: as the crate says of all functions.
    let (experiment, recording, of) =
        unsafe { (experiment.as_mut(), recording.as_ref(), at_or_none(of, "the name of a recording")?) };
    let experiment = experiment.ok_or_else(|| Failure::null("the experiment"))?;
    let recording = recording.ok_or_else(|| Failure::null("the recording"))?;
    giving(&mut experiment.given, of, &recording.given()?)?;
    Ok(true)
}

/// Frees an experiment; null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_experiment_free(experiment: *mut KalmemsExperiment) {
    if !experiment.is_null() {
        // SAFETY: it came from `Box::into_raw`.
        drop(unsafe { Box::from_raw(experiment) });
    }
}
