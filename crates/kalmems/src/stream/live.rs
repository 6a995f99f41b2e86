//! The loop that estimates samples while they arrive, and what it keeps.

use super::events::{Event, TrajectoryWatch};
use super::lag::{LagTurn, LagWatch, WorkWatch};
use super::last_estimate::LastEstimate;
use super::latency::{ArrivalTimes, LatencyHistogram};
use super::noise_only::{NoiseWatch, SignalContent};
use super::output::{StreamOutputs, StreamWriter};
use super::shared::Shared;
use super::state::StateWriter;
use super::stream_judge::StreamJudge;
use super::supervision::{FilterHealth, Health, Heartbeat, StreamEvent};
use super::{AheadSummary, StreamError, StreamSummary};
use crate::estimate::{
    EstimateError, MotionRate, Past, PhasePredictionCounts, SegmentEstimate, SegmentPart, StretchAnswer,
    StretchJudge, StretchSummary, Trajectory, TrajectoryKind,
};
use crate::progress::Progress;
use crate::recording::{self, Finding, ReadError, Stretch, Stretches};
use crate::results::StreamTracks;
use crate::rigs::Estimator;
use std::cell::Cell;
use std::collections::BTreeMap;
use std::io;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// How long the reading thread has to hand over what it has when the stream is stopped; one that waits for a pipe cannot.
const GRACE: Duration = Duration::from_millis(300);

/// Whether the stream is stopped, and since when.
pub(super) struct Stopping<'a> {
    stop: &'a dyn Fn() -> bool,
    since: Cell<Option<Instant>>,
}

impl<'a> Stopping<'a> {
    pub(super) fn new(stop: &'a dyn Fn() -> bool) -> Self {
        Self { stop, since: Cell::new(None) }
    }

    /// Whether it is stopped.
    fn is_asked(&self) -> bool {
        if self.since.get().is_none() && (self.stop)() {
            self.since.set(Some(Instant::now()));
        }
        self.since.get().is_some()
    }

    /// Whether what is going on has to end now.
    fn is_over(&self) -> bool {
        self.is_asked() && self.since.get().is_some_and(|since| since.elapsed() > GRACE)
    }
}

impl Progress for Stopping<'_> {
    fn begin(&self, _: &str, _: u64) {}

    fn reached(&self, _: u64) -> ControlFlow<()> {
        if self.is_over() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// What an estimate of a stream needs to know.
pub(super) struct StreamSettings {
    /// The device's angles, each with its rate.
    pub angles: &'static [[&'static str; 2]],
    /// Whether samples come as they are taken.
    pub is_live: bool,
    /// How many of them come in a second.
    pub rate_hz: f64,
    /// Samples that an estimate needs to begin.
    pub head: usize,
    /// The settling time in s.
    pub skip_s: f64,
    /// Over how many samples the mean NIS is watched.
    pub over: usize,
    /// One estimate is written of so many samples.
    pub every: u64,
    /// Whether zero phases that are to come are told among the lines, and among the frames.
    pub channel: [bool; 2],
    pub heartbeat: Option<Duration>,
}

/// What is kept while samples arrive.
pub(super) struct LiveEstimate<'a> {
    settings: StreamSettings,
    stopping: &'a Stopping<'a>,
    /// What went wrong while samples were waited for.
    failed: Option<io::Error>,
    /// One per answer.
    watches: Vec<(String, TrajectoryWatch)>,
    noise: NoiseWatch,
    judged: StreamJudge,
    /// Of the events, and of what supervises the stream.
    heartbeats: [Heartbeat; 2],
    lag: LagWatch,
    work: WorkWatch,
    ahead: AheadSummary,
    /// What was told ahead in the stretches before.
    ahead_before: PhasePredictionCounts,
    writer: StreamWriter,
    /// Samples of another run that this one begins with; none once that is done.
    resumes: bool,
    again: u64,
    /// Samples that were taken, estimated or not.
    taken: u64,
    /// Which stretches can be estimated, and how many there were.
    judge: StretchJudge,
    stretches: u64,
    /// Samples at the beginning of the present stretch that are not estimated; whether the present stretch is estimated.
    refused: u64,
    is_estimated: bool,
    start_s: f64,
    last_s: Option<f64>,
    /// Samples that were found clipped, and samples whose value stays.
    disturbed: [usize; 2],
    keeper: Option<StateWriter>,
    arrivals: ArrivalTimes,
    shared: Shared,
    summary: StreamSummary,
    last: Option<LastEstimate>,
    /// For a page, where one is wanted, with the quantity that the device is for.
    seen: Option<(StreamTracks, Option<&'static str>)>,
}

impl<'a> LiveEstimate<'a> {
    pub(super) fn new(
        settings: StreamSettings,
        outputs: StreamOutputs,
        keeper: Option<StateWriter>,
        (arrivals, shared): (ArrivalTimes, Shared),
        stopping: &'a Stopping<'a>,
    ) -> Self {
        let summary = StreamSummary {
            answer: Vec::new(),
            received: shared.counts(),
            origin: None,
            diagnosis: Vec::new(),
            estimated: 0,
            not_estimated: 0,
            ends_with_estimate: false,
            stretches: StretchSummary::default(),
            events: 0,
            stopped: 0,
            disturbed: 0,
            restarted: 0,
            noise_only: 0,
            withheld: 0,
            crossings_by_fallback: 0,
            crossings_refused: 0,
            ahead: None,
            broken: None,
            interrupted: false,
            waits_for: 0,
            step_errors: BTreeMap::new(),
            sustained_hz: None,
            rate_hz: settings.rate_hz,
            latency: LatencyHistogram::default(),
        };
        Self {
            stopping,
            failed: None,
            watches: Vec::new(),
            noise: NoiseWatch::default(),
            judged: StreamJudge::default(),
            heartbeats: [settings.heartbeat, outputs.supervisor.as_ref().map(|(every, _)| *every)]
                .map(Heartbeat::new),
            lag: LagWatch::new(),
            work: WorkWatch::default(),
            ahead: AheadSummary::default(),
            ahead_before: PhasePredictionCounts::default(),
            writer: StreamWriter::new(outputs, settings.every),
            settings,
            resumes: false,
            again: 0,
            taken: 0,
            judge: StretchJudge::of_arriving(),
            stretches: 0,
            refused: 0,
            is_estimated: false,
            start_s: f64::NAN,
            last_s: None,
            disturbed: [0; 2],
            keeper,
            arrivals,
            shared,
            summary,
            last: None,
            seen: None,
        }
    }

    /// Keeps what a page shows.
    pub(super) fn see(&mut self, wanted: Option<&'static str>) {
        self.seen = Some((StreamTracks::default(), wanted));
    }

    /// What was kept for a page.
    pub(super) fn tracks(&mut self) -> Option<StreamTracks> {
        self.seen.take().map(|(tracks, _)| tracks)
    }

    /// Goes on from another run, of which so many samples come again, in a segment that began at this time in s, and which gave so many samples of
    /// an answer.
    pub(super) fn resume(&mut self, again: u64, start_s: f64, given: u64) {
        (self.resumes, self.again, self.start_s) = (true, again, start_s);
        self.writer.resume(given);
    }

    /// Takes what comes until it ends; whether there was anything at all. `whole`: what a stretch that begins later needs.
    pub(super) fn run(
        &mut self,
        stretches: &mut Stretches,
        estimator: &mut dyn Estimator,
        whole: recording::StretchSize,
    ) -> Result<bool, StreamError> {
        loop {
            let next = stretches.next(&mut |_, _| self.attend());
            if let Some(e) = self.failed.take() {
                return Err(e.into());
            }
            let stretch = match next {
                // Stopped: what has been read is all there is.
                Err(ReadError::Interrupted { .. }) => {
                    stretches.cut_off();
                    continue;
                }
                // Nothing ever came, for a reason that the summary gives.
                Err(ReadError::Unusable { .. }) if self.is_cut_short() && self.came() == 0 => {
                    return Ok(false);
                }
                next => next?,
            };
            let Some(stretch) = stretch else {
                self.hear(stretches)?;
                return Ok(true);
            };
            let (begun, before) = (Instant::now(), self.taken);
            let again = match self.stretch(&stretch, estimator) {
                // Stopped: what was written is all there is.
                Err(StreamError::Estimate(EstimateError::Interrupted)) => return Ok(true),
                taken => taken?,
            };
            self.hear(stretches)?;
            self.judge_work(self.taken - before, begun.elapsed(), stretch.begins)?;
            if stretch.begins {
                stretches.give(whole);
            }
            if let Some(rows) = again {
                stretches.begin_again(rows);
            }
            stretches.reuse(stretch);
            if self.attend().is_break() {
                stretches.cut_off();
            }
        }
    }

    /// What came of it.
    pub(super) fn finish(mut self, diagnosis: Vec<Finding>) -> Result<StreamSummary, StreamError> {
        self.tell()?;
        let health = self.heartbeats[1].measure(&self.shared);
        let health = self.health(health);
        self.writer.supervise(&health);
        self.writer.flush()?;
        let stretches = self.judge.finish()?;
        let ends_with_estimate = self.is_estimated && self.watches.iter().any(|(_, watch)| watch.holds());
        let step_errors =
            self.watches.iter().filter_map(|(key, watch)| Some((key.clone(), watch.step_errors()?)));
        Ok(StreamSummary {
            step_errors: step_errors.collect(),
            answer: self.last.iter().map(LastEstimate::sentence).collect(),
            ends_with_estimate,
            received: self.shared.counts(),
            diagnosis,
            ahead: Some(self.ahead),
            broken: self.shared.broken(),
            interrupted: self.stopping.is_asked(),
            stretches,
            ..self.summary
        })
    }

    fn came(&self) -> u64 {
        self.shared.counts().order.passed
    }

    /// Whether the samples did not end by themselves.
    fn is_cut_short(&self) -> bool {
        self.stopping.is_asked() || self.shared.broken().is_some()
    }

    /// Looks whether to go on, and tells what happened to the stream and how it fares; called by the time of day, whether samples
    /// come or not.
    fn attend(&mut self) -> ControlFlow<()> {
        if let Err(e) = self.tell() {
            self.failed = Some(e);
            return ControlFlow::Break(());
        }
        if self.stopping.is_asked() {
            self.shared.stop();
        }
        self.stopping.reached(0)
    }

    fn tell(&mut self) -> io::Result<()> {
        for notice in self.shared.notices() {
            self.notice(&StreamEvent::from(notice))?;
        }
        if let Some(health) = self.heartbeats[1].beat(&self.shared) {
            let health = self.health(health);
            self.writer.supervise(&health);
        }
        let Some(health) = self.heartbeats[0].beat(&self.shared) else { return Ok(()) };
        let health = self.health(health);
        self.writer.notice(&StreamEvent::Health(Box::new(health)))
    }

    /// What is known of the way, with what is known of the estimates.
    fn health(&self, mut health: Health) -> Health {
        health.time_s = self.last_s;
        (health.estimated, health.not_estimated) = (self.summary.estimated, self.summary.not_estimated);
        health.stretches = self.stretches;
        [health.clipped, health.staying] = self.disturbed.map(|samples| samples as u64);
        health.noise_only = self.noise.is_noise_only();
        let of = |(key, watch): &(String, TrajectoryWatch)| FilterHealth {
            failing: self.judged.failing(key),
            ..watch.health(key)
        };
        health.filters = self.watches.iter().map(of).collect();
        health
    }

    fn notice(&mut self, event: &StreamEvent) -> io::Result<()> {
        self.summary.events += 1;
        self.writer.notice(event)
    }

    /// Tells what the checks of the recording have found since this was last called.
    fn hear(&mut self, stretches: &mut Stretches) -> io::Result<()> {
        self.disturbed = stretches.disturbed();
        for found in stretches.news() {
            let time_s = self.last_s.unwrap_or(self.start_s);
            self.notice(&StreamEvent::InputCheck { time_s, found })?;
        }
        Ok(())
    }

    /// Takes a stretch of samples, new ones of a segment; behind how many of them the segment is to begin again, where it is.
    fn stretch(
        &mut self,
        stretch: &Stretch,
        estimator: &mut dyn Estimator,
    ) -> Result<Option<usize>, StreamError> {
        let Some(segment) = stretch.recording.segments().first() else { return Ok(None) };
        // Before all that has a time.
        self.writer.origin(stretch.recording.source().origin.as_ref())?;
        // What another run took already is there to be interpolated through.
        let resumes = stretch.begins && std::mem::take(&mut self.resumes);
        let known = usize::try_from(if resumes { self.again } else { 0 }).unwrap_or(usize::MAX);
        let part = SegmentPart {
            recording: &stretch.recording,
            segment,
            fresh: stretch.fresh.start.saturating_add(known).min(stretch.fresh.end)..stretch.fresh.end,
            begins: stretch.begins && !resumes,
            ends: stretch.ends,
        };
        if stretch.begins {
            self.begin(&part)?;
        }
        if part.fresh.is_empty() {
            return Ok(None);
        }
        let answer = if self.judge.leaves_out(&part)? {
            StretchAnswer::Refused { why: String::new(), again: None }
        } else {
            self.judge.attempt(&part, self.settings.head, &mut |part| estimator.take(part))?
        };
        let taken = match &answer {
            StretchAnswer::Refused { again: Some(rows), .. } => *rows,
            _ => part.fresh.len(),
        };
        let last_s = part.segment.time.at((part.fresh.start + taken).min(part.fresh.end) - 1);
        if let Some(keeper) = &self.keeper {
            keeper.recent().pass(last_s);
        }
        let again = match answer {
            StretchAnswer::Estimated(estimate) => {
                self.begin_estimates(&part)?;
                self.writer.name(&estimate.trajectories)?;
                // First of all, so that nothing is told ahead of a signal that is noise.
                let was_noise = self.noise.is_noise_only();
                let contents = self.contents(&estimate, &part);
                self.predict(&estimate.trajectories, &part, estimator.past())?;
                self.take(&estimate, &part, (was_noise, &contents))?;
                self.keep(&estimate.trajectories, &part, estimator)?;
                None
            }
            StretchAnswer::Refused { why, again } => {
                self.refuse(&part, taken, why)?;
                again.map(|rows| known + rows)
            }
        };
        let before = self.again + self.taken;
        self.taken += taken as u64;
        self.last_s = Some(last_s);
        let behind = if self.settings.is_live { self.lag.take(last_s) } else { Duration::ZERO };
        let histogram = (&mut self.summary.latency, behind);
        let longest = self.arrivals.done(self.again + self.taken, histogram, before);
        self.heartbeats.iter_mut().for_each(|heartbeat| heartbeat.lagged(longest));
        match self.lag.turn(behind) {
            Some(LagTurn::Behind(lag_s)) => self.notice(&StreamEvent::Behind { time_s: last_s, lag_s })?,
            Some(LagTurn::CaughtUp) => self.notice(&StreamEvent::CaughtUp { time_s: last_s })?,
            None => {}
        }
        Ok(again)
    }

    /// Follows how long the work takes, but for that of a beginning, which is searched for.
    fn judge_work(&mut self, samples: u64, work: Duration, begins: bool) -> io::Result<()> {
        if begins {
            return Ok(());
        }
        self.work.take(samples, work);
        self.summary.sustained_hz = self.work.sustained_hz();
        let rate_hz = self.settings.rate_hz;
        let (true, Some(time_s)) = (self.settings.is_live, self.last_s) else { return Ok(()) };
        let Some(sustained_hz) = self.work.verdict(rate_hz) else { return Ok(()) };
        self.notice(&StreamEvent::TooSlow { time_s, rate_hz, sustained_hz })
    }

    /// Some rows at the beginning of a part are not estimated.
    fn refuse(&mut self, part: &SegmentPart, rows: usize, why: String) -> io::Result<()> {
        self.summary.not_estimated += rows as u64;
        self.is_estimated = false;
        let is_told = self.refused > 0;
        self.refused += rows as u64;
        if is_told {
            return Ok(());
        }
        let time_s = part.segment.time.at(part.fresh.start);
        self.notice(&StreamEvent::NotEstimated { time_s, why })
    }

    /// A part is estimated, which those before it in its stretch may not be.
    fn begin_estimates(&mut self, part: &SegmentPart) -> io::Result<()> {
        self.is_estimated = true;
        let not_estimated = std::mem::take(&mut self.refused);
        if not_estimated == 0 {
            return Ok(());
        }
        let time_s = part.segment.time.at(part.fresh.start);
        self.notice(&StreamEvent::EstimateBegins { time_s, not_estimated })
    }

    /// A stretch begins.
    fn begin(&mut self, part: &SegmentPart) -> io::Result<()> {
        if part.begins {
            self.start_s = part.segment.time.start_s();
        }
        let begins_again = self.judge.begins_again();
        self.stretches += u64::from(!begins_again);
        let Some(after_s) = self.last_s else {
            self.shared.first().into_iter().for_each(|first| self.lag.begin_with(first));
            return Ok(());
        };
        self.watches.iter_mut().for_each(|(_, watch)| watch.begin());
        self.judged.begin();
        self.ahead_before = self.ahead.counts;
        if let Some(keeper) = &mut self.keeper {
            keeper.begin();
        }
        if begins_again {
            return Ok(());
        }
        (self.refused, self.is_estimated) = (0, false);
        self.lag.begin();
        self.notice(&StreamEvent::NewStretch { time_s: self.start_s, after_s })
    }

    /// Keeps what another run needs, and says what it need not be sent again.
    fn keep(
        &mut self,
        trajectories: &[Trajectory],
        part: &SegmentPart,
        estimator: &mut dyn Estimator,
    ) -> Result<(), StreamError> {
        let Some(keeper) = &mut self.keeper else { return Ok(()) };
        let given = self.writer.given();
        let last = || (part.segment.time.at(part.fresh.end - 1), given, estimator.state());
        if let Some(acknowledged_s) =
            keeper.given((trajectories, part.recording.origin()), last, part.ends)?
        {
            self.writer.acknowledged(acknowledged_s)?;
        }
        Ok(())
    }

    /// Tells the zero phases that are to come, before all else of their samples.
    fn predict(
        &mut self,
        trajectories: &[Trajectory],
        part: &SegmentPart,
        past: &mut Past,
    ) -> Result<(), StreamError> {
        let Some((predictor, mirrored)) = past.phase_predictor() else { return Ok(()) };
        let mut predicted = predictor.take_predictions(mirrored);
        self.ahead.counts = self.ahead_before.and(predictor.counts());
        if self.noise.is_noise_only() {
            self.summary.withheld += predicted.len() as u64;
            predicted.clear();
        }
        let key = predictor.key();
        let place = trajectories.iter().position(|trajectory| trajectory.key == key).unwrap_or(0);
        let of = self.settings.angles.first().map_or("angle", |[angle, _]| angle);
        let [on_lines, on_frames] = self.settings.channel;
        for predicted in &predicted {
            if on_lines {
                self.writer.events(Some(key), &[Event::ZeroPhaseAhead { of, predicted: *predicted }])?;
            }
            if on_frames {
                self.writer.ahead(place, predicted)?;
            }
        }
        self.writer.flush()?;
        self.summary.events += predicted.len() as u64;
        let mut row = part.fresh.start;
        for predicted in &predicted {
            while row + 1 < part.fresh.end && part.segment.time.at(row) < predicted.told_s {
                row += 1;
            }
            let sample = self.again + self.taken + 1 + (row - part.fresh.start) as u64;
            let left_s = predicted.time_s - predicted.told_s;
            let passed = self.arrivals.of(sample).map(|arrived| arrived.elapsed().as_secs_f64());
            self.ahead.overdue += u64::from(passed.is_some_and(|passed_s| passed_s > left_s));
        }
        Ok(())
    }

    fn take(
        &mut self,
        estimate: &SegmentEstimate,
        part: &SegmentPart,
        (was_noise, contents): (bool, &[SignalContent]),
    ) -> io::Result<()> {
        let trajectories = &estimate.trajectories;
        let from_s = self.start_s + self.settings.skip_s;
        let is_noise = |time_s: f64| {
            let before = contents.iter().take_while(|content| content.time_s <= time_s).last();
            before.map_or(was_noise, |content| content.noise_only)
        };
        self.writer.estimates(trajectories)?;
        for SignalContent { time_s, noise_only } in contents {
            self.summary.noise_only += u64::from(*noise_only);
            let (only, over) =
                (StreamEvent::NoiseOnly { time_s: *time_s }, StreamEvent::NoiseOnlyOver { time_s: *time_s });
            self.notice(if *noise_only { &only } else { &over })?;
        }
        let mut crossings: Vec<Event> = estimate.crossings.iter().map(Event::from).collect();
        self.withhold(&mut crossings, is_noise);
        let by_fallback =
            crossings.iter().filter(|event| matches!(event, Event::Crossing { fallback: true, .. }));
        self.summary.crossings_by_fallback += by_fallback.count() as u64;
        self.summary.crossings_refused += estimate.crossings_refused as u64;
        self.summary.events += crossings.len() as u64;
        self.writer.events(None, &crossings)?;
        let (over, angles) = (self.settings.over, self.settings.angles);
        for (place, trajectory) in trajectories.iter().enumerate() {
            if self.watches.len() <= place {
                self.watches.push((trajectory.key.clone(), TrajectoryWatch::new(over)));
            }
            let watch = &mut self.watches[place].1;
            let mut events = watch.look(trajectory, angles, from_s);
            self.summary.withheld += watch.take_withheld();
            self.withhold(&mut events, is_noise);
            self.count(trajectory.kind, &events);
            self.writer.events(Some(&trajectory.key), &events)?;
        }
        self.judged.take(estimate);
        LastEstimate::take(&mut self.last, trajectories);
        if let Some((tracks, wanted)) = &mut self.seen {
            tracks.take(estimate, *wanted);
        }
        let (rows, first_s) = (part.fresh.len(), part.segment.time.at(part.fresh.start));
        // Those of a smoother are of earlier samples.
        let of_these = || {
            trajectories.iter().filter(|one| one.time_s.first() == Some(&first_s) && one.time_s.len() == rows)
        };
        let has_estimate = |k: &usize| of_these().any(|trajectory| trajectory.has_estimate(*k));
        let estimated = (0..rows).filter(has_estimate).count();
        self.summary.estimated += estimated as u64;
        self.summary.not_estimated += (rows - estimated) as u64;
        self.writer.flush()
    }

    /// Counts what happened in an answer; a smoother says of its filter what that says itself.
    fn count(&mut self, kind: TrajectoryKind, events: &[Event]) {
        self.summary.events += events.len() as u64;
        for event in events.iter().filter(|_| kind != TrajectoryKind::Smoothed) {
            match event {
                Event::Stopped { .. } => self.summary.stopped += 1,
                Event::Disturbed { .. } => self.summary.disturbed += 1,
                Event::Restarted { .. } => self.summary.restarted += 1,
                _ => {}
            }
        }
    }

    /// Drops what cannot be told of a signal that is noise alone, and counts it.
    fn withhold(&mut self, events: &mut Vec<Event>, is_noise: impl Fn(f64) -> bool) {
        let before = events.len();
        events.retain(|event| {
            let is_passage = matches!(event, Event::ZeroPhase { .. } | Event::Crossing { .. });
            !(is_passage && is_noise(event.time_s()))
        });
        self.summary.withheld += (before - events.len()) as u64;
    }

    /// What has changed in what is in the signal, of a device that a steady drive moves.
    fn contents(&mut self, estimate: &SegmentEstimate, part: &SegmentPart) -> Vec<SignalContent> {
        let Some(trajectory) = estimate.trajectories.first() else { return Vec::new() };
        if part.begins || self.summary.estimated == 0 {
            let motions =
                std::iter::once(estimate.motion).chain(estimate.other_axes.iter().map(|a| a.motion));
            let driven =
                motions.filter(|motion| motion.is_driven).map(|MotionRate { frequency_hz, .. }| frequency_hz);
            let has_angles = !self.settings.angles.is_empty();
            let interval_s = part.segment.time.interval_s().unwrap_or(f64::INFINITY);
            self.noise.begin(
                driven.filter(|_| has_angles),
                part.segment.time.at(part.fresh.start),
                interval_s,
            );
        }
        self.noise.take(&trajectory.time_s, &trajectory.signal)
    }
}
