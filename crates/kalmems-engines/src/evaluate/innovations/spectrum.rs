//! The spectrum of the innovations, which is flat for a filter that is right.

use super::{InnovationMoments, InnovationTest, TestPlace, TestResult, WRONG};
use crate::signal::fourier_transform_by;
use kalmems_core::Portable;
use realfft::RealFftPlanner;
use statrs::distribution::{ChiSquared, ContinuousCDF, Gamma};
use std::cell::RefCell;

thread_local! {
    /// Remembers the tables of the lengths that were transformed, which take as long as a transform.
    static PLANNER: RefCell<RealFftPlanner<f64>> = RefCell::new(RealFftPlanner::new());
}

/// Innovations that are transformed together; longer recordings have the mean of several spectra.
const BLOCK: usize = 1 << 16;

/// Bands, equally spaced in the logarithm of the frequency, from one cycle in a block to half the sampling rate.
const BANDS: usize = 40;

/// Lags of the test of whiteness.
const LAGS: usize = 20;

/// The probability of what some band has above the claim, where correlation counts.
const ABOVE: f64 = 1e-3;

/// Fewer innovations have no spectrum worth the name.
const FEWEST: usize = 128;

/// Ordinates on each side by which the level around a frequency is told, and those next to it that are left out.
const AROUND: usize = 30;
const NEXT: usize = 2;

/// Innovations on their way to a spectrum. Missing ones are passed over: those that are there are white all the same.
#[derive(Clone, Default)]
pub struct SpectrumRecord {
    block: Vec<f64>,
    full: Option<BlockPeriodograms>,
    products: Products,
}

/// Sums of |Σ z·e^{−2πiνk}|²/n of blocks of one length, from the first frequency above zero to the last below half the sampling
/// rate. Each is exponential with mean 1 of a filter that is right.
#[derive(Clone, Debug)]
struct BlockPeriodograms {
    length: usize,
    blocks: f64,
    sums: Vec<f64>,
}

/// Σ z_k·z_{k−l} for l = 20 … 0, and how many products there were for l = 0 … 20.
#[derive(Clone, Copy, Default)]
struct Products {
    sums: [f64; LAGS + 1],
    pairs: [f64; LAGS + 1],
}

/// The spectrum of all innovations until now.
pub struct InnovationSpectrum {
    /// That of the blocks, and that of what has not become one, as far as they are there.
    parts: Vec<BlockPeriodograms>,
    products: Products,
}

/// The level of a spectrum around a frequency.
#[derive(Clone, Copy, Debug)]
pub struct SpectralLevel {
    /// The mean of the ordinates.
    pub mean: f64,
    /// How many exponential numbers it is the mean of.
    pub count: f64,
}

/// Neighbouring ordinates.
#[derive(Clone, Copy, Debug)]
pub struct OrdinateGroup {
    /// The geometric mean of the first and the last frequency in cycles per sample.
    pub frequency: f64,
    /// The mean of the ordinates.
    pub mean: f64,
    /// The largest of them.
    pub largest: f64,
    /// How many exponential numbers the mean is of.
    pub count: f64,
}

impl SpectrumRecord {
    /// Takes an innovation in.
    #[inline]
    pub fn take(&mut self, z: f64) {
        self.block.push(z);
        if self.block.len() == BLOCK {
            let new = BlockPeriodograms::of(&self.block);
            match &mut self.full {
                Some(full) => full.add(&new),
                none => *none = Some(new),
            }
            self.products.add(&self.block);
            self.block.clear();
        }
    }

    /// What is known until now. `None` of too few innovations.
    pub fn spectrum(&self) -> Option<InnovationSpectrum> {
        let length = smooth_below(self.block.len());
        let rest = (length >= FEWEST).then(|| BlockPeriodograms::of(&self.block[..length]));
        let mut products = self.products;
        products.add(&self.block);
        let parts: Vec<BlockPeriodograms> = self.full.iter().cloned().chain(rest).collect();
        (!parts.is_empty()).then_some(InnovationSpectrum { parts, products })
    }
}

/// The largest number up to this one that has no prime factors but 2, 3 and 5: lengths that are transformed fast.
fn smooth_below(count: usize) -> usize {
    let mut best = 0;
    let mut five = 1;
    while five <= count {
        let mut three = five;
        while three <= count {
            let two = three * (1 << (count / three).ilog2());
            best = best.max(two);
            three *= 3;
        }
        five *= 5;
    }
    best
}

impl BlockPeriodograms {
    fn of(block: &[f64]) -> Self {
        let length = block.len();
        let lines = PLANNER.with_borrow_mut(|planner| fourier_transform_by(planner, &mut block.to_vec()));
        let sums = lines[1..length.div_ceil(2)].iter().map(|line| line.norm_sqr() / length as f64).collect();
        Self { length, blocks: 1.0, sums }
    }

    fn add(&mut self, other: &Self) {
        self.blocks += other.blocks;
        self.sums.iter_mut().zip(&other.sums).for_each(|(sum, other)| *sum += other);
    }

    /// The frequency of an ordinate in cycles per sample.
    fn frequency(&self, i: usize) -> f64 {
        (i + 1) as f64 / self.length as f64
    }
}

impl Products {
    fn add(&mut self, block: &[f64]) {
        let mut before = [0.0; LAGS + 1];
        for (k, z) in block.iter().enumerate() {
            // The newest last, so that a window of the block serves where it has begun long enough ago.
            let window: &[f64; LAGS + 1] = if let Some(window) = block[..=k].last_chunk() {
                window
            } else {
                before.rotate_left(1);
                before[LAGS] = *z;
                &before
            };
            for (sum, other) in self.sums.iter_mut().zip(window) {
                *sum += z * other;
            }
        }
        for (lag, pairs) in self.pairs.iter_mut().enumerate() {
            *pairs += block.len().saturating_sub(lag) as f64;
        }
    }

    /// The correlation of innovations that are so many updates apart.
    fn correlation(&self, lag: usize) -> f64 {
        self.sums[LAGS - lag] / self.sums[LAGS]
    }
}

impl InnovationSpectrum {
    /// The distance of neighbouring frequencies in cycles per sample.
    pub fn resolution(&self) -> f64 {
        1.0 / self.parts[0].length as f64
    }

    /// Σ ρ^power over lags on both sides, and that of lag 0: how much longer a mean takes of numbers so correlated.
    pub fn inflation(&self, power: i32) -> f64 {
        1.0 + 2.0 * (1..=LAGS).map(|lag| self.products.correlation(lag).abs().powi(power)).sum::<f64>()
    }

    /// At most so many groups of neighbouring ordinates, equally spaced in the logarithm of the frequency.
    pub fn groups(&self, most: usize) -> Vec<OrdinateGroup> {
        let Some(part) = self.parts.first() else { return Vec::new() };
        let (mut groups, mut first) = (Vec::new(), 0);
        for group in 1..=most {
            let end = (part.sums.len() as f64).portable_powf(group as f64 / most as f64).round();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // up to half the length
            let end = (end as usize).min(part.sums.len());
            if end <= first {
                continue;
            }
            let sums = &part.sums[first..end];
            let count = part.blocks * sums.len() as f64;
            groups.push(OrdinateGroup {
                frequency: (part.frequency(first) * part.frequency(end - 1)).sqrt(),
                mean: sums.iter().sum::<f64>() / count,
                largest: sums.iter().copied().fold(0.0, f64::max) / part.blocks,
                count,
            });
            first = end;
        }
        groups
    }

    /// The correlation of innovations 1, 2 and so on updates apart, and within which ± 95 of 100 lie where there is none.
    pub fn autocorrelation(&self) -> Vec<[f64; 2]> {
        let lags = 1..=LAGS;
        lags.map(|lag| [self.products.correlation(lag), 1.96 / self.products.pairs[lag].sqrt()]).collect()
    }

    /// The level around a frequency in cycles per sample. `None` where there is too little.
    pub fn around(&self, frequency: f64) -> Option<SpectralLevel> {
        let part = self.parts.first()?;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // up to half the length
        let at = ((frequency * part.length as f64).round() as usize).saturating_sub(1);
        let others = (at.saturating_sub(AROUND)..(at + AROUND + 1).min(part.sums.len()))
            .filter(|i| i.abs_diff(at) > NEXT);
        let (count, sum) =
            others.fold((0.0, 0.0), |(count, sum), i| (count + part.blocks, sum + part.sums[i]));
        (count >= 8.0).then_some(SpectralLevel { mean: sum / count, count })
    }

    /// Whether some band of frequencies has more in it than claimed: the sum of its ordinates follows the law of Gamma.
    pub fn bands(&self, interval_s: f64) -> Option<TestResult> {
        let mut bands = [(0.0, 0.0, f64::INFINITY, 0.0_f64); BANDS];
        let widest = BLOCK as f64 / 2.0;
        for part in &self.parts {
            let mut first = 0;
            for (b, (count, sum, from, to)) in bands.iter_mut().enumerate() {
                let end =
                    widest.portable_powf((b + 1) as f64 / BANDS as f64) / BLOCK as f64 * part.length as f64;
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // up to half the length
                let end = if b + 1 == BANDS { part.sums.len() } else { (end as usize).min(part.sums.len()) };
                if end > first {
                    *count += part.blocks * (end - first) as f64;
                    *sum += part.sums[first..end].iter().sum::<f64>();
                    *from = from.min(part.frequency(first));
                    *to = to.max(part.frequency(end - 1));
                    first = end;
                }
            }
        }
        let used = bands.iter().filter(|(count, ..)| *count > 0.0);
        let looks = used.clone().count() as f64;
        let judged = used.filter_map(|&(count, sum, from, to)| {
            Some((Gamma::new(count, 1.0).ok()?.sf(sum), sum / count, from, to))
        });
        let (chance, size, from, to) = judged.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let place = TestPlace::Band { from_hz: from / interval_s, to_hz: to / interval_s };
        Some(TestResult {
            test: InnovationTest::Bands,
            p_value: (looks * chance).min(1.0),
            size,
            place: Some(place),
            signal: None,
        })
    }

    /// Whether one frequency stands out: the largest ordinate, beside what it is one of so many. Noise that is larger than claimed
    /// is no line.
    pub fn line(&self, moments: &InnovationMoments, interval_s: f64) -> Option<TestResult> {
        let level = moments.mean_square().max(1.0);
        let looks: usize = self.parts.iter().map(|part| part.sums.len()).sum();
        let largest = self.parts.iter().filter_map(|part| {
            let (i, sum) = part.sums.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
            let chance = Gamma::new(part.blocks, 1.0).ok()?.sf(sum / level);
            let amplitude = 2.0 * (sum / part.blocks / part.length as f64).sqrt();
            Some((chance, amplitude, part.frequency(i)))
        });
        let (chance, size, frequency) = largest.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let place = TestPlace::Frequency { hz: frequency / interval_s };
        let p_value = (looks as f64 * chance).min(1.0);
        Some(TestResult { test: InnovationTest::Line, p_value, size, place: Some(place), signal: None })
    }

    /// Whether an innovation tells of the next: the statistic of Ljung and Box over 20 lags (Biometrika 65, 297, 1978).
    ///
    /// A process noise that is a little larger than the true one leaves correlation as well, long before the mean NIS shows it, and
    /// is right: its spectrum lies nowhere above the claim. So some band has to be above it for this to count, with a probability of
    /// less than a thousandth.
    pub fn whiteness(&self, interval_s: f64) -> Option<TestResult> {
        let n = self.products.pairs[0];
        if n < FEWEST as f64 {
            return None;
        }
        let term = |lag: usize| self.products.correlation(lag).powi(2) / self.products.pairs[lag];
        let statistic = n * (n + 2.0) * (1..=LAGS).map(term).sum::<f64>();
        let above = self.bands(interval_s)?.p_value;
        let p_value = ChiSquared::new(LAGS as f64).ok()?.sf(statistic).max(WRONG / ABOVE * above);
        let largest = (1..=LAGS).max_by(|a, b| term(*a).total_cmp(&term(*b)))?;
        let (test, size) = (InnovationTest::Whiteness, self.products.correlation(largest));
        Some(TestResult {
            test,
            p_value,
            size,
            place: Some(TestPlace::Lag { updates: largest }),
            signal: None,
        })
    }
}
