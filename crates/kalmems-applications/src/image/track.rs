//! The angle of one axis as an estimate gives it, at any time between its samples.

use crate::signal::{GAP, Sine, cubic_between, fit_sine, fit_sine_at, usual_interval};
use std::f64::consts::TAU;
use std::ops::{Range, RangeInclusive};

/// Samples that a run must have for a cubic.
const SHORTEST: usize = 4;
/// Cycles that a part of a run must have for a sine of its own.
const FEWEST_CYCLES: f64 = 2.0;

/// An axis' angle over time, in runs without gaps.
///
/// Between samples it is the cubic through the four around; nothing is interpolated across a gap, which is a time
/// without samples longer than [`GAP`] usual intervals or a sample without a number.
#[derive(Clone, Debug)]
pub struct AxisTrack {
    time_s: Vec<f64>,
    angle_rad: Vec<f64>,
    runs: Vec<Range<usize>>,
    interval_s: f64,
    frequency_hz: f64,
    amplitude_rad: f64,
    amplitudes_at_ends_rad: [f64; 2],
    largest_rad: f64,
}

/// Why an axis' trajectory cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// Times and angles do not belong together, or times do not increase.
    #[error("expected as many times as angles, the times increasing from one to the next")]
    Times,
    /// Too short between gaps.
    #[error("expected at least {SHORTEST} samples in a row without a gap; the longest row has {longest}")]
    Short {
        /// Samples in the longest row.
        longest: usize,
    },
    /// Without a frequency a phase means nothing.
    #[error(
        "the angle follows no sine, so that its phase has no meaning; expected the motion of a resonant scanner"
    )]
    NoSine,
}

/// What is known of the angle at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TrackAngle {
    /// It is known.
    At {
        /// In rad.
        angle_rad: f64,
        /// Whether it grows from the sample before this time to the one after.
        rising: bool,
    },
    /// Between two samples with a gap between them.
    InGap,
    /// Before the first sample or after the last.
    Beyond,
}

impl AxisTrack {
    /// From times in s, increasing, and angles in rad; NaN where there is none.
    pub fn new(time_s: Vec<f64>, angle_rad: Vec<f64>) -> Result<Self, TrackError> {
        Self::scanned(time_s, angle_rad, f64::NEG_INFINITY..=f64::INFINITY)
    }

    /// The same, whose sine is that of the motion in these times, in which intensities were recorded: before them a motion
    /// may not have settled. Where the track has no two cycles in them, it is that of its longest run.
    pub fn scanned(
        time_s: Vec<f64>,
        angle_rad: Vec<f64>,
        during_s: RangeInclusive<f64>,
    ) -> Result<Self, TrackError> {
        if time_s.len() != angle_rad.len() || !time_s.is_sorted_by(|a, b| a < b) {
            return Err(TrackError::Times);
        }
        let interval_s = usual_interval(&time_s);
        let mut runs = Vec::new();
        let mut longest = 0..0;
        let mut start = 0;
        for i in 0..time_s.len() {
            let joins = |j: usize| angle_rad[j].is_finite() && angle_rad[i].is_finite();
            if i == 0 || !(joins(i - 1) && time_s[i] - time_s[i - 1] <= GAP * interval_s) {
                start = i;
            }
            let last = i + 1 == time_s.len()
                || !angle_rad[i + 1].is_finite()
                || time_s[i + 1] - time_s[i] > GAP * interval_s;
            if last && angle_rad[i].is_finite() {
                let run = start..i + 1;
                if run.len() > longest.len() {
                    longest = run.clone();
                }
                if run.len() >= SHORTEST {
                    runs.push(run);
                }
            }
        }
        if runs.is_empty() {
            return Err(TrackError::Short { longest: longest.len() });
        }
        let sine_of = |run: &Range<usize>| {
            let sine = fit_sine(&time_s[run.clone()], &angle_rad[run.clone()], interval_s);
            sine.filter(|s| s.frequency_hz > 0.0 && s.residual_rms < 0.5 * s.amplitude)
        };
        // Fewer cycles hardly tell a sine from its offset.
        let has_cycles = |run: &Range<usize>, sine: &Sine| {
            run.len() as f64 * interval_s * sine.frequency_hz > FEWEST_CYCLES
        };
        let scanned = runs.iter().rev().map(|run| {
            let times = &time_s[run.clone()];
            let until = times.partition_point(|time| time <= during_s.end());
            run.start + times.partition_point(|time| time < during_s.start()).min(until)..run.start + until
        });
        let scanned = scanned.max_by_key(Range::len).filter(|run| run.len() >= SHORTEST);
        let scanned = scanned.and_then(|run| Some((sine_of(&run)?, run)));
        let scanned = scanned.filter(|(sine, run)| has_cycles(run, sine));
        let fitted = scanned.or_else(|| Some((sine_of(&longest)?, longest)));
        let (sine, fitted) = fitted.ok_or(TrackError::NoSine)?;
        let tenth = fitted.len() / 10;
        let amplitudes_at_ends_rad = [fitted.start..fitted.start + tenth, fitted.end - tenth..fitted.end]
            .map(|end| {
                let end = has_cycles(&end, &sine)
                    .then(|| fit_sine_at(&time_s[end.clone()], &angle_rad[end], sine.frequency_hz));
                end.flatten().map_or(sine.amplitude, |end| end.amplitude)
            });
        let used = runs.iter().flat_map(|run| &angle_rad[run.clone()]);
        let largest_rad = used.fold(0.0, |largest: f64, angle| largest.max(angle.abs()));
        Ok(Self {
            frequency_hz: sine.frequency_hz,
            amplitude_rad: sine.amplitude,
            amplitudes_at_ends_rad,
            time_s,
            angle_rad,
            runs,
            interval_s,
            largest_rad,
        })
    }

    /// The frequency of the sine that its longest run while it is scanned follows best, in Hz.
    pub const fn frequency_hz(&self) -> f64 {
        self.frequency_hz
    }

    /// The amplitude of that sine in rad.
    pub const fn amplitude_rad(&self) -> f64 {
        self.amplitude_rad
    }

    /// The amplitudes in rad of the same frequency in the first and in the last tenth of that run: they differ where the motion has
    /// not settled. Where a tenth has no two cycles, that of all of it.
    pub const fn amplitudes_at_ends_rad(&self) -> [f64; 2] {
        self.amplitudes_at_ends_rad
    }

    /// The largest magnitude of the angle in rad.
    pub const fn largest_rad(&self) -> f64 {
        self.largest_rad
    }

    /// How many gaps it has between its runs.
    pub fn gaps(&self) -> usize {
        self.runs.len() - 1
    }

    /// What the cubic may be off by in rad, for its sine and the usual interval h: a·(2πfh)⁴·(9/16)/4!.
    ///
    /// Up to four times as much in the first and the last interval of a run.
    pub fn interpolation_error_rad(&self) -> f64 {
        self.amplitude_rad * (TAU * self.frequency_hz * self.interval_s).powi(4) * (9.0 / 16.0) / 24.0
    }

    /// How much earlier, in s, an axis is seen that is this much further ahead in its cycle.
    pub fn lead_s(&self, phase_rad: f64) -> f64 {
        phase_rad / (TAU * self.frequency_hz)
    }

    /// Goes along it.
    pub const fn walk(&self) -> TrackWalk<'_> {
        TrackWalk { track: self, run: 0, to: 0 }
    }
}

/// Looks at a track at one time after the other; quick where they increase.
#[derive(Clone, Debug)]
pub struct TrackWalk<'a> {
    track: &'a AxisTrack,
    run: usize,
    /// The sample at the end of the interval that was looked at last.
    to: usize,
}

impl TrackWalk<'_> {
    /// The angle at a time in s.
    pub fn at(&mut self, time_s: f64) -> TrackAngle {
        let times = &self.track.time_s;
        let runs = &self.track.runs;
        if self.to > 0 && times[self.to - 1] > time_s {
            (self.run, self.to) = (0, 0);
        }
        while runs.get(self.run).is_some_and(|run| times[run.end - 1] < time_s) {
            self.run += 1;
        }
        let Some(run) = runs.get(self.run).filter(|_| !time_s.is_nan()) else { return TrackAngle::Beyond };
        if time_s < times[run.start] {
            return if self.run == 0 { TrackAngle::Beyond } else { TrackAngle::InGap };
        }
        self.to = self.to.max(run.start + 1);
        while times[self.to] < time_s {
            self.to += 1;
        }
        let angle = &self.track.angle_rad[run.clone()];
        let to = self.to - run.start;
        TrackAngle::At {
            angle_rad: cubic_between(&times[run.clone()], |k| angle[k], to, time_s),
            rising: angle[to] >= angle[to - 1],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f64 = 32.0;

    fn sine(t: f64) -> f64 {
        0.2 * (TAU * t).sin()
    }

    fn with_holes() -> AxisTrack {
        let mut time: Vec<f64> = (0..640).map(|k| f64::from(k) / RATE).collect();
        let mut angle: Vec<f64> = time.iter().map(|t| sine(*t)).collect();
        angle[100] = f64::NAN;
        time.drain(300..320);
        angle.drain(300..320);
        AxisTrack::new(time, angle).unwrap()
    }

    #[test]
    fn between_samples_it_is_the_motion_and_in_gaps_nothing() {
        let track = with_holes();
        assert_eq!(track.gaps(), 2);
        assert!((track.frequency_hz() - 1.0).abs() < 1e-6 && (track.amplitude_rad() - 0.2).abs() < 1e-6);
        let mut walk = track.walk();
        let (mut gap, mut known) = (0, 0);
        for k in -10..7000 {
            let t = f64::from(k) / 350.0;
            match walk.at(t) {
                TrackAngle::At { angle_rad, rising } => {
                    known += 1;
                    let off = (angle_rad - sine(t)).abs();
                    assert!(off < 4.01 * track.interpolation_error_rad(), "{t}: {off}");
                    let slope = (TAU * t).cos();
                    assert!(slope.abs() < 0.2 || rising == (slope > 0.0));
                }
                TrackAngle::InGap => {
                    gap += 1;
                    let [a, b, c, d] = [99.0, 101.0, 299.0, 320.0].map(|k| k / RATE);
                    assert!((a..b).contains(&t) || (c..d).contains(&t), "{t}");
                }
                TrackAngle::Beyond => assert!(!(0.0..=639.0 / RATE).contains(&t), "{t}"),
            }
        }
        // 2 intervals and 21 of 1/32 s, at 350 per second.
        assert!((gap - 251_i32).abs() < 4 && known > 6000, "{gap} {known}");
        // Going back gives the same.
        let mut fresh = track.walk();
        assert_eq!(walk.at(0.123), fresh.at(0.123));
    }

    #[test]
    fn a_motion_that_settles_before_the_scan_has_the_sine_of_the_scan() {
        let time: Vec<f64> = (0..3200).map(|k| f64::from(k) / RATE).collect();
        // Amplitude and frequency come to those of the drive with a time constant of 8 s.
        let settling = |t: f64| (-t / 8.0).exp();
        let angle: Vec<f64> =
            time.iter().map(|t| 0.2 * (1.0 - settling(*t)) * (TAU * t + settling(*t)).sin()).collect();
        let whole = AxisTrack::new(time.clone(), angle.clone()).unwrap();
        let settled = AxisTrack::scanned(time.clone(), angle.clone(), 60.0..=99.0).unwrap();
        assert!((whole.frequency_hz() - 1.0).abs() > 1e-4, "{}", whole.frequency_hz());
        assert!((settled.frequency_hz() - 1.0).abs() < 2e-6, "{}", settled.frequency_hz());
        assert!((settled.amplitude_rad() - 0.2).abs() < 5e-5, "{}", settled.amplitude_rad());
        let change = |track: &AxisTrack| {
            let [first, last] = track.amplitudes_at_ends_rad();
            last / first - 1.0
        };
        assert!(
            change(&whole) > 0.5 && change(&settled).abs() < 1e-3,
            "{} {}",
            change(&whole),
            change(&settled)
        );
        // A scan at another time than the trajectory, or of half a cycle, has no sine of its own.
        for during_s in [200.0..=300.0, 60.0..=60.5] {
            let without = AxisTrack::scanned(time.clone(), angle.clone(), during_s).unwrap();
            assert_eq!(without.frequency_hz().to_bits(), whole.frequency_hz().to_bits());
        }
    }

    #[test]
    fn what_cannot_be_used_is_refused() {
        let refused = |t: &[f64], a: &[f64]| AxisTrack::new(t.to_vec(), a.to_vec()).unwrap_err();
        assert_eq!(refused(&[0.0, 1.0, 1.0], &[0.0; 3]), TrackError::Times);
        assert_eq!(refused(&[0.0, 1.0], &[0.0; 3]), TrackError::Times);
        assert_eq!(refused(&[], &[]), TrackError::Short { longest: 0 });
        assert_eq!(refused(&[0.0, 1.0, 2.0], &[0.0, f64::NAN, 1.0]), TrackError::Short { longest: 1 });
        let line: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(refused(&line, &[0.3; 100]), TrackError::NoSine);
    }
}
