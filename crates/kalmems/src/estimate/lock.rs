//! Whether a filter followed the motion, told from the recording alone.

use crate::signal::{Cycle, fit_cycles};
use serde::Serialize;
use std::f64::consts::PI;

/// The judgement over a segment.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Lock {
    /// What happened after the settling time, in order of time; empty for a filter that held on.
    pub events: Vec<LockEvent>,
}

/// Something that a good estimate never does.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum LockEvent {
    /// Over a whole cycle of the motion the prediction left more than half of the signal unexplained, and far
    /// more than the filter expected.
    Lost {
        /// When the cycle began, in s.
        time_s: f64,
        /// The root mean square innovation over the signal's standard deviation in that cycle.
        unexplained: f64,
    },
    /// The estimated motion has moved by more than a quarter of a cycle against the drive since it was last
    /// settled: it went over to another branch, most often the mirrored one.
    Flipped {
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
}

impl std::fmt::Display for LockEvent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Lost { time_s, unexplained } => write!(
                f,
                "lost the signal at {:.3} ms: the prediction leaves {:.0} % of it unexplained over a cycle",
                time_s * 1e3,
                unexplained * 100.0
            ),
            Self::Flipped { time_s, moved_deg } => write!(
                f,
                "changed branch at {:.3} ms: the motion has moved by {moved_deg:.0}° against the drive",
                time_s * 1e3
            ),
        }
    }
}

/// How fast the motion goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Cycles per second.
    pub frequency_hz: f64,
    /// Whether a steady drive sets it; otherwise it is what the device would do by itself.
    pub is_driven: bool,
}

/// The share of the signal that may stay unexplained.
const UNEXPLAINED: f64 = 0.5;
/// The mean NIS of a cycle from which on the filter itself says that something is wrong.
const ALARM: f64 = 4.0;

/// Judges a trajectory's lock from `start_s` on, cycle by cycle of the motion.
///
/// `angle` is the estimated angle, `signal` what was measured, `innovation` and `nis` what the filter made of
/// it. A signal without motion cannot be lost: both its share and the NIS must be too large. Whether the
/// motion keeps its phase can be told only where a steady drive sets its frequency.
pub fn judge_lock(
    time_s: &[f64],
    (angle, signal): (&[f64], &[f64]),
    (innovation, nis): (&[f64], &[f64]),
    motion: Motion,
    start_s: f64,
) -> Lock {
    let mut events = lost(time_s, signal, innovation, nis, motion.frequency_hz, start_s);
    if motion.is_driven {
        events.extend(flipped(&fit_cycles(time_s, angle, motion.frequency_hz, start_s)));
    }
    events.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    Lock { events }
}

impl LockEvent {
    /// When, in s.
    pub fn time_s(&self) -> f64 {
        match self {
            Self::Lost { time_s, .. } | Self::Flipped { time_s, .. } => *time_s,
        }
    }
}

/// The first cycle of each stretch in which the signal was lost.
fn lost(
    time_s: &[f64],
    signal: &[f64],
    innovation: &[f64],
    nis: &[f64],
    motion_hz: f64,
    start_s: f64,
) -> Vec<LockEvent> {
    let mut events = Vec::new();
    let mut was_lost = false;
    let mut first = time_s.partition_point(|t| *t < start_s);
    while first < time_s.len() {
        let end = first + time_s[first..].partition_point(|t| *t < time_s[first] + 1.0 / motion_hz);
        let updates = || (first..end).filter(|k| nis[*k].is_finite());
        let count = updates().count();
        if count >= 8 {
            let mean = |f: &dyn Fn(usize) -> f64| updates().map(f).sum::<f64>() / count as f64;
            let level = mean(&|k| signal[k]);
            let spread = mean(&|k| (signal[k] - level).powi(2));
            let unexplained = (mean(&|k| innovation[k].powi(2)) / spread).sqrt();
            // Once lost, it is found again only when the prediction is twice as good, so that one loss is told once.
            let share = if was_lost { UNEXPLAINED / 2.0 } else { UNEXPLAINED };
            let is_lost = unexplained > share && mean(&|k| nis[k]) > ALARM;
            if is_lost && !was_lost {
                events.push(LockEvent::Lost { time_s: time_s[first], unexplained });
            }
            was_lost = is_lost;
        }
        first = end.max(first + 1);
    }
    events
}

/// Where the motion left its phase by more than a quarter cycle, and how far it had gone when it was steady
/// again (within a twelfth of a cycle from one cycle to the next).
fn flipped(cycles: &[Cycle]) -> Vec<LockEvent> {
    let mut events = Vec::new();
    let Some(mut settled) = cycles.first().map(|cycle| cycle.phase_rad) else { return events };
    let mut left = None;
    for pair in cycles.windows(2) {
        let [before, cycle] = pair else { continue };
        let moved = wrapped(cycle.phase_rad - settled);
        if moved.abs() <= PI / 2.0 {
            left = None;
            continue;
        }
        let time_s = *left.get_or_insert(cycle.start_s);
        if wrapped(cycle.phase_rad - before.phase_rad).abs() < PI / 6.0 {
            events.push(LockEvent::Flipped { time_s, moved_deg: moved.to_degrees() });
            settled = cycle.phase_rad;
            left = None;
        }
    }
    events
}

fn wrapped(angle: f64) -> f64 {
    angle - 2.0 * PI * (angle / (2.0 * PI)).round()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const MOTION_HZ: f64 = 15_675.0;

    fn judge(amplitude: impl Fn(f64) -> f64, innovation: impl Fn(f64) -> f64) -> Lock {
        let time: Vec<f64> = (0..10_000).map(|i| f64::from(i) * 1e-6).collect();
        let angle: Vec<f64> = time.iter().map(|t| amplitude(*t) * (TAU * MOTION_HZ * t).sin()).collect();
        let signal: Vec<f64> = angle.iter().map(|a| 30.0 * a * a).collect();
        let innovation: Vec<f64> = time.iter().map(|t| innovation(*t)).collect();
        let nis: Vec<f64> = innovation.iter().map(|v| (v / 0.014).powi(2)).collect();
        let motion = Motion { frequency_hz: MOTION_HZ, is_driven: true };
        judge_lock(&time, (&angle, &signal), (&innovation, &nis), motion, 1e-3)
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

    #[test]
    fn a_change_of_branch_is_told_with_its_time() {
        let lock = judge(|t| 0.15 * ((5e-3 - t) / 1e-3).clamp(-1.0, 1.0), |_| 0.014);
        assert_eq!(lock.events.len(), 1, "{lock:?}");
        let LockEvent::Flipped { time_s, moved_deg } = lock.events[0] else { panic!("{lock:?}") };
        assert!((time_s - 5e-3).abs() < 1e-4 && (moved_deg.abs() - 180.0).abs() < 3.0, "{lock:?}");
    }

    #[test]
    fn a_lost_signal_is_told_once_with_its_time() {
        let lock = judge(|_| 0.15, |t| if t > 4e-3 { 0.3 } else { 0.01 });
        assert_eq!(lock.events.len(), 1, "{lock:?}");
        let LockEvent::Lost { time_s, .. } = lock.events[0] else { panic!("{lock:?}") };
        assert!((time_s - 4e-3).abs() < 1e-4, "{lock:?}");
    }
}
