//! Whether a record that is called one at rest shows motion.
//!
//! Four tests, each with a rate of false alarms of at most 1 in 1000 for noise that is white, flickers or wanders:
//!
//! - A motion that comes and goes: the variances about their own means of 16 to 127 pieces of the record, by their median. Of
//!   white noise they are χ² by its degrees of freedom; 30 of these at most are counted on, so that coloured noise is not taken for
//!   motion. A piece of a long record stands out from some 2.6 times the median on: a motion as large as 1.3 standard deviations of the
//!   noise. Of 64 samples the pieces have four each, and one stands out from some 15 times the median on.
//! - A step of the mean: the differences of the means of neighbouring pieces, by the median of their sizes. Of noise whose differences are stationary, as
//!   those of white noise, flicker and a random walk are, one does not stand out.
//! - Noise that changes over the record: a straight line through the logarithms of the pieces' variances, if it changes the standard deviation by a
//!   fifth at least.
//! - A motion that lasts: lines of the longest stretch's spectrum ([`RestSpectrum`]).
//!
//! What turns the unit at a constant rate throughout cannot be told from its bias, and what swings less than 33 times in the
//! record, as long and as slow as the bias wanders, not from that.

use super::rest_samples::{Piece, RestSamples};
use super::rest_spectrum::{RestLine, RestSpectrum};
use crate::metrology::coverage_factor;
use kalmems_core::Portable;
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

/// Pieces that are compared at most, fewer of a short record, and how many at least.
const MOST_PIECES: usize = 127;
const FEWEST_PIECES: usize = 16;
/// Samples that a piece has at least, of the shortest record and of one that is long enough.
const SHORTEST_PIECE: [usize; 2] = [4, 16];
/// The median of variances is known as well as their mean by this part of them (0.64 of many, less of few).
const KNOWN_BY_MEDIAN: f64 = 0.5;

/// The change of a standard deviation over a record that is none of a stationary noise to a reader.
const LEAST_CHANGE: f64 = 1.2;

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
    /// The mean changes at once.
    Step {
        /// When, in s.
        time_s: f64,
        /// By how much.
        size: f64,
    },
    /// The noise changes from the beginning to the end.
    Changing {
        /// The standard deviation at the end by that at the beginning.
        ratio: f64,
    },
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
        let changes = [self.passing(), self.step(), self.change()];
        changes.into_iter().flatten().chain(lines.map(RestMotion::Line)).collect()
    }

    /// The motions of a record whose mean and noise follow a temperature.
    pub fn motions_but_drift(&self, spectrum: Option<&RestSpectrum>) -> Vec<RestMotion> {
        let is_drift =
            |motion: &RestMotion| matches!(motion, RestMotion::Step { .. } | RestMotion::Changing { .. });
        self.motions(spectrum).into_iter().filter(|motion| !is_drift(motion)).collect()
    }

    fn step(&self) -> Option<RestMotion> {
        let is_still = |(piece, state): &(Piece, PieceState)| (*state == PieceState::Still).then_some(*piece);
        let pairs = self.each.windows(2).filter_map(|pair| {
            let [one, next] = pair else { return None };
            let (one, next) = (is_still(one)?, is_still(next)?);
            let [from, to] = [one, next].map(|piece| 0.5 * (piece.time_s[0] + piece.time_s[1]));
            // Neighbours of one record, without a gap.
            let length = next.time_s[1] - next.time_s[0];
            let is_next = (to - from - length).abs() < 0.5 * length;
            is_next.then_some((0.5 * (from + to), next.moments.mean - one.moments.mean))
        });
        let pairs: Vec<(f64, f64)> = pairs.collect();
        let count = pairs.len();
        let middle = median(pairs.iter().map(|(_, size)| *size))?;
        // Of a normal law.
        let scale = median(pairs.iter().map(|(_, size)| (size - middle).abs()))? / 0.6745;
        let most = coverage_factor(1.0 - FALSE_ALARMS / count as f64, KNOWN_BY_MEDIAN * count as f64) * scale;
        let worst = pairs.into_iter().max_by(|a, b| (a.1 - middle).abs().total_cmp(&(b.1 - middle).abs()));
        let (time_s, size) = worst.filter(|(_, size)| (size - middle).abs() > most)?;
        Some(RestMotion::Step { time_s, size: size - middle })
    }

    fn change(&self) -> Option<RestMotion> {
        let still = self.each.iter().enumerate().filter(|(_, (_, state))| *state == PieceState::Still);
        let points: Vec<(f64, f64)> = still
            .map(|(place, (piece, _))| (place as f64, piece.moments.variance().portable_ln()))
            .filter(|(_, size)| size.is_finite())
            .collect();
        let count = points.len() as f64;
        if points.len() < FEWEST_PIECES {
            return None;
        }
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
        let (place, size) = (mean(&|p| p.0), mean(&|p| p.1));
        let spread = mean(&|p| (p.0 - place).powi(2));
        let slope = mean(&|p| (p.0 - place) * (p.1 - size)) / spread;
        let left = mean(&|p| (p.1 - size - slope * (p.0 - place)).powi(2)) * count / (count - 2.0);
        let deviation = (left / (count * spread)).sqrt();
        let ratio = (0.5 * slope * (self.each.len() as f64 - 1.0)).portable_exp();
        let stands_out = slope.abs() > coverage_factor(1.0 - FALSE_ALARMS, count - 2.0) * deviation;
        (stands_out && ratio.max(ratio.recip()) > LEAST_CHANGE).then_some(RestMotion::Changing { ratio })
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

/// The middle one; of an even number the upper of the two in the middle.
fn median(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    (middle > 0).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
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
            // 1.2 are expected at most; six or more come once in 700 times.
            assert!(alarms < 6, "walk {walk}, {samples}: {alarms}");
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

    /// Of 2.5 standard deviations, which the variance of no piece shows.
    #[test]
    fn a_step_of_the_mean_is_found_where_it_is() {
        for seed in 0..20 {
            let mut values = noise(seed, 16_384, 0.0);
            values[9000..].iter_mut().for_each(|value| *value += 2.5);
            let found = motions(&values);
            let step = found.iter().find_map(|motion| match motion {
                RestMotion::Step { time_s, size } => Some((*time_s, *size)),
                _ => None,
            });
            let Some((time_s, size)) = step else { panic!("{seed}: {found:?}") };
            assert!((time_s - 9000.0).abs() < 130.0 && (1.0..3.0).contains(&size), "{seed}: {time_s} {size}");
        }
    }

    #[test]
    fn noise_that_grows_is_found_and_a_little_more_of_it_is_not() {
        for (times, is_found) in [(1.5, true), (1.0, false), (1.05, false)] {
            for seed in 0..20 {
                let mut values = noise(seed, 16_384, 0.0);
                values[8192..].iter_mut().for_each(|value| *value *= times);
                let found = motions(&values);
                let changes = found
                    .iter()
                    .any(|motion| matches!(motion, RestMotion::Changing { ratio } if *ratio > 1.2));
                assert_eq!(changes, is_found, "{seed} {times}: {found:?}");
            }
        }
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
