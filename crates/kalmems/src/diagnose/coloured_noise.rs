//! Noise that a sample shares with those before it, as what may be the cause: what of it the innovations show.

use super::change::TrialChange;
use super::trial::DiagnosisTrial;
use crate::config::{Key, written};
use kalmems_core::{Portable, Scalar};
use toml::{Table, Value};

/// Noise of first order with an autocovariance of sd²·e^(−t/time).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ColouredNoiseCause {
    /// Its standard deviation, in the unit of the signal.
    pub(super) sd: f64,
    /// Its correlation time in s.
    pub(super) time_s: f64,
    unit: &'static str,
    /// The correlation times that the recording can tell, in s.
    told_s: [f64; 2],
}

/// Innovations that are looked at, at least.
const LEAST: usize = 256;

/// Standard errors by which the autocorrelation at the first lag has to be positive.
const SEEN: f64 = 5.0;

/// The correlation times that a recording can tell from none, and from an offset that is not the same throughout: from a part of an interval to a
/// part of the recording.
const SHORTEST: f64 = 0.5;
const LONGEST: f64 = 0.1;

impl ColouredNoiseCause {
    /// What the innovations of the first signal show: `None` where neighbours do not have more in common than white noise.
    ///
    /// A filter follows a part of such noise, and what it leaves is smaller and shorter: this is where a search begins.
    pub(super) fn of(trial: &DiagnosisTrial) -> Option<Self> {
        let of_first = trial.innovations.value.iter().zip(&trial.time_s).zip(&trial.is_of_first);
        let (values, times): (Vec<f64>, Vec<f64>) =
            of_first.filter(|(_, is_first)| **is_first).map(|((value, time), _)| (*value, *time)).unzip();
        let known = values.iter().filter(|value| value.is_finite()).count();
        if known < LEAST {
            return None;
        }
        let lasts_s = times.last()? - times.first()?;
        let interval_s = lasts_s / (times.len() - 1) as f64;
        let covariance = |lag: usize| {
            let products = values.iter().zip(values.iter().skip(lag)).map(|(a, b)| a * b);
            products.filter(|product| product.is_finite()).sum::<f64>() / known as f64
        };
        let (variance, first) = (covariance(0), covariance(1));
        // The standard error of an autocorrelation of white noise is 1/√n.
        if first < SEEN * variance / (known as f64).sqrt() {
            return None;
        }
        // Where it has fallen to e⁻¹ of what it is after one sample.
        let fallen = (2..values.len() / 4).find(|lag| covariance(*lag) < (-1.0_f64).portable_exp() * first);
        let lags = fallen.unwrap_or(values.len() / 4) - 1;
        let time_s = (lags as f64).max(1.0) * interval_s;
        let told_s = [SHORTEST * interval_s, LONGEST * lasts_s];
        let cause = Self { sd: first.sqrt(), time_s, unit: trial.signal_unit, told_s };
        cause.is_told().then_some(cause)
    }

    /// Whether the recording can tell noise with this correlation time.
    pub(super) fn is_told(&self) -> bool {
        let [shortest_s, longest_s] = self.told_s;
        self.sd > 0.0 && (shortest_s..longest_s).contains(&self.time_s)
    }

    /// The logarithms of both numbers, which are searched.
    pub(super) fn sizes(&self) -> [f64; 2] {
        [self.sd.portable_ln(), self.time_s.portable_ln()]
    }

    pub(super) fn resized(&self, [sd, time_s]: [f64; 2]) -> Self {
        Self { sd: Scalar::exp(sd), time_s: Scalar::exp(time_s), ..*self }
    }

    /// The same with so many times its standard deviation and its correlation time.
    pub(super) fn times(&self, [sd, time_s]: [f64; 2]) -> Self {
        Self { sd: sd * self.sd, time_s: time_s * self.time_s, ..*self }
    }

    /// The filter's state for it.
    pub(super) fn change(&self) -> TrialChange {
        let key = Key::from("estimate").child("filter").index(0).child("readout").child("coloured_noise");
        let table = Table::from_iter([
            ("sd".to_owned(), written(self.sd, self.unit)),
            ("time".to_owned(), written(self.time_s, "s")),
        ]);
        TrialChange::Key(key, Value::Table(table))
    }

    /// In a few words.
    pub(super) fn name(&self) -> String {
        let Self { sd, time_s, unit, .. } = self;
        format!("coloured noise of {sd:.3e} {unit} with a correlation time of {time_s:.3e} s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_that_hardly_changes_over_the_recording_is_not_told() {
        // 10 000 samples of 1 µs.
        let found = ColouredNoiseCause { sd: 1e-3, time_s: 4e-5, unit: "V", told_s: [5e-7, 1e-3] };
        assert!(found.is_told() && found.times([10.0, 16.0]).is_told());
        let [sd, time] = found.sizes();
        assert!(!found.resized([sd, time + 10.0]).is_told() && !found.times([1.0, 1e-3]).is_told());
    }
}
