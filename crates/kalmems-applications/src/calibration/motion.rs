//! Whether a record that is called one at rest shows motion.
//!
//! Two tests, each with a rate of false alarms of at most 1 in 1000 for noise that is white, flickers or wanders:
//!
//! - A motion that comes and goes: the variances about their own means of 16 to 127 pieces of the record, by their median. Of
//!   white noise they are χ² by its degrees of freedom; 30 of these at most are counted on, so that coloured noise is not taken for
//!   motion. A piece stands out from some 2.6 times the median on: a motion as large as 1.3 standard deviations of the noise.
//! - A motion that lasts: lines of the longest stretch's spectrum ([`RestSpectrum`]).
//!
//! What turns the unit at a constant rate throughout cannot be told from its bias, and what swings less than 33 times in the
//! record, as long and as slow as the bias wanders, not from that.

use super::rest_samples::RestSamples;
use super::rest_spectrum::{RestLine, RestSpectrum};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Pieces that are compared at most, fewer of a short record, how many at least, and samples that each has at least.
const MOST_PIECES: usize = 127;
const FEWEST_PIECES: usize = 16;
const SHORTEST_PIECE: usize = 16;

/// How often noise alone is called a motion.
pub(super) const FALSE_ALARMS: f64 = 1e-3;

/// Degrees of freedom that are counted on, as noise that is not white has fewer.
const FREEDOM: f64 = 30.0;

/// A motion in a record that is called one at rest.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum RestMotion {
    /// Some samples vary more than the others.
    Passing {
        /// From the first to the last piece that does, in s.
        time_s: [f64; 2],
        /// How many times as much the worst varies, as a ratio of standard deviations.
        times: f64,
    },
    /// A line of the spectrum.
    Line(RestLine),
}

/// The motions in a record at rest, with the spectrum of the longest run of its samples.
pub(super) fn motions(samples: &RestSamples, spectrum: Option<&RestSpectrum>) -> Vec<RestMotion> {
    let lines = spectrum.into_iter().flat_map(RestSpectrum::lines);
    passing(samples).into_iter().chain(lines.map(RestMotion::Line)).collect()
}

fn passing(samples: &RestSamples) -> Option<RestMotion> {
    let mut pieces = samples.pieces(MOST_PIECES, SHORTEST_PIECE);
    let length = pieces.first()?.moments.count;
    let all = pieces.len();
    pieces.retain(|piece| piece.is_of_one_stretch() && piece.moments.count == length);
    if pieces.len() < FEWEST_PIECES || 2 * pieces.len() < all {
        return None;
    }
    let mut sorted: Vec<f64> = pieces.iter().map(|piece| piece.moments.variance()).collect();
    let middle = sorted.len() / 2;
    let usual = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    let freedom = FREEDOM.min((length - 1) as f64);
    let law = ChiSquared::new(freedom).ok()?;
    let most = law.inverse_cdf(1.0 - FALSE_ALARMS / pieces.len() as f64) / law.inverse_cdf(0.5);
    let out = || pieces.iter().filter(|piece| piece.moments.variance() > most * usual);
    let (first, last) = (out().next()?, out().next_back()?);
    let worst = out().map(|piece| piece.moments.variance()).fold(0.0, f64::max);
    Some(RestMotion::Passing { time_s: [first.time_s[0], last.time_s[1]], times: (worst / usual).sqrt() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use kalmems_core::Portable;
    use std::f64::consts::TAU;

    /// Of samples with an interval of 1 s.
    fn motions(values: &[f64]) -> Vec<RestMotion> {
        let samples = RestSamples::of(values, 1.0);
        super::motions(&samples, RestSpectrum::of(samples.longest()).as_ref())
    }

    /// White noise, with a walk and a flicker of about its size over the record where that is wanted.
    fn noise(seed: u64, samples: usize, walk: f64) -> Vec<f64> {
        let mut source = WhiteNoise::new(seed, 0);
        let mut bias = 0.0;
        let each = |_| {
            bias += walk * source.sample();
            bias + source.sample()
        };
        (0..samples).map(each).collect()
    }

    #[test]
    fn noise_alone_shows_no_motion() {
        for (walk, samples) in [(0.0, 4096), (0.02, 4096), (0.0, 600), (0.02, 300)] {
            let alarms = (0..300).filter(|seed| !motions(&noise(*seed, samples, walk)).is_empty()).count();
            // 0.6 are expected at most; five or more come once in 2000 times.
            assert!(alarms < 5, "walk {walk}, {samples}: {alarms}");
        }
    }

    #[test]
    fn a_shake_in_one_place_is_found_there() {
        let mut values = noise(1, 8192, 0.0);
        for (i, value) in values.iter_mut().enumerate().skip(3000).take(200) {
            *value += 5.0 * (TAU * 0.07 * i as f64).sin();
        }
        let found = motions(&values);
        let Some(RestMotion::Passing { time_s: [first, last], times }) = found.first() else {
            panic!("{found:?}")
        };
        assert!((2900.0..3100.0).contains(first) && (3100.0..3400.0).contains(last), "{first} {last}");
        assert!((2.5..4.5).contains(times), "{times}");
    }

    #[test]
    fn a_shake_in_a_short_record_is_found() {
        let mut values = noise(1, 700, 0.0);
        for (i, value) in values.iter_mut().enumerate().skip(300).take(60) {
            *value += 5.0 * (TAU * 0.07 * i as f64).sin();
        }
        let found = motions(&values);
        assert!(matches!(found.first(), Some(RestMotion::Passing { .. })), "{found:?}");
    }

    #[test]
    fn a_vibration_below_the_noise_is_a_line() {
        let mut values = noise(1, 65_536, 1e-3);
        for (i, value) in values.iter_mut().enumerate() {
            *value += 0.2 * (TAU * 0.123 * i as f64).sin();
        }
        let found = motions(&values);
        let [RestMotion::Line(RestLine { frequency, amplitude })] = &found[..] else { panic!("{found:?}") };
        assert!((frequency - 0.123).abs() < 1e-4 && (amplitude / 0.2 - 1.0).abs() < 0.2, "{found:?}");
    }

    #[test]
    fn each_of_several_lines_is_named_by_its_frequency_and_amplitude() {
        let mut values = noise(2, 65_536, 1e-3);
        for (i, value) in values.iter_mut().enumerate() {
            let at = |frequency: f64, size: f64| size * (TAU * frequency * i as f64).portable_sin();
            *value += at(0.05, 0.3) + at(0.123, 0.2) + at(0.31, 0.25);
        }
        let lines: Vec<RestLine> = RestSpectrum::of(&values).unwrap().lines();
        let mut found: Vec<(f64, f64)> = lines.iter().map(|l| (l.frequency, l.amplitude)).collect();
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        assert_eq!(found.len(), 3, "{found:?}");
        for ((frequency, amplitude), expected) in
            found.into_iter().zip([(0.05, 0.3), (0.123, 0.2), (0.31, 0.25)])
        {
            assert!((frequency - expected.0).abs() < 1e-4 && (amplitude / expected.1 - 1.0).abs() < 0.2);
        }
    }

    #[test]
    fn too_short_a_record_shows_nothing() {
        assert_eq!(motions(&noise(1, 40, 0.0)), []);
        assert_eq!(motions(&[]), []);
    }
}
