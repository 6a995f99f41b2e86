//! What all runs of a calibration say together.

use super::judged::{NormalizedErrors, RunClaims};
use super::{ClaimCalibration, Share};
use serde::Serialize;

/// What a calibration came to.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StudyCalibrationSummary {
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

/// The sums of one filter.
struct Sums {
    point: String,
    first: RunClaims,
    runs: u64,
    doubted: u64,
    grades: Vec<GradeCount>,
    tests: Vec<(String, u64, u64)>,
    /// Those of each quantity, one for each run.
    claims: Vec<(String, Vec<NormalizedErrors>)>,
}

impl StudyCalibrationSummary {
    /// Of all runs in their order: what each says of its filters, and the settings of its point.
    pub(in super::super) fn of<'a>(runs: impl Iterator<Item = (String, &'a [RunClaims])>) -> Self {
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
    fn begin(point: String, first: &RunClaims) -> Self {
        let first = RunClaims { tests: Vec::new(), claims: Vec::new(), ..first.clone() };
        let (grades, tests, claims) = (Vec::new(), Vec::new(), Vec::new());
        Self { point, first, runs: 0, doubted: 0, grades, tests, claims }
    }

    fn is_of(&self, point: &str, other: &RunClaims) -> bool {
        let key = |judged: &RunClaims| {
            [&judged.recording, &judged.segment, &judged.estimator, &judged.name].map(String::clone)
        };
        self.point == point && key(&self.first) == key(other)
    }

    fn take(&mut self, judged: &RunClaims) {
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
            match self.claims.iter_mut().find(|(quantity, _)| *quantity == claim.quantity) {
                Some((_, runs)) => runs.push(claim.clone()),
                None => self.claims.push((claim.quantity.clone(), vec![claim.clone()])),
            }
        }
    }

    fn finish(self) -> FilterCalibration {
        let RunClaims { recording, segment, estimator, name, .. } = self.first;
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
            claims: self.claims.into_iter().map(|(name, runs)| ClaimCalibration::of(name, &runs)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_counted_by_filter_and_grade() {
        let judged = |estimator: &str, grade: &str, fails: bool| RunClaims {
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
        let summary = StudyCalibrationSummary::of(runs.iter().map(|run| (String::new(), run.as_slice())));
        let [a, b] = &summary.filters[..] else { panic!("{summary:?}") };
        assert_eq!((a.runs, a.doubted.share, b.doubted.share), (2, 0.0, 0.5));
        assert_eq!(b.grades[0], GradeCount { grade: "doubtful".to_owned(), runs: 1 });
        assert_eq!((b.tests[0].failed, summary.tests()[0].failed, summary.tests()[0].rate.of), (1, 1, 4.0));
        assert_eq!(summary.label(a), "a");
    }
}
