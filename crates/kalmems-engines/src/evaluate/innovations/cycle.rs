//! Innovations folded over the cycle of a motion: what repeats with it is no noise.

use super::evidence::CycleEvidence;
use super::spectrum::{InnovationSpectrum, SpectralLevel};
use super::{InnovationMoments, InnovationTest, TestPlace, TestResult};
use kalmems_core::Portable;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::f64::consts::TAU;

/// Parts of a cycle; the eighth harmonic has eight of them in each of its own.
const BINS: usize = 64;

/// Of them those that are looked at together.
const SECTOR: usize = 8;

/// The highest harmonic that is looked at.
const HARMONICS: usize = 8;

/// Fewer innovations say nothing of what repeats.
const FEWEST: f64 = 500.0;

/// Sums over a part of a motion's cycle.
#[derive(Clone, Copy, Debug, Default)]
struct Bin {
    count: f64,
    sum: f64,
    squares: f64,
}

/// Innovations over the cycle of a motion.
#[derive(Clone, Debug)]
pub struct InnovationCycle {
    frequency_hz: f64,
    start_s: f64,
    bins: [Bin; BINS],
}

/// What one harmonic shows.
struct Harmonic {
    number: usize,
    /// The amplitude in standard deviations.
    amplitude: f64,
    /// How probable one as large is by chance.
    chance: f64,
}

impl InnovationCycle {
    /// Of a motion of this frequency in Hz, whose phase counts from this time in s.
    pub fn new(frequency_hz: f64, start_s: f64) -> Self {
        Self { frequency_hz, start_s, bins: [Bin::default(); BINS] }
    }

    /// What they look like, part by part.
    pub fn evidence(&self) -> CycleEvidence {
        let parts = self.bins.iter().enumerate().filter(|(_, bin)| bin.count > 0.0).map(|(i, bin)| {
            let phase_deg = 360.0 * (i as f64 + 0.5) / BINS as f64;
            [phase_deg, bin.count, bin.sum / bin.count, bin.squares / bin.count]
        });
        CycleEvidence { frequency_hz: self.frequency_hz, parts: parts.collect() }
    }

    /// Takes an innovation in.
    #[inline]
    pub fn take(&mut self, time_s: f64, z: f64) {
        // No sample is before the start; of a count of parts of cycles the rest is the part.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let part = ((time_s - self.start_s) * self.frequency_hz * BINS as f64) as u64;
        #[allow(clippy::cast_possible_truncation)] // below 64
        let bin = &mut self.bins[(part % BINS as u64) as usize];
        bin.count += 1.0;
        bin.sum += z;
        bin.squares += z * z;
    }

    /// Whether the innovations have the motion or its harmonics in them. Each |Σ z·e^{−2πikφ}|²/n is exponential, and is held
    /// against the spectrum around it; the harmonics in one are Fisher's sum of logarithms.
    pub fn harmonics(
        &self,
        moments: &InnovationMoments,
        spectrum: &InnovationSpectrum,
        interval_s: f64,
    ) -> Option<TestResult> {
        let mean = moments.mean();
        let all = self.each(interval_s, spectrum.resolution(), |k, place| {
            let power = self.power(k, |bin| bin.sum - mean * bin.count);
            let around = spectrum.around(place)?;
            // A careful filter's spectrum is not flat; what counts is what is above its claim.
            let around = if moments.are_careful() {
                SpectralLevel { mean: around.mean.max(1.0), ..around }
            } else {
                around
            };
            // A ratio of an exponential number to the mean of others.
            let chance = (1.0 + power / around.mean / around.count).portable_powf(-around.count);
            Some((2.0 * (power / moments.count).sqrt(), chance))
        });
        self.together(InnovationTest::Harmonics, moments, &all)
    }

    /// Whether the variance changes over the cycle: the same of z² less its mean, by the variance of z² as it was measured and
    /// `inflation` for squares that are correlated.
    pub fn variance(
        &self,
        moments: &InnovationMoments,
        inflation: f64,
        resolution: f64,
        interval_s: f64,
    ) -> Option<TestResult> {
        let (mean, variance) = (moments.mean_square(), moments.variance_of_squares() * inflation);
        let all = self.each(interval_s, resolution, |k, _| {
            let power = self.power(k, |bin| bin.squares - mean * bin.count);
            Some((2.0 * (power / moments.count).sqrt() / mean, (-power / variance).portable_exp()))
        });
        self.together(InnovationTest::Phase, moments, &all)
    }

    /// Whether the variance is larger than claimed in some part of the cycle: of a careful filter, whose claim may be too large by a
    /// factor that changes.
    pub fn excess(&self, moments: &InnovationMoments) -> Option<TestResult> {
        if moments.count < FEWEST {
            return None;
        }
        let sectors = self.bins.chunks(SECTOR).map(|bins| {
            let add = |(count, squares), bin: &Bin| (count + bin.count, squares + bin.squares);
            bins.iter().fold((0.0, 0.0), add)
        });
        let chance = |(count, squares)| ChiSquared::new(count).map_or(1.0, |chi| chi.sf(squares));
        let judged = sectors.enumerate().map(|(i, sector)| (chance(sector), i, sector.1 / sector.0));
        let (chance, sector, size) = judged.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let p_value = ((BINS / SECTOR) as f64 * chance).min(1.0);
        let middle = (sector * SECTOR + SECTOR / 2) as f64 / BINS as f64;
        let place = TestPlace::Phase { degrees: 360.0 * middle, of_hz: self.frequency_hz };
        Some(TestResult {
            test: InnovationTest::Phase,
            p_value,
            size: size - 1.0,
            place: Some(place),
            signal: None,
        })
    }

    /// Each harmonic that is seen by itself: at these samples a harmonic near zero, half the sampling rate or another harmonic
    /// is none of its own.
    fn each(
        &self,
        interval_s: f64,
        resolution: f64,
        mut of: impl FnMut(usize, f64) -> Option<(f64, f64)>,
    ) -> Vec<Harmonic> {
        let mut places: Vec<f64> = vec![0.0, 0.5];
        let mut all = Vec::new();
        for number in 1..=HARMONICS {
            let turns = number as f64 * self.frequency_hz * interval_s;
            let place = (turns - turns.round()).abs();
            if places.iter().any(|other| (place - other).abs() < 4.0 * resolution) {
                continue;
            }
            places.push(place);
            if let Some((amplitude, chance)) = of(number, place) {
                all.push(Harmonic { number, amplitude, chance });
            }
        }
        all
    }

    /// |Σ|²/n at a harmonic.
    fn power(&self, harmonic: usize, sum: impl Fn(&Bin) -> f64) -> f64 {
        let (mut re, mut im, mut count) = (0.0, 0.0, 0.0);
        for (b, bin) in self.bins.iter().enumerate() {
            let (sin, cos) = (TAU * (harmonic * b) as f64 / BINS as f64).portable_sin_cos();
            re += sum(bin) * cos;
            im += sum(bin) * sin;
            count += bin.count;
        }
        (re * re + im * im) / count
    }

    fn together(
        &self,
        test: InnovationTest,
        moments: &InnovationMoments,
        all: &[Harmonic],
    ) -> Option<TestResult> {
        if moments.count < FEWEST {
            return None;
        }
        let worst = all.iter().min_by(|a, b| a.chance.total_cmp(&b.chance))?;
        let statistic: f64 = all.iter().map(|h| -2.0 * h.chance.max(f64::MIN_POSITIVE).portable_ln()).sum();
        let p_value = ChiSquared::new(2.0 * all.len() as f64).ok()?.sf(statistic);
        let place = TestPlace::Harmonic { number: worst.number, of_hz: self.frequency_hz };
        Some(TestResult { test, p_value, size: worst.amplitude, place: Some(place), signal: None })
    }
}
