//! Whether a filter followed the motion, told from the recording alone.

use super::signal_watch::{SignalTurn, SignalWatch, UNEXPLAINED, WatchedSample};
use super::{FilterStop, Trajectory};
use crate::inspect::quantity;
use crate::signal::fit_cycles;
use kalmems_core::FilterError;
use serde::Serialize;
use std::f64::consts::PI;

/// The judgement over a segment.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Lock {
    /// What happened after the settling time, in order of time; empty for a filter that held on.
    pub events: Vec<LockEvent>,
    /// Whether the signal is lost at the end of the samples.
    #[serde(skip)]
    pub lost: bool,
    /// Where the samples are no estimate, as far as that is known: each time in s from which on the signal is lost, and that at which the
    /// filter has settled again; infinite where it has not been found again.
    #[serde(skip)]
    pub lost_spans: Vec<[f64; 2]>,
    /// The time in s from which on that is not known yet, where more samples are to come.
    #[serde(skip)]
    pub undecided_from_s: Option<f64>,
}

/// Something that a good estimate never does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum LockEvent {
    /// Over a whole cycle of the motion the prediction left more than half of the signal unexplained, noise from sample to sample
    /// not counted, and far more than the filter expected. The axes of a device share the signal, so that all of them lose it.
    Lost {
        /// When the cycle began, in s.
        time_s: f64,
        /// When it was over, so that this was known, in s.
        detected_s: f64,
        /// The root mean square innovation, less its noise, over the signal's standard deviation in that cycle; not a number where the gate rejected
        /// most of its samples.
        unexplained: f64,
    },
    /// After a loss the prediction explained the signal again, in several cycles that followed each other.
    Regained {
        /// When the last of these cycles was over, in s.
        time_s: f64,
        /// When the filter has settled again, in s: the settling time after the beginning of the first of these cycles, or after its new start.
        settled_s: f64,
        /// When the filter was last started again from the signal, in s; `None` where it came back by itself.
        #[serde(skip_serializing_if = "Option::is_none")]
        restarted_s: Option<f64>,
    },
    /// The filter stopped.
    Stopped {
        /// The time of the first sample without an estimate, in s.
        time_s: f64,
        /// The reason.
        #[serde(serialize_with = "in_words")]
        why: FilterError,
    },
    /// The filter was started again after it had stopped.
    StartedAgain {
        /// The time of the first sample with an estimate, in s.
        time_s: f64,
        /// When it has settled again, in s.
        settled_s: f64,
    },
    /// The estimated motion has moved by more than a quarter of a cycle against the drive since it was last
    /// settled: it went over to another branch, most often the mirrored one.
    Flipped {
        /// The angle that did, by its name among the states.
        #[serde(skip_serializing_if = "is_the_only_one")]
        of: &'static str,
        /// When the cycle began, in s.
        time_s: f64,
        /// By how much it has moved, in degrees of the motion's cycle.
        moved_deg: f64,
    },
}

impl Lock {
    /// Whether nothing happened.
    pub fn held(&self) -> bool {
        self.events.is_empty()
    }

    /// Whether there is an estimate: nothing happened, or each loss of the signal was over before the end.
    pub fn is_usable(&self) -> bool {
        let (mut is_lost, mut has_flipped) = (false, false);
        for event in &self.events {
            match event {
                LockEvent::Lost { .. } | LockEvent::Stopped { .. } => is_lost = true,
                LockEvent::Regained { .. } | LockEvent::StartedAgain { .. } => is_lost = false,
                LockEvent::Flipped { .. } => has_flipped = true,
            }
        }
        !(is_lost || has_flipped || self.lost)
    }

    /// Whether the signal is lost at this time in s, or the filter has not settled again by then.
    pub fn is_lost_at(&self, time_s: f64) -> bool {
        self.lost_spans.iter().any(|[from_s, to_s]| (*from_s..*to_s).contains(&time_s))
    }

    /// Whether nothing happened to this angle, by its name among the states.
    pub fn held_of(&self, angle: &str) -> bool {
        self.events.iter().all(|event| matches!(event, LockEvent::Flipped { of, .. } if *of != angle))
    }
}

impl std::fmt::Display for LockEvent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Lost { time_s, detected_s, unexplained } => {
                let (lost, known) = (quantity(*time_s, "s"), quantity(*detected_s, "s"));
                write!(f, "lost the signal at {lost}, which was known at {known}: over a whole cycle ")?;
                if unexplained.is_nan() {
                    f.write_str("the gate rejects most of its samples")
                } else if *unexplained > UNEXPLAINED {
                    write!(f, "the prediction leaves {:.0} % of it unexplained", unexplained * 100.0)
                } else {
                    f.write_str("the innovations are more than five times as large as before")
                }
            }
            Self::Regained { time_s, settled_s, restarted_s } => {
                write!(f, "found the signal again at {}, ", quantity(*time_s, "s"))?;
                match restarted_s {
                    Some(restarted_s) => {
                        write!(f, "started again from the signal at {}", quantity(*restarted_s, "s"))?;
                    }
                    None => f.write_str("by itself")?,
                }
                write!(f, ", and has settled at {}", quantity(*settled_s, "s"))
            }
            Self::Stopped { time_s, why } => write!(f, "stopped at {}: {why}", quantity(*time_s, "s")),
            Self::StartedAgain { time_s, settled_s } => write!(
                f,
                "was started again at {}, and has settled at {}",
                quantity(*time_s, "s"),
                quantity(*settled_s, "s")
            ),
            Self::Flipped { of, time_s, moved_deg } => write!(
                f,
                "changed branch at {}: the phase of the motion{} to the drive has changed by {moved_deg:.0}°",
                quantity(*time_s, "s"),
                if is_the_only_one(of) { String::new() } else { format!(" of {of}") }
            ),
        }
    }
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn in_words<S: serde::Serializer>(why: &FilterError, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(why)
}

/// How fast the motion goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionRate {
    /// Cycles per second.
    pub frequency_hz: f64,
    /// Whether a steady drive sets it; otherwise it is what the device would do by itself.
    pub is_driven: bool,
}

/// The part of a small move that is taken for settled in each cycle, so that a drive whose frequency was found a little wrong,
/// or drifts, is no change of branch after an hour.
const FOLLOWED: f64 = 1.0 / 64.0;

/// Whether an angle, by its name among the states, is that of a device of one axis, which need not say which.
pub fn is_the_only_one(angle: &&str) -> bool {
    *angle == "angle"
}

/// Judges a trajectory's lock from `start_s` on, cycle by cycle of each axis's motion.
///
/// Each axis is the name of its angle among the states, and how fast it goes. A signal without motion cannot be lost: both
/// its share and the NIS must be too large over a cycle of the slowest axis. Whether a motion keeps its phase can be told
/// only where a steady drive sets its frequency.
pub fn judge_lock(trajectory: &Trajectory, axes: &[(&'static str, MotionRate)], start_s: f64) -> Lock {
    LockJudge::default().judge(trajectory, axes, start_s, true)
}

impl LockEvent {
    /// When, in s.
    pub fn time_s(&self) -> f64 {
        match self {
            Self::Lost { time_s, .. }
            | Self::Regained { time_s, .. }
            | Self::Stopped { time_s, .. }
            | Self::StartedAgain { time_s, .. }
            | Self::Flipped { time_s, .. } => *time_s,
        }
    }
}

/// Judges a trajectory that comes in parts.
#[derive(Default)]
pub struct LockJudge {
    signal: SignalWatch,
    axes: Vec<AxisJudge>,
    /// How long the filter has to settle, in s, once that is known.
    settling_s: Option<f64>,
    /// When it was last started again from the signal, while the signal is lost, in s.
    restarted_s: Option<f64>,
    /// When the last stop of the filter began, in s, and whether the filter has not been started again.
    stopped_s: Option<f64>,
    is_stopped: bool,
    /// Until when a filter settles that was started again after a stop, in s: it is not judged before.
    settles_until_s: f64,
    lost_spans: Vec<[f64; 2]>,
}

impl LockJudge {
    /// What happened in the cycles that end in this part; `ends` says that no further one comes. See [`judge_lock`].
    pub fn judge(
        &mut self,
        trajectory: &Trajectory,
        axes: &[(&'static str, MotionRate)],
        start_s: f64,
        ends: bool,
    ) -> Lock {
        let first_s = trajectory.time_s.first().copied().unwrap_or(start_s);
        self.settling_s.get_or_insert((start_s - first_s).max(0.0));
        self.lost_spans.retain(|[_, to_s]| *to_s > first_s);
        let slowest_hz = axes.iter().map(|(_, motion)| motion.frequency_hz).fold(f64::INFINITY, f64::min);
        let mut events = Vec::new();
        self.judge_signal(trajectory, (slowest_hz, start_s), ends, &mut events);
        // Whether the signal is lost in a cycle that has not ended is not known, and the phase of a lost motion means nothing.
        let last_s = trajectory.time_s.last().copied().unwrap_or(start_s);
        // A stop is known at once.
        let not_begun_s = if self.stopped_s.is_some() { last_s.max(start_s) } else { start_s };
        let undecided_from_s = (!ends).then(|| self.signal.began_s().unwrap_or(not_begun_s));
        let known_until_s = undecided_from_s.unwrap_or(f64::INFINITY);
        self.axes.resize_with(axes.len(), AxisJudge::default);
        for ((of, motion), judge) in axes.iter().zip(&mut self.axes).filter(|((_, m), _)| m.is_driven) {
            let known = (known_until_s, &*self.lost_spans);
            judge.judge((of, motion.frequency_hz), trajectory, start_s, known, &mut events);
        }
        events.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        Lock {
            events,
            lost: self.signal.is_lost() || self.is_stopped,
            lost_spans: self.lost_spans.clone(),
            undecided_from_s,
        }
    }

    /// The first cycle of each stretch in which the signal was lost, and when it was found again.
    fn judge_signal(
        &mut self,
        trajectory: &Trajectory,
        (motion_hz, start_s): (f64, f64),
        ends: bool,
        events: &mut Vec<LockEvent>,
    ) {
        let Trajectory { time_s, signal, innovation, nis, restarts, .. } = trajectory;
        let has_gate = trajectory.gate_nis.is_some();
        let rejected = trajectory.rejected.iter().filter(|one| one.signal == 0);
        let mut rejected = rejected.map(|one| one.sample).peekable();
        let mut restarts = restarts.iter().map(|restart| restart.time_s).peekable();
        let settled = time_s.partition_point(|t| *t < start_s);
        // A stop is one while the filter settles as well.
        let first = if trajectory.stops.is_empty() { settled } else { 0 };
        for k in first..time_s.len() {
            self.follow_stops(trajectory, time_s[k], events);
            if k < settled || self.is_stopped || time_s[k] < self.settles_until_s {
                continue;
            }
            if let Some(restarted_s) = restarts.next_if(|restarted_s| *restarted_s <= time_s[k]) {
                self.restarted_s = Some(restarted_s);
            }
            let rule = (motion_hz, has_gate);
            while rejected.next_if(|sample| *sample < k).is_some() {}
            let sample = if rejected.peek() == Some(&k) {
                WatchedSample::Rejected
            } else {
                WatchedSample::Taken([signal[k], innovation[k], nis[k]])
            };
            let ended = self.signal.take(rule, time_s[k], sample);
            if let Some(turn) = ended.and_then(|ended| ended.turn) {
                self.turn(turn, events);
            }
        }
        if ends
            && let Some(last_s) = time_s.last()
            && let Some(turn) = self.signal.finish(*last_s, has_gate).and_then(|ended| ended.turn)
        {
            self.turn(turn, events);
        }
    }

    /// Hears at a sample of this time in s that the filter stopped there, or was started again.
    fn follow_stops(&mut self, trajectory: &Trajectory, time_s: f64, events: &mut Vec<LockEvent>) {
        for FilterStop { failure, until_s } in &trajectory.stops {
            let is_new = self.stopped_s.is_none_or(|before_s| before_s < failure.time_s);
            if is_new && failure.time_s <= time_s {
                (self.stopped_s, self.is_stopped) = (Some(failure.time_s), true);
                self.signal.begin_again();
                if self.lost_spans.last().is_none_or(|[_, to_s]| to_s.is_finite()) {
                    self.lost_spans.push([failure.time_s, f64::INFINITY]);
                }
                events.push(LockEvent::Stopped { time_s: failure.time_s, why: failure.why });
            }
            if self.is_stopped && self.stopped_s == Some(failure.time_s) && *until_s <= time_s {
                let settled_s = until_s + self.settling_s.unwrap_or(0.0);
                (self.is_stopped, self.settles_until_s) = (false, settled_s);
                if let Some(last) = self.lost_spans.last_mut() {
                    last[1] = settled_s;
                }
                events.push(LockEvent::StartedAgain { time_s: *until_s, settled_s });
            }
        }
    }

    fn turn(&mut self, turn: SignalTurn, events: &mut Vec<LockEvent>) {
        match turn {
            SignalTurn::Lost { time_s, detected_s, unexplained } => {
                self.restarted_s = None;
                self.lost_spans.push([time_s, f64::INFINITY]);
                events.push(LockEvent::Lost { time_s, detected_s, unexplained });
            }
            SignalTurn::Regained { time_s, from_s } => {
                let restarted_s = self.restarted_s.take();
                let from_s = restarted_s.map_or(from_s, |restarted_s| restarted_s.max(from_s));
                let settled_s = time_s.max(from_s + self.settling_s.unwrap_or(0.0));
                if let Some(last) = self.lost_spans.last_mut() {
                    last[1] = settled_s;
                }
                events.push(LockEvent::Regained { time_s, settled_s, restarted_s });
            }
        }
    }
}

/// Cycles that a number tells apart: so many take ten thousand years at 30 kHz.
const MOST_CYCLES: u64 = 1 << 53;

/// Where the motion was when it was settled, and the samples of the cycle that has not ended.
#[derive(Default)]
struct AxisJudge {
    /// Cycles that were looked at, those that could not be fitted included.
    cycles: u64,
    settled: Option<f64>,
    left: Option<f64>,
    before: f64,
    time_s: Vec<f64>,
    angle: Vec<f64>,
}

impl AxisJudge {
    /// Where the motion left its phase by more than a quarter cycle, and how far it had gone when it was steady
    /// again (within a twelfth of a cycle from one cycle to the next).
    fn judge(
        &mut self,
        (of, motion_hz): (&'static str, f64),
        trajectory: &Trajectory,
        start_s: f64,
        (known_until_s, lost_spans): (f64, &[[f64; 2]]),
        events: &mut Vec<LockEvent>,
    ) {
        let angle = trajectory.state(of).map_or(&[][..], |state| &state.mean);
        let from = trajectory.time_s.partition_point(|t| *t < start_s).min(angle.len());
        self.time_s.extend_from_slice(&trajectory.time_s[from..angle.len()]);
        self.angle.extend_from_slice(&angle[from..]);
        let at_s = |cycles: u64| start_s + cycles as f64 / motion_hz;
        let known = ..self.time_s.partition_point(|t| *t < known_until_s);
        let is_lost = |cycle_s: f64| {
            lost_spans.iter().any(|[from_s, to_s]| cycle_s < *to_s && cycle_s + 1.0 / motion_hz > *from_s)
        };
        for cycle in fit_cycles(&self.time_s[known], &self.angle[known], motion_hz, at_s(self.cycles)) {
            if is_lost(cycle.start_s) {
                self.left = None;
                continue;
            }
            let before = std::mem::replace(&mut self.before, cycle.phase_rad);
            let Some(settled) = self.settled else {
                self.settled = Some(cycle.phase_rad);
                continue;
            };
            let moved = wrapped(cycle.phase_rad - settled);
            if moved.abs() <= PI / 2.0 {
                self.settled = Some(settled + FOLLOWED * moved);
                self.left = None;
                continue;
            }
            let time_s = *self.left.get_or_insert(cycle.start_s);
            if wrapped(cycle.phase_rad - before).abs() < PI / 6.0 {
                events.push(LockEvent::Flipped { of, time_s, moved_deg: moved.to_degrees() });
                self.settled = Some(cycle.phase_rad);
                self.left = None;
            }
        }
        let Some(last_s) = self.time_s[known].last() else { return };
        // The last that begins by then; the product may be a rounding beyond it, or before it.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count, saturating
        let about = (((*last_s - start_s) * motion_hz).floor() as u64).min(MOST_CYCLES);
        let begun = (about.saturating_sub(1)..=about + 1).rev().find(|cycles| at_s(*cycles) <= *last_s);
        self.cycles = self.cycles.max(begun.unwrap_or(0));
        let done = self.time_s.partition_point(|t| *t < at_s(self.cycles));
        self.time_s.drain(..done);
        self.angle.drain(..done);
    }
}

fn wrapped(angle: f64) -> f64 {
    angle - 2.0 * PI * (angle / (2.0 * PI)).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::TrajectoryKind;
    use crate::units::kind;
    use std::f64::consts::TAU;

    const MOTION_HZ: f64 = 15_675.0;

    fn judge(amplitude: impl Fn(f64) -> f64, innovation: impl Fn(f64) -> f64) -> Lock {
        let time: Vec<f64> = (0..10_000).map(|i| f64::from(i) * 1e-6).collect();
        let states = [("angle", "rad", &kind::ANGLE), ("other", "rad", &kind::ANGLE)];
        let samples = (&time[..], &time[..], &(0..time.len()));
        let mut trajectory = Trajectory::blank(("", ""), TrajectoryKind::Filtered, samples, &states);
        let swing = |hz: f64, t: f64| (TAU * hz * t).sin();
        trajectory.states[0].mean = time.iter().map(|t| amplitude(*t) * swing(MOTION_HZ, *t)).collect();
        trajectory.states[1].mean = time.iter().map(|t| 0.1 * swing(MOTION_HZ / 3.0, *t)).collect();
        trajectory.innovation = time.iter().map(|t| innovation(*t)).collect();
        trajectory.nis = trajectory.innovation.iter().map(|v| (v / 0.014).powi(2)).collect();
        trajectory.signal = trajectory.states[0].mean.iter().map(|a| 30.0 * a * a).collect();
        let axes = [("angle", MOTION_HZ), ("other", MOTION_HZ / 3.0)]
            .map(|(of, frequency_hz)| (of, MotionRate { frequency_hz, is_driven: true }));
        let whole = judge_lock(&trajectory, &axes, 1e-3);
        // In parts, whatever their length, the same is found.
        let (mut judge, mut parts) = (LockJudge::default(), Vec::new());
        for length in [1, 7, 64, 999, 5000].into_iter().cycle() {
            let rest = trajectory.time_s.len();
            let part = trajectory.take_front(length);
            parts.append(&mut judge.judge(&part, &axes, 1e-3, length >= rest).events);
            if length >= rest {
                break;
            }
        }
        parts.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        assert_eq!(parts.len(), whole.events.len());
        for (a, b) in parts.iter().zip(&whole.events) {
            assert!((a.time_s() - b.time_s()).abs() < 1e-9, "{a} and {b}");
        }
        whole
    }

    #[test]
    fn a_steady_estimate_holds() {
        assert!(judge(|_| 0.15, |_| 0.014).held());
        // Noise alone, larger than the motion, is nothing to lose.
        assert!(judge(|_| 1e-4, |_| 0.014).held());
        // What happens before the settling time is not held against it.
        assert!(
            judge(|t| if t < 0.9e-3 { -0.15 } else { 0.15 }, |t| if t < 0.9e-3 { 1.0 } else { 0.0 }).held()
        );
    }

    /// Days of a stream: more cycles than 32 bits count, each part of the stream of them at its end.
    #[test]
    fn cycles_are_not_counted_one_by_one() {
        let angle = [("angle", "rad", &kind::ANGLE)];
        let mut judge = AxisJudge::default();
        for begins_s in [0.0, 1e5, 1e6, 1e10] {
            let time: Vec<f64> = (0..1000).map(|i| begins_s + f64::from(i) * 1e-6).collect();
            let samples = (&time[..], &time[..], &(0..time.len()));
            let trajectory = Trajectory::blank(("", ""), TrajectoryKind::Filtered, samples, &angle);
            judge.judge(("angle", 1e5), &trajectory, 0.0, (f64::INFINITY, &[]), &mut Vec::new());
            let begun = begins_s * 1e5 + 99.0;
            assert!(
                (judge.cycles as f64 - begun).abs() <= 1.0 + 1e-15 * begun,
                "{begins_s}: {}",
                judge.cycles
            );
        }
    }

    #[test]
    fn a_change_of_branch_is_reported_with_its_time() {
        let lock = judge(|t| 0.15 * ((5e-3 - t) / 1e-3).clamp(-1.0, 1.0), |_| 0.014);
        assert_eq!(lock.events.len(), 1, "{lock:?}");
        let LockEvent::Flipped { of, time_s, moved_deg } = lock.events[0] else { panic!("{lock:?}") };
        assert!(of == "angle" && lock.held_of("other") && !lock.held_of("angle"));
        assert!((time_s - 5e-3).abs() < 1e-4 && (moved_deg.abs() - 180.0).abs() < 3.0, "{lock:?}");
    }

    #[test]
    fn a_frequency_that_was_found_a_little_wrong_is_no_change_of_branch() {
        // A part in 10⁴ is half a turn in 5000 cycles.
        let (hz, found_hz) = (1000.0, 1000.1);
        let time: Vec<f64> = (0..80_000).map(|i| f64::from(i) / 16e3).collect();
        let states = [("angle", "rad", &kind::ANGLE)];
        let samples = (&time[..], &time[..], &(0..time.len()));
        let mut trajectory = Trajectory::blank(("", ""), TrajectoryKind::Filtered, samples, &states);
        trajectory.states[0].mean = time.iter().map(|t| 0.1 * (TAU * hz * t).sin()).collect();
        let axes = [("angle", MotionRate { frequency_hz: found_hz, is_driven: true })];
        assert!(judge_lock(&trajectory, &axes, 0.0).held());
        for mean in &mut trajectory.states[0].mean[40_000..] {
            *mean = -*mean;
        }
        let lock = judge_lock(&trajectory, &axes, 0.0);
        let [LockEvent::Flipped { time_s, .. }] = lock.events[..] else { panic!("{lock:?}") };
        assert!((time_s - 2.5).abs() < 2e-3, "{lock:?}");
    }

    #[test]
    fn a_lost_signal_is_reported_once_with_its_time() {
        let lock = judge(|_| 0.15, |t| if t > 4e-3 { 0.3 } else { 0.01 });
        assert_eq!(lock.events.len(), 1, "{lock:?}");
        let LockEvent::Lost { time_s, .. } = lock.events[0] else { panic!("{lock:?}") };
        // The slower motion's cycle.
        assert!((time_s - 4e-3).abs() < 2e-4, "{lock:?}");
        assert!(!lock.held_of("other") && !lock.held_of("angle"));
    }
}
