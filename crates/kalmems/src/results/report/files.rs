//! The files of an estimate.

use super::figure_files::write_figure;
use super::names::prefix;
use super::page::page;
use super::samples::SamplesFile;
use crate::config::{ConfigError, Experiment};
use crate::estimate::Trajectory;
use crate::progress::Pace;
use crate::recording::{RecordingSource, contribution_column};
use crate::results::{Metrics, Output, OutputError, RunInfo, RunTiming};
use crate::workflow::{Outcome, RecordingOutcome, SegmentOutcome};
use kalmems_figures::ReportError;
use serde::Serialize;
use std::borrow::Cow;
use std::io::{self, Write};

/// How results are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WriteOptions {
    /// Whether each sample is written: the trajectories, and the file of all samples of the report where the report shows groups of them. Those
    /// of a long recording take several times its room.
    pub trajectories: bool,
}

impl Default for WriteOptions {
    fn default() -> Self {
        Self { trajectories: true }
    }
}

/// Why the results are not there.
#[derive(Debug, thiserror::Error)]
pub enum ResultWriteError {
    /// They cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// The report cannot be made.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The experiment file is wrong.
    #[error(transparent)]
    Experiment(Box<ConfigError>),
    /// Stopped from outside.
    #[error("interrupted; nothing was written")]
    Interrupted,
}

/// Writes trajectories, figures, record of the run and report into a result.
///
/// `trajectory_<filter>.csv`, with the recording's and the segment's name in front where there are several, and `stretch_2` and
/// so on for the later stretches of a record;
/// `metrics.json`; `run.toml`; `report.html`, and its pictures in `figures/`; `report_samples.bin` where a series has more samples than the
/// report. Where `stop` says so in between, the
/// work ends.
pub fn write_estimate(
    outcome: &Outcome,
    metrics: &Metrics,
    output: &Output,
    options: WriteOptions,
    info: RunInfo,
    stop: &dyn Fn() -> bool,
) -> Result<(), ResultWriteError> {
    for recording in outcome.recordings.iter().filter(|_| options.trajectories) {
        for segment in &recording.segments {
            let unit = signal_unit(recording, segment);
            let prefix = prefix(outcome, recording, &segment.estimate.segment);
            for trajectory in &segment.estimate.trajectories {
                let name = format!("{prefix}trajectory_{}.csv", trajectory.key);
                let mut finished = true;
                let columns = columns(trajectory, &unit);
                output.write(&name, |w| {
                    write_header(&columns, w)?;
                    finished = write_rows(&columns, w, stop)?;
                    Ok(())
                })?;
                if !finished || stop() {
                    return Err(ResultWriteError::Interrupted);
                }
            }
        }
    }
    output.write("metrics.json", |w| {
        serde_json::to_writer_pretty(&mut *w, metrics)?;
        writeln!(w)
    })?;
    let (mut page, figures) = page(outcome, metrics);
    if options.trajectories && page.leaves_out_samples() {
        page = page.beside(Some(SamplesFile::write(output, outcome)?));
    }
    let html = page.to_html()?;
    output.write("report.html", |w| w.write_all(html.as_bytes()))?;
    for figure in figures {
        write_figure(output, &figure)?;
        if stop() {
            return Err(ResultWriteError::Interrupted);
        }
    }
    Ok(output
        .write_run(&input_id(outcome), || run_record(&outcome.experiment, metrics, sources(outcome), info))?)
}

/// What tells one input from another: the experiment's name and the bytes of its recordings.
fn input_id(outcome: &Outcome) -> String {
    let files = outcome.recordings.iter().map(|recording| {
        let source = recording.recording.source();
        let digest = source.sha256.get(..12).unwrap_or(&source.sha256);
        format!("{} {digest}", source.file)
    });
    format!("{}: {}", outcome.experiment.name, files.collect::<Vec<_>>().join(", "))
}

/// The columns of a trajectory: their names with units, and a number for each sample, which is not finite where there is none.
pub(in crate::results) fn columns<'a>(
    trajectory: &'a Trajectory,
    signal_unit: &str,
) -> Vec<(String, Cow<'a, [f64]>)> {
    let mut columns = vec![("time_s".to_owned(), Cow::from(&trajectory.time_s))];
    for state in &trajectory.states {
        columns.push((format!("{}_{}", state.name, state.unit), Cow::from(&state.mean)));
        if trajectory.claims() {
            columns.push((format!("{}_sd_{}", state.name, state.unit), Cow::from(&state.sd)));
        }
    }
    let unit = trajectory.signal_name.as_ref().map_or(signal_unit, |signal| signal.kind.ending());
    let own = [&trajectory.innovation, &trajectory.innovation_sd, &trajectory.nis];
    columns.extend(with_rejections(
        trajectory,
        0,
        own,
        [format!("innovation_{unit}"), format!("innovation_sd_{unit}"), "nis_1".to_owned()],
    ));
    for (signal, place) in trajectory.further.iter().zip(1..) {
        let (name, unit) = (&signal.of.name, signal.of.kind.ending());
        let own = [&signal.innovation, &signal.sd, &signal.nis];
        let names = [
            format!("innovation_{name}_{unit}"),
            format!("innovation_sd_{name}_{unit}"),
            format!("nis_{name}_1"),
        ];
        columns.extend(with_rejections(trajectory, place, own, names));
    }
    for (place, one) in trajectory.considered.iter().enumerate() {
        // Numbers whose errors hang together have as many directions.
        let before = trajectory.considered.iter().take(place).filter(|other| other.name == one.name).count();
        let by = if before > 0 { format!("{} {}", one.name, before + 1) } else { one.name.to_string() };
        for (state, moved) in trajectory.states.iter().zip(&one.states) {
            columns.push((contribution_column(state.name, state.unit, &by), Cow::from(moved)));
        }
    }
    columns
}

/// Columns of innovation, standard deviation and NIS of a signal: what was rejected of it has an innovation and no part in anything.
fn with_rejections<'a>(
    trajectory: &Trajectory,
    signal: usize,
    own: [&'a Vec<f64>; 3],
    names: [String; 3],
) -> impl Iterator<Item = (String, Cow<'a, [f64]>)> {
    let mut update = own.map(Cow::from);
    for one in trajectory.rejected.iter().filter(|one| one.signal == signal) {
        for (column, value) in update.iter_mut().zip([one.innovation, one.sd, f64::NAN]) {
            if let Some(cell) = column.to_mut().get_mut(one.sample) {
                *cell = value;
            }
        }
    }
    names.into_iter().zip(update)
}

/// The names of the columns of a trajectory.
pub(super) fn write_header(columns: &[(String, Cow<[f64]>)], w: &mut dyn Write) -> io::Result<()> {
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    writeln!(w, "{}", names.join(","))
}

/// One row per sample; a cell is empty where there is no number. Numbers are as short as they can be and still
/// read back as the same bits. Whether it came to the end, or was stopped.
pub(super) fn write_rows(
    columns: &[(String, Cow<[f64]>)],
    w: &mut dyn Write,
    stop: &dyn Fn() -> bool,
) -> io::Result<bool> {
    let mut pace = Pace::default();
    let Some(((_, time_s), others)) = columns.split_first() else { return Ok(true) };
    for (k, time_s) in time_s.iter().enumerate() {
        if pace.is_due(k) && stop() {
            return Ok(false);
        }
        write!(w, "{time_s}")?;
        for value in others.iter().filter_map(|(_, values)| values.get(k)) {
            if value.is_finite() {
                write!(w, ",{value:e}")?;
            } else {
                write!(w, ",")?;
            }
        }
        writeln!(w)?;
    }
    Ok(true)
}

/// The unit of the signal that a segment's innovations are of, as names of columns have it.
pub(in crate::results) fn signal_unit(recording: &RecordingOutcome, segment: &SegmentOutcome) -> String {
    let column = recording.recording.column(&segment.estimate.signal_column).ok();
    let unit = column.and_then(|column| column.header.unit);
    unit.map_or_else(|| "1".to_owned(), |unit| unit.si_header())
}

/// The record of a run.
#[derive(Serialize)]
pub(super) struct EstimateRecord<'a> {
    timing: EstimateTiming,
    input: Vec<&'a RecordingSource>,
    experiment: toml::Table,
}

#[derive(Serialize)]
struct EstimateTiming {
    #[serde(flatten)]
    run: RunTiming,
    nanoseconds_per_step: toml::Table,
}

/// The files that an outcome is of.
fn sources(outcome: &Outcome) -> Vec<&RecordingSource> {
    let each = outcome.recordings.iter().flat_map(|recording| {
        let reference = recording.reference.as_ref().map(|r| r.recording().source());
        [Some(recording.recording.source()), reference].into_iter().flatten()
    });
    each.collect()
}

/// The record of a run on these inputs.
pub(super) fn run_record<'a>(
    experiment: &Experiment,
    metrics: &Metrics,
    input: Vec<&'a RecordingSource>,
    info: RunInfo,
) -> io::Result<EstimateRecord<'a>> {
    let mut steps = toml::Table::new();
    for estimator in metrics.estimators() {
        // Tenths of a nanosecond are noise.
        let nanoseconds = (estimator.seconds_per_step * 1e10).round() / 10.0;
        steps.entry(estimator.key.clone()).or_insert(toml::Value::Float(nanoseconds));
    }
    Ok(EstimateRecord {
        timing: EstimateTiming { run: info.timing(), nanoseconds_per_step: steps },
        input,
        experiment: experiment.to_table().map_err(io::Error::other)?,
    })
}
