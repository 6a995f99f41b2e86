//! Which of the likeliest numbers are put into the experiment.

use super::likelihood_search::{DETERMINED, LikelihoodSearch};
use crate::diagnose::answer::{AnswerChange, moved};
use crate::diagnose::search::MostLikelySizes;
use crate::diagnose::suspect::Suspect;
use crate::diagnose::trial::{DiagnosisTrial, TrialBlocks};
use crate::identify::{CONNECTED, LikelihoodSolution, NumberStatus, TWO_SIDED, joint_number_statuses};
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// With this probability a recording of the device as it is stated does not speak against it.
const SPEAKS: f64 = 0.99;

/// How much of the filter's claimed error what is not known of the numbers may add, where the recordings do not speak against what is
/// stated: with 0.3 of it the error grows by 5 %.
pub(super) const ADDS: f64 = 0.3;

/// The gain of ln p by so many numbers that a recording of the device as it is stated does not exceed but once in a hundred times.
pub(super) fn by_chance(count: f64) -> f64 {
    ChiSquared::new(count).map_or(f64::INFINITY, |law| 0.5 * law.inverse_cdf(SPEAKS))
}

/// What becomes of each number, and why.
///
/// The numbers whose errors hang together by more than 0.3 are one group. A group is written where all of it is determined to 30 %, by
/// [`joint_number_statuses`], and where writing it cannot make the estimate worse than it was:
///
/// - with the numbers of one half of the recordings the innovations of the other half are not less likely than chance allows
///   (cross-validation), and
/// - the recordings speak against what is stated (likelihood ratio, one in a hundred), or what remains unknown of the numbers moves the answer
///   by less than 0.3 of the error that the filter claims, and
/// - the filter does not lose the motion for longer with them than before.
///
/// Nothing is written where the innovations with all that was found still fail a test: the value of a number that stands beside a wrong one, or at
/// which a search has stopped short of the largest likelihood, is off by more than its standard error says.
///
/// Else the experiment keeps what it says. A filter that is told the truth is not made worse by a recording that hardly tells it.
pub(super) struct NumberJudgement {
    /// Of each number.
    pub(super) verdicts: Vec<NumberVerdict>,
    /// The run with all that was found, be it written or not; `None` where the filter cannot be run.
    pub(super) trial: Option<DiagnosisTrial>,
    /// By how much the answer moves from the stated numbers to those that are found.
    pub(super) moves: Option<AnswerChange>,
    /// By how much one standard deviation of what remains unknown of all numbers that are written moves it, root mean square in SI.
    pub(super) remains: Option<f64>,
}

/// What becomes of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberVerdict {
    /// It is written.
    Written,
    /// The search ended where the likelihood still rises.
    NoMaximum,
    /// Another value is nearly as likely.
    SecondMaximum,
    /// The recordings do not tell it.
    Untold,
    /// It depends on another, at this place, that is not told.
    HangsOn(usize),
    /// The recordings agree with what is stated, and tell it too badly to improve the answer.
    Agrees,
    /// With the numbers of one half of the recordings the other half is less likely than before.
    NotConfirmed,
    /// With it the filter loses the motion for longer than before.
    LosesMotion,
    /// With all that was found the innovations still show that something is wrong, so that neither value nor standard error can be
    /// believed.
    Contradicted,
}

impl NumberJudgement {
    /// `None` where the filter cannot be run with what was found.
    pub(super) fn of(
        sought: &LikelihoodSearch,
        suspects: &[Suspect],
        found: &MostLikelySizes,
        ends: &[[f64; 2]],
    ) -> Option<Self> {
        let spread = |i: usize| 0.5 * (ends[i][0] + ends[i][1]) / TWO_SIDED;
        let correlation = |i: usize, j: usize| found.correlation[i][j];
        let likeliest = LikelihoodSolution {
            at: &found.at,
            spread: &spread,
            is_told: &|i| spread(i) < DETERMINED,
            correlation: &correlation,
        };
        let standings = joint_number_statuses(&likeliest, |kept| {
            let start: Vec<f64> =
                (0..suspects.len()).map(|i| if kept[i] { 0.0 } else { found.at[i] }).collect();
            let free: Vec<bool> = kept.iter().map(|kept| !kept).collect();
            sought.refit_blocks(suspects, &start, &free, TrialBlocks::All).map(|there| there.at).ok_or(())
        });
        let no_maximum = found.is_no_maximum();
        let mut verdicts: Vec<NumberVerdict> = match standings {
            _ if no_maximum => vec![NumberVerdict::NoMaximum; suspects.len()],
            Ok(standings) => standings.into_iter().map(NumberVerdict::from).collect(),
            // Beside what is kept there is no filter: nothing is known of the others without it.
            Err(()) => vec![NumberVerdict::Untold; suspects.len()],
        };
        for place in written(&verdicts) {
            if sought.second_maximum(suspects, found, place).is_some() {
                verdicts[place] = NumberVerdict::SecondMaximum;
            }
        }
        let told = with(suspects.len(), found, &written(&verdicts));
        for group in groups(&verdicts, &correlation) {
            if let Some(verdict) = refused(sought, suspects, found, (&group, &told)) {
                for place in &group {
                    verdicts[*place] = verdict;
                }
            }
        }
        let trial = sought.run(suspects, &found.at);
        if trial.as_ref().is_none_or(|trial| !trial.passes()) {
            for place in written(&verdicts) {
                verdicts[place] = NumberVerdict::Contradicted;
            }
        }
        let written: Vec<usize> = written(&verdicts);
        let moved = with(suspects.len(), found, &written);
        let after = sought.run(suspects, &moved)?;
        let moves = AnswerChange::between(sought.base, &after).filter(|_| !written.is_empty());
        let remains = unknown(sought, suspects, found, (&written, &moved)).filter(|_| !written.is_empty());
        Some(Self { verdicts, trial, moves, remains })
    }
}

impl From<NumberStatus> for NumberVerdict {
    fn from(standing: NumberStatus) -> Self {
        match standing {
            NumberStatus::Determined => Self::Written,
            NumberStatus::Undetermined => Self::Untold,
            NumberStatus::DependsOn(other) => Self::HangsOn(other),
        }
    }
}

fn written(verdicts: &[NumberVerdict]) -> Vec<usize> {
    (0..verdicts.len()).filter(|place| verdicts[*place] == NumberVerdict::Written).collect()
}

/// The sizes of these places, and 0 elsewhere.
fn with(count: usize, found: &MostLikelySizes, places: &[usize]) -> Vec<f64> {
    (0..count).map(|place| if places.contains(&place) { found.at[place] } else { 0.0 }).collect()
}

/// Those that are to be written, by groups whose errors hang together.
fn groups(verdicts: &[NumberVerdict], correlation: &dyn Fn(usize, usize) -> f64) -> Vec<Vec<usize>> {
    let mut left = written(verdicts);
    let mut groups = Vec::new();
    while let Some(first) = left.pop() {
        let mut group = vec![first];
        let mut next = 0;
        while let Some(from) = group.get(next).copied() {
            let hangs = |to: &usize| correlation(from, *to).abs() > CONNECTED;
            group.extend(left.iter().copied().filter(hangs));
            left.retain(|to| !group.contains(to));
            next += 1;
        }
        group.sort_unstable();
        groups.push(group);
    }
    groups
}

/// Why a group is not to be written; `told` are all sizes that are to be. Beside the stated value of another number that is wrong a right one
/// would be judged by what it makes up for.
fn refused(
    sought: &LikelihoodSearch,
    suspects: &[Suspect],
    found: &MostLikelySizes,
    (group, told): (&[usize], &[f64]),
) -> Option<NumberVerdict> {
    let free: Vec<bool> = (0..suspects.len()).map(|place| group.contains(&place)).collect();
    let count = group.len() as f64;
    let stated: Vec<f64> = (told.iter().enumerate())
        .map(|(place, size)| if group.contains(&place) { 0.0 } else { *size })
        .collect();
    let likelihood =
        |sizes: &[f64], blocks| sought.run(suspects, sizes).map(|trial| trial.log_likelihood(blocks));
    // By every second block, judged on the others.
    if let Some(half) = sought.refit_blocks(suspects, told, &free, TrialBlocks::Fitted)
        && let Some(before) = likelihood(&stated, TrialBlocks::HeldOut)
    {
        let after = likelihood(&half.at, TrialBlocks::HeldOut).unwrap_or(f64::NEG_INFINITY);
        // Of numbers that are as stated ln p falls by half of a number on the average, and by more than this once in a few hundred times.
        if after < before - count - 3.0 * count.sqrt() {
            return Some(NumberVerdict::NotConfirmed);
        }
    }
    let after = sought.run(suspects, told)?;
    if sought.base.is_its_own() && after.lost_s() > sought.base.lost_s() {
        return Some(NumberVerdict::LosesMotion);
    }
    let gain = after.log_likelihood(TrialBlocks::All) - likelihood(&stated, TrialBlocks::All)?;
    // Where the filter does not follow the motion with what is stated, anything that follows it is better.
    if gain > by_chance(count) || !sought.base.follows() {
        return None;
    }
    let claimed = AnswerChange::between(sought.base, sought.base)?.claimed;
    let unknown = unknown(sought, suspects, found, (group, told)).unwrap_or(f64::INFINITY);
    (unknown > ADDS * claimed).then_some(NumberVerdict::Agrees)
}

/// By how much what is not known of these numbers moves the answer, root mean square in SI: along the independent directions of their errors.
fn unknown(
    sought: &LikelihoodSearch,
    suspects: &[Suspect],
    found: &MostLikelySizes,
    (places, at): (&[usize], &[f64]),
) -> Option<f64> {
    let own = sought.run(suspects, at)?;
    let correlation: Vec<Vec<f64>> = places
        .iter()
        .map(|i| places.iter().map(|j| if i == j { 1.0 } else { found.correlation[*i][*j] }).collect())
        .collect();
    let root = crate::config::cholesky(&correlation)?;
    let mut square = 0.0;
    for direction in 0..places.len() {
        let mut there = at.to_vec();
        for (row, place) in root.iter().zip(places) {
            there[*place] += row[direction] * found.sd[*place];
        }
        let beside = sought.run(suspects, &there)?;
        square += moved(&own, &beside).powi(2);
    }
    Some(square.sqrt())
}
