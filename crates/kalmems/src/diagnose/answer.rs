//! What a change makes of the answer.

use super::trial::{AnswerSign, DiagnosisTrial};
use crate::estimate::are_opposite;
use crate::evaluate::{ErrorDecomposition, ErrorSeries};
use crate::progress::Interruption;
use serde::Serialize;

/// The root mean square by which the answers of two runs over the same samples differ, in SI; 0 where they have none in common.
pub(super) fn moved(from: &DiagnosisTrial, to: &DiagnosisTrial) -> f64 {
    let differences = differences(from, to).into_iter().filter(|d| d.is_finite());
    let (count, sum) = differences.fold((0.0, 0.0), |(count, sum), d| (count + 1.0, sum + d * d));
    (sum / f64::max(count, 1.0)).sqrt()
}

/// The second answer minus the first one, in SI, on one branch if the signals do not tell which it is, and without whole turns of what comes round.
fn differences(from: &DiagnosisTrial, to: &DiagnosisTrial) -> Vec<f64> {
    let is_opposite = from.sign == AnswerSign::Arbitrary && are_opposite(&from.answer, &to.answer);
    let sign = if is_opposite { -1.0 } else { 1.0 };
    let whole = |apart: f64| from.period.map_or(0.0, |period| period * (apart / period).round());
    let apart = to.answer.iter().zip(&from.answer).map(|(b, a)| sign * b - a);
    apart.map(|apart| apart - whole(apart)).collect()
}

/// How an answer differs from another one of the same samples: Δx = offset + scale·x + early·ẋ and a rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AnswerChange {
    /// The root mean square of the difference, in SI.
    pub rms: f64,
    /// What is added everywhere, in SI.
    pub offset: f64,
    /// By which part it becomes larger.
    pub scale: f64,
    /// By how much it becomes earlier, in s.
    pub early_s: f64,
    /// The share of the mean square difference that these three explain.
    pub share: f64,
    /// The root mean square of the answer itself about its mean, in SI.
    pub of_rms: f64,
    /// The root mean square of the standard deviation that the filter claims of it, in SI.
    pub claimed: f64,
}

impl AnswerChange {
    /// From one answer to another; `None` where they have no samples in common.
    pub(super) fn between(from: &DiagnosisTrial, to: &DiagnosisTrial) -> Option<Self> {
        if from.answer.len() != to.answer.len() || !from.is_its_own() {
            return None;
        }
        let difference = differences(from, to);
        let mean_square = |values: &mut dyn Iterator<Item = f64>| {
            let (count, sum) =
                values.filter(|v| v.is_finite()).fold((0.0, 0.0), |(n, s), v| (n + 1.0, s + v * v));
            (count > 0.0).then(|| sum / count)
        };
        let square = mean_square(&mut difference.iter().copied())?;
        let (count, sum) = (from.answer.iter().filter(|x| x.is_finite()))
            .fold((0.0, 0.0), |(count, sum), x| (count + 1.0, sum + x));
        let mean = sum / f64::max(count, 1.0);
        let of_rms = mean_square(&mut from.answer.iter().map(|x| x - mean))?.sqrt();
        let claimed = mean_square(&mut from.answer_sd.iter().copied()).unwrap_or(0.0).sqrt();
        let none =
            Self { rms: square.sqrt(), offset: 0.0, scale: 0.0, early_s: 0.0, share: 0.0, of_rms, claimed };
        let series = ErrorSeries { time_s: from.answer_time_s.clone(), error: difference, sd: Vec::new() };
        Some(ErrorDecomposition::of(&series, &from.answer, &Interruption::never()).map_or(none, |found| {
            Self {
                offset: found.bias,
                scale: found.scale,
                early_s: found.early_s,
                share: found.share,
                ..none
            }
        }))
    }

    /// That of a change which is so many times as large.
    #[must_use]
    pub(super) fn times(self, factor: f64) -> Self {
        Self {
            rms: factor * self.rms,
            offset: factor * self.offset,
            scale: factor * self.scale,
            early_s: factor * self.early_s,
            ..self
        }
    }
}
