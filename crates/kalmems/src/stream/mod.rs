//! Estimation while samples arrive.
//!
//! The samples go the way of a recording: they are a table whose rows arrive, are read by the same pass, and the same
//! estimators take them stretch by stretch. So the estimate of a sample is that of [`workflow::estimate`](crate::workflow::estimate)
//! over the same samples, to the last bit.

mod connection;
mod decode;
mod events;
mod lag;
mod last_estimate;
mod latency;
mod live;
mod noise_only;
mod order;
mod output;
mod pushed;
mod recent;
mod shared;
mod state;
mod stream_judge;
mod supervision;
mod table;

pub use connection::{Connection, OpenedConnection};
pub use decode::{Damage, Decoder, END_MARK, StreamSample};
pub use events::{Event, TrajectoryWatch};
pub use latency::LatencyHistogram;
pub use noise_only::{CYCLES, FOUND_BY_CHANCE, NoiseWatch, SignalContent};
pub use order::{Order, OrderCounts, OrderSettings, OrderedEvent};
pub use output::{SYNC, SYNC_AHEAD, SYNC_ORIGIN, StreamOutputs, Supervisor, is_frames, is_lines};
pub use pushed::{Push, PushedStream};
pub use shared::{StreamCounts, StreamEnd};
pub use supervision::{FilterHealth, Health, LockState, StreamEvent};

use crate::config::{
    ConfigError, ConfigFault, Experiment, FilterTable, Key, Method, StreamTable, TriggerChannel,
};
use crate::estimate::{EstimateError, PhasePredictionCounts, StretchSummary};
use crate::evaluate::StepErrors;
use crate::recording::{self, Finding, ReadError, Stretches, TimeOrigin, TimeSource};
use crate::results::StreamTracks;
use crate::rigs::Workbench;
#[cfg(feature = "report")]
use kalmems_figures::ReportError;
use latency::ArrivalTimes;
use live::LiveEstimate;
use recent::RecentSamples;
use serde::Serialize;
use shared::Shared;
use state::{StateWriter, StreamState};
use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::time::Duration;
use table::{LiveSettings, LiveTable};

/// New samples that are taken at once at most.
const MOST: usize = 4096;

/// For how many later samples one that is missing is waited for, where the experiment does not say it.
const WAIT: u32 = 32;

/// The most later samples that a missing one is waited for, as the schema says.
const LONGEST_WAIT: u32 = 1_000_000;

/// Samples that are kept to go on from, where the estimator does not need more before the new ones.
const KEPT: usize = 8;

/// Over how many samples the mean NIS is watched, where the experiment does not say it.
const WATCHED: usize = 100;

/// The most missing rows that rows without numbers stand for, whatever the recording says.
const LONGEST_GAP: u64 = 1 << 16;

/// The shortest time between two health lines.
const SHORTEST_BEAT: Duration = Duration::from_millis(100);

/// Why a stream cannot be estimated, or ended early.
#[derive(Debug, thiserror::Error)]
pub enum StreamError {
    /// The experiment file is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The samples cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// They cannot be estimated.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
    /// What was estimated cannot be written.
    #[error("the estimates cannot be written: {0}")]
    Output(#[from] io::Error),
    /// The report cannot be made.
    #[cfg(feature = "report")]
    #[error(transparent)]
    Report(#[from] ReportError),
    /// The state cannot be written, or another run cannot go on from it.
    #[error("the state in `{path}`: {why}; to begin anew, remove it or name another file")]
    State {
        /// The file.
        path: String,
        /// Why.
        why: String,
    },
    /// A filter is to be smoothed over the whole.
    #[error(
        "the filters are smoothed over whole recordings: record the samples and use `kalmems estimate`, or leave \
         `smooth = true` out; `smooth_lag = \"100 us\"` smooths while they arrive"
    )]
    Smooths,
}

/// What came of a stream.
#[derive(Clone, Debug, Serialize)]
pub struct StreamSummary {
    /// What the first filter that claims an uncertainty says at the end, in a sentence; none if no sample was estimated.
    pub answer: Vec<String>,
    /// What was received, and what the way has made of it.
    pub received: StreamCounts,
    /// Where the times of all estimates count from, where that is not zero of the samples' clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<TimeOrigin>,
    /// What was found in the samples.
    pub diagnosis: Vec<Finding>,
    /// Samples of which some filter has an estimate.
    pub estimated: u64,
    /// Samples of which none has: of stretches that could not be estimated, such as some that were too short, and where all filters had stopped.
    pub not_estimated: u64,
    /// Whether some filter had an estimate when the stream ended: one that has neither stopped nor lost the signal.
    pub ends_with_estimate: bool,
    /// What became of the stretches of the samples, where there are several: a new one begins behind a long gap, and where the
    /// clock goes back.
    #[serde(skip_serializing_if = "StretchSummary::is_empty")]
    pub stretches: StretchSummary,
    /// Events, by what happened.
    pub events: u64,
    /// How often a filter stopped, its state or covariance being no number.
    #[serde(skip_serializing_if = "is_zero")]
    pub stopped: u64,
    /// How often a sample disturbed a filter that settles.
    #[serde(skip_serializing_if = "is_zero")]
    pub disturbed: u64,
    /// How often such a filter was started again from the signal.
    #[serde(skip_serializing_if = "is_zero")]
    pub restarted: u64,
    /// Times at which the signal was found to be only noise.
    pub noise_only: u64,
    /// Zero phases and crossings that were not told while it was, and zero phases of a motion that a filter cannot tell from noise.
    pub withheld: u64,
    /// Crossings of a threshold that were told by the steepest slope of the signal, as it has no zero there, or one that may be noise.
    #[serde(skip_serializing_if = "is_zero")]
    pub crossings_by_fallback: u64,
    /// Crossings that were not told, because their times are hardly known.
    #[serde(skip_serializing_if = "is_zero")]
    pub crossings_refused: u64,
    /// How zero phases were told before they happened, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ahead: Option<AheadSummary>,
    /// Why no more samples came, where that was not the orderly end of the stream.
    pub broken: Option<StreamEnd>,
    /// Whether it was stopped.
    pub interrupted: bool,
    /// How many later samples each estimate waits for; that time is in the latency.
    pub waits_for: usize,
    /// What the integration steps of each filter add to its errors, by its key; without filters whose steps are exact.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub step_errors: BTreeMap<String, StepErrors>,
    /// How many samples could be estimated and written in a second.
    #[serde(skip)]
    pub sustained_hz: Option<f64>,
    /// How many come in a second, as the experiment states it.
    #[serde(skip)]
    pub rate_hz: f64,
    /// How long each sample took from its arrival to its estimate.
    #[serde(skip)]
    pub latency: LatencyHistogram,
}

/// Whether a count is left out.
#[allow(clippy::trivially_copy_pass_by_ref)] // serde's own form
fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// How zero phases were told before they happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct AheadSummary {
    /// By the times of the samples.
    #[serde(flatten)]
    pub counts: PhasePredictionCounts,
    /// Those that were written when they had happened already, if samples arrive when they are taken.
    pub overdue: u64,
}

/// Estimates the samples of a connection until it ends or breaks for good, or until `stop` says so.
///
/// Where `state` names a file, what is needed to go on is kept there, and a run that finds it goes on from it: samples that it
/// acknowledged are passed over, so that the sender may send them again.
///
/// A connection that breaks is no error: what was received is estimated, and the summary says what broke and when.
pub fn stream(
    workbench: &Workbench,
    experiment: &Experiment,
    connection: Box<dyn Connection>,
    outputs: StreamOutputs,
    state: Option<&Path>,
    stop: &dyn Fn() -> bool,
) -> Result<StreamSummary, StreamError> {
    Ok(estimated((workbench, experiment), connection, outputs, state, stop, false)?.0)
}

/// Likewise, with a page of what was estimated: its text, which needs nothing else.
#[cfg(feature = "report")]
pub fn stream_with_page(
    workbench: &Workbench,
    experiment: &Experiment,
    connection: Box<dyn Connection>,
    outputs: StreamOutputs,
    state: Option<&Path>,
    stop: &dyn Fn() -> bool,
) -> Result<(StreamSummary, String), StreamError> {
    let (summary, seen) = estimated((workbench, experiment), connection, outputs, state, stop, true)?;
    let html = seen.unwrap_or_default().page(experiment, &summary).to_html()?;
    Ok((summary, html))
}

fn estimated(
    (workbench, experiment): (&Workbench, &Experiment),
    connection: Box<dyn Connection>,
    outputs: StreamOutputs,
    state: Option<&Path>,
    stop: &dyn Fn() -> bool,
    with_page: bool,
) -> Result<(StreamSummary, Option<StreamTracks>), StreamError> {
    let described = experiment.stream.as_ref().ok_or_else(|| {
        let remedy =
            "add a table `[stream]` with `rate` and `[stream.input.text]` or `[stream.input.frames]`";
        experiment.error("stream", ConfigFault::MissingKey { remedy: remedy.to_owned() })
    })?;
    let rig = workbench.rig(experiment)?;
    let index = rig.wanted(experiment)?.first().copied().unwrap_or(0);
    let stopping = live::Stopping::new(stop);
    let mut estimator = rig.considering_live(experiment, index, &stopping)?;
    let rate_hz = described.rate.si();
    let around = estimator.around(1.0 / rate_hz);
    // To smooth over the whole there must be an end.
    if around.smooths {
        return Err(StreamError::Smooths);
    }
    let layout = rig.layout(experiment, index)?;
    let (arrivals, shared) = (ArrivalTimes::default(), Shared::default());
    let text = experiment.to_toml().unwrap_or_default();
    let kept = around.before.max(KEPT);
    // Before it is read, so that nobody else writes it meanwhile.
    let keeper = state.map(|path| keeper(path, text.clone(), described, &layout, kept)).transpose()?;
    let left = state.map(|path| StreamState::read(path, &text)).transpose()?.flatten();
    let is_live = connection.is_live();
    let mut table =
        live_table(experiment, described, &layout, connection, (arrivals.clone(), shared.clone()))?;
    if let Some(keeper) = &keeper {
        table.keep(keeper.recent());
    }
    let again = left.as_ref().map_or(0, StreamState::kept);
    if let Some(left) = &left {
        estimator.resume(left.past());
        table.go_on(left);
    }
    // An empty stretch at the end of a segment stands on rows before it.
    let waits_for = usize::from(around.before == 0 || !gives_at_once(experiment));
    let whole = recording::StretchSize {
        rows: MOST,
        first: around.head,
        before: around.before,
        after: around.after.max(waits_for),
    };
    let first = if left.is_some() { again + 1 } else { around.head };
    let begin = recording::StretchSize { first, ..whole };
    let mut stretches = Stretches::of_arriving(Box::new(table), Path::new("the stream"), &layout, begin)?;
    if whole.after == 0 {
        stretches = stretches.without_waiting();
    }
    // A stretch that begins later begins as a recording does.
    let settings = live::StreamSettings {
        angles: rig.angles(experiment),
        is_live,
        rate_hz,
        head: around.head,
        skip_s: experiment.estimate.as_ref().map_or(0.0, |estimate| estimate.skip.si()),
        over: described.alarm_over.as_ref().map_or(WATCHED, |over| watched(over.si(), rate_hz)),
        every: described.every.map_or(1, |every| u64::from(every.get())),
        channel: channel(experiment, described, &outputs)?,
        heartbeat: heartbeat(experiment, described)?,
    };
    let mut live = LiveEstimate::new(settings, outputs, keeper, (arrivals, shared), &stopping);
    if with_page {
        live.see(rig.values(experiment).first().map(|value| value.name));
    }
    if left.is_some() {
        live.resume(again as u64, estimator.past().start_s, left.as_ref().map_or(0, StreamState::given));
    }
    let ended = live.run(&mut stretches, estimator.as_mut(), whole)?;
    let (recording::RecordingSource { origin, .. }, diagnosis) = stretches.finish();
    let seen = live.tracks();
    let mut summary = live.finish(if ended { diagnosis } else { Vec::new() })?;
    summary.origin = origin;
    summary.waits_for = whole.after;
    summary.ahead = summary.ahead.filter(|_| described.trigger.is_some());
    Ok((summary, seen))
}

/// Whether each sample is estimated before another one tells that its stretch goes on: where that is asked for, and no answer keeps samples back that
/// it gives at the end.
fn gives_at_once(experiment: &Experiment) -> bool {
    let keeps = |filter: &FilterTable| filter.smooth_lag.is_some() || filter.method == Method::LockIn;
    experiment
        .estimate
        .as_ref()
        .is_some_and(|estimate| estimate.interpolation_lag == 0 && !estimate.filters.iter().any(keeps))
}

/// How often health is told.
fn heartbeat(experiment: &Experiment, described: &StreamTable) -> Result<Option<Duration>, ConfigError> {
    let Some(every) = &described.heartbeat else { return Ok(None) };
    match Duration::try_from_secs_f64(every.si()) {
        Ok(every) if every >= SHORTEST_BEAT => Ok(Some(every)),
        _ => {
            let why =
                format!("found a health line every {} s; expected an interval of 0.1 s or more", every.si());
            Err(experiment.error(Key::from("stream").child("heartbeat"), ConfigFault::Value { why }))
        }
    }
}

/// Whether zero phases that are to come are told among the lines, and among the frames; there have to be such.
fn channel(
    experiment: &Experiment,
    described: &StreamTable,
    outputs: &StreamOutputs,
) -> Result<[bool; 2], StreamError> {
    let Some(trigger) = &described.trigger else { return Ok([false; 2]) };
    let there = [outputs.lines.is_some(), outputs.frames.is_some()];
    let Some(on) = trigger.on.map(TriggerChannel::lines_and_frames) else { return Ok(there) };
    for ((on, there), name) in on.into_iter().zip(there).zip(["lines", "frames"]) {
        if on && !there {
            let why = format!(
                "zero phases are to be written among the {name}, and no {name} are written; add `--{name} FILE`, or change this key"
            );
            let key = Key::from("stream").child("trigger").child("on");
            return Err(experiment.error(key, ConfigFault::Value { why }).into());
        }
    }
    Ok(on)
}

/// The samples as a table.
fn live_table(
    experiment: &Experiment,
    described: &StreamTable,
    layout: &recording::RecordingLayout,
    connection: Box<dyn Connection>,
    shared: (ArrivalTimes, Shared),
) -> Result<LiveTable, StreamError> {
    let columns = described.input.columns();
    let time = match &layout.clock {
        TimeSource::Column(name) => {
            let place = columns.iter().position(|column| column == name);
            if place.is_none() {
                let why =
                    format!("the recording's clock is the column `{name}`, which the stream does not have");
                return Err(experiment.error(Key::from("stream.input"), ConfigFault::Value { why }).into());
            }
            place
        }
        TimeSource::Rate { .. } => None,
    };
    if time.is_some() && layout.declared.iter().any(|known| known.is_clock() && is_scaled(known)) {
        let why = "the times of samples that arrive are compared as they come, in their unit: leave `scale` and `offset` of the \
                   recording's clock out, and say `unit`";
        return Err(experiment
            .error(Key::from("stream.input"), ConfigFault::Value { why: why.to_owned() })
            .into());
    }
    let wait = described.wait.unwrap_or(WAIT);
    if wait > LONGEST_WAIT {
        let why = format!("found {wait} samples; expected at most {LONGEST_WAIT}");
        return Err(experiment.error(Key::from("stream").child("wait"), ConfigFault::Value { why }).into());
    }
    let settings = LiveSettings {
        wait: wait as usize,
        time,
        interval_s: 1.0 / described.rate.si(),
        longest_gap: longest_gap(layout, described.rate.si()),
        patience: [&described.reconnect, &described.idle].map(|time| {
            time.as_ref().map(|time| Duration::try_from_secs_f64(time.si()).unwrap_or(Duration::MAX))
        }),
    };
    Ok(LiveTable::new(connection, &described.input, &settings, shared))
}

/// How many rows are missing at most that are predicted over.
fn longest_gap(layout: &recording::RecordingLayout, rate_hz: f64) -> u64 {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count, saturating
    let rows = layout.restarts.map_or(LONGEST_GAP, |restarts| (restarts.longest_gap_s * rate_hz) as u64);
    rows.min(LONGEST_GAP)
}

/// What keeps the state. Samples without a time could not be told from those that were taken already.
fn keeper(
    path: &Path,
    experiment: String,
    described: &StreamTable,
    layout: &recording::RecordingLayout,
    kept: usize,
) -> Result<StateWriter, StreamError> {
    let columns = described.input.columns();
    let time = match &layout.clock {
        TimeSource::Column(time) => columns.iter().position(|column| column == time),
        TimeSource::Rate { .. } => None,
    };
    let Some(time) = time else {
        let why =
            "without a column of times, samples cannot be distinguished from those that were taken before; record one, or leave `--state` out".to_owned();
        return Err(StreamError::State { path: path.display().to_string(), why });
    };
    StateWriter::new(path.to_owned(), experiment, columns, RecentSamples::new(time, kept))
}

/// Whether the settings say a factor or an offset of a column.
fn is_scaled(known: &recording::DeclaredColumn) -> bool {
    known.reading.as_ref().is_some_and(|reading| reading.scale.is_some() || reading.offset.is_some())
}

/// How many samples last this long.
fn watched(over_s: f64, rate_hz: f64) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, saturating
    let samples = (over_s * rate_hz).round().max(1.0) as usize;
    samples
}
