//! The position of a mirror at any time between its samples.

use crate::signal::{GAP, fit_sine, polynomial_between, usual_interval};
use std::f64::consts::TAU;
use std::ops::Range;

/// Samples that a run must have for a polynomial through them.
const POINTS: usize = 6;

/// A position over time, in runs without gaps.
///
/// Between samples it is the polynomial through the six around; nothing is interpolated across a gap, which is a time
/// without samples longer than [`GAP`] usual intervals or a sample without a number.
#[derive(Clone, Debug)]
pub struct PositionTrack {
    time_s: Vec<f64>,
    position_m: Vec<f64>,
    runs: Vec<Range<usize>>,
    interval_s: f64,
}

/// Why a position cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PositionTrackError {
    /// Times and positions do not belong together, or times do not increase.
    #[error("expected as many times as positions, the times increasing from one to the next")]
    Times,
    /// Too short between gaps.
    #[error("expected at least {POINTS} samples in a row without a gap; the longest row has {longest}")]
    Short {
        /// Samples in the longest row.
        longest: usize,
    },
}

/// What is known of a position at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrackPosition {
    /// It is known, in m.
    At(f64),
    /// Between two samples with a gap between them.
    InGap,
    /// Before the first sample or after the last.
    Beyond,
}

impl PositionTrack {
    /// From times in s, increasing, and positions in m; NaN where there is none.
    pub fn new(time_s: Vec<f64>, position_m: Vec<f64>) -> Result<Self, PositionTrackError> {
        if time_s.len() != position_m.len() || !time_s.is_sorted_by(|a, b| a < b) {
            return Err(PositionTrackError::Times);
        }
        let interval_s = usual_interval(&time_s);
        let mut runs: Vec<Range<usize>> = Vec::new();
        for k in 0..time_s.len() {
            let joins = k > 0
                && position_m[k - 1].is_finite()
                && position_m[k].is_finite()
                && time_s[k] - time_s[k - 1] <= GAP * interval_s;
            match runs.last_mut().filter(|_| joins) {
                Some(run) => run.end = k + 1,
                None => runs.push(k..k + 1),
            }
        }
        let longest = runs.iter().map(Range::len).max().unwrap_or(0);
        runs.retain(|run| run.len() >= POINTS);
        if runs.is_empty() {
            return Err(PositionTrackError::Short { longest });
        }
        Ok(Self { time_s, position_m, runs, interval_s })
    }

    /// First and last time in s.
    pub fn span_s(&self) -> [f64; 2] {
        let [first, last] = [self.runs.first(), self.runs.last()].map(|run| run.cloned().unwrap_or(0..1));
        [self.time_s[first.start], self.time_s[last.end - 1]]
    }

    /// The position at a time in s.
    pub fn at(&self, time_s: f64) -> TrackPosition {
        let after = self.runs.partition_point(|run| self.time_s[run.end - 1] < time_s);
        let Some(run) = self.runs.get(after).filter(|_| !time_s.is_nan()) else {
            return TrackPosition::Beyond;
        };
        let times = &self.time_s[run.clone()];
        if time_s < times[0] {
            return if after == 0 { TrackPosition::Beyond } else { TrackPosition::InGap };
        }
        let to = times.partition_point(|t| *t < time_s).max(1);
        let sample = |k: usize| self.position_m[run.start + k];
        TrackPosition::At(polynomial_between(POINTS, times, sample, to, time_s))
    }

    /// How many gaps it has between its runs.
    pub fn gaps(&self) -> usize {
        self.runs.len() - 1
    }

    /// What the polynomial may be off by in m in the middle of its six points, for a sine of amplitude a and the usual interval
    /// h: a·(2πfh)⁶·(225/64)/6!. `None` where the longest run follows no sine.
    pub fn interpolation_error_m(&self) -> Option<f64> {
        let run = self.runs.iter().max_by_key(|run| run.len())?.clone();
        let sine = fit_sine(&self.time_s[run.clone()], &self.position_m[run], self.interval_s)?;
        let step = TAU * sine.frequency_hz * self.interval_s;
        sine.is_steady().then(|| sine.amplitude * step.powi(6) * (225.0 / 64.0) / 720.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_samples_it_is_the_motion_and_in_gaps_nothing() {
        let sine = |t: f64| 1e-3 + 0.5e-3 * (TAU * 500.0 * t).cos();
        let mut time: Vec<f64> = (0..400).map(|k| f64::from(k) / 20e3).collect();
        time.drain(200..220);
        let mut position: Vec<f64> = time.iter().map(|t| sine(*t)).collect();
        position[100] = f64::NAN;
        let track = PositionTrack::new(time, position).unwrap();
        assert_eq!(track.gaps(), 2);
        // A run of 100 samples ends before a whole number of cycles does; the fit needs none.
        let bound = track.interpolation_error_m().unwrap();
        assert!((bound / 3.65e-11 - 1.0).abs() < 0.02, "{bound}");
        for k in 60..900 {
            let t = f64::from(k) * 2e-5 + 3e-6;
            let row = t * 20e3;
            match track.at(t) {
                TrackPosition::At(position) => {
                    // Up to (10·1·2·…)/(225/64) times as much where the points lie to one side.
                    assert!((position - sine(t)).abs() < 6.0 * bound, "{t}: {}", position - sine(t));
                }
                TrackPosition::InGap => {
                    assert!((99.0..101.0).contains(&row) || (199.0..220.0).contains(&row), "{row}");
                }
                TrackPosition::Beyond => assert!(row > 399.0, "{row}"),
            }
        }
        assert_eq!(track.at(-1e-9), TrackPosition::Beyond);
        assert_eq!(track.at(f64::NAN), TrackPosition::Beyond);
        assert_eq!(PositionTrack::new(vec![0.0, 1.0], vec![0.0]).unwrap_err(), PositionTrackError::Times);
        let short = PositionTrack::new(vec![0.0, 1.0, 2.0], vec![0.0; 3]).unwrap_err();
        assert_eq!(short, PositionTrackError::Short { longest: 3 });
    }
}
