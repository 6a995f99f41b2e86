//! What work with an experiment other than its estimate finds: identification, diagnosis, simulation, calibration and the source of a filter.

use crate::error::{Failure, KalmemsError, guarded, or, or_null};
use crate::estimate::KalmemsColumn;
use crate::experiment::KalmemsExperiment;
use crate::text::{at, at_or_none, owned};
use crate::watch::{KalmemsProgress, Watch};
use kalmems::applications::ApplicationFile;
use kalmems::applications::calibration::{CalibrationSummary, GyroscopeCalibration, calibrate};
use kalmems::array_experiment::PreparedExperiment;
use kalmems::diagnose::{DiagnosisEffort, diagnose_with, identify, pasted};
use kalmems::export::{ExportError, ExportRequest, SourceDigits, SourceLanguage};
use kalmems::results::IdentificationSummary;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use serde::Serialize;
use std::collections::VecDeque;
use std::ffi::{CString, c_char, c_void};
use std::num::NonZeroU32;
use std::path::Path;
use std::ptr::null;

/// What came of such work.
#[derive(Default)]
pub struct KalmemsFindings {
    json: CString,
    text: CString,
    experiment: Option<CString>,
    recorded: Vec<(CString, Vec<f64>)>,
    truth: Vec<(CString, Vec<f64>)>,
}

impl KalmemsFindings {
    fn of(found: &impl Serialize, text: &str) -> Result<Self, Failure> {
        let json = serde_json::to_string(found).map_err(|error| Failure::estimation(&error))?;
        Ok(Self { json: owned(&json), text: owned(text), ..Self::default() })
    }
}

/// Does work with an experiment and what was given for it.
///
/// # Safety
/// As the crate says of all functions.
unsafe fn found(
    experiment: *const KalmemsExperiment,
    (progress, user): (KalmemsProgress, *mut c_void),
    error: *mut *mut KalmemsError,
    work: impl FnOnce(PreparedExperiment, &Watch) -> Result<KalmemsFindings, Failure>,
) -> *mut KalmemsFindings {
    let made = guarded(|| {
        // SAFETY: null or an experiment of this library.
        let experiment = unsafe { experiment.as_ref() }.ok_or_else(|| Failure::null("the experiment"))?;
        let watch = Watch::new(progress, user);
        let prepared = experiment.given().prepare(published(), &watch)?;
        Ok(Box::into_raw(Box::new(work(prepared, &watch)?)))
    });
    or_null(made, error)
}

/// Identifies parameters, as `kalmems identify` does; null with an error where that cannot be done. The experiment of the findings has the values.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_identify(
    experiment: *const KalmemsExperiment,
    progress: KalmemsProgress,
    user: *mut c_void,
    error: *mut *mut KalmemsError,
) -> *mut KalmemsFindings {
    let work = |ready: PreparedExperiment, watch: &Watch| {
        let found = identify(&ready.workbench, &ready.experiment, watch)?;
        let summary = IdentificationSummary::of(&found);
        let experiment = found.experiment.to_toml().map_err(|error| Failure::estimation(&error))?;
        let findings = KalmemsFindings::of(&summary, &summary.to_text())?;
        Ok(KalmemsFindings { experiment: Some(owned(&experiment)), ..findings })
    };
    // SAFETY: as the crate says of all functions.
    unsafe { found(experiment, (progress, user), error, work) }
}

/// Finds what of an experiment is wrong, as `kalmems diagnose` does: by this filter, or the first one if `filter` is null. The experiment of the
/// findings is the corrected one; null where no single cause is found.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_diagnose(
    experiment: *const KalmemsExperiment,
    filter: *const c_char,
    thorough: bool,
    progress: KalmemsProgress,
    user: *mut c_void,
    error: *mut *mut KalmemsError,
) -> *mut KalmemsFindings {
    let work = |ready: PreparedExperiment, watch: &Watch| {
        // SAFETY: as the crate says of all functions.
        let filter = unsafe { at_or_none(filter, "the name of a filter") }?;
        let effort = if thorough { DiagnosisEffort::Thorough } else { DiagnosisEffort::Usual };
        let found = diagnose_with(&ready.workbench, &ready.experiment, (filter, effort), watch)?;
        let cause = found.chosen(None).filter(|cause| !cause.edits.is_empty());
        let corrected = cause.and_then(|cause| pasted(&ready.experiment, cause));
        let findings = KalmemsFindings::of(&found, &found.to_text())?;
        Ok(KalmemsFindings { experiment: corrected.as_deref().map(owned), ..findings })
    };
    // SAFETY: as the crate says of all functions.
    unsafe { found(experiment, (progress, user), error, work) }
}

/// Simulates the recording that the table `simulate` describes. The findings have its columns and those of the true motion; their experiment is that of
/// the recording.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_simulate(
    experiment: *const KalmemsExperiment,
    progress: KalmemsProgress,
    user: *mut c_void,
    error: *mut *mut KalmemsError,
) -> *mut KalmemsFindings {
    let work = |ready: PreparedExperiment, watch: &Watch| {
        let PreparedExperiment { workbench, experiment, .. } = ready;
        let simulation = workbench.rig(&experiment)?.simulate(&experiment)?;
        let samples = ComputedRecording::of(simulation.as_ref(), watch)?;
        let text = described(&experiment, simulation.as_ref()).to_toml();
        let text = text.map_err(|error| Failure::estimation(&error))?;
        let named = |columns: Vec<(&'static str, Vec<f64>)>| {
            columns.into_iter().map(|(name, numbers)| (owned(name), numbers)).collect()
        };
        Ok(KalmemsFindings {
            experiment: Some(owned(&text)),
            recorded: named(samples.recorded_columns()),
            truth: named(samples.true_columns()),
            ..KalmemsFindings::of(&serde_json::Map::new(), "")?
        })
    };
    // SAFETY: as the crate says of all functions.
    unsafe { found(experiment, (progress, user), error, work) }
}

/// The source of a filter for a microcontroller, as `kalmems export` writes it: in C, or in Rust if `in_rust` says so; of the first filter that can be
/// exported if `filter` is null, and for the sampling rate of the recording if `rate_hz` is 0. The findings' JSON has its files by their names.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_export(
    experiment: *const KalmemsExperiment,
    filter: *const c_char,
    in_rust: bool,
    rate_hz: f64,
    error: *mut *mut KalmemsError,
) -> *mut KalmemsFindings {
    let work = |ready: PreparedExperiment, _: &Watch| {
        // SAFETY: as the crate says of all functions.
        let filter = unsafe { at_or_none(filter, "the name of a filter") }?;
        if !(rate_hz >= 0.0 && rate_hz.is_finite()) {
            return Err(Failure::argument(&format!(
                "the rate is {rate_hz} Hz; give one above 0, or 0 for that of the recording"
            )));
        }
        let filters = ready.experiment.estimate.as_ref().map_or(&[][..], |estimate| &estimate.filters[..]);
        let all = || filters.iter().map(|filter| filter.name.to_string()).collect();
        let mut names: VecDeque<String> =
            filter.map_or_else(all, |filter| VecDeque::from([filter.to_owned()]));
        let mut request = ExportRequest {
            target: if in_rust { SourceLanguage::Rust } else { SourceLanguage::C },
            filter: names.pop_front().unwrap_or_default(),
            interval_s: (rate_hz > 0.0).then(|| rate_hz.recip()),
            update_every: NonZeroU32::MIN,
            samples: 0,
            adjustable: Vec::new(),
            digits: SourceDigits::AsNeeded,
            verify: false,
            notes: Vec::new(),
        };
        let exported = loop {
            match (kalmems::source::source(&ready.workbench, &ready.experiment, &request), names.pop_front())
            {
                // This one cannot be exported; the next one may.
                (Err(ExportError::Filter { .. }), Some(next)) => request.filter = next,
                (exported, _) => break exported.map_err(|error| Failure::estimation(&error))?,
            }
        };
        let files: serde_json::Map<_, _> =
            exported.files.iter().map(|(name, text)| (name.clone(), text.clone().into())).collect();
        let json = serde_json::json!({
            "filter": exported.filter, "interval_s": exported.interval_s, "files": files, "cost": exported.cost,
        });
        KalmemsFindings::of(&json, "")
    };
    // SAFETY: as the crate says of all functions.
    unsafe { found(experiment, (None, std::ptr::null_mut()), error, work) }
}

/// Calibrates a gyroscope as the file at this path describes it, as `kalmems calibrate gyro` does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_calibrate(
    path: *const c_char,
    progress: KalmemsProgress,
    user: *mut c_void,
    error: *mut *mut KalmemsError,
) -> *mut KalmemsFindings {
    let made = guarded(|| {
        // SAFETY: as the crate says of all functions.
        let path = Path::new(unsafe { at(path, "the path of the calibration") }?);
        let found = calibrate(&GyroscopeCalibration::load(path)?, &Watch::new(progress, user));
        let found = found.map_err(|error| Failure::estimation(&error))?;
        let summary = CalibrationSummary::of(&found);
        Ok(Box::into_raw(Box::new(KalmemsFindings::of(&summary, &summary.to_text())?)))
    });
    or_null(made, error)
}

/// What was found as JSON, with the keys of the file that the command writes. The text is the findings'.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_findings_json(findings: *const KalmemsFindings) -> *const c_char {
    // SAFETY: null or findings of this library.
    unsafe { findings.as_ref() }.map_or(null(), |findings| findings.json.as_ptr())
}

/// The same as the command prints it; empty of a simulation and a source. The text is the findings'.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_findings_text(findings: *const KalmemsFindings) -> *const c_char {
    // SAFETY: null or findings of this library.
    unsafe { findings.as_ref() }.map_or(null(), |findings| findings.text.as_ptr())
}

/// The experiment in TOML that follows; null where none does. The text is the findings'.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_findings_experiment(findings: *const KalmemsFindings) -> *const c_char {
    // SAFETY: null or findings of this library.
    let findings = unsafe { findings.as_ref() };
    findings.and_then(|findings| findings.experiment.as_ref()).map_or(null(), |text| text.as_ptr())
}

/// How many columns a simulation has: of its recording, or of the true motion if `of_truth` says so.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_findings_column_count(
    findings: *const KalmemsFindings,
    of_truth: bool,
) -> usize {
    // SAFETY: null or findings of this library.
    let findings = unsafe { findings.as_ref() };
    findings.map_or(0, |findings| if of_truth { findings.truth.len() } else { findings.recorded.len() })
}

/// A column of a simulation, put where `column` points; its unit is what its name ends with, and empty here. `false` with an error where there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_findings_column(
    findings: *const KalmemsFindings,
    of_truth: bool,
    index: usize,
    column: *mut KalmemsColumn,
    error: *mut *mut KalmemsError,
) -> bool {
    let put = guarded(|| {
        // SAFETY: as the crate says of all functions.
        let (findings, place) = unsafe { (findings.as_ref(), KalmemsColumn::place(column)?) };
        let findings = findings.ok_or_else(|| Failure::null("what was found"))?;
        let all = if of_truth { &findings.truth } else { &findings.recorded };
        let none = || Failure::argument(&format!("there is no column {index}; there are {}", all.len()));
        let (name, numbers) = all.get(index).ok_or_else(none)?;
        *place = KalmemsColumn {
            struct_size: place.struct_size,
            name: name.as_ptr(),
            unit: c"".as_ptr(),
            numbers: numbers.as_ptr(),
            count: numbers.len(),
        };
        Ok(true)
    });
    or(put, false, error)
}

/// Frees findings, and with them all their texts and columns; null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_findings_free(findings: *mut KalmemsFindings) {
    if !findings.is_null() {
        // SAFETY: it came from `Box::into_raw`.
        drop(unsafe { Box::from_raw(findings) });
    }
}
