//! How well an Allan deviation is known.

use super::{AllanDeviation, Deviation, OctaveSums};
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
    /// The deviations at octaves with intervals that hold the true ones with this probability, such as 0.95.
    ///
    /// Which noise it is at an averaging time in s `noise` says by its α; where it does not, it is read off the correlation of neighbouring means
    /// (Riley and Greenhall, Proceedings of the 18th European Frequency and Time Forum, 2004) at the beginning of the longest stretch; where fewer than
    /// 30 means are left, it is as at the time before. The degrees of freedom are those of Greenhall and Riley, Proceedings of the 35th PTTI Meeting,
    /// 267, 2003, of the total deviation those of Riley, NIST Special Publication 1065, 2008, table 7, and the interval is that of χ². Those of stretches
    /// add up. What the mirrors of the total deviation take from flicker and random-walk noise is put back. With phase noise (α above 0) the
    /// total deviation has no formula here and comes back without an interval, not numbers.
    pub fn with_confidence(
        self,
        sums: &OctaveSums,
        interval_s: f64,
        probability: f64,
        noise: impl Fn(f64) -> Option<i32>,
    ) -> Vec<Confident> {
        let mut exponent = 0;
        let found =
            sums.octaves().filter_map(|octave| Some((self.of_sums(octave.sums, 1.0, interval_s)?, octave)));
        let with = found.map(|(averaged, octave)| {
            let (beginning, step) = octave.beginning;
            exponent = noise(averaged.time_s)
                .or_else(|| noise_of(beginning, step, self.differences()))
                .unwrap_or(exponent);
            let of = |phases: usize, count: usize| {
                let freedom = self.freedom(phases, averaged.factor, exponent);
                freedom.is_finite().then_some(count as f64 * freedom)
            };
            let freedom: f64 = if self == Self::Total {
                octave.sums.mirrored_phases().filter_map(|phases| of(phases, 1)).sum()
            } else {
                let stretches = sums.stretches(averaged.factor);
                stretches.into_iter().filter_map(|(samples, count)| of(samples + 1, count)).sum()
            };
            let kept = self.kept(octave.longest + 1, averaged.factor, exponent);
            let averaged = AllanDeviation { deviation: averaged.deviation / kept.sqrt(), ..averaged };
            let end = |part: f64| match ChiSquared::new(freedom) {
                Ok(law) => averaged.deviation * (freedom / law.inverse_cdf(part)).sqrt(),
                Err(_) => f64::NAN,
            };
            let interval = [end(0.5 + 0.5 * probability), end(0.5 - 0.5 * probability)];
            Confident { averaged, exponent, freedom, interval }
        });
        with.collect()
    }

    /// The part of the variance that the mirrors of the total deviation leave; 1 of the others.
    fn kept(self, phases: usize, factor: usize, exponent: i32) -> f64 {
        let taken = match self {
            Self::Total => total_noise(exponent).map_or(0.0, |(.., taken)| taken),
            _ => 0.0,
        };
        1.0 - taken * factor as f64 / phases.saturating_sub(1).max(1) as f64
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
    /// 256. The phase of the modified deviation is averaged over the averaging time itself.
    pub fn freedom(self, phases: usize, factor: usize, exponent: i32) -> f64 {
        let (overlapping, is_averaged) = match self {
            Self::Overlapping | Self::OverlappingHadamard => (true, false),
            Self::Allan | Self::Hadamard => (false, false),
            Self::Modified | Self::Time => (true, true),
            Self::Total => {
                let ratio = phases as f64 / factor as f64;
                let published = total_noise(exponent).map(|(slope, less, _)| slope * ratio - less);
                // The formula is that of long averaging times; at short ones the mirrors add nothing.
                let most = if factor < SHORT {
                    Self::Overlapping.freedom(phases, factor, exponent)
                } else {
                    f64::INFINITY
                };
                return published.map_or(f64::NAN, |published| published.min(most));
            }
        };
        let d = self.differences();
        let length = factor * d + if is_averaged { factor - 1 } else { 0 };
        // Phases that can be the first of a difference.
        let Some(room) = phases.checked_sub(length) else { return f64::NAN };
        let stride = if overlapping { factor } else { 1 };
        // Terms of the sum, on a grid of `stride` to an averaging time.
        let terms = 1 + stride * room.saturating_sub(1) / factor;
        // Of long averages only the ratio of both matters.
        let (stride, terms) = if stride > FINEST {
            (FINEST as f64, terms as f64 * FINEST as f64 / stride as f64)
        } else {
            (stride as f64, terms as f64)
        };
        let averaged_over = if is_averaged { 1.0 } else { factor as f64 };
        let covariance = |t: f64| correlation(t, averaged_over, exponent, d);
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

/// Of the total deviation with noise of this α: the degrees of freedom by the ratio of record and averaging time, what is less of them, and the part of
/// the variance that the mirrors take at an averaging time as long as the record (Riley, 2008, tables 7 and 8).
fn total_noise(exponent: i32) -> Option<(f64, f64, f64)> {
    match exponent {
        0 => Some((1.5, 0.0, 0.0)),
        -1 => Some((1.17, 0.22, (3.0 * std::f64::consts::LN_2).recip())),
        -2 => Some((0.93, 0.36, 0.75)),
        _ => None,
    }
}

/// Below this factor the degrees of freedom of the total deviation are those of the overlapping one, if they are fewer.
const SHORT: usize = 4;

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
