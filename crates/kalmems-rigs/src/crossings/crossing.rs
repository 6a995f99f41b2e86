//! When a signal crosses a level.

use super::search::{CrossingSearch, SearchedSignal, SignalRows};
use super::settings::DetectorSettings;
use crate::config::CrossingTiming;
use kalmems_core::detect::DetectError;

/// A crossing of the level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelCrossing {
    /// At the sample of the steepest slope.
    pub sample: CrossingReading,
    /// At the vertex of the parabola through that and its neighbours.
    pub parabola: CrossingReading,
    /// At the zero of the smoothed signal, where it has one there.
    pub zero: Option<CrossingReading>,
    /// The mean of its time given what was recorded, with all of its variance, where there is no zero, or noise has slopes as steep as
    /// that beside it.
    pub fallback: Option<CrossingReading>,
    /// The sample of the steepest slope, counted from the first of the segment.
    pub index: usize,
    /// The sample at which a detector that runs with the signal knows of it, counted from the first of the segment.
    pub known_at: usize,
}

/// One reading of when a crossing was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossingReading {
    /// When, in s.
    pub time_s: f64,
    /// The standard deviation of that, in s.
    pub sd_s: f64,
    /// The variance of the angle then, in rad²: that of the time, by the square of the rate; not a number without a model of the signal.
    pub angle_variance: f64,
    /// How fast the signal rises, in its unit per s.
    pub volts_per_s: f64,
}

impl LevelCrossing {
    /// When it was; `None` where the signal passes its offset nowhere near.
    pub fn at(&self, timing: CrossingTiming) -> Option<CrossingReading> {
        match timing {
            CrossingTiming::Sample => Some(self.sample),
            CrossingTiming::Parabola => Some(self.parabola),
            CrossingTiming::ZeroCrossing => self.zero,
        }
    }

    /// When it was, as well as is known, whatever the signal is like around it.
    pub fn best(&self) -> CrossingReading {
        self.fallback.or(self.zero).unwrap_or(self.parabola)
    }
}

/// The largest standard deviation of a crossing that is told without a zero, as a part of that of a time of which nothing is known
/// but that it is the nearest crossing: half of the time between two, over √3.
pub(crate) const TOLD_SHARE: f64 = 0.5;

/// The numbers of a crossing.
pub const NUMBERS: usize = 18;

impl LevelCrossing {
    /// It in numbers, for another run.
    pub(super) fn numbers(&self) -> [f64; NUMBERS] {
        let nowhere = CrossingReading { time_s: f64::NAN, ..self.sample };
        let mut numbers = [self.index as f64; NUMBERS];
        numbers[1] = self.known_at as f64;
        let [zero, fallback] = [self.zero, self.fallback].map(|instant| instant.unwrap_or(nowhere));
        let instants = [self.sample, self.parabola, zero, fallback];
        for (place, instant) in numbers[2..].chunks_exact_mut(4).zip(instants) {
            let CrossingReading { time_s, sd_s, angle_variance, volts_per_s } = instant;
            place.copy_from_slice(&[time_s, sd_s, angle_variance, volts_per_s]);
        }
        numbers
    }

    /// That of these numbers.
    pub(super) fn of_numbers(numbers: &[f64; NUMBERS]) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts of rows
        let [index, known_at] = [numbers[0] as usize, numbers[1] as usize];
        let instant = |from: usize| CrossingReading {
            time_s: numbers[from],
            sd_s: numbers[from + 1],
            angle_variance: numbers[from + 2],
            volts_per_s: numbers[from + 3],
        };
        let [zero, fallback] =
            [10, 14].map(|from| Some(instant(from)).filter(|instant| instant.time_s.is_finite()));
        Self { sample: instant(2), parabola: instant(6), zero, fallback, index, known_at }
    }
}

/// The crossings of a whole signal in the order of time, with the variances of their times and of the angle then. Refused where the settings make no detector at the interval of the samples.
pub fn find(
    rows: SignalRows,
    sought: SearchedSignal,
    settings: &DetectorSettings,
) -> Result<Vec<LevelCrossing>, DetectError> {
    Ok(CrossingSearch::new(sought, settings)?.take(&rows, true))
}
