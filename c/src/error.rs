//! What went wrong, for C.

use crate::text::owned;
use kalmems::config::ConfigError;
use kalmems::diagnose::DiagnoseError;
use kalmems::estimate::EstimateError;
use kalmems::evaluate::ReferenceError;
use kalmems::identify::IdentifyError;
use kalmems::recording::ReadError;
use kalmems::simulate::SimulateError;
use kalmems::workflow::WorkflowError;
use std::ffi::{CString, c_char, c_int};
use std::ptr::null;

/// What kind of error it is.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KalmemsErrorKind {
    /// The caller gave something that the function cannot take.
    Argument = 1,
    /// The experiment is wrong: file, key and line are said.
    Experiment = 2,
    /// A recording is unusable.
    Recording = 3,
    /// Experiment and recording were read, and there is no answer.
    Estimation = 4,
    /// The caller's function of the progress has stopped the work.
    Interrupted = 5,
    /// A defect of this library.
    Defect = 6,
}

/// An error, which its reader frees.
pub struct KalmemsError {
    kind: KalmemsErrorKind,
    message: CString,
    file: Option<CString>,
    key: Option<CString>,
    line: c_int,
}

/// An error on its way to C.
pub struct Failure {
    kind: KalmemsErrorKind,
    message: String,
    file: Option<String>,
    key: Option<String>,
    line: usize,
}

impl Failure {
    fn of(kind: KalmemsErrorKind, message: &dyn std::fmt::Display) -> Self {
        Self { kind, message: message.to_string(), file: None, key: None, line: 0 }
    }

    /// An argument that cannot be.
    pub fn argument(message: &str) -> Self {
        Self::of(KalmemsErrorKind::Argument, &message)
    }

    /// A null pointer in the place of an object.
    pub fn null(what: &str) -> Self {
        Self::argument(&format!("{what} is a null pointer"))
    }

    /// Work that could not be done.
    pub fn estimation(error: &dyn std::fmt::Display) -> Self {
        Self::of(KalmemsErrorKind::Estimation, error)
    }

    /// Work that was stopped.
    pub fn interrupted() -> Self {
        Self::of(KalmemsErrorKind::Interrupted, &"interrupted")
    }

    fn defect(panic: &(dyn std::any::Any + Send)) -> Self {
        let told = panic.downcast_ref::<String>().map(String::as_str);
        let told = told.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("without a message");
        Self::of(KalmemsErrorKind::Defect, &format!("a defect of kalmems: {told}"))
    }
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        Self {
            file: Some(error.place.file.display().to_string()),
            key: Some(error.place.key.to_string()),
            line: error.place.position.map_or(0, |position| position.line),
            ..Self::of(KalmemsErrorKind::Experiment, &error)
        }
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        match &error {
            ReadError::Interrupted { .. } => Self::interrupted(),
            ReadError::Unusable { file, .. }
            | ReadError::Io { file, .. }
            | ReadError::Format { file, .. }
            | ReadError::Clock { file, .. }
            | ReadError::NoColumn { file, .. }
            | ReadError::Kind { file, .. } => {
                Self { file: Some(file.clone()), ..Self::of(KalmemsErrorKind::Recording, &error) }
            }
        }
    }
}

impl From<EstimateError> for Failure {
    fn from(error: EstimateError) -> Self {
        match error {
            EstimateError::Config(error) => error.into(),
            EstimateError::Read(error) => error.into(),
            EstimateError::Interrupted => Self::interrupted(),
            error => Self::estimation(&error),
        }
    }
}

impl From<ReferenceError> for Failure {
    fn from(error: ReferenceError) -> Self {
        match error {
            ReferenceError::Config(error) => error.into(),
            ReferenceError::Read(error) => error.into(),
        }
    }
}

impl From<WorkflowError> for Failure {
    fn from(error: WorkflowError) -> Self {
        match error {
            WorkflowError::Config(error) => error.into(),
            WorkflowError::Read(error) => error.into(),
            WorkflowError::Estimate(error) => error.into(),
            WorkflowError::Reference(error) => error.into(),
        }
    }
}

impl From<DiagnoseError> for Failure {
    fn from(error: DiagnoseError) -> Self {
        match error {
            DiagnoseError::Config(error) => error.into(),
            DiagnoseError::Read(error) => error.into(),
            DiagnoseError::Interrupted => Self::interrupted(),
            error @ (DiagnoseError::Stops { .. } | DiagnoseError::NoNoise { .. }) => Self::estimation(&error),
        }
    }
}

impl From<IdentifyError> for Failure {
    fn from(error: IdentifyError) -> Self {
        match error {
            IdentifyError::Config(error) => error.into(),
            IdentifyError::Read(error) => error.into(),
            IdentifyError::Reference(error) => error.into(),
            IdentifyError::Interrupted => Self::interrupted(),
            error => Self::estimation(&error),
        }
    }
}

impl From<SimulateError> for Failure {
    fn from(error: SimulateError) -> Self {
        match error {
            SimulateError::Config(error) => error.into(),
            SimulateError::Read(error) => error.into(),
            SimulateError::Interrupted => Self::interrupted(),
            error => Self::estimation(&error),
        }
    }
}

impl From<Failure> for KalmemsError {
    fn from(failure: Failure) -> Self {
        Self {
            kind: failure.kind,
            message: owned(&failure.message),
            file: failure.file.as_deref().map(owned),
            key: failure.key.as_deref().filter(|key| !key.is_empty()).map(owned),
            line: failure.line.try_into().unwrap_or(0),
        }
    }
}

/// Does something for C; a panic, which would be a defect, becomes an error instead of the end of the caller.
pub fn guarded<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    // What was half done is dropped with the panic.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(work))
        .unwrap_or_else(|panic| Err(Failure::defect(&*panic)))
}

/// The value, or `otherwise` with the error put where the caller wants it.
pub fn or<T>(made: Result<T, Failure>, otherwise: T, error: *mut *mut KalmemsError) -> T {
    made.unwrap_or_else(|failure| {
        if !error.is_null() {
            // SAFETY: the caller's pointer is null or to a place for a pointer (`lib.rs`).
            unsafe { *error = Box::into_raw(Box::new(failure.into())) };
        }
        otherwise
    })
}

/// A pointer, or null with the error put where the caller wants it.
pub fn or_null<T>(made: Result<*mut T, Failure>, error: *mut *mut KalmemsError) -> *mut T {
    or(made, std::ptr::null_mut(), error)
}

/// What kind of error it is.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_error_kind(error: *const KalmemsError) -> KalmemsErrorKind {
    // SAFETY: null or an error of this library.
    unsafe { error.as_ref() }.map_or(KalmemsErrorKind::Argument, |error| error.kind)
}

/// What was found, what was expected, and what to do. The text is the error's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_error_message(error: *const KalmemsError) -> *const c_char {
    // SAFETY: null or an error of this library.
    unsafe { error.as_ref() }.map_or(null(), |error| error.message.as_ptr())
}

/// The file that is wrong; null where it is none. The text is the error's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_error_file(error: *const KalmemsError) -> *const c_char {
    // SAFETY: null or an error of this library.
    unsafe { error.as_ref() }.and_then(|error| error.file.as_deref()).map_or(null(), std::ffi::CStr::as_ptr)
}

/// The key of the experiment that is wrong, such as `estimate.filter[0].start`; null where it is none. The text is the error's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_error_key(error: *const KalmemsError) -> *const c_char {
    // SAFETY: null or an error of this library.
    unsafe { error.as_ref() }.and_then(|error| error.key.as_deref()).map_or(null(), std::ffi::CStr::as_ptr)
}

/// The line of the file, counted from 1; 0 where it is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_error_line(error: *const KalmemsError) -> c_int {
    // SAFETY: null or an error of this library.
    unsafe { error.as_ref() }.map_or(0, |error| error.line)
}

/// Frees an error; null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_error_free(error: *mut KalmemsError) {
    if !error.is_null() {
        // SAFETY: it came from `Box::into_raw`.
        drop(unsafe { Box::from_raw(error) });
    }
}
