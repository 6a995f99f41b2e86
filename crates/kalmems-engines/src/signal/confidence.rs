//! How well an Allan deviation is known.

use super::{AllanDeviation, Deviation};
use kalmems_core::Portable;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// A deviation with the interval that holds the true one so often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Confident {
    /// The deviation.
    pub averaged: AllanDeviation,
    /// α: the power of the frequency in the density of the rate's noise: 2 and 1 phase noise, white and flicker; 0 white,
    /// −1 flicker, −2 random walk of the rate.
    pub exponent: i32,
    /// The equivalent degrees of freedom.
    pub freedom: f64,
    /// The interval.
    pub interval: [f64; 2],
}

impl Deviation {
    /// The deviations of a rate with intervals that hold the true ones with this probability, such as 0.95.
    ///
    /// Which noise it is at an averaging time is read off the correlation of neighbouring means (Riley and Greenhall,
    /// Proceedings of the 18th European Frequency and Time Forum, 2004); where fewer than 30 means are left, it is as at
    /// the time before. The degrees of freedom are those of Greenhall and Riley, Proceedings of the 35th PTTI Meeting,
    /// 267, 2003, and the interval is that of χ². The modified and the total deviation and that of time have none here
    /// and come back without an interval, not numbers.
    pub fn with_confidence(
        self,
        rate: &[f64],
        interval_s: f64,
        factors: &[usize],
        probability: f64,
    ) -> Vec<Confident> {
        self.of_phase_with_confidence(
            &super::allan::phase(rate, interval_s),
            interval_s,
            factors,
            probability,
        )
    }

    /// The same from the phase.
    pub fn of_phase_with_confidence(
        self,
        phase: &[f64],
        interval_s: f64,
        factors: &[usize],
        probability: f64,
    ) -> Vec<Confident> {
        self.of_phases_with_confidence(&[phase], interval_s, factors, probability)
    }

    fn of_phases_with_confidence(
        self,
        phases: &[&[f64]],
        interval_s: f64,
        factors: &[usize],
        probability: f64,
    ) -> Vec<Confident> {
        let mut exponent = 0;
        let longest = phases.iter().copied().max_by_key(|phase| phase.len()).unwrap_or_default();
        let found = factors.iter().filter_map(|factor| self.of_phases(phases, interval_s, *factor));
        let with = found.map(|averaged| {
            exponent = noise_of(longest, averaged.factor, self.differences()).unwrap_or(exponent);
            let freedoms = phases.iter().map(|phase| self.freedom(phase.len(), averaged.factor, exponent));
            let freedom = match phases {
                [_] => freedoms.sum(),
                _ => freedoms.filter(|freedom| freedom.is_finite()).sum(),
            };
            let end = |part: f64| match ChiSquared::new(freedom) {
                Ok(law) => averaged.deviation * (freedom / law.inverse_cdf(part)).sqrt(),
                Err(_) => f64::NAN,
            };
            let interval = [end(0.5 + 0.5 * probability), end(0.5 - 0.5 * probability)];
            Confident { averaged, exponent, freedom, interval }
        });
        with.collect()
    }

    /// The deviation over several phases: the root of the mean square of all their differences.
    fn of_phases(self, phases: &[&[f64]], interval_s: f64, factor: usize) -> Option<AllanDeviation> {
        let each = phases.iter().flat_map(|phase| self.of_phase(phase, interval_s, &[factor]));
        each.reduce(|all, one| {
            let square = |of: &AllanDeviation| of.terms as f64 * of.deviation.powi(2);
            let terms = all.terms + one.terms;
            let deviation = ((square(&all) + square(&one)) / terms as f64).sqrt();
            AllanDeviation { deviation, terms, ..all }
        })
    }

    /// The same of a rate that is known in stretches with gaps between them: the mean square is that of the differences in
    /// all stretches, none of them across a gap, and their degrees of freedom add up. Which noise it is, the longest tells.
    pub fn of_stretches_with_confidence(
        self,
        stretches: &[&[f64]],
        interval_s: f64,
        factors: &[usize],
        probability: f64,
    ) -> Vec<Confident> {
        let phases: Vec<Vec<f64>> =
            stretches.iter().map(|rate| super::allan::phase(rate, interval_s)).collect();
        let phases: Vec<&[f64]> = phases.iter().map(Vec::as_slice).collect();
        self.of_phases_with_confidence(&phases, interval_s, factors, probability)
    }

    /// Which difference of the phase it squares.
    const fn differences(self) -> usize {
        match self {
            Self::Hadamard | Self::OverlappingHadamard => 3,
            _ => 2,
        }
    }

    /// The equivalent degrees of freedom for so many phases, averages over so many intervals and noise of this α; not a
    /// number where there is no formula here.
    ///
    /// ν = s_z(0)²·M/Σ s_z² over the lags of the sum, with the covariance s_z of two differences (Greenhall and Riley, 2003,
    /// equations 7 to 12), evaluated as it stands at any length; for more than 256 steps to an averaging time on a grid of
    /// 256.
    pub fn freedom(self, phases: usize, factor: usize, exponent: i32) -> f64 {
        let overlapping = match self {
            Self::Overlapping | Self::OverlappingHadamard => true,
            Self::Allan | Self::Hadamard => false,
            Self::Modified | Self::Time | Self::Total => return f64::NAN,
        };
        let d = self.differences();
        // Phases that can be the first of a difference.
        let Some(room) = phases.checked_sub(factor * d) else { return f64::NAN };
        let stride = if overlapping { factor } else { 1 };
        // Terms of the sum, on a grid of `stride` to an averaging time.
        let terms = 1 + stride * room.saturating_sub(1) / factor;
        // Of long averages only the ratio of both matters.
        let (stride, terms) = if stride > FINEST {
            (FINEST as f64, terms as f64 * FINEST as f64 / stride as f64)
        } else {
            (stride as f64, terms as f64)
        };
        let covariance = |t: f64| correlation(t, factor as f64, exponent, d);
        let own = covariance(0.0).powi(2);
        let last = terms.min((d + 1) as f64 * stride).ceil();
        let mut sum = own + (1.0 - last / terms).max(0.0) * covariance(last / stride).powi(2);
        let mut j = 1.0;
        while j < last {
            sum += 2.0 * (1.0 - j / terms).max(0.0) * covariance(j / stride).powi(2);
            j += 1.0;
        }
        own * terms / sum
    }
}

/// Steps to an averaging time in the sum over lags.
const FINEST: usize = 256;

/// Beyond this factor the phase's noise counts as continuous.
const CONTINUOUS: f64 = 1024.0;

/// The covariance of two d-th differences t averaging times apart, up to a factor: s_z(t) of Greenhall and Riley.
fn correlation(t: f64, factor: f64, exponent: i32, differences: usize) -> f64 {
    let phase = |t: f64| phase_covariance(t, factor.min(CONTINUOUS), exponent);
    if differences == 2 {
        6.0 * phase(t) - 4.0 * (phase(t - 1.0) + phase(t + 1.0)) + phase(t - 2.0) + phase(t + 2.0)
    } else {
        20.0 * phase(t) - 15.0 * (phase(t - 1.0) + phase(t + 1.0)) + 6.0 * (phase(t - 2.0) + phase(t + 2.0))
            - phase(t - 3.0)
            - phase(t + 3.0)
    }
}

/// s_x(t): that of the phase averaged over one interval, a second difference of s_w.
fn phase_covariance(t: f64, factor: f64, exponent: i32) -> f64 {
    let step = factor.recip();
    factor
        * factor
        * (2.0 * integrated(t, exponent) - integrated(t - step, exponent) - integrated(t + step, exponent))
}

/// s_w(t).
fn integrated(t: f64, exponent: i32) -> f64 {
    let t = t.abs();
    let logarithm = if t > 0.0 { t.portable_ln() } else { 0.0 };
    match exponent {
        2 => -t,
        1 => t * t * logarithm,
        0 => t.powi(3),
        -1 => -t.powi(4) * logarithm,
        _ => -t.powi(5),
    }
}

/// α by the correlation of neighbours, of the phase taken every m-th time and differenced until it is stationary; `None`
/// of fewer than 30 values.
fn noise_of(phase: &[f64], factor: usize, differences: usize) -> Option<i32> {
    let mut series: Vec<f64> = phase.iter().copied().step_by(factor).collect();
    for d in 0..=differences {
        let count = series.len();
        if count < 30 {
            return None;
        }
        let correlation = neighbours(&series);
        let fraction = correlation / (1.0 + correlation);
        if fraction < 0.25 || d == differences {
            #[allow(clippy::cast_possible_truncation)] // between −6 and 3
            let exponent = (2.0 - 2.0 * (fraction + d as f64)).round() as i32;
            return Some(exponent.clamp(-2, 2));
        }
        series = series.windows(2).map(|pair| pair[1] - pair[0]).collect();
    }
    None
}

/// The correlation of neighbours about the mean.
fn neighbours(series: &[f64]) -> f64 {
    let mean = series.iter().sum::<f64>() / series.len() as f64;
    let square: f64 = series.iter().map(|v| (v - mean).powi(2)).sum();
    series.windows(2).map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum::<f64>() / square
}
