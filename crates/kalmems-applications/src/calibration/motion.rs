//! Whether a record that is called one at rest shows motion.
//!
//! Two tests, each with a rate of false alarms of at most 1 in 1000 for noise that is white, flickers or wanders:
//!
//! - A motion that comes and goes: the variances about their own means of 16 to 127 pieces of the record, by their median. Of
//!   white noise they are χ² by its degrees of freedom; 30 of these at most are counted on, so that coloured noise is not taken for
//!   motion. A piece of a long record stands out from some 2.6 times the median on: a motion as large as 1.3 standard deviations of the
//!   noise. Of 64 samples the pieces have four each, and one stands out from some 15 times the median on.
//! - A motion that lasts: lines of the longest stretch's spectrum ([`RestSpectrum`]).
//!
//! What turns the unit at a constant rate throughout cannot be told from its bias, and what swings less than 33 times in the
//! record, as long and as slow as the bias wanders, not from that.

use super::rest_samples::{Piece, RestSamples};
use super::rest_spectrum::{RestLine, RestSpectrum};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Pieces that are compared at most, fewer of a short record, and how many at least.
const MOST_PIECES: usize = 127;
const FEWEST_PIECES: usize = 16;
/// Samples that a piece has at least, of the shortest record and of one that is long enough.
const SHORTEST_PIECE: [usize; 2] = [4, 16];
/// The median of variances is known as well as their mean by this part of them (0.64 of many, less of few).
const KNOWN_BY_MEDIAN: f64 = 0.5;

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
    /// Gaps leave too few pieces to tell.
    Unknown,
}

/// What a piece of a record at rest is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PieceState {
    Still,
    Moving,
    /// It has a gap or fewer samples than the others, or there are too few pieces.
    NotJudged,
}

/// The pieces of a record at rest with what each is taken for.
pub(super) struct RestPieces {
    pub each: Vec<(Piece, PieceState)>,
    /// The median of the variances of the pieces that are judged.
    usual: f64,
}

impl RestPieces {
    pub fn of(samples: &RestSamples) -> Self {
        let [short, long] = SHORTEST_PIECE;
        let shortest = 1 << (samples.count() / FEWEST_PIECES).max(1).ilog2();
        let pieces = samples.pieces(MOST_PIECES, usize::clamp(shortest, short, long));
        let length = pieces.first().map_or(0, |piece| piece.moments.count);
        let is_whole = |piece: &Piece| piece.is_of_one_stretch() && piece.moments.count == length;
        let mut sorted: Vec<f64> =
            pieces.iter().filter(|piece| is_whole(piece)).map(|piece| piece.moments.variance()).collect();
        let (whole, all) = (sorted.len(), pieces.len());
        let limits = (whole >= FEWEST_PIECES && 2 * whole >= all).then(|| {
            let usual = *sorted.select_nth_unstable_by(whole / 2, f64::total_cmp).1;
            Some([usual, usual * largest_ratio(length, whole)?])
        });
        let limits = limits.flatten();
        let state = |piece: &Piece| match limits {
            Some([_, most]) if is_whole(piece) && piece.moments.variance() > most => PieceState::Moving,
            Some(_) if is_whole(piece) => PieceState::Still,
            _ => PieceState::NotJudged,
        };
        let each = pieces.into_iter().map(|piece| (piece, state(&piece))).collect();
        Self { each, usual: limits.map_or(f64::NAN, |[usual, _]| usual) }
    }

    /// The motions, with the spectrum of the longest run of the samples.
    pub fn motions(&self, spectrum: Option<&RestSpectrum>) -> Vec<RestMotion> {
        let lines = spectrum.into_iter().flat_map(RestSpectrum::lines);
        self.passing().into_iter().chain(lines.map(RestMotion::Line)).collect()
    }

    fn passing(&self) -> Option<RestMotion> {
        if self.each.iter().all(|(_, state)| *state == PieceState::NotJudged) {
            return Some(RestMotion::Unknown);
        }
        let out =
            || self.each.iter().filter(|(_, state)| *state == PieceState::Moving).map(|(piece, _)| piece);
        let (first, last) = (out().next()?, out().next_back()?);
        let worst = out().map(|piece| piece.moments.variance()).fold(0.0, f64::max);
        let times = (worst / self.usual).sqrt();
        Some(RestMotion::Passing { time_s: [first.time_s[0], last.time_s[1]], times })
    }
}

/// The ratio to the median that the largest variance of so many pieces of so many samples hardly exceeds.
fn largest_ratio(length: usize, pieces: usize) -> Option<f64> {
    let freedom = FREEDOM.min((length - 1) as f64);
    let of_median = KNOWN_BY_MEDIAN * pieces as f64 * freedom;
    let law = FisherSnedecor::new(freedom, of_median).ok()?;
    let middle = ChiSquared::new(freedom).ok()?.inverse_cdf(0.5) / freedom;
    Some(law.inverse_cdf(1.0 - FALSE_ALARMS / pieces as f64) / middle)
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
        RestPieces::of(&samples).motions(RestSpectrum::of(samples.longest()).as_ref())
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
        let each = [(0.0, 4096), (0.02, 4096), (0.0, 600), (0.02, 300), (0.0, 200), (0.02, 130), (0.0, 64)];
        for (walk, samples) in each {
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
        for (samples, size) in [(700, 5.0), (200, 5.0), (64, 20.0)] {
            let mut values = noise(1, samples, 0.0);
            for (i, value) in values.iter_mut().enumerate().skip(samples / 2).take(samples / 10) {
                *value += size * (TAU * 0.17 * i as f64).portable_sin();
            }
            let found = motions(&values);
            assert!(matches!(found.first(), Some(RestMotion::Passing { .. })), "{samples}: {found:?}");
        }
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

    /// Twenty of each 64 samples are missing: no piece is one stretch, and that is said instead of nothing.
    #[test]
    fn a_record_in_which_motion_cannot_be_seen_is_not_called_still() {
        let mut values = noise(1, 4096, 0.0);
        for first in (0..4096).step_by(64) {
            values[first..first + 20].fill(f64::NAN);
        }
        assert_eq!(motions(&values), [RestMotion::Unknown]);
        assert_eq!(motions(&noise(1, 40, 0.0)), [RestMotion::Unknown]);
    }
}
