//! What a change makes of the answer.

use super::trial::Trial;
use crate::signal::least_squares;
use serde::Serialize;

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
    pub(super) fn between(from: &Trial, to: &Trial) -> Option<Self> {
        if from.answer.len() != to.answer.len() || !from.is_its_own() {
            return None;
        }
        let difference: Vec<f64> = to.answer.iter().zip(&from.answer).map(|(b, a)| b - a).collect();
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
        let own =
            Self { rms: square.sqrt(), offset: 0.0, scale: 0.0, early_s: 0.0, share: 0.0, of_rms, claimed };
        Some(own.explained(from, &difference, mean, square))
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

    fn explained(self, from: &Trial, difference: &[f64], mean: f64, square: f64) -> Self {
        let (times, answer) = (&from.answer_time_s, &from.answer);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a place
        let basis = |place: f64| {
            let k = place as usize;
            let (before, after) = (k.saturating_sub(1), (k + 1).min(answer.len() - 1));
            let rate = (answer[after] - answer[before]) / (times[after] - times[before]);
            // Another segment begins here.
            if rate.is_finite() && times[after] > times[before] {
                [1.0, answer[k] - mean, rate]
            } else {
                [1.0, 0.0, 0.0]
            }
        };
        let places: Vec<f64> = (0..difference.len()).map(|k| k as f64).collect();
        let Some([offset, scale, early_s]) = least_squares(&places, difference, basis) else { return self };
        let (mut left, mut count) = (0.0, 0.0);
        for (place, difference) in places.iter().zip(difference).filter(|(_, d)| d.is_finite()) {
            let [one, x, rate] = basis(*place);
            left += (difference - offset * one - scale * x - early_s * rate).powi(2);
            count += 1.0;
        }
        let share = if square > 0.0 { 1.0 - left / count / square } else { 0.0 };
        Self { offset: offset - scale * mean, scale, early_s, share, ..self }
    }
}
