//! Recordings that are handed over as arrays.

use crate::error::{Failure, KalmemsError, guarded, or};
use crate::text::at;
use kalmems::array_experiment::{ArrayClock, ArrayRecording};
use kalmems::recording::{Array, Arrays};
use std::collections::BTreeMap;
use std::ffi::c_char;

/// Columns of one length, to be given to an experiment.
#[derive(Default)]
pub struct KalmemsRecording {
    columns: Vec<Array>,
    units: BTreeMap<String, String>,
    segments: Option<String>,
    clock: Option<ArrayClock>,
}

impl KalmemsRecording {
    /// As what an experiment takes.
    pub fn given(&self) -> Result<ArrayRecording, Failure> {
        let arrays =
            Arrays::new(self.columns.clone()).map_err(|error| Failure::argument(&error.to_string()))?;
        Ok(ArrayRecording {
            arrays,
            units: self.units.clone(),
            segments: self.segments.clone(),
            clock: self.clock.clone(),
        })
    }
}

/// Changes a recording; `false` with the error where that cannot be.
///
/// # Safety
/// As the crate says of all functions.
unsafe fn changed(
    recording: *mut KalmemsRecording,
    change: impl FnOnce(&mut KalmemsRecording) -> Result<(), Failure>,
    error: *mut *mut KalmemsError,
) -> bool {
    let changed = guarded(|| {
        // SAFETY: null or a recording of this library.
        let recording = unsafe { recording.as_mut() }.ok_or_else(|| Failure::null("the recording"))?;
        change(recording).map(|()| true)
    });
    or(changed, false, error)
}

/// A recording without columns. They are read as those of a file would be: their units are what their names end with (`cap_V`, `time_us`), what
/// is not a number is missing, and nothing is repaired.
#[unsafe(no_mangle)]
pub extern "C" fn kalmems_recording_new() -> *mut KalmemsRecording {
    Box::into_raw(Box::default())
}

/// Adds a column; its numbers are copied.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_recording_add(
    recording: *mut KalmemsRecording,
    name: *const c_char,
    numbers: *const f64,
    count: usize,
    error: *mut *mut KalmemsError,
) -> bool {
    let added = guarded(|| {
        // SAFETY: as the crate says of all functions.
        let (recording, name) = unsafe { (recording.as_mut(), at(name, "the name of a column")?) };
        let recording = recording.ok_or_else(|| Failure::null("the recording"))?;
        let numbers = if count == 0 {
            &[]
        } else if numbers.is_null() {
            return Err(Failure::null(&format!("the array of `{name}`")));
        } else {
            // SAFETY: there are as many as `count` says.
            unsafe { std::slice::from_raw_parts(numbers, count) }
        };
        recording.columns.push(Array::of_numbers(name, numbers));
        Ok(true)
    });
    or(added, false, error)
}

/// Says what the numbers of a column are in, where its name does not, or says it wrongly.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_recording_unit(
    recording: *mut KalmemsRecording,
    column: *const c_char,
    unit: *const c_char,
    error: *mut *mut KalmemsError,
) -> bool {
    // SAFETY: as the crate says of all functions.
    let told = |recording: &mut KalmemsRecording| unsafe {
        recording
            .units
            .insert(at(column, "the name of a column")?.to_owned(), at(unit, "a unit")?.to_owned());
        Ok(())
    };
    unsafe { changed(recording, told, error) }
}

/// Says at which rate in Hz the samples were taken, where that is not for the experiment to say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_recording_rate(
    recording: *mut KalmemsRecording,
    rate_hz: f64,
    error: *mut *mut KalmemsError,
) -> bool {
    let told = |recording: &mut KalmemsRecording| {
        recording.clock = Some(ArrayClock::Rate(rate_hz));
        Ok(())
    };
    // SAFETY: as the crate says of all functions.
    unsafe { changed(recording, told, error) }
}

/// Says which column has the times of the samples, where that is not for the experiment to say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_recording_clock(
    recording: *mut KalmemsRecording,
    column: *const c_char,
    error: *mut *mut KalmemsError,
) -> bool {
    // SAFETY: as the crate says of all functions.
    let told = |recording: &mut KalmemsRecording| unsafe {
        recording.clock = Some(ArrayClock::Column(at(column, "the name of a column")?.to_owned()));
        Ok(())
    };
    unsafe { changed(recording, told, error) }
}

/// Says which column tells several records apart, where that is not for the experiment to say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_recording_segments(
    recording: *mut KalmemsRecording,
    column: *const c_char,
    error: *mut *mut KalmemsError,
) -> bool {
    // SAFETY: as the crate says of all functions.
    let told = |recording: &mut KalmemsRecording| unsafe {
        recording.segments = Some(at(column, "the name of a column")?.to_owned());
        Ok(())
    };
    unsafe { changed(recording, told, error) }
}

/// Frees a recording, which an experiment that it was given to does not need any more; null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_recording_free(recording: *mut KalmemsRecording) {
    if !recording.is_null() {
        // SAFETY: it came from `Box::into_raw`.
        drop(unsafe { Box::from_raw(recording) });
    }
}
