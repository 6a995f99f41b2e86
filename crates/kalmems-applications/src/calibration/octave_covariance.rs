//! How overlapping Allan's or Hadamard's variances of a mixture of noises scatter about their expectations, and with one another.

use kalmems_core::Portable;

/// Quantisation of the angle, white noise, flicker, and a random walk of the rate.
pub(super) const PARTS: usize = 4;
pub(super) const QUANTISATION: usize = 0;
pub(super) const WHITE: usize = 1;
pub(super) const FLICKER: usize = 2;
pub(super) const WALK: usize = 3;

/// Lags to the shorter averaging time in the sums below.
const FINENESS: usize = 8;
/// How many of the longer averaging time two differences may be apart and still hang together.
const REACH: usize = 3;
/// Variances whose averaging times differ by more than this factor count as independent: white noise leaves a correlation of 0.02 there.
const FARTHEST: usize = 32;
/// From this many intervals on the phase of flicker is that of continuous time.
const CONTINUOUS: f64 = 64.0;

/// Differences of the phase, of which a variance is the mean square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PhaseDifference {
    weights: &'static [f64],
    /// What the sum of the squares is divided by.
    divisor: f64,
}

impl PhaseDifference {
    /// Second differences: a rate that changes evenly adds R²·τ²/2.
    pub const ALLAN: Self = Self { weights: &[1.0, -2.0, 1.0], divisor: 2.0 };
    /// Third differences: an even change adds nothing.
    pub const HADAMARD: Self = Self { weights: &[1.0, -3.0, 3.0, -1.0], divisor: 6.0 };

    /// Averaging times that a difference extends over.
    pub const fn order(self) -> usize {
        self.weights.len() - 1
    }

    /// The weights of two differences, the latter by the lag of their phases in averaging times.
    fn products(self) -> impl Iterator<Item = ([usize; 2], f64)> {
        let each = self.weights.iter().enumerate();
        each.flat_map(move |(a, first)| {
            self.weights.iter().enumerate().map(move |(b, second)| ([a, b], first * second))
        })
    }

    /// The variance of a phase with this generalised covariance, which is that of a lag in averaging times.
    pub fn variance(self, covariance: impl Fn(f64) -> f64) -> f64 {
        let sum: f64 =
            self.products().map(|([a, b], weight)| weight * covariance(a.abs_diff(b) as f64)).sum();
        sum / self.divisor
    }
}

/// The noise of the averaging times `factors`, of which the first is not the longer one.
pub(super) struct OctavePair {
    pub difference: PhaseDifference,
    /// Both averaging times in intervals; powers of two.
    pub factors: [usize; 2],
    /// The part of each noise in both Allan variances, each summing up to 1.
    pub shares: [[f64; 2]; PARTS],
    /// The correlation of neighbouring samples of the white noise, which a low pass before the sampling leaves; 0 without one.
    pub memory: f64,
}

impl OctavePair {
    /// Cov(A₁, A₂)/(E A₁·E A₂) of two overlapping variances; that of a variance with itself is 2/ν with its degrees of freedom ν. `None`
    /// where no stretch is long enough. The stretches are those with differences at either averaging time, as lengths in samples with their
    /// number: a gap that ends one at the shorter time may be short for the longer one.
    ///
    /// The differences of the phase are normal, and of two normal numbers the squares have the covariance 2·Cov²; summed over all
    /// pairs by their lag. Of several noises the covariances of the differences add up before they are squared.
    pub fn covariance(&self, stretches: [&[(usize, usize)]; 2]) -> Option<f64> {
        let [m, n] = self.factors;
        let [own, stretches] = stretches;
        let order = self.difference.order();
        let terms = |factor: usize, samples: usize| (samples + 1).saturating_sub(order * factor);
        let all = |stretches: &[(usize, usize)], factor: usize| {
            let each = stretches.iter().map(|(samples, count)| count * terms(factor, *samples));
            each.sum::<usize>() as f64
        };
        // Differences at the shorter time outside of the stretches with longer ones hang together with none of these.
        let (first, second) = (all(own, m).max(all(stretches, m)), all(stretches, n));
        if first == 0.0 || second == 0.0 {
            return None;
        }
        if n > FARTHEST * m {
            return Some(0.0);
        }
        // Pairs of differences of which the second begins `lag` intervals after the first.
        let pairs = |lag: i64| {
            let each = stretches.iter().map(|(samples, count)| {
                let [a, b] = [m, n].map(|factor| signed(terms(factor, *samples)));
                *count as f64 * (a.min(b - lag) - 0.max(-lag)).max(0) as f64
            });
            each.sum::<f64>()
        };
        // Where a stretch has few differences, each lag counts.
        let most =
            |factor: usize| stretches.iter().map(|(samples, _)| terms(factor, *samples)).max().unwrap_or(0);
        let (first_most, second_most) = (most(m), most(n));
        let finest = (m / FINENESS).min((first_most + second_most) / (2 * FINENESS)).max(1);
        let smooth = SmoothCovariance::of(self, 1 << finest.ilog2());
        let step = smooth.step;
        // The middles of both differences are at one place.
        let middle = signed(order) * (signed(m) - signed(n)) / 2;
        let reach = signed((REACH + order - 2) * n);
        let (from, to) =
            ((middle - reach).max(-signed(first_most)), (middle + reach).min(signed(second_most)));
        let mut sum = 0.0;
        let mut lag = from / step * step;
        while lag <= to {
            sum += step as f64 * pairs(lag) * smooth.at(lag).powi(2);
            lag += step;
        }
        // Quantisation is white in the phase: its differences hang together where they share a sample, and at no lag between.
        for (lag, spike) in self.spikes() {
            let smooth = smooth.at(lag);
            sum += pairs(lag) * ((smooth + spike).powi(2) - smooth.powi(2));
        }
        Some(2.0 * sum / (first * second))
    }

    /// The lags at which differences of quantisation share samples, and their correlation there, by its share.
    fn spikes(&self) -> Vec<(i64, f64)> {
        let [m, n] = self.factors.map(signed);
        let whole = self.difference.divisor * self.difference.variance(|lag| f64::from(u8::from(lag == 0.0)));
        let size = self.share(QUANTISATION) / whole;
        let mut spikes: Vec<(i64, f64)> = Vec::new();
        for ([a, b], weight) in self.difference.products() {
            let lag = signed(a) * m - signed(b) * n;
            match spikes.iter_mut().find(|(own, _)| *own == lag) {
                Some((_, value)) => *value += size * weight,
                None => spikes.push((lag, size * weight)),
            }
        }
        spikes
    }

    /// √(s₁·s₂) of a noise's shares.
    fn share(&self, part: usize) -> f64 {
        (self.shares[part][0] * self.shares[part][1]).sqrt()
    }
}

#[allow(clippy::cast_possible_wrap)] // counts of samples
const fn signed(count: usize) -> i64 {
    count as i64
}

/// The correlation of two differences by their lag, for all noises whose phase is continuous.
struct SmoothCovariance<'a> {
    pair: &'a OctavePair,
    /// From one lag to the next; a power of two not above the shorter averaging time.
    step: i64,
    /// Of each noise its share by the deviations of its differences.
    scales: [f64; PARTS],
    /// The phase's generalised covariance by its lag in steps.
    phase: Vec<f64>,
}

/// Lags of the phase that are computed once.
const LONGEST_TABLE: usize = 4096;

impl<'a> SmoothCovariance<'a> {
    fn of(pair: &'a OctavePair, step: usize) -> Self {
        let [m, n] = pair.factors;
        // Of the lags themselves, and what both differences reach beyond them.
        let order = pair.difference.order();
        let last = ((REACH + 2 * order - 2) * n + (order + 1) * m) / step + 2;
        let scales: [f64; PARTS] = std::array::from_fn(|part| {
            let difference = pair.difference;
            let variance = |factor: usize| {
                let at = |times: f64| phase_covariance(part, times * factor as f64, pair.memory);
                difference.divisor * difference.variance(at)
            };
            let share = pair.share(part);
            if part == QUANTISATION || share == 0.0 {
                0.0
            } else {
                share / (variance(m) * variance(n)).sqrt()
            }
        });
        let mut found = Self { pair, step: signed(step), scales, phase: Vec::new() };
        let lags = (0..last.min(LONGEST_TABLE)).map(|lag| found.phase_at((lag * step) as f64));
        found.phase = lags.collect();
        found
    }

    fn phase_at(&self, lag: f64) -> f64 {
        let each = self.scales.iter().enumerate().filter(|(_, scale)| **scale > 0.0);
        each.map(|(part, scale)| scale * phase_covariance(part, lag, self.pair.memory)).sum()
    }

    fn at(&self, lag: i64) -> f64 {
        let [m, n] = self.pair.factors.map(signed);
        let mut sum = 0.0;
        for ([a, b], weight) in self.pair.difference.products() {
            let apart = (lag + signed(b) * n - signed(a) * m).unsigned_abs();
            #[allow(clippy::cast_possible_truncation)] // looked up only where it is in the table
            let place = (apart / self.step.unsigned_abs()) as usize;
            sum += weight * self.phase.get(place).copied().unwrap_or_else(|| self.phase_at(apart as f64));
        }
        sum
    }
}

/// The generalised covariance of a noise's phase so many intervals apart, up to a factor.
pub(super) fn phase_covariance(part: usize, lag: f64, memory: f64) -> f64 {
    match part {
        // −½ the variance of a sum of samples of which neighbours have this correlation.
        WHITE => -0.5 * correlated_sum(lag, memory),
        FLICKER if lag < CONTINUOUS => {
            let fourth = |t: f64| if t > 0.0 { t.powi(4) * t.portable_ln() } else { 0.0 };
            fourth(lag + 1.0) + fourth((lag - 1.0).abs()) - 2.0 * fourth(lag)
        }
        FLICKER => (12.0 * lag * lag + 2.0) * lag.portable_ln() + 7.0 * lag * lag + 25.0 / 6.0,
        WALK if lag < 1.0 => 2.0,
        WALK => 20.0 * lag.powi(3) + 10.0 * lag,
        _ => 0.0,
    }
}

/// The variance of a sum of so many samples of low-passed white noise by that which one sample adds to a long sum. `memory` is the correlation of
/// neighbouring samples.
fn correlated_sum(samples: f64, memory: f64) -> f64 {
    if memory <= 0.0 {
        return samples;
    }
    samples - 2.0 * memory * (1.0 - memory.portable_powf(samples)) / (1.0 - memory * memory)
}

/// The variance of low-passed white noise at an averaging time of so many intervals, by N²/τ₀.
pub(super) fn low_passed(difference: PhaseDifference, factor: usize, memory: f64) -> f64 {
    let m = factor as f64;
    difference.variance(|times| phase_covariance(WHITE, times * m, memory)) / (m * m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::Deviation;
    use crate::simulate::WhiteNoise;

    fn pure(part: usize, factors: [usize; 2]) -> OctavePair {
        let mut shares = [[0.0; 2]; PARTS];
        shares[part] = [1.0; 2];
        OctavePair { difference: PhaseDifference::ALLAN, factors, shares, memory: 0.0 }
    }

    /// Riley, NIST Special Publication 1065, 2008, section 5.4.1: fitted formulas for N phases, some 5 % from the truth at the longest times.
    #[test]
    fn the_variance_of_one_noise_is_two_by_its_published_degrees_of_freedom() {
        const N: f64 = 2001.0;
        for factor in [1_u32, 4, 64, 256] {
            let m = f64::from(factor);
            let flicker = if factor == 1 {
                2.0 * (N - 2.0).powi(2) / (2.3 * N - 4.9)
            } else {
                5.0 * N * N / (4.0 * m * (N + 3.0 * m))
            };
            let published = [
                (QUANTISATION, (N + 1.0) * (N - 2.0 * m) / (2.0 * (N - m))),
                (WHITE, (1.5 * (N - 1.0) / m - 2.0 * (N - 2.0) / N) * 4.0 * m * m / (4.0 * m * m + 5.0)),
                (FLICKER, flicker),
                (
                    WALK,
                    (N - 2.0) / m * ((N - 1.0).powi(2) - 3.0 * m * (N - 1.0) + 4.0 * m * m)
                        / (N - 3.0).powi(2),
                ),
            ];
            // The formula of a random walk is that of continuous time.
            for (part, published) in published.into_iter().filter(|(part, _)| *part != WALK || factor > 1) {
                let freedom = 2.0 / pure(part, [factor as usize; 2]).covariance([&[(2000, 1)]; 2]).unwrap();
                assert!((freedom / published - 1.0).abs() < 0.1, "{part} {factor}: {freedom} {published}");
            }
        }
        // One difference has one degree of freedom.
        assert!((2.0 / pure(WHITE, [1000; 2]).covariance([&[(2000, 1)]; 2]).unwrap() - 1.0).abs() < 0.01);
    }

    /// Records of white noise and quantisation: the covariances of their variances, by 4000 of them.
    #[test]
    fn covariances_of_a_mixture_are_those_of_simulated_records() {
        const RECORDS: usize = 4000;
        const SAMPLES: usize = 256;
        let factors = [1, 2, 4, 8];
        let mut found = vec![Vec::new(); factors.len()];
        for seed in 0..RECORDS as u64 {
            let mut noise = WhiteNoise::new(seed, 3);
            let mut before = 0.6 * noise.sample();
            let rate: Vec<f64> = (0..SAMPLES)
                .map(|_| {
                    let angle = 0.6 * noise.sample();
                    let quantised = angle - before;
                    before = angle;
                    quantised + noise.sample()
                })
                .collect();
            for (values, d) in found.iter_mut().zip(Deviation::Overlapping.of(&rate, 1.0, &factors)) {
                values.push(d.deviation.powi(2));
            }
        }
        let expected = |m: usize| [3.0 * 0.36 / (m * m) as f64, 1.0 / m as f64];
        for (i, m) in factors.into_iter().enumerate() {
            for (j, n) in factors.into_iter().enumerate().skip(i) {
                let [of_m, of_n] = [expected(m), expected(n)];
                let mut shares = [[0.0; 2]; PARTS];
                for part in [QUANTISATION, WHITE] {
                    shares[part] = [of_m[part] / (of_m[0] + of_m[1]), of_n[part] / (of_n[0] + of_n[1])];
                }
                let pair =
                    OctavePair { difference: PhaseDifference::ALLAN, factors: [m, n], shares, memory: 0.0 };
                let mean = |values: &[f64]| values.iter().sum::<f64>() / RECORDS as f64;
                let [a, b] = [mean(&found[i]), mean(&found[j])];
                let products = found[i].iter().zip(&found[j]).map(|(x, y)| (x / a - 1.0) * (y / b - 1.0));
                let simulated = products.sum::<f64>() / RECORDS as f64;
                let own = |factor: usize, place: usize| {
                    let own = shares.map(|share| [share[place]; 2]);
                    let pair = OctavePair {
                        difference: PhaseDifference::ALLAN,
                        factors: [factor; 2],
                        shares: own,
                        memory: 0.0,
                    };
                    pair.covariance([&[(SAMPLES, 1)]; 2]).unwrap()
                };
                let scale = (own(m, 0) * own(n, 1)).sqrt();
                let correlation = pair.covariance([&[(SAMPLES, 1)]; 2]).unwrap() / scale;
                // The covariance of so many normal pairs of correlation r scatters by √((1 + r²)/4000) of the root of both variances: a weak
                // correlation is known to no part of itself.
                let scatter = ((1.0 + correlation.powi(2)) / RECORDS as f64).sqrt();
                let off = simulated / scale - correlation;
                assert!(off.abs() < 4.0 * scatter, "{m} {n}: {correlation}, off by {off}, scatter {scatter}");
            }
        }
    }

    /// An autoregression of first order: its Allan variance in closed form (IEEE Std 952, exponentially correlated noise).
    #[test]
    fn low_passed_noise_has_its_published_variance() {
        let memory = (-1.0_f64 / 400.0).portable_exp();
        for factor in [400_usize, 1600, 25_600] {
            let x = factor as f64 / 400.0;
            let published = (1.0 - (3.0 - 4.0 * (-x).portable_exp() + (-2.0 * x).portable_exp()) / (2.0 * x))
                / factor as f64;
            assert!(
                (low_passed(PhaseDifference::ALLAN, factor, memory) / published - 1.0).abs() < 1e-3,
                "{factor}"
            );
        }
        assert_eq!(low_passed(PhaseDifference::ALLAN, 8, 0.0), 1.0 / 8.0);
    }
}
