//! What all runs say together of one claim.

use super::judged::{APART, LEVELS, NormalizedErrors};
use super::{Share, Uniformity};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};
use std::fmt;

/// The claim of one quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClaimCalibration {
    /// The quantity, or the parameter at the end of the recording.
    pub quantity: String,
    /// How many errors were compared.
    pub errors: u64,
    /// How many independent ones they are worth for the share within one standard deviation.
    pub independent: f64,
    /// The share of them within one, two and three standard deviations.
    pub coverage: [CoverageLevel; LEVELS.len()],
    /// How many errors that have nothing to do with each other the ranks are of.
    pub ranked: usize,
    /// The mean of (truth − estimate)/sd of these; 0 of a claim that holds.
    pub mean: f64,
    /// The root of the mean of its square; 1 of a claim that holds, and less of a filter that claims larger errors than it makes.
    pub rms: f64,
    /// Whether the ranks Φ((truth − estimate)/sd) are uniform; `None` of too few.
    pub ranks: Option<Uniformity>,
    /// What that comes to.
    pub finding: ClaimFinding,
}

/// A level of coverage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CoverageLevel {
    /// What a normal distribution has within so many standard deviations.
    pub claimed: f64,
    /// What was found.
    #[serde(flatten)]
    pub found: Share,
}

/// What the errors of a claim come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ClaimFinding {
    /// Nothing speaks against it, as far as so many can tell.
    Holds,
    /// The errors are smaller than claimed.
    Careful,
    /// The errors are larger than claimed.
    Overconfident,
    /// The errors have a mean.
    Biased,
    /// The errors have another distribution.
    NotNormal,
    /// There are too few.
    TooFew,
}

/// The probability from which on a claim counts as one that holds, after a correction for four looks: each table has many rows.
const HOLDS: f64 = 1e-3;

impl ClaimFinding {
    /// In a word or two.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Careful => "careful",
            Self::Overconfident => "overconfident",
            Self::Biased => "biased",
            Self::NotNormal => "not normal",
            Self::TooFew => "too few",
        }
    }

    /// By the least probable of four: the ranks, and of what they are of the mean, a spread that is larger and one that is smaller.
    fn of(ranks: Option<&Uniformity>, (mean, square): (f64, f64), count: usize) -> Self {
        let n = count as f64;
        let (Some(ranks), Ok(chi)) = (ranks, ChiSquared::new(n - 1.0)) else { return Self::TooFew };
        // Σ(z − z̄)² is χ² with n − 1 degrees of freedom.
        let spread = n * (square - mean * mean);
        let looks = [
            (Self::Overconfident, chi.sf(spread)),
            (Self::Careful, chi.cdf(spread)),
            (Self::Biased, 2.0 * Normal::standard().sf(mean.abs() * n.sqrt())),
            (Self::NotNormal, ranks.p_value),
        ];
        let [first, rest @ ..] = looks;
        let (finding, p) =
            rest.into_iter().fold(first, |least, look| if look.1 < least.1 { look } else { least });
        if p * 4.0 >= HOLDS {
            return Self::Holds;
        }
        // The ranks see the others as well; what they see has a name then.
        let named = looks.into_iter().take(3).find(|(_, p)| p * 4.0 < HOLDS);
        named.filter(|_| finding == Self::NotNormal).map_or(finding, |(named, _)| named)
    }
}

impl fmt::Display for ClaimFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.words())
    }
}

/// Runs from which on they show by themselves how much their shares vary.
const MANY: usize = 10;

/// How many independent errors the runs hold.
///
/// The claims say so themselves; where the shares within a level vary more from run to run than that allows, an error lasts longer than
/// the filter's propagation of errors has it, and the runs, which have nothing to do with each other, tell: the variance of a share p of n
/// independent errors is p(1 − p)/n.
fn independent(runs: &[NormalizedErrors], level: usize, share: f64) -> f64 {
    let claimed: f64 = runs.iter().map(|run| run.independent).sum();
    if runs.len() < MANY {
        return claimed;
    }
    let count = runs.len() as f64;
    let of_run = |run: &NormalizedErrors| run.within[level] as f64 / run.errors as f64 - share;
    let squares: f64 = runs.iter().map(|run| of_run(run).powi(2)).sum();
    let shown = share * (1.0 - share) / (squares / (count - 1.0) / count);
    // Where no run differs from another there is nothing to tell by; a run holds one error at least.
    if shown > 0.0 { shown.clamp(count.min(claimed), claimed) } else { claimed }
}

/// So many of a run's errors, as far apart as they are.
fn thinned(deviates: &[f64], most: usize) -> impl Iterator<Item = f64> {
    let kept = deviates.len().min(most);
    (0..kept).filter_map(move |part| deviates.get((2 * part + 1) * deviates.len() / (2 * kept)).copied())
}

impl ClaimCalibration {
    /// Of one quantity in all runs.
    pub(super) fn of(quantity: String, runs: &[NormalizedErrors]) -> Self {
        let normal = Normal::standard();
        let errors: u64 = runs.iter().map(|run| run.errors).sum();
        let coverage: [CoverageLevel; LEVELS.len()] = std::array::from_fn(|level| {
            let within: u64 = runs.iter().map(|run| run.within[level]).sum();
            let share = within as f64 / errors as f64;
            CoverageLevel {
                claimed: 1.0 - 2.0 * normal.sf(LEVELS[level]),
                found: Share::new(share, independent(runs, level, share)),
            }
        });
        let independent = coverage[0].found.of;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at least 1 for each run
        let most = (independent / runs.len() as f64 / APART).max(1.0) as usize;
        let deviates: Vec<f64> = runs.iter().flat_map(|run| thinned(&run.deviates, most)).collect();
        let n = deviates.len() as f64;
        let mean = deviates.iter().sum::<f64>() / n;
        let square = deviates.iter().map(|z| z * z).sum::<f64>() / n;
        let ranks = Uniformity::of(&deviates);
        Self {
            finding: ClaimFinding::of(ranks.as_ref(), (mean, square), deviates.len()),
            quantity,
            errors,
            independent,
            coverage,
            ranked: deviates.len(),
            mean,
            rms: square.sqrt(),
            ranks,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::WhiteNoise;

    fn finding(count: usize, error: impl Fn(f64, usize) -> f64) -> ClaimFinding {
        let mut noise = WhiteNoise::new(7, 2);
        let run = |k| NormalizedErrors {
            quantity: String::new(),
            errors: 1,
            independent: 1.0,
            within: [1; 3],
            deviates: vec![error(noise.sample(), k)],
        };
        let runs: Vec<NormalizedErrors> = (0..count).map(run).collect();
        ClaimCalibration::of(String::new(), &runs).finding
    }

    #[test]
    fn what_is_wrong_with_a_claim_is_named() {
        assert_eq!(finding(19, |z, _| 10.0 * z), ClaimFinding::TooFew);
        assert_eq!(finding(1000, |z, _| z), ClaimFinding::Holds);
        assert_eq!(finding(1000, |z, _| 0.8 * z), ClaimFinding::Careful);
        assert_eq!(finding(1000, |z, _| 1.2 * z), ClaimFinding::Overconfident);
        assert_eq!(finding(1000, |z, _| z + 0.2), ClaimFinding::Biased);
        // Of the same mean and spread, on two sides.
        assert_eq!(
            finding(1000, |z, k| 0.1 * z + if k % 2 == 0 { 1.0 } else { -1.0 }),
            ClaimFinding::NotNormal
        );
        // Few that are far off are in no bin of a histogram, and in the spread.
        assert_eq!(finding(100, |z, k| if k < 3 { 15.0 } else { z }), ClaimFinding::Overconfident);
    }

    /// Each run has one error that lasts through all of it, of which the claim says that it is a thousand independent ones.
    #[test]
    fn an_error_that_lasts_longer_than_claimed_shows_from_run_to_run() {
        let mut noise = WhiteNoise::new(3, 9);
        let mut lasting = |errors: u64, lasts: bool| {
            let of_run = |_| {
                let all = noise.sample();
                let of_each: Vec<f64> =
                    (0..errors).map(|_| if lasts { all } else { noise.sample() }).collect();
                let within = LEVELS.map(|level| of_each.iter().filter(|z| z.abs() <= level).count() as u64);
                let deviates = of_each.into_iter().take(16).collect();
                NormalizedErrors {
                    quantity: String::new(),
                    errors,
                    independent: errors as f64,
                    within,
                    deviates,
                }
            };
            let runs: Vec<NormalizedErrors> = (0..200).map(of_run).collect();
            ClaimCalibration::of(String::new(), &runs)
        };
        let own = lasting(1000, true);
        assert!((own.independent - 200.0).abs() < 10.0 && own.ranked == 200, "{own:?}");
        // Of 200 errors: a share that is further off is one of a thousand.
        let CoverageLevel { claimed, found } = own.coverage[0];
        let sd = (claimed * (1.0 - claimed) / 200.0).sqrt();
        assert!((found.share - claimed).abs() < 3.3 * sd && own.finding == ClaimFinding::Holds, "{own:?}");
        // Of 200 shares the variance is known to 10 %.
        let own = lasting(1000, false);
        assert!(own.independent > 120_000.0 && own.ranked == 3200, "{own:?}");
    }
}
