//! Whether a record that is called one at rest shows motion.
//!
//! Two tests, each with a rate of false alarms of at most 1 in 1000 for noise that is white, flickers or wanders:
//!
//! - A motion that comes and goes: the variances about their own means of 16 to 64 pieces of the record, by their median. Of
//!   white noise they are χ² by its degrees of freedom; 30 of these at most are counted on, so that coloured noise is not taken for
//!   motion. A piece stands out from some 2.6 times the median on: a motion as large as 1.3 standard deviations of the noise.
//! - A motion that lasts: the bins of the longest stretch's spectrum, by the median of the bins from 1/1.25 to 1.25 of their
//!   frequency. A line stands out whose power is four times what noise reaches once in 1000 records.
//!
//! What turns the unit at a constant rate throughout cannot be told from its bias, and what swings less than 33 times in the
//! record, as long and as slow as the bias wanders, not from that.

use crate::inspect::spectrum_magnitudes;
use kalmems_core::Portable;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::ops::Range;

/// Pieces that are compared, fewer of a short record, and samples that each has at least.
const PIECES: usize = 64;
const FEWEST_PIECES: usize = 16;
const SHORTEST_PIECE: usize = 16;

/// How often noise alone is called a motion.
const FALSE_ALARMS: f64 = 1e-3;

/// Degrees of freedom that are counted on, as noise that is not white has fewer.
const FREEDOM: f64 = 30.0;

/// Half the width of a band of the spectrum by its middle, the first of these, and samples of one transform at most.
const BAND: f64 = 1.25;
const FIRST_BIN: usize = 33;
const LONGEST: usize = 1 << 20;

/// What noise may exceed its expectation by in power, as it is not flat within a band.
const SLOPE: f64 = 4.0;

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
    Line {
        /// In cycles per sample.
        frequency: f64,
        /// In rad/s.
        amplitude: f64,
    },
}

/// The motions in a record at rest, given as stretches without gaps.
pub(super) fn motions(stretches: &[&[f64]]) -> Vec<RestMotion> {
    let longest = stretches.iter().max_by_key(|stretch| stretch.len());
    let line = longest.and_then(|longest| line(&longest[..longest.len().min(LONGEST)]));
    passing(stretches).into_iter().chain(line).collect()
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

/// The strongest line of those that stand out of their band.
fn line(values: &[f64]) -> Option<RestMotion> {
    let (bins, amplitude_of) = spectrum_magnitudes(values)?;
    let last = bins.len().saturating_sub(3);
    let power = SLOPE * (bins.len() as f64 / FALSE_ALARMS).portable_ln() / std::f64::consts::LN_2;
    let mut strongest: Option<(usize, f64)> = None;
    let mut from = FIRST_BIN;
    while from < last {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive number of bins
        let to = ((from as f64 * BAND * BAND) as usize).min(last);
        let band = bins.get(from..to)?;
        let mut sorted = band.to_vec();
        let middle = sorted.len() / 2;
        let floor = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
        for (i, bin) in band.iter().enumerate() {
            let is_out = *bin > floor * power.sqrt();
            if is_out && strongest.is_none_or(|(_, other)| *bin > other) {
                strongest = Some((from + i, *bin));
            }
        }
        from = to.max(from + 1);
    }
    let (bin, magnitude) = strongest?;
    Some(RestMotion::Line {
        frequency: bin as f64 / values.len() as f64,
        amplitude: amplitude_of * magnitude,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;
    use std::f64::consts::TAU;

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
        let Some(RestMotion::Line { frequency, amplitude }) = found.last() else { panic!("{found:?}") };
        assert!((frequency - 0.123).abs() < 1e-4 && (amplitude / 0.2 - 1.0).abs() < 0.2, "{found:?}");
    }

    #[test]
    fn too_short_a_record_shows_nothing() {
        assert_eq!(motions(&[&noise(1, 40, 0.0)]), []);
        assert_eq!(motions(&[]), []);
    }
}
