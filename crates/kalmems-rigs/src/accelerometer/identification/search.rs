//! The most likely parameters.

use super::likelihood::{Likelihood, LikelihoodError, unknown};
use crate::progress::Progress;
use kalmems_core::adapt::Score;
use kalmems_core::{Covariance, Dual, Ldl, Mat};
use std::ops::ControlFlow;
use unknown::COUNT;

type ParameterDual = Dual<f64, COUNT>;

/// Where the likelihood is largest, and what the recording says there.
#[derive(Clone, Debug)]
pub struct LikelihoodMaximum {
    /// The logarithms of the factors.
    pub logs: [f64; COUNT],
    /// Their covariance: the inverse of Fisher's information and of how far a search may go. What the recording does not tell is known to
    /// that alone, and so is what depends on it.
    pub covariance: Covariance<f64, COUNT>,
    /// Which ran to their bound: the recording does not tell them.
    pub at_bound: [bool; COUNT],
    /// ln p of what is counted.
    pub log_likelihood: f64,
    /// The same where the search began.
    pub at_start: f64,
    /// Samples that are counted.
    pub samples: usize,
    /// Innovations over their standard deviation.
    pub innovations: Vec<f64>,
    /// What the filter claims of the acceleration, a standard deviation in m/s².
    pub claimed: f64,
    /// The mean of ∂a/∂θᵢ·∂a/∂θⱼ over the samples, in (m/s²)²: by how much the parameters move the acceleration.
    pub moves: Covariance<f64, COUNT>,
    /// Likelihoods that were computed.
    pub passes: usize,
    /// Whether the search came to its end, and not to its last step.
    pub is_settled: bool,
}

impl LikelihoodMaximum {
    /// How the errors of two unknowns hang together.
    pub fn correlation(&self, i: usize, j: usize) -> f64 {
        let c = &self.covariance;
        c.get(i, j) / (c.get(i, i) * c.get(j, j)).sqrt()
    }
}

/// Why the search has no end.
#[derive(Debug, thiserror::Error)]
pub enum LikelihoodSearchError {
    /// Nothing can be computed where it begins.
    #[error("the likelihood cannot be computed at the values of the experiment: {0}")]
    Likelihood(#[from] LikelihoodError),
    /// Stopped from outside.
    #[error("interrupted")]
    Interrupted,
}

/// The longest step of a logarithm: a factor of 1.6.
const LONGEST: f64 = 0.5;
/// How far a logarithm may go: to a quarter, or four times as much.
pub const FARTHEST: f64 = 1.386;
/// A step below this share of the standard error ends the search.
const SETTLED: f64 = 1e-3;
/// A gain of ln p below this is none: a step of a seventieth of a standard error.
const NEXT_TO_NOTHING: f64 = 1e-4;
/// Steps, and halvings of one.
const STEPS: usize = 60;
const HALVINGS: usize = 30;

/// Fisher's scoring, θ + I⁻¹·∂ ln p/∂θ, with steps that are held and halved until the likelihood grows (Gupta and Mehra,
/// IEEE Trans. Automatic Control 19, 774, 1974).
pub fn search(
    likelihood: &Likelihood,
    progress: &dyn Progress,
) -> Result<LikelihoodMaximum, LikelihoodSearchError> {
    search_from(likelihood, [0.0; COUNT], [false; COUNT], progress)
}

/// The same from here on, with some of the logarithms kept.
pub fn search_from(
    likelihood: &Likelihood,
    start: [f64; COUNT],
    kept: [bool; COUNT],
    progress: &dyn Progress,
) -> Result<LikelihoodMaximum, LikelihoodSearchError> {
    let mut at = LikelihoodPass::of(likelihood, start)?;
    let at_start = at.log_likelihood;
    let mut passes = 1;
    let mut gain = f64::INFINITY;
    let mut taken = 0;
    loop {
        if progress.reached(0) == ControlFlow::Break(()) {
            return Err(LikelihoodSearchError::Interrupted);
        }
        let held = at.held(kept);
        let covariance = inverse(at.score.information(), held);
        let score = at.score.score();
        let change: [f64; COUNT] =
            std::array::from_fn(|i| (0..COUNT).map(|j| covariance.get(i, j) * score[j]).sum());
        let settled = |i: usize| change[i].abs() <= SETTLED * covariance.standard_deviation(i);
        let is_settled = (0..COUNT).all(settled) || gain < NEXT_TO_NOTHING;
        if is_settled || taken == STEPS {
            return at.end(likelihood, held, at_start, (passes, is_settled));
        }
        let longest = change.iter().fold(0.0_f64, |most, change| most.max(change.abs()));
        let mut share = (LONGEST / longest).min(1.0);
        let mut better = None;
        for _ in 0..HALVINGS {
            let logs = std::array::from_fn(|i| (at.logs[i] + share * change[i]).clamp(-FARTHEST, FARTHEST));
            passes += 1;
            // Parameters without a settled filter are as good as impossible.
            better = LikelihoodPass::of(likelihood, logs)
                .ok()
                .filter(|next| next.log_likelihood > at.log_likelihood);
            if better.is_some() {
                break;
            }
            share *= 0.5;
        }
        match better {
            Some(next) => {
                gain = next.log_likelihood - at.log_likelihood;
                at = next;
            }
            // No digit of the likelihood is left to gain.
            None => return at.end(likelihood, held, at_start, (passes, true)),
        }
        taken += 1;
    }
}

/// The likelihood at one set of parameters with its slope.
struct LikelihoodPass {
    logs: [f64; COUNT],
    log_likelihood: f64,
    score: Score<f64, COUNT>,
    moves: Covariance<f64, COUNT>,
    claimed: f64,
    samples: usize,
}

impl LikelihoodPass {
    fn of(likelihood: &Likelihood, logs: [f64; COUNT]) -> Result<Self, LikelihoodError> {
        let (mut total, mut samples, mut score) = (0.0, 0_usize, Score::new());
        let mut moves = Covariance::<f64, COUNT>::zero();
        let claimed =
            likelihood.follow(&ParameterDual::variables(&logs), &mut |innovation, acceleration| {
                score.add(innovation);
                total += innovation.log_likelihood().value();
                samples += 1;
                let by = acceleration.gradient();
                moves = moves.plus(&Covariance::from_lower(Mat::from_fn(|i, j| by[i] * by[j])));
            })?;
        let mean = |i: usize, j: usize| moves.get(i, j) / samples.max(1) as f64;
        Ok(Self {
            logs,
            log_likelihood: total,
            score,
            moves: Covariance::from_lower(Mat::from_fn(mean)),
            claimed: claimed.value(),
            samples,
        })
    }

    /// What is kept, and what stands at a bound that the likelihood would have it cross.
    fn held(&self, kept: [bool; COUNT]) -> [bool; COUNT] {
        let score = self.score.score();
        let crosses = |i: usize| self.logs[i].abs() >= FARTHEST && self.logs[i] * score[i] > 0.0;
        std::array::from_fn(|i| kept[i] || crosses(i))
    }

    fn end(
        self,
        likelihood: &Likelihood,
        at_bound: [bool; COUNT],
        at_start: f64,
        (passes, is_settled): (usize, bool),
    ) -> Result<LikelihoodMaximum, LikelihoodSearchError> {
        let mut innovations = Vec::with_capacity(self.samples);
        likelihood.follow(&self.logs, &mut |innovation, _: f64| {
            innovations.push(innovation.residual[0] / innovation.covariance.standard_deviation(0));
        })?;
        Ok(LikelihoodMaximum {
            covariance: inverse(self.score.information(), [false; COUNT]),
            at_bound,
            logs: self.logs,
            log_likelihood: self.log_likelihood,
            at_start,
            samples: self.samples,
            innovations,
            claimed: self.claimed,
            moves: self.moves,
            passes,
            is_settled,
        })
    }
}

/// The inverse of what a recording tells of the logarithms, and of how far each may go at all; zero for those that are held.
///
/// Without the second there is no inverse of what is not determined; with it a logarithm is known to ±[`FARTHEST`] where nothing else tells
/// it, and one that only its ratio to another is known of moves with that.
fn inverse(information: &Covariance<f64, COUNT>, held: [bool; COUNT]) -> Covariance<f64, COUNT> {
    let within = FARTHEST.powi(-2);
    let own = |i: usize| information.get(i, i) + within;
    let unit: [f64; COUNT] = std::array::from_fn(|i| if held[i] { 0.0 } else { own(i).sqrt().recip() });
    let scaled = Mat::<f64, COUNT, COUNT>::from_fn(|i, j| {
        if i == j { 1.0 } else { information.get(i, j) * unit[i] * unit[j] }
    });
    let ldl = Ldl::of(&Covariance::from_lower(scaled));
    let columns: [[f64; COUNT]; COUNT] =
        std::array::from_fn(|j| ldl.solve(&std::array::from_fn(|i| f64::from(u8::from(i == j)))));
    Covariance::from_lower(Mat::from_fn(|i, j| columns[j][i] * unit[i] * unit[j]))
}
