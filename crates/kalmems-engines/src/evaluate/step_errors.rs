//! How far the steps between samples lead a filter astray, over all that is scored of it.

use crate::estimate::{StepError, Trajectory};
use serde::Serialize;
use std::collections::VecDeque;
use std::fmt;

/// The error of a filter's steps: what its mean is off by because it goes from sample to sample in steps of a finite length, in standard
/// deviations that it claims, of the state in which that is most.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StepErrors {
    /// Steps from each sample to the next, at the end; `None` if their number follows kinks of the equations, sample by sample.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub steps_per_sample: Option<usize>,
    /// The root mean square after the settling time.
    pub error: f64,
    /// The same of the last 4096 samples, or of as many as there are: without process noise it grows to the end.
    pub at_the_end: f64,
    #[serde(skip)]
    squares: f64,
    #[serde(skip)]
    samples: f64,
}

/// Samples of the end.
const END: usize = 4096;
/// The error from which on it is told: a twentieth of the claimed standard deviation.
const REMARKABLE: f64 = 0.05;
/// The error from which on the claim is doubtful: errors with this bias are 2 % larger than claimed, and those of numbers that are determined
/// from the innovations several times.
const LARGE: f64 = 0.2;
/// What a plan leaves, as in the plan of the steps.
const SHORT_ENOUGH: f64 = 0.02;

impl StepErrors {
    /// Of a trajectory, from a time in s on; `None` where its steps are exact, or too few samples are known.
    pub fn of(trajectory: &Trajectory, from_s: f64) -> Option<Self> {
        let mut record = StepErrorRecord::default();
        record.take(trajectory, from_s);
        record.errors()
    }

    /// Takes those of a later part in.
    pub fn pool(&mut self, later: &Self) {
        self.squares += later.squares;
        self.samples += later.samples;
        self.error = (self.squares / self.samples).sqrt();
        (self.at_the_end, self.steps_per_sample) = (later.at_the_end, later.steps_per_sample);
    }

    /// The larger of both, infinite where it is not a number.
    fn worst(&self) -> f64 {
        let worst = if self.at_the_end > self.error { self.at_the_end } else { self.error };
        if worst.is_nan() { f64::INFINITY } else { worst }
    }

    /// Whether it is worth a word.
    pub fn is_remarkable(&self) -> bool {
        self.worst() > REMARKABLE
    }

    /// Whether the claim is doubtful for it.
    pub fn is_large(&self) -> bool {
        self.worst() > LARGE
    }

    /// The steps with which it would be small, where that is a number that the file may state.
    fn enough(&self) -> Option<usize> {
        let mut steps = self.steps_per_sample?.max(1);
        let mut error = self.worst();
        while error > SHORT_ENOUGH && steps <= 1024 {
            (steps, error) = (2 * steps, error / 16.0);
        }
        (error.is_finite() && steps <= 1024).then_some(steps)
    }
}

/// The errors of steps as they become known part by part, in bounded memory; the same for any division into parts.
#[derive(Clone, Debug, Default)]
pub struct StepErrorRecord {
    steps_per_sample: Option<usize>,
    squares: f64,
    samples: f64,
    /// Those of the end, over at least 4096 samples if there are as many.
    last: VecDeque<StepError>,
}

impl StepErrorRecord {
    /// Takes those of the next part of a trajectory in, from a time in s on.
    pub fn take(&mut self, part: &Trajectory, from_s: f64) {
        self.steps_per_sample = part.steps.last().or(self.steps_per_sample);
        for one in part.step_errors.iter().filter(|one| one.until_s >= from_s) {
            self.squares += one.error * one.error * one.samples as f64;
            self.samples += one.samples as f64;
            if one.samples == 0 {
                self.last.clear();
                continue;
            }
            self.last.push_back(*one);
            let mut of_last: usize = self.last.iter().map(|one| one.samples).sum();
            while let Some(first) = self.last.front().filter(|first| of_last - first.samples >= END) {
                of_last -= first.samples;
                self.last.pop_front();
            }
        }
    }

    /// The errors until now; `None` if the steps are exact, or too few samples are known.
    pub fn errors(&self) -> Option<StepErrors> {
        let (mut last, mut of_last) = (0.0, 0);
        for one in self.last.iter().rev() {
            last += one.error * one.error * one.samples as f64;
            of_last += one.samples;
        }
        let Self { steps_per_sample, squares, samples, .. } = *self;
        (samples > 0.0).then(|| StepErrors {
            steps_per_sample,
            error: (squares / samples).sqrt(),
            at_the_end: (last / of_last as f64).sqrt(),
            squares,
            samples,
        })
    }
}

impl StepErrors {
    /// The error and what to write, in a line of a terminal.
    pub fn in_brief(&self) -> String {
        let steps = self.steps_per_sample.and_then(|_| self.enough());
        let write = steps.map_or_else(String::new, |steps| format!("write `steps = {steps}`, or "));
        let error = percent(self.error.max(self.at_the_end));
        format!("the integration step adds {error} of the claim: {write}sample faster")
    }
}

fn percent(error: f64) -> String {
    format!("{:.0} %", 100.0 * error)
}

impl fmt::Display for StepErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { steps_per_sample, error, at_the_end, .. } = self;
        match steps_per_sample {
            Some(steps) => write!(f, "the integration step, {steps} from each sample to the next,")?,
            None => write!(
                f,
                "the integration step, up to 64 from each sample to the next as kinks of the equations need them,"
            )?,
        }
        write!(f, " adds an error of {} of the claimed standard deviation", percent(*error))?;
        if *at_the_end > 1.5 * error || *error <= REMARKABLE {
            write!(f, ", and of {} at the end", percent(*at_the_end))?;
        }
        match (steps_per_sample, self.enough()) {
            (Some(_), Some(steps)) => {
                write!(f, ": write `steps = {steps}` in the table of the filter, or sample faster")
            }
            (Some(_), None) => write!(f, ": sample faster"),
            (None, _) => write!(f, ": sample faster; `steps` has no effect on equations with kinks"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{StepError, TrajectoryKind};

    fn errors(each: &[f64]) -> Option<StepErrors> {
        errors_where(true, each)
    }

    /// Of a filter with one step from each sample to the next, or with as many as kinks need.
    fn errors_where(is_taken: bool, each: &[f64]) -> Option<StepErrors> {
        let mut trajectory =
            Trajectory::blank(("ekf", "EKF"), TrajectoryKind::Filtered, (&[], &[], &(0..0)), &[]);
        trajectory.steps.begin(0.0, 1, is_taken);
        trajectory.step_errors = (1..)
            .zip(each)
            .map(|(k, error)| StepError { until_s: f64::from(k), samples: 256, error: *error })
            .collect();
        StepErrors::of(&trajectory, 2.0)
    }

    #[test]
    fn an_error_that_grows_to_the_end_is_judged_by_its_end() {
        let growing: Vec<f64> = (0..100).map(|k| 0.004 * f64::from(k)).collect();
        let found = errors(&growing).unwrap();
        assert!(found.is_large() && found.error < 0.25 && found.at_the_end > 0.35, "{found:?}");
        let text = found.to_string();
        assert!(text.contains("at the end") && text.contains("`steps = 4`"), "{text}");
        let steady = errors(&[9.0, 0.1, 0.1]).unwrap();
        assert!(steady.is_remarkable() && !steady.is_large() && (steady.error - 0.1).abs() < 1e-15);
        // Remarked on for its end, it is printed with that.
        let growing: Vec<f64> = (0..100).map(|k| 0.036 + 0.0002 * f64::from(k)).collect();
        let found = errors(&growing).unwrap();
        assert!(found.is_remarkable() && found.error < 0.05 && found.to_string().contains("at the end"));
        assert!(!errors(&[0.01, 0.01]).unwrap().is_remarkable());
        assert!(errors(&[0.1, f64::NAN]).unwrap().is_large());
        assert!(errors(&[0.1]).is_none());
    }

    #[test]
    fn errors_that_become_known_part_by_part_are_those_of_the_whole() {
        let mut whole = Trajectory::blank(("ekf", "EKF"), TrajectoryKind::Filtered, (&[], &[], &(0..0)), &[]);
        whole.steps.begin(0.0, 2, true);
        let error = |k: usize| StepError { until_s: k as f64, samples: 256, error: 1e-3 * k as f64 };
        whole.step_errors = (0..100).map(error).collect();
        let mut record = StepErrorRecord::default();
        for one in &whole.step_errors {
            record.take(&Trajectory { step_errors: vec![*one], ..whole.clone() }, 3.0);
            assert!(record.last.len() <= END / 256, "{record:?}");
        }
        let found = record.errors().unwrap();
        assert_eq!(found, StepErrors::of(&whole, 3.0).unwrap());
        // Means of squares: of 3 to 99, and of the last 16 of them, 84 to 99.
        let mean =
            |from: u32| (from..100).map(|k| 1e-6 * f64::from(k * k)).sum::<f64>() / f64::from(100 - from);
        let expected = [mean(3), mean(84)].map(f64::sqrt);
        assert!((found.error / expected[0] - 1.0).abs() < 1e-12, "{found:?} {expected:?}");
        assert!((found.at_the_end / expected[1] - 1.0).abs() < 1e-12, "{found:?} {expected:?}");
    }

    /// `steps` changes nothing where kinks ask for a number of steps at each sample.
    #[test]
    fn a_filter_that_follows_kinks_is_not_advised_to_take_more_steps() {
        let mut found = errors_where(false, &[9.0, 0.1, 0.1]).unwrap();
        let text = found.to_string();
        assert!(
            text.contains("as kinks of the equations need them") && text.contains("sample faster"),
            "{text}"
        );
        assert!(!text.contains("`steps = "), "{text}");
        found.pool(&errors_where(false, &[9.0, 0.3, 0.3]).unwrap());
        assert!(found.is_large() && !found.to_string().contains("`steps = "), "{found}");
    }
}
