//! When a crossing was, where no zero of the smoothed signal tells it.
//!
//! The steepest slope of the signal is near a crossing and not at it, and in noise it may be anywhere. What is told in its place
//! is the mean of the crossing's time given what was recorded, with the variance of that:
//!
//! - Of a slope that noise does not reach, the time of the vertex less the bias that the model's line has there, with the variance by
//!   which noise moves it. The direction of the motion is not known, nor exactly its rate: mean and variance are those of both
//!   directions, over the rate's own uncertainty.
//! - Of any other slope, the mean and the variance of the posterior distribution of the time over the half cycle around it, by the
//!   likelihood of the samples under the model's line, for motions of all rates and both directions. Where several maxima are near
//!   each other in height, their distance is in the variance.

use super::kernel::{CrossingKernel, KernelWindow};
use super::line::CrossingWaveform;
use kalmems_core::Scalar;
use kalmems_core::detect::Peak;
use std::sync::Arc;

/// A response, in standard deviations of that to noise, that noise does not reach in a year, nor beside a crossing that is there.
pub const LOUD: f64 = 8.0;

/// The chance that noise alone has a slope as steep as this one between two crossings, above which its zero is not told.
///
/// The slope of a weak signal is seen where noise makes it steep, and a zero there claims the small standard deviation of a steep
/// slope, and may be one of the noise.
const CHANCE: f64 = 1e-5;

/// A crossing in samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CrossingPlace {
    /// Its time after the sample of the steepest slope.
    pub displacement: f64,
    /// The variance of that in samples².
    pub variance: f64,
    /// How much the signal rises there per sample, in V.
    pub slope: f64,
}

/// What stands in where the smoothed signal has no zero that could be told.
pub struct Fallback {
    line: Arc<dyn CrossingWaveform>,
    window: KernelWindow,
    /// From one time of a crossing to the next whose likelihoods are compared, in samples.
    step: usize,
    noise_variance: f64,
    /// The standard deviation of the response to noise.
    deviation: f64,
    /// The half of the time between two crossings, in samples.
    half_pass: usize,
    /// Lines of motions at all rates and in both directions, once they are asked for.
    lines: Option<ResponseLines>,
}

/// A motion that passes the threshold in one direction and the other: +1 and −1.
const DIRECTIONS: [f64; 2] = [1.0, -1.0];

/// Gauss and Hermite's three nodes in standard deviations, with their weights: of a normal distribution, exact to the fifth power.
const NODES: [(f64, f64); 3] =
    [(-1.732_050_807_568_877_2, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.732_050_807_568_877_2, 1.0 / 6.0)];

/// How often the rate is corrected by the response that it would give. Each time leaves a part of the difference that the width of
/// the kernel over that of the edge makes.
const CORRECTIONS: usize = 6;

impl Fallback {
    /// For a kernel of this width in samples, a signal with this noise per sample in V², this deviation of the response to it, and this interval in s.
    pub fn new(
        line: Arc<dyn CrossingWaveform>,
        (window, width): (KernelWindow, f64),
        (noise_variance, deviation, interval_s): (f64, f64, f64),
    ) -> Self {
        let pass = 1.0 / (line.passes_hz() * interval_s);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and clamped
        let half_pass = (0.5 * pass).clamp(1.0, 8.0 * window.look_ahead() as f64) as usize;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and clamped
        let step = (width / 3.0).clamp(1.0, (half_pass as f64 / 16.0).max(1.0)) as usize;
        Self { line, window, step, noise_variance, deviation, half_pass, lines: None }
    }

    /// Whether a response is so large that noise makes none as large between two crossings but with a chance of [`CHANCE`].
    pub fn is_clear(&self, kernel: &dyn CrossingKernel, height: f64) -> bool {
        let per_sample = kernel.detections(height / self.deviation, self.window.reach);
        // Without noise the height is infinitely many deviations, or not a number.
        self.deviation == 0.0 || per_sample * 2.0 * (self.half_pass as f64) < CHANCE
    }

    /// The standard deviation in samples of a time of which nothing is known but that it is the nearest crossing.
    pub fn unknown(&self) -> f64 {
        self.half_pass as f64 / 3.0_f64.sqrt()
    }

    /// The crossing at a maximum of the response; `near` are the samples around it that follow each other, `centre` its own place
    /// among them.
    pub fn place(
        &mut self,
        kernel: &dyn CrossingKernel,
        peak: &Peak<f64>,
        near: &[f64],
        centre: usize,
    ) -> CrossingPlace {
        let by_vertex = || self.by_vertex(kernel, peak);
        let found = if peak.height > LOUD * self.deviation {
            by_vertex()
        } else {
            self.by_likelihood(kernel, near, centre)
        };
        found.unwrap_or(CrossingPlace {
            displacement: peak.fraction,
            variance: self.unknown() * self.unknown(),
            slope: peak.height,
        })
    }

    /// By the vertex, less its bias.
    fn by_vertex(&self, kernel: &dyn CrossingKernel, peak: &Peak<f64>) -> Option<CrossingPlace> {
        let mut sum = WeightedMoments::default();
        for (deviations, weight) in NODES {
            let height = peak.height + deviations * self.deviation;
            for direction in DIRECTIONS {
                let (rate, vertex) = self.vertex(kernel, direction, height)?;
                let jitter = kernel.timing_variance(self.noise_variance, vertex.curvature);
                sum.add(0.5 * weight, peak.fraction - vertex.displacement, jitter, self.line.slope(rate));
            }
        }
        sum.place()
    }

    /// The rate at which the line's largest response is this one, and where that is after the crossing.
    fn vertex(&self, kernel: &dyn CrossingKernel, direction: f64, height: f64) -> Option<(f64, Vertex)> {
        let mut rate = self.line.rate(height);
        let mut vertex = Vertex::of(kernel, &*self.line, self.window, direction * rate)?;
        for _ in 0..CORRECTIONS {
            rate *= (height / vertex.height).abs().sqrt();
            vertex = Vertex::of(kernel, &*self.line, self.window, direction * rate)?;
        }
        rate.is_finite().then_some((rate, vertex))
    }

    /// By the likelihood of the samples, whatever their mean is.
    ///
    /// For a line s and an offset of which nothing is known, ln p = (Σs·y − ½·Σ(s − s̄)²)/σ² with Σy = 0, but for what is the same for
    /// every line.
    fn by_likelihood(
        &mut self,
        kernel: &dyn CrossingKernel,
        near: &[f64],
        centre: usize,
    ) -> Option<CrossingPlace> {
        let reach = self.window.look_ahead();
        let first = centre.saturating_sub(reach);
        let samples = near.get(first..near.len().min(centre + reach + 1))?;
        let before = centre - first;
        let known: Vec<(f64, f64)> = known(samples)?;
        let count: f64 = known.iter().map(|(is_known, _)| is_known).sum();
        let lines = match self.lines.take() {
            Some(lines) => lines,
            None => self.lines_of(kernel),
        };
        let mut likelihoods = Vec::new();
        for volts in lines.volts.chunks_exact(lines.length) {
            for lag in self.lags() {
                // The crossing is `lag` after the steepest slope, both counted from half a pass before it.
                let from = reach + 2 * self.half_pass - lag - before;
                let line = volts.get(from..from + known.len())?;
                let (mut product, mut sum, mut square) = (0.0, 0.0, 0.0);
                for (s, (is_known, y)) in line.iter().zip(&known) {
                    product += s * y;
                    sum += s * is_known;
                    square += s * s * is_known;
                }
                likelihoods.push((product - 0.5 * (square - sum * sum / count)) / self.noise_variance);
            }
        }
        let largest = likelihoods.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let rounding = (self.step * self.step) as f64 / 12.0;
        let mut sum = WeightedMoments::default();
        for (of_line, rate) in likelihoods.chunks(self.lags().count()).zip(&lines.rates) {
            let slope = self.line.slope(*rate);
            for (likelihood, lag) in of_line.iter().zip(self.lags()) {
                sum.add(
                    Scalar::exp(likelihood - largest),
                    lag as f64 - self.half_pass as f64,
                    rounding,
                    slope,
                );
            }
        }
        self.lines = Some(lines);
        sum.place()
    }

    /// The times of a crossing, counted from half a pass before the steepest slope.
    fn lags(&self) -> impl Iterator<Item = usize> + use<> {
        (0..=2 * self.half_pass).step_by(self.step)
    }

    fn lines_of(&self, kernel: &dyn CrossingKernel) -> ResponseLines {
        let reach = self.window.look_ahead() + self.half_pass;
        let (mut rates, mut volts) = (Vec::new(), Vec::new());
        let mut slope = SLOWEST * self.deviation;
        for _ in 0..MOST {
            let rate = self.line.rate(slope);
            for direction in DIRECTIONS {
                rates.push(rate);
                volts.extend(self.line.samples(direction * rate, reach));
            }
            let height =
                Vertex::of(kernel, &*self.line, self.window, rate).map_or(0.0, |vertex| vertex.height);
            if height > (LOUD + MARGIN) * self.deviation {
                break;
            }
            slope *= RATIO;
        }
        ResponseLines { rates, volts, length: 2 * reach + 1 }
    }
}

/// Whether each sample is known, as one or zero, and how far it is from the mean of those that are; `None` where fewer than four are.
fn known(samples: &[f64]) -> Option<Vec<(f64, f64)>> {
    let finite = || samples.iter().filter(|y| y.is_finite());
    let count = finite().count();
    let mean = finite().sum::<f64>() / count as f64;
    let of = |y: &f64| if y.is_finite() { (1.0, y - mean) } else { (0.0, 0.0) };
    (count > 3).then(|| samples.iter().map(of).collect())
}

/// The largest response to a line.
struct Vertex {
    /// How many samples after the crossing it is.
    displacement: f64,
    height: f64,
    curvature: f64,
}

impl Vertex {
    /// For a crossing at this rate, with its sign; `None` where the response is largest beyond a width of the kernel.
    fn of(
        kernel: &dyn CrossingKernel,
        line: &dyn CrossingWaveform,
        window: KernelWindow,
        rate: f64,
    ) -> Option<Self> {
        let around = window.half / 2;
        let reach = window.half + around;
        let volts = line.samples(rate, reach);
        let mut responses = vec![f64::NAN; volts.len()];
        kernel.responses(&volts, &mut responses);
        let of_line = responses.get(window.half..=window.half + 2 * around)?;
        let (place, _) = of_line.iter().enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b))?;
        let [before, height, after] = *of_line.get(place.checked_sub(1)?..=place + 1)? else { return None };
        let curvature = (before - height) + (after - height);
        let displacement = place as f64 - around as f64 + 0.5 * (before - after) / curvature;
        displacement.is_finite().then_some(Self { displacement, height, curvature })
    }
}

/// Lines of motions at rates whose responses go from below the noise to what is loud.
struct ResponseLines {
    /// The rate of each.
    rates: Vec<f64>,
    /// One after the other, from half a pass before the window of samples to half a pass after it.
    volts: Vec<f64>,
    length: usize,
}

/// The slope of the slowest motion in standard deviations of the response to noise, and its ratio from one motion to the next: the
/// likelihoods of two neighbours are near each other wherever the data tell no rate.
const SLOWEST: f64 = 0.3;
const RATIO: f64 = 1.4;

/// The most motions; the fastest ones give less and less more response, where the kernel is wider than the edge.
const MOST: usize = 24;

/// Beyond what is loud by so many standard deviations noise takes no response down.
const MARGIN: f64 = 5.0;

/// Weighted sums over what may be.
#[derive(Default)]
struct WeightedMoments {
    weight: f64,
    displacement: f64,
    square: f64,
    slope: f64,
}

impl WeightedMoments {
    fn add(&mut self, weight: f64, displacement: f64, variance: f64, slope: f64) {
        self.weight += weight;
        self.displacement += weight * displacement;
        self.square += weight * (displacement * displacement + variance);
        self.slope += weight * slope;
    }

    fn place(&self) -> Option<CrossingPlace> {
        let displacement = self.displacement / self.weight;
        let variance = self.square / self.weight - displacement * displacement;
        let place = CrossingPlace { displacement, variance, slope: self.slope / self.weight };
        (variance > 0.0 && variance.is_finite() && place.slope.is_finite()).then_some(place)
    }
}

#[cfg(test)]
mod tests;
