//! Estimates.

use crate::document::without_lines;
use crate::errors::{Raise, failed};
use crate::figures::{as_json, pictures};
use crate::recording::Columns;
use crate::watch::{Watch, done};
use kalmems::array_experiment::{ArrayExperiment, PreparedExperiment};
use kalmems::config::Experiment;
use kalmems::diagnose::DiagnoseError;
use kalmems::estimate::{Trajectory, TrajectoryKind};
use kalmems::figures::Figure;
use kalmems::recording::RecordingSource;
use kalmems::results::{
    Estimated, Output, ResultWriteError, RunInfo, Work, WriteOptions, budget_table, notices,
    parameters_table, summary_table, summary_text,
};
use kalmems::rigs::published;
use kalmems::workflow::{RecordingOutcome, SegmentOutcome};
use numpy::PyArray1;
use numpy::ndarray::ArrayView1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Instant, SystemTime};

/// Recordings by their name or role; none where it is clear which is meant.
pub type Recordings = Vec<(Option<String>, Py<Columns>)>;

/// An experiment that is ready for work, with these recordings and references in the place of its files.
pub fn ready(
    text: &str,
    path: &Path,
    (recordings, references): (&Recordings, &Recordings),
    has_lines: bool,
    watch: &Watch,
) -> Result<PreparedExperiment, DiagnoseError> {
    let told = |error| DiagnoseError::from(without_lines(error, has_lines));
    let mut given = ArrayExperiment::new(text, path).map_err(told)?;
    for (of, columns) in recordings {
        given.recording(of.as_deref(), columns.get().given()).map_err(told)?;
    }
    for (of, columns) in references {
        given.reference(of.as_deref(), columns.get().given()).map_err(told)?;
    }
    given.prepare(published(), watch).map_err(|error| match error {
        DiagnoseError::Config(error) => told(error),
        other => other,
    })
}

/// Estimates an experiment.
#[pyfunction]
#[pyo3(signature = (text, path, has_lines, recordings, references, progress: "_Progress" = None))]
pub fn estimate(
    py: Python<'_>,
    text: String,
    path: PathBuf,
    has_lines: bool,
    recordings: Recordings,
    references: Recordings,
    progress: Option<Py<PyAny>>,
) -> PyResult<Outcome> {
    let started = SystemTime::now();
    let found = done(py, progress, move |watch| {
        let clock = Instant::now();
        let PreparedExperiment { workbench, experiment, noise } =
            ready(&text, &path, (&recordings, &references), has_lines, watch)
                .map_err(|error| Box::new(error) as Box<dyn Raise + Send>)?;
        let estimated = Estimated::of(&workbench, &experiment, noise, watch)
            .map_err(|error| Box::new(error) as Box<dyn Raise + Send>)?;
        Ok::<_, Box<dyn Raise + Send>>((Arc::new(estimated), clock.elapsed()))
    })?;
    let (estimated, took) = found.map_err(|error| error.raise(py))?;
    Ok(Outcome { estimated, info: RunInfo { started, took } })
}

/// What came of an experiment; its arrays are views of what is held here.
#[pyclass(frozen, module = "kalmems._kalmems")]
pub struct Outcome {
    estimated: Arc<Estimated>,
    info: RunInfo,
}

impl Outcome {
    fn experiment(&self) -> &Experiment {
        &self.estimated.outcome.experiment
    }

    /// The report and its pictures.
    fn drawn(&self, py: Python<'_>) -> PyResult<(String, Vec<Figure>)> {
        let estimated = Arc::clone(&self.estimated);
        done(py, None, move |_| estimated.report())?.map_err(|error| failed(py, &error))
    }
}

#[pymethods]
impl Outcome {
    /// The figures, as `metrics.json` has them.
    fn metrics_json(&self, py: Python<'_>) -> PyResult<String> {
        serde_json::to_string(&self.estimated.metrics).map_err(|error| failed(py, &error))
    }

    /// What a reader must know before trusting a figure: how serious it is, and the sentence.
    fn notices(&self) -> Vec<(String, String)> {
        let severity = |severity| format!("{severity:?}").to_lowercase();
        notices(&self.estimated.metrics)
            .into_iter()
            .map(|notice| (severity(notice.severity), notice.sentence()))
            .collect()
    }

    /// The filters whose answers cannot be trusted.
    fn not_trusted(&self) -> Vec<String> {
        self.estimated.metrics.estimators().filter(|e| !e.passes()).map(|e| e.name.clone()).collect()
    }

    /// The tables that the command prints: heads and rows of each.
    fn tables(&self) -> Vec<(Vec<String>, Vec<Vec<String>>)> {
        let metrics = &self.estimated.metrics;
        let further = [parameters_table(metrics), budget_table(metrics)];
        let all = std::iter::once(summary_table(metrics, true)).chain(further.into_iter().flatten());
        all.map(|table| (table.columns.iter().map(kalmems::figures::ColumnHead::head).collect(), table.rows))
            .collect()
    }

    /// What the command prints: the answers, and behind them the tables.
    fn summary(&self) -> String {
        summary_text(&self.estimated.metrics, true, usize::MAX)
    }

    /// The motion and how well it is known, a sentence for each quantity.
    fn answers(&self) -> Vec<String> {
        self.estimated.metrics.answer.clone()
    }

    /// The experiment as it was understood, every default written out.
    fn experiment_toml(&self, py: Python<'_>) -> PyResult<String> {
        self.experiment().to_toml().map_err(|error| failed(py, &error))
    }

    /// What was read: file, SHA-256 and number of bytes.
    fn sources(&self) -> Vec<(String, String, u64)> {
        let of = |source: &RecordingSource| (source.file.clone(), source.sha256.clone(), source.bytes);
        let recordings = self.estimated.outcome.recordings.iter();
        let each = recordings.flat_map(|recording| {
            let reference = recording.reference.as_ref().map(|reference| reference.recording().source());
            [Some(recording.recording.source()), reference]
        });
        each.flatten().map(of).collect()
    }

    /// How long the work took in Rust, in s.
    fn took_s(&self) -> f64 {
        self.info.took.as_secs_f64()
    }

    /// The segments with their trajectories, as dictionaries; see `kalmems._result`.
    #[pyo3(signature = () -> "list[dict[str, Any]]")]
    fn segments<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyList>> {
        let all = PyList::empty(slf.py());
        for recording in &slf.get().estimated.outcome.recordings {
            for segment in &recording.segments {
                all.append(segment_of(slf, recording, segment)?)?;
            }
        }
        Ok(all)
    }

    /// The report as a page of HTML.
    fn report_html(&self, py: Python<'_>) -> PyResult<String> {
        self.drawn(py).map(|(html, _)| html)
    }

    /// The pictures of the report by their names, as SVG.
    #[pyo3(signature = () -> "dict[str, bytes]")]
    fn figures<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.drawn(py).and_then(|(_, figures)| pictures(py, &figures))
    }

    /// The pictures of the report as data, which another program can draw.
    fn figure_data(&self, py: Python<'_>) -> PyResult<String> {
        self.drawn(py).map(|(_, figures)| as_json(&figures))
    }

    /// Writes all of it into a folder, as `kalmems estimate` does; where that is.
    fn write(&self, py: Python<'_>, folder: PathBuf, trajectories: bool, force: bool) -> PyResult<PathBuf> {
        let (estimated, info) = (Arc::clone(&self.estimated), self.info);
        let written = done(py, None, move |watch| {
            let experiment = &estimated.outcome.experiment;
            let work = Work::of_file("estimate", experiment.path(), experiment.files()).forced(force);
            let output = Output::begin(&folder, &work)?;
            let stop = || watch.is_stopped();
            estimated.write(&output, WriteOptions { trajectories }, info, &stop)?;
            if stop() {
                return Err(ResultWriteError::Interrupted);
            }
            let target = output.target().to_owned();
            output.commit()?;
            Ok::<PathBuf, ResultWriteError>(target)
        })?;
        written.map_err(|error| failed(py, &error))
    }
}

/// A segment as a dictionary.
fn segment_of<'py>(
    owner: &Bound<'py, Outcome>,
    recording: &RecordingOutcome,
    segment: &SegmentOutcome,
) -> PyResult<Bound<'py, PyDict>> {
    let py = owner.py();
    let (estimate, own) = (&segment.estimate, PyDict::new(py));
    own.set_item("recording", &recording.name)?;
    own.set_item("label", &estimate.segment.label)?;
    own.set_item("stretch", estimate.segment.stretch.number)?;
    own.set_item("signal", &estimate.signal_column)?;
    own.set_item("skip", estimate.skip_s)?;
    let column = recording.recording.column(&estimate.signal_column).ok();
    let unit =
        column.and_then(|column| column.header.unit).map_or_else(|| "1".to_owned(), |unit| unit.si_header());
    own.set_item("signal_unit", unit)?;
    let all = PyList::empty(py);
    for trajectory in &estimate.trajectories {
        all.append(trajectory_of(owner, trajectory)?)?;
    }
    own.set_item("trajectories", all)?;
    own.set_item("references", references_of(py, recording, segment)?)?;
    Ok(own)
}

/// What a reference knows of a segment: the name of a state, times in s, and values in SI.
fn references_of<'py>(
    py: Python<'py>,
    recording: &RecordingOutcome,
    segment: &SegmentOutcome,
) -> PyResult<Bound<'py, PyList>> {
    let all = PyList::empty(py);
    let Some(reference) = &recording.reference else { return Ok(all) };
    let part = &segment.estimate.segment;
    let add = |state: &str, time_s: &[f64], values: &[f64]| {
        all.append((state, PyArray1::from_slice(py, time_s), PyArray1::from_slice(py, values)))
    };
    for motion in reference.angles_of(part).map_err(|error| failed(py, &error))? {
        let [angle, rate] = motion.states;
        add(angle, &motion.time_s, &motion.angle)?;
        if let Some(values) = &motion.rate {
            add(rate, &motion.time_s, values)?;
        }
    }
    for known in reference.values_of(part).map_err(|error| failed(py, &error))? {
        add(known.state.name, &known.time_s, &known.value)?;
    }
    Ok(all)
}

fn trajectory_of<'py>(owner: &Bound<'py, Outcome>, trajectory: &Trajectory) -> PyResult<Bound<'py, PyDict>> {
    let py = owner.py();
    let own = PyDict::new(py);
    own.set_item("key", &trajectory.key)?;
    own.set_item("name", &trajectory.name)?;
    let kind = match trajectory.kind {
        TrajectoryKind::ModelAlone => "model",
        TrajectoryKind::LockIn => "lock_in",
        TrajectoryKind::Filtered => "filtered",
        TrajectoryKind::Smoothed => "smoothed",
    };
    own.set_item("kind", kind)?;
    own.set_item("seconds_per_step", trajectory.seconds_per_step)?;
    for (name, values) in [
        ("time", &trajectory.time_s),
        ("measured", &trajectory.signal),
        ("innovation", &trajectory.innovation),
        ("innovation_sd", &trajectory.innovation_sd),
        ("nis", &trajectory.nis),
        ("log_likelihood", &trajectory.log_likelihood),
    ] {
        own.set_item(name, view(owner, values)?)?;
    }
    let rejected = |signal: usize| -> Vec<usize> {
        trajectory.rejected.iter().filter(|one| one.signal == signal).map(|one| one.sample).collect()
    };
    own.set_item("rejected", rejected(0))?;
    let unit = trajectory.signal_name.as_ref().map(|signal| signal.kind.ending());
    own.set_item("signal_unit", unit)?;
    let further = PyList::empty(py);
    for (signal, place) in trajectory.further.iter().zip(1..) {
        let [innovation, sd, nis] = [&signal.innovation, &signal.sd, &signal.nis].map(|all| view(owner, all));
        let unit = signal.of.kind.ending();
        further.append((&signal.of.name, unit, innovation?, sd?, nis?, rejected(place)))?;
    }
    own.set_item("further", further)?;
    let states = PyList::empty(py);
    for state in &trajectory.states {
        let sd = if state.sd.is_empty() { None } else { Some(view(owner, &state.sd)?) };
        states.append((state.name, state.unit, view(owner, &state.mean)?, sd))?;
    }
    own.set_item("states", states)?;
    Ok(own)
}

/// Numbers of an outcome as an array that shares its memory and keeps it alive, and cannot be written to.
fn view<'py>(owner: &Bound<'py, Outcome>, values: &[f64]) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let numbers = ArrayView1::from(values);
    // SAFETY: the numbers are those of the outcome that the array holds as its base. It is frozen, so that nobody moves or changes them
    // while that lives, and the array is made read-only before anybody else sees it.
    let array = unsafe { PyArray1::borrow_from_array(&numbers, owner.clone().into_any()) };
    array.getattr("flags")?.setattr("writeable", false)?;
    Ok(array)
}
