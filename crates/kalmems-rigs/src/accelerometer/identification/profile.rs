//! Where each of the parameters may lie, by the likelihood itself.

use super::likelihood::{Likelihood, unknown};
use super::search::{FARTHEST, LikelihoodMaximum, LikelihoodSearchError, search_from};
use crate::identify;
use crate::progress::Progress;
use unknown::COUNT;

/// The ends of an interval of 95 % of a logarithm, from its likeliest value; infinite where nothing sets one.
pub type Ends = [f64; 2];

/// The intervals of all parameters by their profiles: where ln p, with all others as likely as they can be, has fallen by ½·1.96².
///
/// Far from the maximum the likelihood of what is hardly known is no Gaussian: it has a limit on one side and none on the other, or bends.
/// Fisher's information knows its curvature at the top alone.
pub fn profiles(
    likelihood: &Likelihood,
    found: &LikelihoodMaximum,
    progress: &dyn Progress,
) -> Result<[Ends; COUNT], LikelihoodSearchError> {
    let mut all = [[f64::NEG_INFINITY, f64::INFINITY]; COUNT];
    for (index, ends) in all.iter_mut().enumerate() {
        for (end, side) in ends.iter_mut().zip([-1.0, 1.0]) {
            *end = side * reach(likelihood, found, (index, side), progress)?;
        }
    }
    Ok(all)
}

/// How far a logarithm may go to one side.
fn reach(
    likelihood: &Likelihood,
    found: &LikelihoodMaximum,
    (index, side): (usize, f64),
    progress: &dyn Progress,
) -> Result<f64, LikelihoodSearchError> {
    let room = FARTHEST - side * found.logs[index];
    identify::likelihood_half_width(found.covariance.standard_deviation(index), room, &mut |distance| {
        fallen(likelihood, found, (index, side * distance), progress)
    })
}

/// √(2·fall) of ln p with a logarithm so far from its likeliest value; infinite where there is no filter.
fn fallen(
    likelihood: &Likelihood,
    found: &LikelihoodMaximum,
    (index, by): (usize, f64),
    progress: &dyn Progress,
) -> Result<f64, LikelihoodSearchError> {
    let c = &found.covariance;
    let along = |i: usize| if i == index { by } else { by * c.get(i, index) / c.get(index, index) };
    let start = std::array::from_fn(|i| (found.logs[i] + along(i)).clamp(-FARTHEST, FARTHEST));
    let top = found.log_likelihood;
    let from = |log_likelihood: f64| (2.0 * (top - log_likelihood)).max(0.0).sqrt();
    match search_from(likelihood, start, std::array::from_fn(|i| i == index), progress) {
        Ok(there) => Ok(from(there.log_likelihood)),
        Err(LikelihoodSearchError::Interrupted) => Err(LikelihoodSearchError::Interrupted),
        Err(LikelihoodSearchError::Likelihood(_)) => Ok(f64::INFINITY),
    }
}
