//! The most likely parameters.

use super::likelihood::{Likelihood, LikelihoodError, unknown};
use crate::estimate::Progress;
use kalmems_core::adapt::Score;
use kalmems_core::{Covariance, Dual, Ldl, Mat};
use std::ops::ControlFlow;
use unknown::COUNT;

type Number = Dual<f64, COUNT>;

/// Where the likelihood is largest, and what the recording says there.
#[derive(Clone, Debug)]
pub struct Found {
    /// The logarithms of the factors.
    pub logs: [f64; COUNT],
    /// Their covariance: the inverse of Fisher's information.
    pub covariance: Covariance<f64, COUNT>,
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
}

/// Why the search has no end.
#[derive(Debug, thiserror::Error)]
pub enum SearchError {
    /// Nothing can be computed where it begins.
    #[error("the likelihood cannot be computed at the values of the experiment: {0}")]
    Likelihood(#[from] LikelihoodError),
    /// The information is singular.
    #[error(
        "the recording does not tell spring, damping, mass and noise apart; record with a dither on the feedback, or \
         for longer"
    )]
    Inseparable,
    /// It ran away, or crept.
    #[error(
        "the likelihood has no maximum near the values of the experiment after {0} steps; give better ones"
    )]
    Endless(usize),
    /// Stopped from outside.
    #[error("interrupted")]
    Interrupted,
}

/// The longest step of a logarithm: a factor of 1.6.
const LONGEST: f64 = 0.5;
/// A step below this share of the standard error ends the search.
const SETTLED: f64 = 1e-3;
/// Steps, and halvings of one.
const STEPS: usize = 60;
const HALVINGS: usize = 30;

/// Fisher's scoring, θ + I⁻¹·∂ ln p/∂θ, with steps that are held and halved until the likelihood grows (Gupta and Mehra,
/// IEEE Trans. Automatic Control 19, 774, 1974).
pub fn search(likelihood: &Likelihood, progress: &dyn Progress) -> Result<Found, SearchError> {
    let mut at = Pass::of(likelihood, [0.0; COUNT])?;
    let at_start = at.log_likelihood;
    let mut passes = 1;
    for _ in 0..STEPS {
        if progress.reached(0) == ControlFlow::Break(()) {
            return Err(SearchError::Interrupted);
        }
        let step = at.score.step().ok_or(SearchError::Inseparable)?;
        let shares = step.change.iter().zip(step.standard_deviation).map(|(change, sd)| (change / sd).abs());
        if shares.fold(0.0, f64::max) < SETTLED {
            return at.end(likelihood, at_start, passes);
        }
        let longest = step.change.iter().fold(0.0_f64, |most, change| most.max(change.abs()));
        let mut share = (LONGEST / longest).min(1.0);
        let mut better = None;
        for _ in 0..HALVINGS {
            let logs = std::array::from_fn(|i| at.logs[i] + share * step.change[i]);
            passes += 1;
            // Parameters without a settled filter are as good as impossible.
            better = Pass::of(likelihood, logs).ok().filter(|next| next.log_likelihood > at.log_likelihood);
            if better.is_some() {
                break;
            }
            share *= 0.5;
        }
        match better {
            Some(next) => at = next,
            // No digit of the likelihood is left to gain.
            None => return at.end(likelihood, at_start, passes),
        }
    }
    Err(SearchError::Endless(STEPS))
}

/// The likelihood at one set of parameters with its slope.
struct Pass {
    logs: [f64; COUNT],
    log_likelihood: f64,
    score: Score<f64, COUNT>,
    moves: Covariance<f64, COUNT>,
    claimed: f64,
    samples: usize,
}

impl Pass {
    fn of(likelihood: &Likelihood, logs: [f64; COUNT]) -> Result<Self, LikelihoodError> {
        let (mut total, mut samples, mut score) = (0.0, 0, Score::new());
        let mut moves = Covariance::<f64, COUNT>::zero();
        let claimed = likelihood.follow(&Number::variables(&logs), &mut |innovation, acceleration| {
            score.add(innovation);
            total += innovation.log_likelihood().value();
            samples += 1;
            let by = acceleration.gradient();
            moves = moves.plus(&Covariance::from_lower(Mat::from_fn(|i, j| by[i] * by[j])));
        })?;
        let mean = |i: usize, j: usize| moves.get(i, j) / f64::from(samples.max(1));
        Ok(Self {
            logs,
            log_likelihood: total,
            score,
            moves: Covariance::from_lower(Mat::from_fn(mean)),
            claimed: claimed.value(),
            samples: samples as usize,
        })
    }

    fn end(self, likelihood: &Likelihood, at_start: f64, passes: usize) -> Result<Found, SearchError> {
        let mut innovations = Vec::with_capacity(self.samples);
        likelihood.follow(&self.logs, &mut |innovation, _: f64| {
            innovations.push(innovation.residual[0] / innovation.covariance.standard_deviation(0));
        })?;
        Ok(Found {
            covariance: inverse(self.score.information()).ok_or(SearchError::Inseparable)?,
            logs: self.logs,
            log_likelihood: self.log_likelihood,
            at_start,
            samples: self.samples,
            innovations,
            claimed: self.claimed,
            moves: self.moves,
            passes,
        })
    }
}

/// The inverse of an information, in units of each parameter's own.
fn inverse(information: &Covariance<f64, COUNT>) -> Option<Covariance<f64, COUNT>> {
    let unit: [f64; COUNT] = std::array::from_fn(|i| information.get(i, i).sqrt().recip());
    let scaled = Mat::<f64, COUNT, COUNT>::from_fn(|i, j| information.get(i, j) * unit[i] * unit[j]);
    let ldl = Ldl::of(&Covariance::from_lower(scaled));
    let columns: [[f64; COUNT]; COUNT] =
        std::array::from_fn(|j| ldl.solve(&std::array::from_fn(|i| f64::from(u8::from(i == j)))));
    (ldl.positive && unit.iter().all(|unit| unit.is_finite()))
        .then(|| Covariance::from_lower(Mat::from_fn(|i, j| columns[j][i] * unit[i] * unit[j])))
}
