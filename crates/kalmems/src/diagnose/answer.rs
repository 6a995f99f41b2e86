//! What a change makes of the answer.

use super::trial::{AnswerSign, DiagnosisTrial, TurnedAnswer};
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
    let turned = turned(from, to);
    let answer = turned.as_deref().unwrap_or(&to.answer);
    let is_opposite =
        turned.is_none() && from.sign == AnswerSign::Arbitrary && are_opposite(&from.answer, answer);
    let sign = if is_opposite { -1.0 } else { 1.0 };
    let whole = |apart: f64| from.period.map_or(0.0, |period| period * (apart / period).round());
    let apart = answer.iter().zip(&from.answer).map(|(b, a)| sign * b - a);
    apart.map(|apart| apart - whole(apart)).collect()
}

/// The second answer after the hidden turns that bring its trajectories nearest to those of the first one; `None` without a hidden turn.
fn turned(from: &DiagnosisTrial, to: &DiagnosisTrial) -> Option<Vec<f64>> {
    if from.turned.is_empty() || from.turned.len() != to.turned.len() {
        return None;
    }
    let mut answer = Vec::with_capacity(to.answer.len());
    for (from, TurnedAnswer { trajectory, place, scored }) in from.turned.iter().zip(&to.turned) {
        let turned = from.trajectory.turned_like(trajectory)?;
        answer.extend(turned.states.get(*place)?.mean.get(scored.clone())?);
    }
    (answer.len() == to.answer.len()).then_some(answer)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{Trajectory, TrajectoryKind, TurnedStates};
    use crate::units::kind;
    use std::f64::consts::TAU;

    /// An ellipse, 2 m long and 1 m wide times a factor, turned by an angle in rad; the answer is its first axis.
    fn trial(angle: f64, factor: f64) -> DiagnosisTrial {
        let time_s: Vec<f64> = (0..400).map(f64::from).collect();
        let states = [("x", "m", &kind::LENGTH), ("y", "m", &kind::LENGTH)];
        let all = (&time_s[..], &time_s[..], &(0..400));
        let mut of = Trajectory::blank(("a", "A"), TrajectoryKind::Filtered, all, &states);
        let (sine, cosine) = angle.sin_cos();
        for (k, t) in time_s.iter().enumerate() {
            let (x, y) = (2.0 * factor * (TAU * t / 100.0).cos(), factor * (TAU * t / 100.0).sin());
            of.states[0].mean[k] = cosine * x - sine * y;
            of.states[1].mean[k] = sine * x + cosine * y;
        }
        of.hidden_turns = vec![vec![TurnedStates { places: [0, 1], rate: 1.0 }]];
        let scored = 100..400;
        let mut trial = DiagnosisTrial::default();
        trial.answer = of.states[0].mean[scored.clone()].to_vec();
        (trial.answer_sd, trial.answer_time_s) = (vec![0.01; 300], time_s[scored.clone()].to_vec());
        trial.turned.push(TurnedAnswer { trajectory: of, place: 0, scored });
        trial
    }

    #[test]
    fn answers_that_a_hidden_turn_tells_apart_differ_by_what_is_left_after_it() {
        let from = trial(0.0, 1.0);
        assert!(moved(&from, &trial(1.7, 1.0)) < 1e-6);
        // 1 % larger, whatever the turn is.
        let of_rms = (from.answer.iter().map(|x| x * x).sum::<f64>() / 300.0).sqrt();
        let change = AnswerChange::between(&from, &trial(-2.0, 1.01)).unwrap();
        assert!((change.rms / (0.01 * of_rms) - 1.0).abs() < 1e-4, "{change:?} {of_rms}");
        assert!((change.scale - 0.01).abs() < 1e-5, "{change:?}");
        // Of answers that are known to be what they are the whole difference counts.
        let known = |mut trial: DiagnosisTrial| {
            trial.turned.clear();
            trial
        };
        assert!(moved(&known(from), &known(trial(1.7, 1.0))) > 1.0);
    }
}
