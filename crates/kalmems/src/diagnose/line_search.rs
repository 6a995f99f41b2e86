//! The search for lines in the signal: sines that the innovations show and no model of the motion makes.

use super::cause::Cause;
use super::search::{CauseSearch, FittedCause, TrialPart};
use super::trial::TrialBlocks;
use crate::evaluate::{InnovationTest, TestPlace};
use crate::fit::most_likely;
use kalmems_core::Scalar;
use std::f64::consts::TAU;

/// Steps of a search for a line, for each frequency that the recording can tell from the next; and how many there are at most.
const FINE: f64 = 8.0;
const MOST_STEPS: f64 = 400.0;

/// A first step of the frequency of a line, and how far it may be from where the innovations have most, in parts of what the recording can tell
/// from the next.
const FREQUENCY_STEP: f64 = 0.03;
const FARTHEST: f64 = 2.0;

/// The amplitudes of cosine and sine with the time counted from so many cycles later.
fn turned([a, b]: [f64; 2], cycles: f64) -> [f64; 2] {
    let (sine, cosine) = (Scalar::sin(TAU * cycles), Scalar::cos(TAU * cycles));
    [a * cosine + b * sine, b * cosine - a * sine]
}

impl CauseSearch<'_> {
    /// A line at each frequency at which the tests of the innovations find one, or too much power: where the innovations have most.
    pub(super) fn lines(&self) -> Vec<FittedCause> {
        let resolution_hz = 1.0 / self.duration_s();
        let mut frequencies: Vec<f64> = Vec::new();
        for found in self.base.failing() {
            let around = |hz: f64, by: f64| {
                [(hz - by * resolution_hz).max(0.25 * resolution_hz), hz + by * resolution_hz]
            };
            let range = match (found.test, &found.place) {
                (InnovationTest::Line, Some(TestPlace::Frequency { hz })) => around(*hz, 1.5),
                (InnovationTest::Harmonics, Some(TestPlace::Harmonic { number, of_hz })) => {
                    around(*number as f64 * of_hz, 0.5)
                }
                (InnovationTest::Bands, Some(TestPlace::Band { from_hz, to_hz })) => {
                    [around(*from_hz, 1.0)[0], around(*to_hz, 1.0)[1]]
                }
                _ => continue,
            };
            let frequency_hz = self.strongest(range, resolution_hz);
            if frequencies.iter().all(|known| (known - frequency_hz).abs() > resolution_hz) {
                frequencies.push(frequency_hz);
            }
        }
        frequencies.into_iter().filter_map(|hz| self.tuned(hz, resolution_hz)).collect()
    }

    /// A line near a frequency, where it makes the fitted blocks the likeliest: what follows of it in the innovations is not all at its own
    /// frequency.
    ///
    /// Its amplitudes are fitted at that frequency first, and then all three together: without an amplitude no frequency is likelier than another.
    fn tuned(&self, frequency_hz: f64, resolution_hz: f64) -> Option<FittedCause> {
        let line = |frequency_hz: f64, amplitude: [f64; 2]| {
            let (signal, harmonic) = (self.bench.signal.clone(), self.harmonic(frequency_hz, resolution_hz));
            Cause::Line { signal, frequency_hz, amplitude, harmonic }
        };
        let first = line(frequency_hz, [0.0; 2]);
        let (amplitudes, trial) = self.most_likely_from(&first, self.of_nothing(), TrialBlocks::Fitted)?;
        // Those in the middle of the recording hardly depend on the frequency.
        let middle_s = self.middle_s();
        let [a, b] = turned(amplitudes.at.try_into().ok()?, frequency_hz * middle_s);
        let at = |[a, b, away]: [f64; 3]| {
            let frequency_hz = frequency_hz + away * resolution_hz;
            let is_near = away.abs() <= FARTHEST && frequency_hz > 0.0;
            is_near.then(|| line(frequency_hz, turned([a, b], -frequency_hz * middle_s)))
        };
        let (start, step) = ([a, b, 0.0], self.amplitude_step());
        let found = most_likely(start, [step, step, FREQUENCY_STEP], &mut |sizes| {
            let run = || self.run_unjudged(&at(*sizes)?);
            let trial = if *sizes == start { Some(trial.clone()) } else { run() };
            trial.map(|trial| TrialPart::of(trial, TrialBlocks::Fitted))
        })?;
        self.fitted(at(found.at)?, &found.run.trial)
    }

    /// Which harmonic of the motion a frequency is, by the motion's frequency in the test of harmonics.
    fn harmonic(&self, frequency_hz: f64, resolution_hz: f64) -> Option<usize> {
        let of_hz = self.base.tests.iter().find_map(|test| match &test.place {
            Some(TestPlace::Harmonic { of_hz, .. }) => Some(*of_hz),
            _ => None,
        })?;
        let number = (frequency_hz / of_hz).round();
        let is_near = (frequency_hz - number * of_hz).abs() < 0.5 * resolution_hz;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // from 1 to below 1000
        (is_near && (1.0..1e3).contains(&number)).then_some(number as usize)
    }

    /// The frequency in a range at which the innovations of the first signal, over their standard deviations, have most.
    fn strongest(&self, [from_hz, to_hz]: [f64; 2], resolution_hz: f64) -> f64 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a number of steps, bounded
        let steps = (FINE * (to_hz - from_hz) / resolution_hz).clamp(1.0, MOST_STEPS).ceil() as u32;
        let at = |step: u32| from_hz + (to_hz - from_hz) * f64::from(step) / f64::from(steps);
        let power = |hz: f64| {
            let (mut cosine, mut sine) = (0.0, 0.0);
            for (k, (value, variance)) in
                self.base.innovations.value.iter().zip(&self.base.innovations.variance).enumerate()
            {
                let z = value / variance.sqrt();
                if self.base.is_of_first[k] && z.is_finite() {
                    let phase = TAU * hz * self.base.time_s[k];
                    cosine += z * Scalar::cos(phase);
                    sine += z * Scalar::sin(phase);
                }
            }
            cosine * cosine + sine * sine
        };
        let all = (0..=steps).map(|step| (power(at(step)), at(step)));
        all.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(from_hz, |(_, hz)| hz)
    }

    /// When the first innovation was and the last, in s.
    fn ends_s(&self) -> [f64; 2] {
        [self.base.time_s.first(), self.base.time_s.last()].map(|time_s| time_s.copied().unwrap_or(0.0))
    }

    /// From the first innovation to the last, in s.
    fn duration_s(&self) -> f64 {
        let [first, last] = self.ends_s();
        (last - first).abs().max(f64::MIN_POSITIVE)
    }

    /// The middle between the first innovation and the last, in s.
    fn middle_s(&self) -> f64 {
        let [first, last] = self.ends_s();
        first.midpoint(last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_the_same_whenever_its_time_is_counted_from() {
        let line = |[a, b]: [f64; 2], cycles: f64| a * (TAU * cycles).cos() + b * (TAU * cycles).sin();
        let (amplitudes, later) = ([0.3, -1.2], 7.4);
        for cycles in [0.0, 0.21, 8.3] {
            let found = line(turned(amplitudes, later), cycles - later);
            assert!((found - line(amplitudes, cycles)).abs() < 1e-12, "{cycles}");
        }
    }
}
