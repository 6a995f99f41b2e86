//! What became of a parameter that is a state.

use crate::estimate::{StateSeries, TrackedPrior};
use serde::Serialize;

/// A parameter that is a state, as a filter left it. It is a deviation from what the device table says: of a factor relative
/// to it, else in SI.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterAnswer {
    /// The parameter, by its name.
    #[serde(skip)]
    pub name: &'static str,
    /// The unit of its deviation, as column names have it.
    pub unit: &'static str,
    /// Its standard deviation before the recording.
    pub start_sd: f64,
    /// Its mean at the end.
    pub end: f64,
    /// Its standard deviation at the end.
    pub end_sd: f64,
    /// What speaks against it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fault: Option<ParameterFault>,
}

/// What speaks against a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum ParameterFault {
    /// It is further from what was known before than that allows.
    FarFromStart {
        /// In standard deviations of the start.
        deviations: f64,
    },
    /// It is a factor that has changed its sign.
    WrongSign,
    /// It still moves at the end, more than its standard deviation allows.
    StillMoving {
        /// By how much over the last fifth of the recording.
        moved: f64,
        /// By how much it may, one standard deviation.
        sd: f64,
    },
}

/// Standard deviations from which on something speaks against a parameter.
const FAR: f64 = 5.0;

/// Values that are kept at most; where they are full, every second one is dropped.
const KEPT: usize = 64;

/// A parameter on its way.
#[derive(Clone)]
pub(super) struct ParameterRecord {
    prior: TrackedPrior,
    unit: &'static str,
    /// Times in s with mean and standard deviation.
    kept: Vec<[f64; 3]>,
    every: usize,
    seen: usize,
    last: [f64; 3],
}

impl ParameterRecord {
    pub(super) fn new(prior: TrackedPrior, unit: &'static str) -> Self {
        Self { prior, unit, kept: Vec::new(), every: 1, seen: 0, last: [f64::NAN; 3] }
    }

    /// Takes its values over new samples in.
    pub(super) fn take(&mut self, time_s: &[f64], state: &StateSeries) {
        for ((time_s, mean), sd) in time_s.iter().zip(&state.mean).zip(&state.sd) {
            if !mean.is_finite() {
                continue;
            }
            self.last = [*time_s, *mean, *sd];
            if self.kept.len() == KEPT && self.seen.is_multiple_of(self.every) {
                let mut places = 0..;
                self.kept.retain(|_| places.next().is_some_and(|place: usize| place.is_multiple_of(2)));
                self.every *= 2;
            }
            if self.seen.is_multiple_of(self.every) {
                self.kept.push(self.last);
            }
            self.seen += 1;
        }
    }

    /// What became of it; `None` without a value.
    pub(super) fn answer(&self) -> Option<ParameterAnswer> {
        let TrackedPrior { name, sd: start_sd, .. } = self.prior;
        let [_, end, end_sd] = self.last;
        let fault = self.fault();
        end.is_finite().then_some(ParameterAnswer { name, unit: self.unit, start_sd, end, end_sd, fault })
    }

    fn fault(&self) -> Option<ParameterFault> {
        let TrackedPrior { sd: start_sd, drift, is_factor, .. } = self.prior;
        let ([first_s, ..], [last_s, end, end_sd]) = (*self.kept.first()?, self.last);
        if is_factor && end < -1.0 {
            return Some(ParameterFault::WrongSign);
        }
        let deviations = end / (start_sd * start_sd + drift * (last_s - first_s)).sqrt();
        if deviations.abs() > FAR {
            return Some(ParameterFault::FarFromStart { deviations });
        }
        // What a filter that is right learns in between has the variance that it loses.
        let late_s = first_s + 0.8 * (last_s - first_s);
        let [from_s, mean, sd] =
            *self.kept.get(self.kept.partition_point(|[time_s, ..]| *time_s < late_s))?;
        let learned = (sd * sd + drift * (last_s - from_s) - end_sd * end_sd).max(0.0);
        let (moved, may) = (end - mean, learned.sqrt());
        // Beside what it claims to know, a move without a claim to learn is rounding.
        (moved.abs() > FAR * may && moved.abs() > end_sd)
            .then_some(ParameterFault::StillMoving { moved, sd: may })
    }
}

impl std::fmt::Display for ParameterFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::FarFromStart { deviations } => write!(
                f,
                "lies {deviations:.1} times its `start_sd` away from the value in the device's table: that value or `start_sd` is wrong, or the \
                 parameter takes up the error of another number"
            ),
            Self::WrongSign => f.write_str("has changed its sign, which that of a device cannot"),
            Self::StillMoving { moved, sd } => write!(
                f,
                "still changes at the end: by {moved:.2e} over the last fifth of the recording, while its standard deviations allow \
                 {sd:.1e}"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::kind;

    fn judged(prior_sd: f64, count: usize, value: impl Fn(f64) -> (f64, f64)) -> ParameterAnswer {
        let prior = TrackedPrior { name: "gain", sd: prior_sd, drift: 0.0, is_factor: true };
        let mut record = ParameterRecord::new(prior, "1");
        let times: Vec<f64> = (0..count).map(|k| k as f64 / count as f64).collect();
        let (mean, sd): (Vec<f64>, Vec<f64>) = times.iter().map(|t| value(*t)).unzip();
        for part in [0..count / 3, count / 3..count] {
            let (mean, sd) = (mean[part.clone()].to_vec(), sd[part.clone()].to_vec());
            let state = StateSeries { name: "gain", unit: "1", kind: &kind::RATIO, mean, sd };
            record.take(&times[part], &state);
        }
        record.answer().unwrap()
    }

    #[test]
    fn a_parameter_that_settles_has_no_fault() {
        for count in [3, 50, 100_000] {
            let answer =
                judged(0.01, count, |t| (0.012 * (1.0 - (-20.0 * t).exp()), 0.01 * (-20.0 * t).exp() + 1e-4));
            assert_eq!(answer.fault, None, "{count}");
            assert_eq!((answer.start_sd, answer.unit), (0.01, "1"));
        }
    }

    #[test]
    fn reasons_against_a_parameter_are_reported() {
        let far = judged(0.01, 1000, |_| (-0.317, 1e-4)).fault;
        assert!(
            matches!(far, Some(ParameterFault::FarFromStart { deviations }) if (deviations + 31.7).abs() < 1e-9)
        );
        assert_eq!(judged(1.0, 1000, |_| (-1.2, 1e-2)).fault, Some(ParameterFault::WrongSign));
        // It claims to know it to 10⁻⁴, and goes on.
        let moving = judged(0.1, 100_000, |t| (0.05 * t, 1e-4)).fault;
        assert!(
            matches!(moving, Some(ParameterFault::StillMoving { moved, .. }) if (0.009..0.012).contains(&moved)),
            "{moving:?}"
        );
        // Moving as it still learns is right.
        let learning = judged(0.1, 100_000, |t| (0.05 * t, 0.1 * (1.0 - 0.9 * t).sqrt())).fault;
        assert_eq!(learning, None);
    }
}
