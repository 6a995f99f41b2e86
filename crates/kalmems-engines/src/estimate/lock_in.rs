//! The lock-in: the sinusoidal motion that the lines of a signal show, window by window.

use super::{FilterBasics, FilterPast, SampleSelection, StateName, Trajectory, TrajectoryKind};
use kalmems_core::Portable;
use std::f64::consts::PI;
use std::time::Instant;

/// x(t) = x₀ + A·sin(ω·t + ψ): how one coordinate moves in one window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    /// x₀ in the unit of the coordinate.
    pub rest: f64,
    /// A in the same unit, above 0.
    pub amplitude: f64,
    /// ω in rad/s.
    pub rate: f64,
    /// ψ in rad.
    pub phase: f64,
}

impl Swing {
    /// The coordinate and its rate per second, at a time in s.
    pub fn at(&self, time_s: f64) -> [f64; 2] {
        let phase = self.rate * time_s + self.phase;
        [self.rest + self.amplitude * phase.portable_sin(), self.amplitude * self.rate * phase.portable_cos()]
    }

    /// The same swing or the opposite one, A → −A, whichever is nearer to the swing of the window before. For signals
    /// that are equal for both.
    #[must_use]
    pub fn nearest_to(mut self, before: Option<&Self>) -> Self {
        if let Some(before) = before {
            self.phase += PI * ((before.phase - self.phase) / PI).round();
        }
        self
    }
}

/// The samples that a lock-in takes.
#[derive(Clone, Copy, Debug)]
pub struct LockInWindows<'a> {
    /// When, in s.
    pub time_s: &'a [f64],
    /// The signals, at least one; of the first one the trajectory holds the samples.
    pub signals: &'a [&'a [f64]],
    /// Which samples are new.
    pub samples: &'a SampleSelection,
    /// The time in s at which the first window began: that of the segment's first sample.
    pub start_s: f64,
    /// The length of a window in s: one cycle of the motion, or as many as separate its lines from others.
    pub length_s: f64,
}

/// The samples of the window that has not ended, and the swings of the window before.
#[derive(Debug, Default)]
pub(super) struct OpenWindow {
    ended: u32,
    before: Vec<Swing>,
    time_s: Vec<f64>,
    signals: Vec<Vec<f64>>,
}

/// Samples that a window must have at least.
const ENOUGH: usize = 8;

/// The motion in the windows that have ended: in each one the swings that `detect` finds, one for each coordinate, whose
/// value and rate are two states of the trajectory.
///
/// `detect` gets the times in s, the signals and the swings of the last window that had any. A window in which it finds none
/// has no numbers. A lock-in has no model of the noise and claims no standard deviations.
pub fn lock_in(
    (filter, past): (&FilterBasics, &mut FilterPast),
    windows: &LockInWindows,
    states: &[StateName],
    detect: impl Fn(&[f64], &[&[f64]], &[Swing]) -> Option<Vec<Swing>>,
) -> Trajectory {
    let begun = Instant::now();
    let open = &mut past.open_window;
    let fresh = windows.samples.fresh.clone();
    open.time_s.extend_from_slice(&windows.time_s[fresh.clone()]);
    open.signals.resize(windows.signals.len(), Vec::new());
    for (kept, signal) in open.signals.iter_mut().zip(windows.signals) {
        kept.extend_from_slice(&signal[fresh.clone()]);
    }
    let (mut first, mut found) = (0, Vec::new());
    while first < open.time_s.len() {
        let end_s = windows.start_s + f64::from(open.ended + 1) * windows.length_s;
        let end = first + open.time_s[first..].partition_point(|t| *t < end_s);
        if end == open.time_s.len() && !windows.samples.ends {
            break;
        }
        let signals: Vec<&[f64]> = open.signals.iter().map(|signal| &signal[first..end]).collect();
        let enough = |signal: &&[f64]| signal.iter().filter(|y| y.is_finite()).count() >= ENOUGH;
        let swings = if signals.iter().any(enough) {
            detect(&open.time_s[first..end], &signals, &open.before)
        } else {
            None
        };
        if let Some(swings) = swings {
            open.before.clone_from(&swings);
            found.push((first..end, swings));
        }
        open.ended += 1;
        first = end;
    }
    let signal = open.signals.first().map_or(&[][..], Vec::as_slice);
    let names = (filter.key.as_str(), filter.name.as_str());
    let samples = (&open.time_s[..], signal, &(0..first));
    let mut trajectory = Trajectory::blank(names, TrajectoryKind::LockIn, samples, states);
    for (samples, swings) in found {
        for (states, swing) in trajectory.states.chunks_mut(2).zip(swings) {
            for k in samples.clone() {
                for (state, value) in states.iter_mut().zip(swing.at(open.time_s[k])) {
                    state.mean[k] = value;
                }
            }
        }
    }
    open.time_s.drain(..first);
    open.signals.iter_mut().for_each(|signal| drop(signal.drain(..first)));
    let there = trajectory.signal.iter().filter(|y| y.is_finite()).count();
    trajectory.counts.updates = there;
    trajectory.counts.without_signal = trajectory.signal.len() - there;
    trajectory.remove_deviations();
    trajectory.seconds_per_step = begun.elapsed().as_secs_f64() / fresh.len().max(1) as f64;
    trajectory
}

/// Each new sample by itself: the states that `invert` makes of the number of a sample and its signal, each with its standard
/// deviation. A sample of which it makes none counts as a missing one.
pub fn inversion<const N: usize>(
    filter: &FilterBasics,
    (time_s, signal, samples): (&[f64], &[f64], &SampleSelection),
    states: &[StateName; N],
    invert: impl Fn(usize, f64) -> Option<[(f64, f64); N]>,
) -> Trajectory {
    let names = (filter.key.as_str(), filter.name.as_str());
    let rows = (time_s, signal, &samples.fresh);
    let mut trajectory = Trajectory::blank(names, TrajectoryKind::LockIn, rows, states);
    for (k, sample) in samples.fresh.clone().enumerate() {
        let Some(found) = invert(sample, signal[sample]) else {
            trajectory.counts.without_signal += 1;
            continue;
        };
        for (state, (mean, sd)) in trajectory.states.iter_mut().zip(found) {
            (state.mean[k], state.sd[k]) = (mean, sd);
        }
    }
    trajectory
}

/// The factor between two amplitudes of the search outwards.
const STRIDE: f64 = 1.25;
/// Steps between two of them, at most; each but the first few doubles the digits.
const STEPS: usize = 60;
/// How near to the size the line of the amplitude is, relative to it.
const NEAR: f64 = 1e-14;

/// The least amplitude whose line has this size, where the line grows with the amplitude: from `unit`, below which it is taken to
/// grow, up to `limit`. `None` where the line stops to grow before it has that size.
pub fn amplitude_of_line(size: f64, [unit, limit]: [f64; 2], line: impl Fn(f64) -> f64) -> Option<f64> {
    let above = |amplitude: f64| line(amplitude).abs() - size;
    if size.is_nan() || size <= 0.0 {
        return None;
    }
    let (mut low, mut high) = (0.0, unit.min(limit));
    let (mut at_low, mut at_high) = (-size, above(high));
    while at_high < 0.0 {
        let next = (high * STRIDE).min(limit);
        let at_next = above(next);
        if next <= high || at_next <= at_high {
            return None;
        }
        (low, at_low, high, at_high) = (high, at_high, next, at_next);
    }
    // By secants, of which the end that stays counts half (the Illinois method: Dowell and Jarratt, BIT 11, 168, 1971).
    let mut middle = high;
    for _ in 0..STEPS {
        middle = high - at_high * (high - low) / (at_high - at_low);
        let at_middle = above(middle);
        if at_middle.is_nan() || at_middle.abs() <= NEAR * size {
            break;
        }
        if at_middle < 0.0 {
            (low, at_low, at_high) = (middle, at_middle, 0.5 * at_high);
        } else {
            (high, at_high, at_low) = (middle, at_middle, 0.5 * at_low);
        }
    }
    middle.is_finite().then_some(middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_amplitude_is_found_again_where_its_line_grows() {
        // Grows up to an amplitude of 1.
        let line = |a: f64| -7.0 * a * (-0.5 * a * a).exp();
        for amplitude in [1e-4, 0.01, 0.3, 0.9] {
            let found = amplitude_of_line(line(amplitude).abs(), [1e-3, 10.0], line).unwrap();
            assert!((found / amplitude - 1.0).abs() < 1e-10, "{amplitude}: {found}");
        }
        assert_eq!(amplitude_of_line(7.0, [1e-3, 10.0], line), None);
        for size in [0.0, -1.0, f64::NAN] {
            assert_eq!(amplitude_of_line(size, [1e-3, 10.0], line), None);
        }
        // A limit below the amplitude that would have this line.
        assert_eq!(amplitude_of_line(line(0.5).abs(), [1e-3, 0.4], line), None);
    }

    #[test]
    fn of_two_opposite_swings_the_nearer_one_is_taken() {
        let swing = Swing { rest: 1.0, amplitude: 0.2, rate: 10.0, phase: 0.3 };
        let opposite = Swing { phase: 0.3 + PI, ..swing };
        assert_eq!(opposite.nearest_to(Some(&swing)).at(0.7), swing.at(0.7));
        assert_eq!(swing.nearest_to(None), swing);
        let [x, v] = swing.at(0.1);
        assert!((x - (1.0 + 0.2 * 1.3_f64.sin())).abs() < 1e-15 && (v - 2.0 * 1.3_f64.cos()).abs() < 1e-15);
    }
}
