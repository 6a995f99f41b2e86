//! Estimates.

use crate::error::{Failure, KalmemsError, guarded, or, or_null};
use crate::experiment::KalmemsExperiment;
use crate::text::{at, handed_over, owned};
use crate::watch::{KalmemsProgress, Watch};
use kalmems::array_experiment::PreparedExperiment;
use kalmems::estimate::{Trajectory, TrajectoryKind};
use kalmems::evaluate::Grade;
use kalmems::results::{
    Estimated, Output, ResultWriteError, RunInfo, Work, WriteOptions, notices, summary_text,
};
use kalmems::rigs::published;
use std::ffi::{CString, c_char, c_void};
use std::path::Path;
use std::ptr::null;
use std::time::{Instant, SystemTime};

/// What came of an experiment.
pub struct KalmemsEstimate {
    estimated: Estimated,
    info: RunInfo,
    metrics: CString,
    summary: CString,
    notices: Vec<CString>,
    trajectories: Vec<Named>,
}

/// Names of a trajectory as C has them.
struct Named {
    recording: usize,
    segment: usize,
    place: usize,
    name: CString,
    kind: CString,
    recording_name: CString,
    segment_label: CString,
    passes: bool,
    grade: CString,
    columns: Vec<CString>,
    units: Vec<CString>,
}

/// A column of a trajectory; its texts and numbers are the estimate's.
#[repr(C)]
pub struct KalmemsColumn {
    /// `sizeof(KalmemsColumn)`, set by the caller: no later version of the library writes more.
    pub struct_size: usize,
    /// What it is: `time`, the name of a state, that with `_sd`, `measured`, `innovation`, `innovation_sd`, `nis`, `log_likelihood`.
    pub name: *const c_char,
    /// The unit of its numbers, in SI.
    pub unit: *const c_char,
    /// Its numbers; what is not known is not a number.
    pub numbers: *const f64,
    /// How many there are.
    pub count: usize,
}

impl KalmemsColumn {
    /// The caller's place for a column.
    ///
    /// # Safety
    /// The pointer is null, or to a column of any version with its size.
    pub unsafe fn place<'a>(column: *mut Self) -> Result<&'a mut Self, Failure> {
        // SAFETY: the first number of a column of any version is its size.
        let size = unsafe { column.cast::<usize>().as_ref() };
        let size = *size.ok_or_else(|| Failure::null("the place for the column"))?;
        if size < size_of::<Self>() {
            return Err(Failure::argument(&format!(
                "`struct_size` of the column is {size}; set it to sizeof(KalmemsColumn), {} or more",
                size_of::<Self>()
            )));
        }
        // SAFETY: not null, and as large as that.
        Ok(unsafe { &mut *column })
    }
}

const fn grade_word(grade: Option<Grade>) -> &'static str {
    match grade {
        None => "no_claim",
        Some(Grade::Passes) => "passes",
        Some(Grade::PassesWithRemarks) => "passes_with_remarks",
        Some(Grade::Doubtful) => "doubtful",
        Some(Grade::Failed) => "failed",
        Some(Grade::NoEstimate) => "no_estimate",
    }
}

impl KalmemsEstimate {
    fn of(estimated: Estimated, info: RunInfo) -> Result<Self, Failure> {
        let metrics =
            serde_json::to_string(&estimated.metrics).map_err(|error| Failure::estimation(&error))?;
        let summary = summary_text(&estimated.metrics, false, usize::MAX);
        let told = notices(&estimated.metrics).into_iter().map(|notice| owned(&notice.text)).collect();
        let mut trajectories = Vec::new();
        for (recording, of_recording) in estimated.outcome.recordings.iter().enumerate() {
            for (segment, of_segment) in of_recording.segments.iter().enumerate() {
                let judged: Vec<(&str, Option<Grade>)> = estimated
                    .metrics
                    .recordings
                    .get(recording)
                    .and_then(|metrics| metrics.segments.get(segment))
                    .map(|metrics| metrics.estimators.iter().map(|e| (e.name.as_str(), e.grade)).collect())
                    .unwrap_or_default();
                let estimate = &of_segment.estimate;
                let signal_unit = of_recording.recording.column(&estimate.signal_column).ok();
                let signal_unit = signal_unit.and_then(|column| column.header.unit);
                let signal_unit = signal_unit.map_or_else(|| "1".to_owned(), |unit| unit.si_header());
                for (place, trajectory) in estimate.trajectories.iter().enumerate() {
                    let (columns, units) = headers(trajectory, &signal_unit).into_iter().unzip();
                    let grade = judged
                        .iter()
                        .find(|(name, _)| *name == trajectory.name)
                        .and_then(|(_, grade)| *grade);
                    trajectories.push(Named {
                        recording,
                        segment,
                        place,
                        name: owned(&trajectory.name),
                        kind: owned(kind(trajectory.kind)),
                        recording_name: owned(&of_recording.name),
                        segment_label: owned(&estimate.segment.label),
                        passes: grade.is_some_and(|grade| grade < Grade::Doubtful),
                        grade: owned(grade_word(grade)),
                        columns,
                        units,
                    });
                }
            }
        }
        Ok(Self {
            info,
            metrics: owned(&metrics),
            summary: owned(&summary),
            notices: told,
            trajectories,
            estimated,
        })
    }

    fn trajectory(&self, index: usize) -> Option<&Trajectory> {
        let named = self.trajectories.get(index)?;
        let recording = self.estimated.outcome.recordings.get(named.recording)?;
        recording.segments.get(named.segment)?.estimate.trajectories.get(named.place)
    }
}

const fn kind(kind: TrajectoryKind) -> &'static str {
    match kind {
        TrajectoryKind::ModelAlone => "model",
        TrajectoryKind::LockIn => "lock_in",
        TrajectoryKind::Filtered => "filtered",
        TrajectoryKind::Smoothed => "smoothed",
    }
}

/// The columns of a trajectory, in the order of their names.
fn columns(trajectory: &Trajectory) -> Vec<(String, &str, &[f64])> {
    let mut all: Vec<(String, &str, &[f64])> = vec![("time".to_owned(), "s", &trajectory.time_s)];
    for state in &trajectory.states {
        all.push((state.name.to_owned(), state.unit, &state.mean));
        if !state.sd.is_empty() {
            all.push((format!("{}_sd", state.name), state.unit, &state.sd));
        }
    }
    let unit = trajectory.signal_name.as_ref().map_or("", |signal| signal.kind.ending());
    let of_signal: [(&str, &str, &[f64]); 5] = [
        ("measured", unit, &trajectory.signal),
        ("innovation", unit, &trajectory.innovation),
        ("innovation_sd", unit, &trajectory.innovation_sd),
        ("nis", "1", &trajectory.nis),
        ("log_likelihood", "1", &trajectory.log_likelihood),
    ];
    all.extend(of_signal.map(|(name, unit, numbers)| (name.to_owned(), unit, numbers)));
    for signal in &trajectory.further {
        let (name, unit) = (&signal.of.name, signal.of.kind.ending());
        all.push((format!("innovation_{name}"), unit, &signal.innovation));
        all.push((format!("innovation_sd_{name}"), unit, &signal.sd));
        all.push((format!("nis_{name}"), "1", &signal.nis));
    }
    all
}

fn headers(trajectory: &Trajectory, signal_unit: &str) -> Vec<(CString, CString)> {
    let header = |(name, unit, _): &(String, &str, &[f64])| {
        (owned(name), owned(if unit.is_empty() { signal_unit } else { unit }))
    };
    columns(trajectory).iter().map(header).collect()
}

/// Estimates an experiment; null with an error where that cannot be done. `progress` may be null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_estimate(
    experiment: *const KalmemsExperiment,
    progress: KalmemsProgress,
    user: *mut c_void,
    error: *mut *mut KalmemsError,
) -> *mut KalmemsEstimate {
    let (started, clock) = (SystemTime::now(), Instant::now());
    let made = guarded(|| {
        // SAFETY: as the crate says of all functions.
        let experiment = unsafe { experiment.as_ref() }.ok_or_else(|| Failure::null("the experiment"))?;
        let watch = Watch::new(progress, user);
        let PreparedExperiment { workbench, experiment, noise } =
            experiment.given().prepare(published(), &watch)?;
        let estimated = Estimated::of(&workbench, &experiment, noise, &watch)?;
        let estimate = KalmemsEstimate::of(estimated, RunInfo { started, took: clock.elapsed() })?;
        Ok(Box::into_raw(Box::new(estimate)))
    });
    or_null(made, error)
}

/// All figures, as `metrics.json` has them. The text is the estimate's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_estimate_metrics(estimate: *const KalmemsEstimate) -> *const c_char {
    // SAFETY: null or an estimate of this library.
    unsafe { estimate.as_ref() }.map_or(null(), |estimate| estimate.metrics.as_ptr())
}

/// The tables that the command prints. The text is the estimate's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_estimate_summary(estimate: *const KalmemsEstimate) -> *const c_char {
    // SAFETY: null or an estimate of this library.
    unsafe { estimate.as_ref() }.map_or(null(), |estimate| estimate.summary.as_ptr())
}

/// How many sentences there are that a reader must know before trusting a figure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_estimate_notice_count(estimate: *const KalmemsEstimate) -> usize {
    // SAFETY: null or an estimate of this library.
    unsafe { estimate.as_ref() }.map_or(0, |estimate| estimate.notices.len())
}

/// One of these sentences; null where there is none. The text is the estimate's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_estimate_notice(
    estimate: *const KalmemsEstimate,
    index: usize,
) -> *const c_char {
    // SAFETY: null or an estimate of this library.
    let estimate = unsafe { estimate.as_ref() };
    estimate.and_then(|estimate| estimate.notices.get(index)).map_or(null(), |notice| notice.as_ptr())
}

/// How many trajectories there are: one for each filter and each segment, and those that are smoothed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_trajectory_count(estimate: *const KalmemsEstimate) -> usize {
    // SAFETY: null or an estimate of this library.
    unsafe { estimate.as_ref() }.map_or(0, |estimate| estimate.trajectories.len())
}

/// A text of a trajectory, by what it is.
unsafe fn text_of(
    estimate: *const KalmemsEstimate,
    trajectory: usize,
    which: impl FnOnce(&Named) -> &CString,
) -> *const c_char {
    // SAFETY: null or an estimate of this library.
    let estimate = unsafe { estimate.as_ref() };
    estimate
        .and_then(|estimate| estimate.trajectories.get(trajectory))
        .map_or(null(), |named| which(named).as_ptr())
}

/// The name of a trajectory's filter; null where there is none. The text is the estimate's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_trajectory_name(
    estimate: *const KalmemsEstimate,
    trajectory: usize,
) -> *const c_char {
    // SAFETY: as the crate says of all functions.
    unsafe { text_of(estimate, trajectory, |named| &named.name) }
}

/// What kind of trajectory it is: `model`, `lock_in`, `filtered`, `smoothed`. The text is the estimate's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_trajectory_kind(
    estimate: *const KalmemsEstimate,
    trajectory: usize,
) -> *const c_char {
    // SAFETY: as the crate says of all functions.
    unsafe { text_of(estimate, trajectory, |named| &named.kind) }
}

/// The recording that it is of. The text is the estimate's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_trajectory_recording(
    estimate: *const KalmemsEstimate,
    trajectory: usize,
) -> *const c_char {
    // SAFETY: as the crate says of all functions.
    unsafe { text_of(estimate, trajectory, |named| &named.recording_name) }
}

/// The segment that it is of. The text is the estimate's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_trajectory_segment(
    estimate: *const KalmemsEstimate,
    trajectory: usize,
) -> *const c_char {
    // SAFETY: as the crate says of all functions.
    unsafe { text_of(estimate, trajectory, |named| &named.segment_label) }
}

/// Whether its filter makes a claim and no test contradicts it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_trajectory_passes(
    estimate: *const KalmemsEstimate,
    trajectory: usize,
) -> bool {
    // SAFETY: null or an estimate of this library.
    let estimate = unsafe { estimate.as_ref() };
    estimate.and_then(|estimate| estimate.trajectories.get(trajectory)).is_some_and(|named| named.passes)
}

/// How far it can be trusted: `passes`, `passes_with_remarks`, `doubtful`, `failed`, `no_estimate`, or `no_claim` of what makes none. The text is the
/// estimate's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_trajectory_grade(
    estimate: *const KalmemsEstimate,
    trajectory: usize,
) -> *const c_char {
    // SAFETY: as the crate says of all functions.
    unsafe { text_of(estimate, trajectory, |named| &named.grade) }
}

/// How many columns a trajectory has.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_column_count(estimate: *const KalmemsEstimate, trajectory: usize) -> usize {
    // SAFETY: null or an estimate of this library.
    let estimate = unsafe { estimate.as_ref() };
    estimate.and_then(|estimate| estimate.trajectories.get(trajectory)).map_or(0, |named| named.columns.len())
}

/// A column of a trajectory, put where `column` points; `false` with an error where there is none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_column(
    estimate: *const KalmemsEstimate,
    trajectory: usize,
    index: usize,
    column: *mut KalmemsColumn,
    error: *mut *mut KalmemsError,
) -> bool {
    let found = guarded(|| {
        // SAFETY: as the crate says of all functions.
        let (estimate, place) = unsafe { (estimate.as_ref(), KalmemsColumn::place(column)?) };
        let estimate = estimate.ok_or_else(|| Failure::null("the estimate"))?;
        let none = || Failure::argument(&format!("trajectory {trajectory} has no column {index}"));
        let named = estimate.trajectories.get(trajectory).ok_or_else(none)?;
        let (name, unit) = named.columns.get(index).zip(named.units.get(index)).ok_or_else(none)?;
        let all = estimate.trajectory(trajectory).map(columns).unwrap_or_default();
        let (_, _, numbers) = all.get(index).ok_or_else(none)?;
        *place = KalmemsColumn {
            struct_size: place.struct_size,
            name: name.as_ptr(),
            unit: unit.as_ptr(),
            numbers: numbers.as_ptr(),
            count: numbers.len(),
        };
        Ok(true)
    });
    or(found, false, error)
}

/// The report as a page of HTML, which the caller frees by `kalmems_text_free`; null with an error where it cannot be made.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_estimate_report(
    estimate: *const KalmemsEstimate,
    error: *mut *mut KalmemsError,
) -> *mut c_char {
    let made = guarded(|| {
        // SAFETY: null or an estimate of this library.
        let estimate = unsafe { estimate.as_ref() }.ok_or_else(|| Failure::null("the estimate"))?;
        let (html, _) = estimate.estimated.report().map_err(|error| Failure::estimation(&error))?;
        Ok(html)
    });
    handed_over(made, error)
}

/// Writes all of it into a folder, as `kalmems estimate` does; what is there is replaced if `force` says so or if this library has made it of the
/// same experiment.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_estimate_write(
    estimate: *const KalmemsEstimate,
    folder: *const c_char,
    force: bool,
    error: *mut *mut KalmemsError,
) -> bool {
    let written = guarded(|| {
        // SAFETY: as the crate says of all functions.
        let (estimate, folder) = unsafe { (estimate.as_ref(), at(folder, "the folder")?) };
        let estimate = estimate.ok_or_else(|| Failure::null("the estimate"))?;
        let experiment = &estimate.estimated.outcome.experiment;
        let work = Work::of_file("estimate", experiment.path(), experiment.files()).forced(force);
        let write = || {
            let output = Output::begin(Path::new(folder), &work)?;
            estimate
                .estimated
                .write(&output, WriteOptions { trajectories: true }, estimate.info, &|| false)?;
            output.commit()?;
            Ok::<bool, ResultWriteError>(true)
        };
        write().map_err(|error| Failure::estimation(&error))
    });
    or(written, false, error)
}

/// Frees an estimate, and with it all texts and columns that are its own; null is nothing.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kalmems_estimate_free(estimate: *mut KalmemsEstimate) {
    if !estimate.is_null() {
        // SAFETY: it came from `Box::into_raw`.
        drop(unsafe { Box::from_raw(estimate) });
    }
}
