//! The verdict on a filter that is known by its innovations alone.

use kalmems::estimate::NisConsistency;
use kalmems::evaluate::{InnovationRecord, TestResult};
use kalmems::progress::Interruption;
use kalmems::results::grade_of_innovations;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The word of a test, the probability of what it found, its size, and the sentence.
type Finding = (String, f64, f64, String);

/// The mean NIS, the ends of its interval, and its number of updates.
type Size = (f64, f64, f64, usize);

/// Times in s, innovations and their standard deviations of a signal with its name.
type Innovations = (String, Vec<f64>, Vec<f64>, Vec<f64>);

/// Tests the innovations of several signals, whose NIS have this sum over so many numbers: the grade, what is found, and the mean NIS.
#[pyfunction]
#[pyo3(signature = (
    signals: "Sequence[tuple[str, Sequence[float], Sequence[float], Sequence[float]]]", motions_hz: "Sequence[float]", whitens,
    sum_nis: "float", updates: "int"
))]
pub fn innovation_tests(
    py: Python<'_>,
    signals: Vec<Innovations>,
    motions_hz: Vec<f64>,
    whitens: bool,
    sum_nis: f64,
    updates: usize,
) -> PyResult<(String, Vec<Finding>, Size)> {
    let consistency = NisConsistency::of(sum_nis, updates, 0.0)
        .ok_or_else(|| PyValueError::new_err("no innovation is a number; there is nothing to test"))?;
    let looks = signals.len() as f64;
    let tests: Vec<TestResult> = py.detach(|| {
        let of_signal = |(name, time_s, innovation, sd): Innovations| {
            let start_s = time_s.first().copied().unwrap_or(0.0);
            let mut record = InnovationRecord::new(motions_hz.iter().copied(), start_s);
            record.take(&time_s, &innovation, &sd, &Interruption::never());
            let signal = (looks > 1.0).then_some(name);
            let tests = record.tests(whitens).into_iter();
            tests.map(move |found| TestResult {
                p_value: (looks * found.p_value).min(1.0),
                signal: signal.clone(),
                ..found
            })
        };
        signals.into_iter().flat_map(of_signal).collect()
    });
    let grade = grade_of_innovations(&tests, &consistency);
    let each = tests
        .iter()
        .map(|found| (found.test.words().to_owned(), found.p_value, found.size, found.to_string()))
        .collect();
    let NisConsistency { mean_nis, lower, upper, updates, .. } = consistency;
    Ok((grade.words().to_owned(), each, (mean_nis, lower, upper, updates)))
}
