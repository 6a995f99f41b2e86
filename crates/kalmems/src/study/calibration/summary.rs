//! What all runs of a calibration say together.

use super::judged::{Claimed, Judged, LEVELS};
use super::{Share, Uniformity};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};
use std::fmt;

/// What a calibration came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CalibrationSummary {
    /// One for each point, segment and filter.
    pub filters: Vec<FilterCalibration>,
}

/// A filter over all runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FilterCalibration {
    /// What the study has at this point, such as `process_noise 1e6 rad^2/s^3`; empty where there is one point.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub point: String,
    /// The recording.
    pub recording: String,
    /// The segment; empty where there is one.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub segment: String,
    /// The filter, as a key.
    pub estimator: String,
    /// The filter, for people.
    pub name: String,
    /// Runs that have it.
    pub runs: u64,
    /// In how many of them it got which grade.
    pub grades: Vec<GradeCount>,
    /// The share of runs in which the verdict is "doubtful" or worse: false alarms, where the truth is as the filter is told.
    pub doubted: Share,
    /// In how many of them each test fails.
    pub tests: Vec<TestCount>,
    /// What it claims, quantity by quantity.
    pub claims: Vec<ClaimCalibration>,
}

/// A grade, and how often it was given.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct GradeCount {
    /// The grade.
    pub grade: String,
    /// In how many runs.
    pub runs: u64,
}

/// A test, and how often it fails.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TestCount {
    /// What is tested.
    pub test: String,
    /// In how many runs it fails.
    pub failed: u64,
    /// The share of those in which it was made.
    pub rate: Share,
}

/// The claim of one quantity.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClaimCalibration {
    /// The quantity, or the parameter at the end of the recording.
    pub quantity: String,
    /// How many errors were compared, and how many independent ones they are worth.
    pub errors: u64,
    /// How many independent ones they are worth.
    pub independent: f64,
    /// The share of them within one, two and three standard deviations.
    pub coverage: [Level; LEVELS.len()],
    /// How many errors that have nothing to do with each other the ranks are of.
    pub ranked: usize,
    /// The mean of (truth − estimate)/sd of these; 0 of a claim that holds.
    pub mean: f64,
    /// The root of the mean of its square; 1 of a claim that holds, and less of a filter that claims larger errors than it makes.
    pub rms: f64,
    /// Whether the ranks Φ((truth − estimate)/sd) are uniform; `None` of too few.
    pub ranks: Option<Uniformity>,
    /// What that comes to.
    pub finding: Finding,
}

/// A level of coverage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Level {
    /// What a normal distribution has within so many standard deviations.
    pub claimed: f64,
    /// What was found.
    #[serde(flatten)]
    pub found: Share,
}

/// What the errors of a claim come to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Finding {
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

impl Finding {
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
        // The ranks see the others as well; what they see has a name then.
        let named = looks.into_iter().take(3).find(|(_, p)| *p < HOLDS / 4.0);
        match (p * 4.0 < HOLDS, finding, named) {
            (false, ..) => Self::Holds,
            (true, Self::NotNormal, Some((finding, _))) => finding,
            (true, finding, _) => finding,
        }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.words())
    }
}

/// The sums of one filter.
struct Sums {
    point: String,
    first: Judged,
    runs: u64,
    doubted: u64,
    grades: Vec<GradeCount>,
    tests: Vec<(String, u64, u64)>,
    claims: Vec<Claimed>,
}

impl CalibrationSummary {
    /// Of all runs in their order: what each says of its filters, and the settings of its point.
    pub(in super::super) fn of<'a>(runs: impl Iterator<Item = (String, &'a [Judged])>) -> Self {
        let mut all: Vec<Sums> = Vec::new();
        for (point, judged) in runs {
            for one in judged {
                let place = all.iter().position(|sums| sums.is_of(&point, one)).unwrap_or_else(|| {
                    all.push(Sums::begin(point.clone(), one));
                    all.len() - 1
                });
                if let Some(sums) = all.get_mut(place) {
                    sums.take(one);
                }
            }
        }
        Self { filters: all.into_iter().map(Sums::finish).collect() }
    }

    /// The filters of several points, segments or recordings need more than their names to be told apart.
    pub(super) fn label(&self, filter: &FilterCalibration) -> String {
        let differ = |of: fn(&FilterCalibration) -> &str| self.filters.iter().any(|f| of(f) != of(filter));
        let mut parts = vec![filter.name.as_str()];
        if differ(|f| &f.recording) {
            parts.push(&filter.recording);
        }
        if differ(|f| &f.segment) {
            parts.push(&filter.segment);
        }
        if !filter.point.is_empty() {
            parts.push(&filter.point);
        }
        let parts: Vec<&str> = parts.into_iter().filter(|part| !part.is_empty()).collect();
        parts.join(", ")
    }

    /// Each test over all filters.
    pub(super) fn tests(&self) -> Vec<TestCount> {
        let mut all: Vec<(String, u64, u64)> = Vec::new();
        for found in self.filters.iter().flat_map(|filter| &filter.tests) {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a number of runs
            count(&mut all, &found.test, found.failed, found.rate.of as u64);
        }
        all.into_iter().map(TestCount::from).collect()
    }
}

/// Adds to the counts of a test.
fn count(all: &mut Vec<(String, u64, u64)>, test: &str, failed: u64, made: u64) {
    match all.iter_mut().find(|(name, ..)| name == test) {
        Some((_, failures, of)) => (*failures, *of) = (*failures + failed, *of + made),
        None => all.push((test.to_owned(), failed, made)),
    }
}

impl From<(String, u64, u64)> for TestCount {
    fn from((test, failed, made): (String, u64, u64)) -> Self {
        Self { test, failed, rate: Share::counted(failed, made) }
    }
}

impl Sums {
    fn begin(point: String, first: &Judged) -> Self {
        let first = Judged { tests: Vec::new(), claims: Vec::new(), ..first.clone() };
        let (grades, tests, claims) = (Vec::new(), Vec::new(), Vec::new());
        Self { point, first, runs: 0, doubted: 0, grades, tests, claims }
    }

    fn is_of(&self, point: &str, other: &Judged) -> bool {
        let key = |judged: &Judged| {
            [&judged.recording, &judged.segment, &judged.estimator, &judged.name].map(String::clone)
        };
        self.point == point && key(&self.first) == key(other)
    }

    fn take(&mut self, judged: &Judged) {
        self.runs += 1;
        if let Some(grade) = &judged.grade {
            self.doubted += u64::from(!grade.starts_with("passes"));
            match self.grades.iter_mut().find(|count| count.grade == *grade) {
                Some(count) => count.runs += 1,
                None => self.grades.push(GradeCount { grade: grade.clone(), runs: 1 }),
            }
        }
        for (test, fails) in &judged.tests {
            count(&mut self.tests, test, u64::from(*fails), 1);
        }
        for claim in &judged.claims {
            match self.claims.iter_mut().find(|sums| sums.quantity == claim.quantity) {
                Some(sums) => {
                    sums.errors += claim.errors;
                    sums.independent += claim.independent;
                    for (sum, more) in sums.within.iter_mut().zip(claim.within) {
                        *sum += more;
                    }
                    sums.deviates.extend(&claim.deviates);
                }
                None => self.claims.push(claim.clone()),
            }
        }
    }

    fn finish(self) -> FilterCalibration {
        let Judged { recording, segment, estimator, name, .. } = self.first;
        FilterCalibration {
            point: self.point,
            recording,
            segment,
            estimator,
            name,
            runs: self.runs,
            doubted: Share::counted(self.doubted, self.runs),
            grades: self.grades,
            tests: self.tests.into_iter().map(TestCount::from).collect(),
            claims: self.claims.into_iter().map(ClaimCalibration::of).collect(),
        }
    }
}

impl ClaimCalibration {
    fn of(sums: Claimed) -> Self {
        let normal = Normal::standard();
        let mut level = 0..;
        let coverage = sums.within.map(|within| {
            let sds = level.next().and_then(|place: usize| LEVELS.get(place)).copied().unwrap_or(f64::NAN);
            let share = within as f64 / sums.errors as f64;
            Level { claimed: 1.0 - 2.0 * normal.sf(sds), found: Share::new(share, sums.independent) }
        });
        let n = sums.deviates.len() as f64;
        let mean = sums.deviates.iter().sum::<f64>() / n;
        let square = sums.deviates.iter().map(|z| z * z).sum::<f64>() / n;
        let ranks = Uniformity::of(&sums.deviates);
        Self {
            finding: Finding::of(ranks.as_ref(), (mean, square), sums.deviates.len()),
            quantity: sums.quantity,
            errors: sums.errors,
            independent: sums.independent,
            coverage,
            ranked: sums.deviates.len(),
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

    fn finding(count: usize, error: impl Fn(f64, usize) -> f64) -> Finding {
        let mut noise = WhiteNoise::new(7, 2);
        let deviates = (0..count).map(|k| error(noise.sample(), k)).collect();
        let claim =
            Claimed { quantity: String::new(), errors: 1, independent: 1.0, within: [1; 3], deviates };
        ClaimCalibration::of(claim).finding
    }

    #[test]
    fn what_is_wrong_with_a_claim_is_named() {
        assert_eq!(finding(19, |z, _| 10.0 * z), Finding::TooFew);
        assert_eq!(finding(1000, |z, _| z), Finding::Holds);
        assert_eq!(finding(1000, |z, _| 0.8 * z), Finding::Careful);
        assert_eq!(finding(1000, |z, _| 1.2 * z), Finding::Overconfident);
        assert_eq!(finding(1000, |z, _| z + 0.2), Finding::Biased);
        // Of the same mean and spread, on two sides.
        assert_eq!(finding(1000, |z, k| 0.1 * z + if k % 2 == 0 { 1.0 } else { -1.0 }), Finding::NotNormal);
        // Few that are far off are in no bin of a histogram, and in the spread.
        assert_eq!(finding(100, |z, k| if k < 3 { 15.0 } else { z }), Finding::Overconfident);
    }

    #[test]
    fn runs_are_counted_by_filter_and_grade() {
        let judged = |estimator: &str, grade: &str, fails: bool| Judged {
            recording: "r".to_owned(),
            segment: String::new(),
            estimator: estimator.to_owned(),
            name: estimator.to_owned(),
            grade: Some(grade.to_owned()),
            tests: vec![("line".to_owned(), fails)],
            claims: Vec::new(),
        };
        let runs = [
            vec![judged("a", "passes", false), judged("b", "doubtful", true)],
            vec![judged("a", "passes with remarks", false), judged("b", "passes", false)],
        ];
        let summary = CalibrationSummary::of(runs.iter().map(|run| (String::new(), run.as_slice())));
        let [a, b] = &summary.filters[..] else { panic!("{summary:?}") };
        assert_eq!((a.runs, a.doubted.share, b.doubted.share), (2, 0.0, 0.5));
        assert_eq!(b.grades[0], GradeCount { grade: "doubtful".to_owned(), runs: 1 });
        assert_eq!((b.tests[0].failed, summary.tests()[0].failed, summary.tests()[0].rate.of), (1, 1, 4.0));
        assert_eq!(summary.label(a), "a");
    }
}
