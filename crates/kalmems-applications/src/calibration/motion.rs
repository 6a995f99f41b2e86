//! Whether a record that is called one at rest shows motion.
//!
//! Two tests, each with a rate of false alarms of at most 1 in 1000 for noise that is white, flickers or wanders:
//!
//! - A motion that comes and goes: the variances about their own means of 16 to 64 pieces of the record, by their median. Of
//!   white noise they are χ² by its degrees of freedom; 30 of these at most are counted on, so that coloured noise is not taken for
//!   motion. A piece stands out from some 2.6 times the median on: a motion as large as 1.3 standard deviations of the noise.
//! - A motion that lasts: lines of the longest stretch's spectrum ([`RestSpectrum`]).
//!
//! What turns the unit at a constant rate throughout cannot be told from its bias, and what swings less than 33 times in the
//! record, as long and as slow as the bias wanders, not from that.

use super::rest_spectrum::{RestLine, RestSpectrum};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::ops::Range;

/// Pieces that are compared, fewer of a short record, and samples that each has at least.
const PIECES: usize = 64;
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
        /// The first and the last piece that does, as samples of all stretches together.
        samples: Range<usize>,
        /// How many times as much the worst varies, as a ratio of standard deviations.
        times: f64,
    },
    /// A line of the spectrum.
    Line(RestLine),
}

/// The motions in a record at rest, given as stretches without gaps and the spectrum of the longest.
pub(super) fn motions(stretches: &[&[f64]], spectrum: Option<&RestSpectrum>) -> Vec<RestMotion> {
    let lines = spectrum.into_iter().flat_map(RestSpectrum::lines);
    passing(stretches).into_iter().chain(lines.map(RestMotion::Line)).collect()
}

fn passing(stretches: &[&[f64]]) -> Option<RestMotion> {
    let samples: usize = stretches.iter().map(|stretch| stretch.len()).sum();
    let wanted = (samples / SHORTEST_PIECE).min(PIECES);
    if wanted < FEWEST_PIECES {
        return None;
    }
    let length = samples / wanted;
    // Pieces do not reach over a gap; what is left at the end of a stretch is in none.
    let mut pieces = Vec::new();
    let mut before = 0;
    for stretch in stretches {
        for (i, piece) in stretch.chunks_exact(length).enumerate() {
            pieces.push((before + i * length, variance(piece)));
        }
        before += stretch.len();
    }
    let mut sorted: Vec<f64> = pieces.iter().map(|(_, variance)| *variance).collect();
    if sorted.len() < wanted / 2 {
        return None;
    }
    let middle = sorted.len() / 2;
    let usual = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
    let freedom = FREEDOM.min((length - 1) as f64);
    let law = ChiSquared::new(freedom).ok()?;
    let most = law.inverse_cdf(1.0 - FALSE_ALARMS / pieces.len() as f64) / law.inverse_cdf(0.5);
    let out = || pieces.iter().filter(|(_, variance)| *variance > most * usual);
    let (first, last) = (out().next()?.0, out().next_back()?.0);
    let worst = out().map(|(_, variance)| *variance).fold(0.0, f64::max);
    Some(RestMotion::Passing { samples: first..last + length, times: (worst / usual).sqrt() })
}

fn variance(piece: &[f64]) -> f64 {
    let mean = piece.iter().sum::<f64>() / piece.len() as f64;
    piece.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (piece.len() - 1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use kalmems_core::Portable;
    use std::f64::consts::TAU;

    fn motions(stretches: &[&[f64]]) -> Vec<RestMotion> {
        let longest = stretches.iter().max_by_key(|stretch| stretch.len());
        super::motions(stretches, longest.and_then(|longest| RestSpectrum::of(longest)).as_ref())
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
            let alarms = (0..300).filter(|seed| !motions(&[&noise(*seed, samples, walk)]).is_empty()).count();
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
        let found = motions(&[&values]);
        let Some(RestMotion::Passing { samples, times }) = found.first() else { panic!("{found:?}") };
        assert!((2900..3100).contains(&samples.start) && (3100..3400).contains(&samples.end), "{samples:?}");
        assert!((2.5..4.5).contains(times), "{times}");
    }

    #[test]
    fn a_shake_in_a_short_record_is_found() {
        let mut values = noise(1, 700, 0.0);
        for (i, value) in values.iter_mut().enumerate().skip(300).take(60) {
            *value += 5.0 * (TAU * 0.07 * i as f64).sin();
        }
        let found = motions(&[&values]);
        assert!(matches!(found.first(), Some(RestMotion::Passing { .. })), "{found:?}");
    }

    #[test]
    fn a_vibration_below_the_noise_is_a_line() {
        let mut values = noise(1, 65_536, 1e-3);
        for (i, value) in values.iter_mut().enumerate() {
            *value += 0.2 * (TAU * 0.123 * i as f64).sin();
        }
        let found = motions(&[&values]);
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
        assert_eq!(motions(&[&noise(1, 40, 0.0)]), []);
        assert_eq!(motions(&[]), []);
    }
}
