//! Whether errors against a reference are as small as a filter claims.

use super::{ErrorSeries, WRONG};
use crate::estimate::Trajectory;
use crate::progress::Interruption;
use crate::signal::least_squares;
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Errors held against their claim.
///
/// With the error e and the standard deviations s of the estimate and s_r of the reference, e²/(s² + s_r²) is 1 on average. Errors that
/// follow each other are alike: N of them are worth
/// \\(n = N / (1 + 2\sum\rho^2)\\), with ρ from the filter's own error propagation ([`ErrorSpan`](crate::estimate::ErrorSpan)),
/// and n times the mean is χ² with n degrees of freedom. Errors by what is uncertain of the device are common to all samples: where such
/// have the shares \\(w_j\\) of the variance, \\(w = \sum w_j\\), the mean varies by twice
/// \\((1 - w^2)/n + \sum w_j^2\\), and that many independent errors, its reciprocal, are what it is worth. Of the delay that is stated of the
/// reference the most likely one within its standard deviation is taken off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// Errors that were compared.
    #[serde(skip)]
    pub samples: usize,
    /// The share of them within three standard deviations.
    #[serde(skip)]
    pub within: f64,
    /// The mean of their squares over the claimed variance.
    pub mean_square: f64,
    /// How many independent ones they are worth.
    pub independent: f64,
    /// How many those that are not common to all samples are worth.
    #[serde(skip)]
    own: f64,
    /// The shares of the variance that are common to all samples.
    #[serde(skip)]
    common: CommonErrorShares,
    /// How probable so large errors are for a filter that is right.
    #[serde(serialize_with = "super::three_digits")]
    pub p_value: f64,
    /// What of them an offset, a factor and a delay explain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub explained: Option<ErrorDecomposition>,
}

/// How an estimate differs from its reference: e = bias + scale·x + delay·ẋ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorDecomposition {
    /// By how much the estimate is larger everywhere, in SI.
    pub bias: f64,
    /// By which part it is large.
    pub scale: f64,
    /// By how much it is early, in s.
    pub early_s: f64,
    /// The share of the mean square error that these three explain.
    pub share: f64,
}

/// Shares of a variance that are common to all samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct CommonErrorShares {
    /// Their sum.
    all: f64,
    /// The sum of their squares.
    squares: f64,
}

impl CommonErrorShares {
    fn of(shares: &[f64]) -> Self {
        Self { all: shares.iter().sum(), squares: shares.iter().map(|share| share * share).sum() }
    }

    /// How many independent errors so many are worth with these shares in common.
    fn worth(self, own: f64) -> f64 {
        ((1.0 - self.all * self.all) / own + self.squares).recip()
    }
}

/// The share of errors within three standard deviations below which a claim does not hold.
const WITHIN: f64 = 0.9;

/// How many times as large as claimed errors are root mean square from which on a claim is doubtful, and from which on it is wrong.
const DOUBTFUL: f64 = 1.3;
const FAILED: f64 = 2.0;

/// How probable so large errors of a right filter are below which its claim is doubtful: an error that lasts as long as the recording is one, and
/// nobody relies on a claim that it exceeds fourfold. A recording has about ten claims, so that one right filter in a thousand is doubted.
const UNLIKELY: f64 = 1e-4;

impl Claim {
    /// Holds errors against their claim: those of a state of a trajectory by its place, against a reference that says this and is
    /// so accurate. `None` of a trajectory without a claim.
    pub(super) fn of(
        series: &ErrorSeries,
        truth: &[f64],
        (trajectory, state): (&Trajectory, usize),
        accuracy: Accuracy,
        stop: &Interruption,
    ) -> Option<Self> {
        let (first, last) = (series.time_s.first()?, series.time_s.last()?);
        let variance = |sd: &f64| sd * sd + accuracy.sd * accuracy.sd;
        let count =
            series.error.iter().zip(&series.sd).filter(|(e, sd)| (*e / variance(sd)).is_finite()).count();
        let lasting_s = trajectory.error_lasts_s(state, *first, *last);
        // Samples of one span of time are no more than one each.
        let most = (count as f64).max(1.0);
        // Where nothing is known of how long an error lasts, all of them are one.
        let independent = lasting_s.map_or(1.0, |lasting_s| ((last - first) / lasting_s).clamp(1.0, most));
        let own = independent;
        let common = CommonErrorShares::of(&trajectory.common_shares(state, *first, *last));
        let independent = common.worth(own).max(1.0);
        let late_s = accuracy.likely_delay_s((series, truth), independent / most, &variance, stop);
        let (mut samples, mut within, mut sum) = (0_usize, 0_usize, 0.0);
        for (k, (error, sd)) in series.error.iter().zip(&series.sd).enumerate() {
            if stop.is_requested_at(k) {
                return None;
            }
            let late = if late_s == 0.0 { 0.0 } else { late_s * rate(series, truth, k).unwrap_or(0.0) };
            let square = (error - late).powi(2) / variance(sd);
            // Infinite where an error is there and none is claimed.
            if !square.is_nan() {
                samples += 1;
                within += usize::from(square <= 9.0);
                sum += square;
            }
        }
        let n = samples as f64;
        let explained = ErrorDecomposition::of(series, truth, stop);
        let (within, mean_square) = (within as f64 / n, sum / n);
        (samples > 0).then(|| {
            let p_value = f64::NAN;
            Self { samples, within, mean_square, independent, own, common, p_value, explained }.judged()
        })
    }

    fn judged(self) -> Self {
        let n = self.independent;
        let p_value = ChiSquared::new(n).map_or(f64::NAN, |chi| chi.sf(n * self.mean_square));
        Self { p_value, ..self }
    }

    /// Whether the errors are larger than claimed by more than chance.
    pub fn is_contradicted(&self) -> bool {
        self.p_value < WRONG
    }

    /// Whether they are so much larger that the claim is not to be relied on.
    pub fn is_doubtful(&self) -> bool {
        self.p_value < UNLIKELY && self.mean_square > DOUBTFUL * DOUBTFUL
    }

    /// Whether the claim is wrong: errors that are much larger, or too many beyond three standard deviations, and not by chance.
    pub fn fails(&self) -> bool {
        self.is_contradicted() && (self.within < WITHIN || self.mean_square > FAILED * FAILED)
    }

    /// Takes those of a later part in.
    pub(super) fn pooled(self, later: Self) -> Self {
        let (own, others) = (self.samples as f64, later.samples as f64);
        let mean = |a: f64, b: f64| (a * own + b * others) / (own + others);
        // What is common to all samples is common to both parts.
        let common = CommonErrorShares {
            all: mean(self.common.all, later.common.all),
            squares: mean(self.common.squares, later.common.squares),
        };
        let own = self.own + later.own;
        Self {
            samples: self.samples + later.samples,
            within: mean(self.within, later.within),
            mean_square: mean(self.mean_square, later.mean_square),
            independent: common.worth(own),
            own,
            common,
            p_value: f64::NAN,
            explained: self.explained.or(later.explained),
        }
        .judged()
    }
}

/// How accurate a reference is by itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accuracy {
    /// The standard deviation of what it says, in SI.
    pub sd: f64,
    /// That of the delay that is stated of it, in s.
    pub delay_sd_s: f64,
}

impl Accuracy {
    /// By how much later than stated the reference most likely shows the motion, in s, where so large a share of the errors is
    /// independent: that which explains them best, drawn to zero by what is stated.
    fn likely_delay_s(
        self,
        (series, truth): (&ErrorSeries, &[f64]),
        share: f64,
        variance: &dyn Fn(&f64) -> f64,
        stop: &Interruption,
    ) -> f64 {
        if self.delay_sd_s == 0.0 {
            return 0.0;
        }
        let (mut product, mut square) = (0.0, self.delay_sd_s.powi(-2));
        for (k, (error, sd)) in series.error.iter().zip(&series.sd).enumerate() {
            if stop.is_requested_at(k) {
                break;
            }
            let Some(rate) = rate(series, truth, k) else { continue };
            let weight = share / variance(sd);
            if (weight * error).is_finite() {
                product += weight * error * rate;
                square += weight * rate * rate;
            }
        }
        product / square
    }
}

/// How fast the reference moves at a sample, by those beside it.
fn rate(series: &ErrorSeries, truth: &[f64], k: usize) -> Option<f64> {
    let (before, after) = (k.checked_sub(1)?, k + 1);
    let rate = (truth.get(after)? - truth[before]) / (series.time_s.get(after)? - series.time_s[before]);
    rate.is_finite().then_some(rate)
}

impl ErrorDecomposition {
    /// The nearest in least squares; `None` of too few errors, and where the reference does not move.
    pub fn of(series: &ErrorSeries, truth: &[f64], stop: &Interruption) -> Option<Self> {
        let places: Vec<f64> = (0..series.error.len()).map(|k| k as f64).collect();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a place
        let basis = |place: f64| {
            let k = place as usize;
            if stop.is_requested_at(k) {
                return [0.0; 3];
            }
            let moving = truth[k].is_finite().then(|| rate(series, truth, k)).flatten();
            moving.map_or([1.0, 0.0, 0.0], |rate| [1.0, truth[k], rate])
        };
        let [bias, scale, early_s] = least_squares(&places, &series.error, basis)?;
        let (mut all, mut left) = (0.0, 0.0);
        for (place, error) in places.iter().zip(&series.error).filter(|(_, error)| error.is_finite()) {
            let [one, x, rate] = basis(*place);
            all += error * error;
            left += (error - bias * one - scale * x - early_s * rate).powi(2);
        }
        Some(Self { bias, scale, early_s, share: 1.0 - left / all }).filter(|found| found.share.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{ErrorSpan, TrajectoryKind};
    use crate::simulate::WhiteNoise;
    use crate::units::kind;

    const EXACT: Accuracy = Accuracy { sd: 0.0, delay_sd_s: 0.0 };

    /// A trajectory whose errors last so long, in s, of 1000 s.
    fn lasting(correlation_s: f64) -> Trajectory {
        let time_s: Vec<f64> = (0..2).map(f64::from).collect();
        let names = [("position", "m", &kind::LENGTH)];
        let mut trajectory =
            Trajectory::blank(("", ""), TrajectoryKind::Filtered, (&time_s, &time_s, &(0..2)), &names);
        trajectory.error_spans =
            vec![ErrorSpan { from_s: 0.0, to_s: 1000.0, correlation_s: vec![correlation_s] }];
        trajectory
    }

    /// A motion of one turn in 10 s, and errors of it.
    fn series(error: impl Fn(f64, f64) -> f64) -> (ErrorSeries, Vec<f64>) {
        let time_s: Vec<f64> = (0..10_000).map(|k| f64::from(k) * 0.1).collect();
        let truth: Vec<f64> = time_s.iter().map(|t| (0.628_318 * t).sin()).collect();
        let mut noise = WhiteNoise::new(3, 1);
        let error = time_s.iter().map(|t| error(*t, noise.sample())).collect();
        (ErrorSeries { sd: vec![1e-3; time_s.len()], error, time_s }, truth)
    }

    fn claim(error: impl Fn(f64, f64) -> f64, lasts_s: f64, accuracy: Accuracy) -> Claim {
        let (series, truth) = series(error);
        Claim::of(&series, &truth, (&lasting(lasts_s), 0), accuracy, &Interruption::never()).unwrap()
    }

    #[test]
    fn errors_as_large_as_claimed_hold() {
        let own = claim(|_, z| 1e-3 * z, 0.1, EXACT);
        assert!(!own.fails() && own.within > 0.99 && (own.mean_square - 1.0).abs() < 0.1, "{own:?}");
        assert!((own.independent - 9999.0).abs() < 2.0, "{own:?}");
        // Chance in the errors' own size leaves the probability where it belongs.
        assert!(own.p_value > 1e-3, "{own:?}");
    }

    #[test]
    fn a_scale_that_is_wrong_fails_and_is_named() {
        let own = claim(|t, z| 1e-3 * z + 0.025 * (0.628_318 * t).sin(), 10.0, EXACT);
        assert!(own.fails() && (own.independent - 99.99).abs() < 0.1, "{own:?}");
        let explained = own.explained.unwrap();
        assert!((explained.scale - 0.025).abs() < 1e-4 && explained.share > 0.99, "{own:?}");
    }

    #[test]
    fn an_error_that_lasts_is_one_error() {
        // Everywhere 3.5 claimed standard deviations off: unlikely for 10⁴ errors, and not for one.
        assert!(claim(|_, _| 3.5e-3, 0.1, EXACT).fails());
        let own = claim(|_, _| 3.5e-3, 2000.0, EXACT);
        assert!(!own.is_doubtful() && own.independent == 1.0 && own.within == 0.0, "{own:?}");
        let own = claim(|_, _| 4.2e-3, 2000.0, EXACT);
        assert!(own.is_doubtful() && !own.fails() && own.p_value > 1e-5, "{own:?}");
        assert!(claim(|_, _| 5.5e-3, 2000.0, EXACT).fails());
    }

    /// An error is followed a part of the time: the span before the scored part goes on, and where there is none all errors are one.
    #[test]
    fn errors_of_which_nobody_knows_how_long_they_last_are_one_and_not_as_many_as_there_are_samples() {
        let (series, truth) = series(|_, z| 1.5e-3 * z);
        let mut trajectory = lasting(2.0);
        let of = |trajectory: &Trajectory| {
            Claim::of(&series, &truth, (trajectory, 0), EXACT, &Interruption::never()).unwrap()
        };
        let within = of(&trajectory).independent;
        trajectory.error_spans[0] = ErrorSpan { from_s: -10.0, to_s: -5.0, correlation_s: vec![2.0] };
        assert!((of(&trajectory).independent - within).abs() < 1e-6 * within, "{within}");
        trajectory.error_spans.clear();
        let unknown = of(&trajectory);
        assert!(unknown.independent == 1.0 && !unknown.is_contradicted(), "{unknown:?}");
    }

    #[test]
    fn a_reference_that_contradicts_a_claim_is_a_remark_a_doubt_or_a_failure_by_its_size() {
        let of = |times: f64| claim(|_, z| times * 1e-3 * z, 0.1, EXACT);
        let judged = |own: &Claim| (own.is_contradicted(), own.is_doubtful(), own.fails());
        assert_eq!(judged(&of(1.0)), (false, false, false));
        assert_eq!(judged(&of(1.15)), (true, false, false));
        // Nearly all errors are within three standard deviations, and they are half as large again as claimed.
        let own = of(1.43);
        assert!(own.within > 0.9 && own.p_value < 1e-6, "{own:?}");
        assert_eq!(judged(&own), (true, true, false));
        assert_eq!(judged(&of(2.2)), (true, true, true));
    }

    #[test]
    fn what_is_known_of_the_references_own_errors_counts() {
        let noisy = |_: f64, z: f64| 5e-3 * z;
        assert!(claim(noisy, 0.1, EXACT).fails());
        let own = claim(noisy, 0.1, Accuracy { sd: 5e-3, delay_sd_s: 0.0 });
        assert!(!own.fails() && (own.mean_square - 25.0 / 26.0).abs() < 0.1, "{own:?}");
        // 10 ms late, of an instrument whose delay is known to 5 ms, and to 1 ms.
        let late = |t: f64, z: f64| 1e-3 * z - 0.010 * 0.628_318 * (0.628_318 * t).cos();
        assert!(claim(late, 0.1, EXACT).fails());
        assert!(!claim(late, 0.1, Accuracy { sd: 0.0, delay_sd_s: 5e-3 }).fails());
        let explained = claim(late, 0.1, EXACT).explained.unwrap();
        assert!((explained.early_s + 0.010).abs() < 1e-3, "{explained:?}");
    }

    #[test]
    fn errors_without_a_claimed_size_are_infinitely_too_large() {
        let (mut series, truth) = series(|_, _| 1e-6);
        series.sd.fill(0.0);
        let own = Claim::of(&series, &truth, (&lasting(0.1), 0), EXACT, &Interruption::never()).unwrap();
        assert!(own.fails() && own.within == 0.0, "{own:?}");
    }

    #[test]
    fn an_error_that_all_samples_have_in_common_is_one_error_in_any_number_of_parts() {
        // An offset of as much as is claimed of it, beside noise of its own.
        let mut trajectory = lasting(0.1);
        let (series, truth) = series(|_, z| 1e-3 * z + 3e-3);
        let sd = (1e-6_f64 + 9e-6).sqrt();
        let series = ErrorSeries { sd: vec![sd; series.error.len()], ..series };
        let independent =
            Claim::of(&series, &truth, (&trajectory, 0), EXACT, &Interruption::never()).unwrap();
        trajectory.time_s.clone_from(&series.time_s);
        trajectory.states[0].sd.clone_from(&series.sd);
        let (name, states) = ("gain".into(), vec![vec![3e-3; series.error.len()]]);
        trajectory.considered = vec![crate::estimate::Contribution { name, states, told: [0.0, 1.0] }];
        let common = Claim::of(&series, &truth, (&trajectory, 0), EXACT, &Interruption::never()).unwrap();
        // w = 0.9: 1/((1 − 0.81)/9999 + 0.81).
        assert!((common.independent - 1.2345).abs() < 1e-3 && independent.independent > 9000.0, "{common:?}");
        assert!(!common.fails() && common.p_value > 0.2, "{common:?}");
        let twice = common.pooled(common);
        assert!((twice.independent - 1.2345).abs() < 1e-3, "{twice:?}");
    }

    #[test]
    fn parts_are_pooled_by_their_independent_errors() {
        let [a, b] = [1.0, 3.0].map(|size| claim(|_, z| size * 1e-3 * z, 0.1, EXACT));
        let both = a.pooled(b);
        assert!((both.mean_square - 0.5 * (a.mean_square + b.mean_square)).abs() < 1e-12);
        assert!((both.independent - a.independent - b.independent).abs() < 1e-9);
        assert!(!a.fails() && both.p_value < WRONG);
    }
}
