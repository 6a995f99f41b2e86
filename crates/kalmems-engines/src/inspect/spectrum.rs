//! The main spectral lines of a channel.
//!
//! The window is the four-term one of Blackman and Harris, whose side lobes are 92 dB down: a strong line hides no
//! weak one beside it. The frequency between two bins follows from the two neighbours of the highest bin, and the
//! amplitude from the known shape of the window, so that neither depends on where in a bin a tone falls.
//! F. J. Harris, "On the use of windows for harmonic analysis with the discrete Fourier transform",
//! Proc. IEEE 66 (1978) 51.

use crate::signal::{PortableComplex, fourier_transform};
use kalmems_core::Portable;
use serde::Serialize;
use std::f64::consts::{PI, TAU};

/// The window, in words.
pub const WINDOW: &str = "Blackman-Harris, 4 terms, side lobes 92 dB down";

/// The terms of the window.
const TERMS: [f64; 4] = [0.35875, 0.48829, 0.14128, 0.01168];

/// Half the width of the window's main lobe, in bins: two lines must be further apart.
const HALF_LOBE: usize = 4;

/// The first bin in which a line is looked for; below it a line cannot be told from a drift.
const FIRST_BIN: usize = 3;

/// A spectrum of fewer rows says little.
const SHORTEST: usize = 64;

/// The most lines that are kept.
pub const MOST_LINES: usize = 5;

/// How far above the median of all bins a line must be, as a ratio of amplitudes: 20 dB. The highest of a million
/// bins of white noise is 13 dB above it.
const ABOVE_FLOOR: f64 = 10.0;

/// How far below the strongest line one may be: 80 dB, which keeps the side lobes of the window out.
const BELOW_STRONGEST: f64 = 1e-4;

/// A line.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SignalLine {
    /// Its frequency, in Hz or in cycles per sample.
    pub frequency: f64,
    /// Its amplitude (half of peak to peak), in SI.
    pub amplitude: f64,
}

/// The lines of a segment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SegmentLines {
    /// The label of the segment.
    pub segment: String,
    /// The distance between two bins: one cycle over the whole segment, or over a stretch of it where it is long.
    pub resolution: f64,
    /// The median amplitude of all bins, in SI.
    pub floor: f64,
    /// The strongest lines that stand out of the floor, the strongest first.
    pub lines: Vec<SignalLine>,
}

/// The spectrum of evenly spaced numbers, `rate` of them per unit of time; `None` where they are too few or not
/// finite.
pub(super) fn spectrum(values: &[f64], rate: f64, segment: &str) -> Option<SegmentLines> {
    of_bins(&magnitudes(values)?.0, values.len(), rate, segment)
}

/// The mean power of stretches of one length that follow each other, for segments too long for one transform
/// (P. D. Welch, IEEE Trans. Audio Electroacoust. 15 (1967) 70, without overlap).
#[derive(Default)]
pub(super) struct Periodogram {
    power: Vec<f64>,
    stretches: usize,
    length: usize,
}

impl Periodogram {
    /// Adds a stretch; one of another length than the first, or with what is no number, is left out.
    pub(super) fn add(&mut self, values: &[f64]) {
        if self.stretches > 0 && values.len() != self.length {
            return;
        }
        let Some((bins, _)) = magnitudes(values) else { return };
        self.length = values.len();
        self.power.resize(bins.len(), 0.0);
        self.power.iter_mut().zip(bins).for_each(|(power, bin)| *power += bin * bin);
        self.stretches += 1;
    }

    pub(super) fn spectrum(&self, rate: f64, segment: &str) -> Option<SegmentLines> {
        let bins: Vec<f64> = self.power.iter().map(|power| (power / self.stretches as f64).sqrt()).collect();
        of_bins(&bins, self.length, rate, segment)
    }
}

fn of_bins(bins: &[f64], length: usize, rate: f64, segment: &str) -> Option<SegmentLines> {
    let length = length as f64;
    let floor = median(bins)?;
    let strongest = bins.iter().skip(FIRST_BIN).copied().fold(0.0, f64::max);
    let least = (ABOVE_FLOOR * floor).max(BELOW_STRONGEST * strongest);
    let last = bins.len().saturating_sub(FIRST_BIN);
    let mut lines: Vec<SignalLine> = (FIRST_BIN..last)
        .filter(|bin| is_peak(bins, *bin, least))
        .filter_map(|bin| {
            let [before, here, after] = *bins.get(bin - 1..=bin + 1)? else { return None };
            let offset = offset(before, after);
            Some(SignalLine {
                frequency: (bin as f64 + offset) * rate / length,
                amplitude: 2.0 * here / (length * lobe(offset)),
            })
        })
        .collect();
    lines.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
    lines.truncate(MOST_LINES);
    Some(SegmentLines {
        segment: segment.to_owned(),
        resolution: rate / length,
        floor: 2.0 * floor / (length * lobe(0.0)),
        lines,
    })
}

/// The magnitudes of the transform of the windowed values without their mean, and the amplitude of a tone in the middle of a
/// bin by its magnitude.
pub fn magnitudes(values: &[f64]) -> Option<(Vec<f64>, f64)> {
    if values.len() < SHORTEST || !values.iter().all(|v| v.is_finite()) {
        return None;
    }
    let window = |i: usize| {
        let angle = TAU * i as f64 / values.len() as f64;
        TERMS[0] - TERMS[1] * angle.portable_cos() + TERMS[2] * (2.0 * angle).portable_cos()
            - TERMS[3] * (3.0 * angle).portable_cos()
    };
    let weights: Vec<f64> = (0..values.len()).map(window).collect();
    // With the mean under the window no offset is left that could leak into the first bins.
    let mean = values.iter().zip(&weights).map(|(v, w)| v * w).sum::<f64>() / weights.iter().sum::<f64>();
    let mut windowed: Vec<f64> = values.iter().zip(&weights).map(|(v, w)| (v - mean) * w).collect();
    let magnitudes = fourier_transform(&mut windowed).iter().map(|line| line.portable_norm()).collect();
    Some((magnitudes, 2.0 / (values.len() as f64 * lobe(0.0))))
}

fn median(bins: &[f64]) -> Option<f64> {
    // The mean was taken out of the first bin.
    let mut sorted = bins.get(1..).filter(|rest| !rest.is_empty())?.to_vec();
    let middle = sorted.len() / 2;
    Some(*sorted.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Whether a bin is the highest within the width of a lobe, and high enough.
fn is_peak(bins: &[f64], bin: usize, least: f64) -> bool {
    let end = bins.len().min(bin + HALF_LOBE + 1);
    let around = bins.get(bin.saturating_sub(HALF_LOBE)..end).unwrap_or_default();
    bins.get(bin).is_some_and(|here| *here > least && around.iter().all(|other| other <= here))
}

/// The transform of the window at a distance from its centre in bins, per row.
fn lobe(distance: f64) -> f64 {
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).portable_sin() / (PI * x) };
    let mut sum = TERMS[0] * sinc(distance);
    for (order, term) in [1.0, 2.0, 3.0].into_iter().zip(&TERMS[1..]) {
        sum += term / 2.0 * (sinc(distance - order) + sinc(distance + order));
    }
    sum
}

/// Where between −½ and ½ bin a tone is, from the bins before and after the highest one.
fn offset(before: f64, after: f64) -> f64 {
    let (mut low, mut high) = (-0.5, 0.5);
    // The ratio of both grows with the offset; 40 halvings leave 1e-12 of a bin.
    for _ in 0..40 {
        let middle = f64::midpoint(low, high);
        if lobe(1.0 - middle) * before < lobe(1.0 + middle) * after {
            low = middle;
        } else {
            high = middle;
        }
    }
    f64::midpoint(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Evenly distributed noise of a small linear congruential generator, variance 1.
    fn noise(count: usize, seed: u64) -> impl Iterator<Item = f64> {
        let mut state = seed;
        (0..count).map(move |_| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 12_f64.sqrt()
        })
    }

    fn tones(count: usize, tones: &[(f64, f64)], sigma: f64, seed: u64) -> Vec<f64> {
        noise(count, seed)
            .enumerate()
            .map(|(i, noise)| {
                let tone = |(bin, amplitude): &(f64, f64)| {
                    amplitude * (TAU * bin * i as f64 / count as f64 + 0.3 * bin).cos()
                };
                0.7 + tones.iter().map(tone).sum::<f64>() + sigma * noise
            })
            .collect()
    }

    proptest! {
        #[test]
        fn tones_between_bins_in_noise(
            a in 10.0..3000.0_f64, gap in 10.0..6000.0_f64, strong in 0.5..2.0_f64, seed: u64, odd in 0..2_usize,
        ) {
            let given = [(a, strong), (a + gap, 0.1)];
            let count = 20_000 + odd;
            // Noise that moves the amplitude of the weaker tone by 0.07 %, so that 1 % is no matter of chance.
            let values = tones(count, &given, 0.005, seed);
            let found = spectrum(&values, count as f64, "").unwrap();
            prop_assert_eq!(found.lines.len(), 2, "{:?}", found);
            for (line, (bin, amplitude)) in found.lines.iter().zip(given) {
                prop_assert!((line.frequency - bin).abs() < 0.02, "{} for {bin}", line.frequency);
                prop_assert!((line.amplitude / amplitude - 1.0).abs() < 0.01, "{} for {amplitude}", line.amplitude);
            }
        }

        #[test]
        fn noise_has_no_lines(seed: u64) {
            let values = tones(50_000, &[], 1.0, seed);
            prop_assert_eq!(spectrum(&values, 1.0, "").unwrap().lines, []);
        }
    }

    #[test]
    fn a_pure_tone_has_no_side_lines() {
        for bin in [4.1, 6.26, 100.5, 731.27, 1990.0] {
            let found = spectrum(&tones(4001, &[(bin, 1.0)], 0.0, 0), 4001.0, "").unwrap();
            assert_eq!(found.lines.len(), 1, "{bin}: {found:?}");
            assert!((found.lines[0].frequency - bin).abs() < 0.02, "{bin}: {found:?}");
            assert!((found.lines[0].amplitude - 1.0).abs() < 0.01, "{bin}: {found:?}");
        }
    }

    #[test]
    fn the_floor_is_that_of_white_noise() {
        // The magnitude of a bin is Rayleigh distributed; its median is sqrt(ln 4) times the deviation of a part,
        // and a part has the variance σ²/2 Σw².
        let count = 20_000;
        let found = spectrum(&tones(count, &[], 1.0, 7), 1.0, "").unwrap();
        let squares = TERMS[0].powi(2) + TERMS[1..].iter().map(|t| t * t / 2.0).sum::<f64>();
        let expected = 4_f64.ln().sqrt() * (squares / 2.0 / count as f64).sqrt() * 2.0 / TERMS[0];
        approx::assert_relative_eq!(found.floor, expected, max_relative = 0.03);
    }

    /// In stretches the lines are where they are in the whole, and the floor of noise is steadier.
    #[test]
    fn stretches_have_the_lines_of_the_whole() {
        let values = tones(200_000, &[(20_000.3, 1.0)], 0.1, 3);
        let mut mean = Periodogram::default();
        values.chunks(20_000).for_each(|part| mean.add(part));
        let (whole, mean) = (spectrum(&values, 1.0, "").unwrap(), mean.spectrum(1.0, "").unwrap());
        assert_eq!((whole.lines.len(), mean.lines.len()), (1, 1));
        assert!((mean.lines[0].frequency - whole.lines[0].frequency).abs() < 0.02 * mean.resolution);
        assert!((mean.lines[0].amplitude - 1.0).abs() < 0.01, "{mean:?}");
        assert_eq!(mean.resolution, 1.0 / 20_000.0);
    }

    #[test]
    fn a_drift_and_a_constant_have_no_lines() {
        let ramp: Vec<f64> = (0..1000).map(f64::from).collect();
        assert_eq!(spectrum(&ramp, 1.0, "").unwrap().lines, []);
        assert_eq!(spectrum(&[5.0; 1000], 1.0, "").unwrap().lines, []);
        assert_eq!(spectrum(&[5.0; 10], 1.0, ""), None);
        assert_eq!(spectrum(&[f64::NAN; 1000], 1.0, ""), None);
    }
}
