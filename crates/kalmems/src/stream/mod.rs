//! Estimation while samples arrive.
//!
//! The samples go the way of a recording: they are a table whose rows arrive, are read by the same pass, and the same
//! estimators take them stretch by stretch. So the estimate of a sample is that of [`workflow::estimate`](crate::workflow::estimate)
//! over the same samples, to the last bit.

mod decode;
mod events;
mod latency;
mod order;
mod output;
mod state;
mod table;

pub use decode::{Damage, Decoder, Sample};
pub use events::{Event, Watch};
pub use latency::Histogram;
pub use order::{Order, OrderCounts};
pub use output::{Outputs, SYNC, SYNC_AHEAD};
pub use table::WayCounts;

use crate::config::{ConfigError, Experiment, Fault, Key, Stream, TriggerChannel};
use crate::estimate::{
    EstimateError, ForetoldCounts, Part, Past, Progress, SegmentEstimate, StretchJudge, StretchSummary,
    Trajectory,
};
use crate::recording::{self, Clock, Finding, Origin, ReadError, Stretches};
use crate::rigs::{self, Estimator, Rig};
use latency::Arrivals;
use output::Writer;
use serde::Serialize;
use state::{Keeper, State};
use std::io::{self, Read};
use std::ops::ControlFlow;
use std::path::Path;
use table::{LiveTable, SharedCounts};

/// New samples that are taken at once at most.
const MOST: usize = 4096;

/// For how many later samples one that is missing is waited for, where the experiment does not say it.
const WAIT: u32 = 32;

/// Samples that are kept to go on from, where the estimator does not need more before the new ones.
const KEPT: usize = 8;

/// Over how many samples the mean NIS is watched, where the experiment does not say it.
const WATCHED: usize = 100;

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
    /// What was received, and what the way has made of it.
    pub received: WayCounts,
    /// Where the times of all estimates count from, where that is not zero of the samples' clock.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin: Option<Origin>,
    /// What was found in the samples.
    pub diagnosis: Vec<Finding>,
    /// Samples that were estimated.
    pub estimated: u64,
    /// What became of the stretches of the samples, where there are several.
    #[serde(skip_serializing_if = "StretchSummary::is_empty")]
    pub stretches: StretchSummary,
    /// Events, by what happened.
    pub events: u64,
    /// How zero phases were told before they happened, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ahead: Option<AheadSummary>,
    /// How long each sample took from its arrival to its estimate.
    #[serde(skip)]
    pub latency: Histogram,
}

/// How zero phases were told before they happened.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct AheadSummary {
    /// By the times of the samples.
    #[serde(flatten)]
    pub counts: ForetoldCounts,
    /// Those that were written when they had happened already, if samples arrive when they are taken.
    pub overdue: u64,
}

/// Estimates the samples of an input until it ends, or until `stop` says so.
///
/// Where `state` names a file, what is needed to go on is kept there, and a run that finds it goes on from it: samples that it
/// acknowledged are passed over, so that the sender may send them again.
pub fn stream(
    experiment: &Experiment,
    input: Box<dyn Read + Send>,
    outputs: Outputs,
    state: Option<&Path>,
    stop: &dyn Fn() -> bool,
) -> Result<StreamSummary, StreamError> {
    let described = experiment.stream.as_ref().ok_or_else(|| {
        let remedy =
            "add a table `[stream]` with `rate` and `[stream.input.text]` or `[stream.input.frames]`";
        experiment.error("stream", Fault::MissingKey { remedy: remedy.to_owned() })
    })?;
    let rig = rigs::of(experiment)?;
    let index = rig.wanted(experiment)?.first().copied().unwrap_or(0);
    let stopped = Stopped(stop);
    let mut estimator = rig.live(experiment, index, &stopped)?;
    let rate_hz = described.rate.si();
    let around = estimator.around(1.0 / rate_hz);
    // To smooth over the whole there must be an end.
    if around.smooths {
        return Err(StreamError::Smooths);
    }
    let layout = rig.layout(experiment, index)?;
    let (arrivals, counts) = (Arrivals::default(), SharedCounts::default());
    let text = experiment.to_toml().unwrap_or_default();
    let left = state.map(|path| State::read(path, &text)).transpose()?.flatten();
    let mut table = live_table(experiment, described, &layout, input, (arrivals.clone(), counts.clone()))?;
    let again = left.as_ref().map_or(0, State::kept);
    if let Some(left) = &left {
        *estimator.past() = Past::resumed(left.past());
        table.go_on(left);
    }
    let around_stretch = recording::Around {
        rows: MOST,
        first: if left.is_some() { again + 1 } else { around.head },
        before: around.before,
        after: around.after.max(1),
    };
    let mut stretches =
        Stretches::of_arriving(Box::new(table), Path::new("the stream"), &layout, around_stretch)?;
    let channel = channel(experiment, described, &outputs)?;
    let mut live = Live {
        rig,
        skip_s: experiment.estimate.as_ref().map_or(0.0, |estimate| estimate.skip.si()),
        over: described.alarm_over.as_ref().map_or(WATCHED, |over| watched(over.si(), rate_hz)),
        watches: Vec::new(),
        channel,
        writer: Writer::new(outputs, described.every.map_or(1, |every| u64::from(every.get()))),
        again: again as u64,
        estimated: 0,
        events: 0,
        ahead: AheadSummary::default(),
        start_s: left.as_ref().map_or(f64::NAN, |_| estimator.past().start_s),
        keeper: state.map(|path| keeper(path, text, &layout)).transpose()?,
        kept: around.before.max(KEPT),
        latency: Histogram::default(),
        arrivals,
    };
    let mut go_on = |_: u64, _: u64| if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
    let (mut judge, mut resumes) = (StretchJudge::default(), left.is_some());
    loop {
        let stretch = match stretches.next(&mut go_on) {
            // Stopped: what has been read is all there is.
            Err(ReadError::Interrupted { .. }) => {
                stretches.cut_off();
                stretches.next(&mut |_, _| ControlFlow::Continue(()))?
            }
            next => next?,
        };
        let Some(stretch) = stretch else { break };
        let Some(segment) = stretch.recording.segments().first() else { continue };
        // What another run took already is there to be interpolated through.
        let known = if stretch.begins && resumes { again } else { 0 };
        let part = Part {
            recording: &stretch.recording,
            segment,
            fresh: (stretch.fresh.start + known).min(stretch.fresh.end)..stretch.fresh.end,
            begins: stretch.begins && !resumes,
            ends: stretch.ends,
        };
        if stretch.begins {
            // A stretch that begins later begins as a recording does.
            stretches.give(recording::Around { first: around.head, ..around_stretch });
            resumes = false;
        }
        if part.fresh.is_empty() || judge.leaves_out(&part)? {
            continue;
        }
        let taken = match judge.judge(&part, estimator.take(&part)) {
            // Stopped: what has been written is all there is.
            Err(EstimateError::Interrupted) => break,
            taken => taken?,
        };
        if let Some(estimate) = taken {
            live.foretell(&estimate.trajectories, &part, estimator.past())?;
            live.take(&estimate, &part)?;
            live.keep(&estimate.trajectories, &part, estimator.as_mut())?;
        }
        stretches.reuse(stretch);
        if stop() {
            stretches.cut_off();
        }
    }
    live.writer.flush()?;
    let (recording::Source { origin, .. }, diagnosis) = stretches.finish();
    let Live { estimated, events, latency, .. } = live;
    let ahead = described.trigger.as_ref().map(|_| live.ahead);
    let (received, stretches) = (counts.now(), judge.finish()?);
    Ok(StreamSummary { received, origin, diagnosis, estimated, stretches, events, ahead, latency })
}

/// Stops the work on samples where the stream is stopped.
struct Stopped<'a>(&'a dyn Fn() -> bool);

impl Progress for Stopped<'_> {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, _: u64) -> ControlFlow<()> {
        if self.0() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Whether zero phases that are to come are told among the lines, and among the frames; there have to be such.
fn channel(experiment: &Experiment, described: &Stream, outputs: &Outputs) -> Result<[bool; 2], StreamError> {
    let Some(trigger) = &described.trigger else { return Ok([false; 2]) };
    let there = [outputs.lines.is_some(), outputs.frames.is_some()];
    let Some(on) = trigger.on.map(TriggerChannel::lines_and_frames) else { return Ok(there) };
    for ((on, there), name) in on.into_iter().zip(there).zip(["lines", "frames"]) {
        if on && !there {
            let why = format!(
                "zero phases are to be told among the {name}, and no {name} are written; give `--{name} FILE`, or change this"
            );
            let key = Key::from("stream").child("trigger").child("on");
            return Err(experiment.error(key, Fault::Value { why }).into());
        }
    }
    Ok(on)
}

/// The samples as a table.
fn live_table(
    experiment: &Experiment,
    described: &Stream,
    layout: &recording::Layout,
    input: Box<dyn Read + Send>,
    shared: (Arrivals, SharedCounts),
) -> Result<LiveTable, StreamError> {
    let columns = described.input.columns();
    let time = match &layout.clock {
        Clock::Column(name) => {
            let place = columns.iter().position(|column| column == name);
            if place.is_none() {
                let why =
                    format!("the recording's clock is the column `{name}`, which the stream does not have");
                return Err(experiment.error(Key::from("stream.input"), Fault::Value { why }).into());
            }
            place
        }
        Clock::Rate { .. } => None,
    };
    if time.is_some() && layout.declared.iter().any(|known| known.is_clock() && is_scaled(known)) {
        let why = "the times of samples that arrive are compared as they come, in their unit: leave `scale` and `offset` of the \
                   recording's clock out, and say `unit`";
        return Err(experiment.error(Key::from("stream.input"), Fault::Value { why: why.to_owned() }).into());
    }
    let wait = described.wait.unwrap_or(WAIT) as usize;
    let interval_s = 1.0 / described.rate.si();
    Ok(LiveTable::new(input, &described.input, (wait, time, interval_s), shared))
}

/// What keeps the state. Samples without a time could not be told from those that were taken already.
fn keeper(path: &Path, experiment: String, layout: &recording::Layout) -> Result<Keeper, StreamError> {
    let (Clock::Column(time), Some(columns)) = (&layout.clock, &layout.columns) else {
        let why =
            "samples without a column of times cannot be told from those that were taken before".to_owned();
        return Err(StreamError::State { path: path.display().to_string(), why });
    };
    if let Some(scaled) =
        layout.declared.iter().find(|known| columns.contains(&known.column) && is_scaled(known))
    {
        let why = format!(
            "the column `{}` has a `scale` or an `offset`, and the state keeps no numbers from before they were applied; run \
             without `--state`",
            scaled.column
        );
        return Err(StreamError::State { path: path.display().to_string(), why });
    }
    let columns = std::iter::once(time).chain(columns).cloned().collect();
    Ok(Keeper::new(path.to_owned(), experiment, columns))
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

/// What is kept while samples arrive.
struct Live {
    rig: &'static dyn Rig,
    skip_s: f64,
    over: usize,
    /// One per answer.
    watches: Vec<Watch>,
    /// Whether zero phases that are to come are told among the lines, and among the frames.
    channel: [bool; 2],
    ahead: AheadSummary,
    writer: Writer,
    /// Samples of another run that this one begins with.
    again: u64,
    estimated: u64,
    events: u64,
    start_s: f64,
    keeper: Option<Keeper>,
    /// How many samples the state keeps.
    kept: usize,
    latency: Histogram,
    arrivals: Arrivals,
}

impl Live {
    /// Keeps what another run needs, and says what it need not be sent again.
    fn keep(
        &mut self,
        trajectories: &[Trajectory],
        part: &Part,
        estimator: &mut dyn Estimator,
    ) -> Result<(), StreamError> {
        let Some(keeper) = &mut self.keeper else { return Ok(()) };
        let (end, kept) = (part.fresh.end, self.kept);
        let last = || {
            let rows = end.saturating_sub(kept)..end;
            let columns = part.recording.columns();
            let sample = |k: usize| {
                let numbers = columns.iter().map(|column| column.of(part.segment)[k]);
                std::iter::once(part.segment.time.at(k)).chain(numbers).map(f64::to_bits).collect()
            };
            (part.segment.time.at(end - 1), estimator.past().state(), rows.map(sample).collect())
        };
        if let Some(acknowledged_s) =
            keeper.given((trajectories, part.recording.origin()), last, part.ends)?
        {
            self.writer.acknowledged(acknowledged_s)?;
        }
        Ok(())
    }

    /// Tells the zero phases that are to come, before all else of their samples.
    fn foretell(
        &mut self,
        trajectories: &[Trajectory],
        part: &Part,
        past: &mut Past,
    ) -> Result<(), StreamError> {
        let Some((foreteller, mirrored)) = past.foreteller() else { return Ok(()) };
        let foretold = foreteller.hand_on(mirrored);
        self.ahead.counts = foreteller.counts();
        let key = foreteller.key();
        let place = trajectories.iter().position(|trajectory| trajectory.key == key).unwrap_or(0);
        let of = self.rig.angles().first().map_or("angle", |[angle, _]| angle);
        let [on_lines, on_frames] = self.channel;
        for foretold in &foretold {
            if on_lines {
                self.writer.events(Some(key), &[Event::ZeroPhaseAhead { of, foretold: *foretold }])?;
            }
            if on_frames {
                self.writer.ahead(place, foretold)?;
            }
        }
        self.writer.flush()?;
        self.events += foretold.len() as u64;
        let mut row = part.fresh.start;
        for foretold in &foretold {
            while row + 1 < part.fresh.end && part.segment.time.at(row) < foretold.told_s {
                row += 1;
            }
            let sample = self.again + self.estimated + 1 + (row - part.fresh.start) as u64;
            let left_s = foretold.time_s - foretold.told_s;
            let passed = self.arrivals.of(sample).map(|arrived| arrived.elapsed().as_secs_f64());
            self.ahead.overdue += u64::from(passed.is_some_and(|passed_s| passed_s > left_s));
        }
        Ok(())
    }

    fn take(&mut self, estimate: &SegmentEstimate, part: &Part) -> Result<(), StreamError> {
        let trajectories = &estimate.trajectories;
        if part.begins {
            self.start_s = part.segment.time.start_s();
            self.watches.clear();
        }
        let from_s = self.start_s + self.skip_s;
        self.writer.origin(part.recording.source().origin.as_ref())?;
        self.writer.estimates(trajectories)?;
        let crossings: Vec<Event> = estimate.crossings.iter().map(Event::from).collect();
        self.events += crossings.len() as u64;
        self.writer.events(None, &crossings)?;
        self.watches.resize_with(trajectories.len(), || Watch::new(self.over));
        for (trajectory, watch) in trajectories.iter().zip(&mut self.watches) {
            let events = watch.look(trajectory, self.rig.angles(), from_s);
            self.events += events.len() as u64;
            self.writer.events(Some(&trajectory.key), &events)?;
        }
        self.writer.flush()?;
        let before = self.again + self.estimated;
        self.estimated += part.fresh.len() as u64;
        self.arrivals.done(self.again + self.estimated, &mut self.latency, before);
        Ok(())
    }
}
