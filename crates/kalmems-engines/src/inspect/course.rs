//! How a channel goes on from sample to sample, and how its frequency changes over a segment.

use super::spectrum;

/// What of a channel's course its other figures do not show.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChannelCourse {
    /// The mean square of the difference between samples that follow each other, relative to twice the variance: 1 of white noise, and much
    /// smaller of a motion that is sampled often (J. von Neumann, Ann. Math. Statist. 12 (1941) 367).
    pub(super) roughness: Option<f64>,
    /// The frequencies of the strongest line at the beginning and at the end of the longest segment, where it goes from one to the other.
    pub(super) swept: Option<(f64, f64)>,
}

/// Differences of samples that follow each other.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SuccessiveDifferences {
    squares: f64,
    count: usize,
}

impl SuccessiveDifferences {
    /// Adds samples of a segment. Of the difference between two parts of a segment nothing is known, which is one of many.
    pub(super) fn add(&mut self, values: &[f64]) {
        for pair in values.windows(2) {
            let square = (pair[1] - pair[0]).powi(2);
            if square.is_finite() {
                self.squares += square;
                self.count += 1;
            }
        }
    }

    /// Relative to twice this variance.
    pub(super) fn roughness(&self, standard_deviation: f64) -> Option<f64> {
        let relative = self.squares / self.count as f64 / (2.0 * standard_deviation.powi(2));
        relative.is_finite().then_some(relative)
    }
}

/// Into so many parts a segment is cut, to see how its frequency changes.
const PARTS: usize = 8;

/// A frequency that changes by less than this factor is one: a resonance that depends on the amplitude changes by a few per cent while it decays.
const CHANGES: f64 = 1.1;

/// The strongest line of each part of a segment; none of a part that has none, or is too short for a spectrum.
pub(super) fn part_frequencies(values: &[f64], rate: f64) -> Vec<Option<f64>> {
    values.chunks_exact((values.len() / PARTS).max(1)).map(|part| frequency(part, rate)).collect()
}

/// The frequency of the strongest line.
pub(super) fn frequency(values: &[f64], rate: f64) -> Option<f64> {
    let lines = spectrum::spectrum(values, rate, "")?.lines;
    lines.first().map(|line| line.frequency)
}

/// The first and the last frequency of parts, where most have one and it goes one way, by more than a bit.
pub(super) fn sweep(parts: &[Option<f64>]) -> Option<(f64, f64)> {
    let known: Vec<f64> = parts.iter().copied().flatten().collect();
    let (first, last) = (*known.first()?, *known.last()?);
    let enough = known.len() >= 4 && 2 * known.len() > parts.len();
    let ratio = if last > first { last / first } else { first / last };
    let way = (last - first).signum();
    let against = known.windows(2).filter(|pair| (pair[1] - pair[0]) * way < 0.0).count();
    (enough && ratio > CHANGES && 5 * against <= known.len()).then_some((first, last))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_chirp_is_a_sweep_and_a_sine_with_noise_is_none() {
        let chirp: Vec<f64> = (0..8000_u32)
            .map(|k| f64::from(k) / 1e4)
            .map(|t| (TAU * (500.0 * t + 0.5 * 1000.0 * t * t)).sin())
            .collect();
        let (first, last) = sweep(&part_frequencies(&chirp, 1e4)).unwrap();
        // The middle of the first and of the last tenth of a second, each within the band that it passes.
        assert!((first - 550.0).abs() < 60.0 && (last - 1250.0).abs() < 60.0, "{first} {last}");
        let sine: Vec<f64> = (0..8000_u32)
            .map(|k| (TAU * 0.1 * f64::from(k)).sin() + 0.1 * (f64::from(k * 7919 % 1000) / 500.0 - 1.0))
            .collect();
        assert_eq!(sweep(&part_frequencies(&sine, 1e4)), None);
        assert_eq!(sweep(&part_frequencies(&vec![0.0; 8000], 1e4)), None);
    }

    #[test]
    fn roughness_is_one_of_white_noise_and_small_of_a_motion() {
        // SplitMix64 without its state: numbers without order.
        let white = |k: u64| {
            let mut z = k.wrapping_mul(0x9E37_79B9_7F4A_7C15);
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            ((z ^ (z >> 27)) >> 40) as f64 / f64::from(1_u32 << 24)
        };
        let of = |values: &[f64]| {
            let mut differences = SuccessiveDifferences::default();
            differences.add(values);
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (values.len() - 1) as f64;
            differences.roughness(variance.sqrt()).unwrap()
        };
        let noise: Vec<f64> = (0..4000).map(white).collect();
        assert!((of(&noise) - 1.0).abs() < 0.1, "{}", of(&noise));
        // A sine of n samples a cycle has 1 − cos(2π/n).
        let sine: Vec<f64> = (0..4000_u32).map(|k| (TAU * f64::from(k) / 40.0).sin()).collect();
        assert!((of(&sine) / (1.0 - (TAU / 40.0).cos()) - 1.0).abs() < 0.01, "{}", of(&sine));
        assert_eq!(SuccessiveDifferences::default().roughness(1.0), None);
    }
}
