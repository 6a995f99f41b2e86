//! Where each of the parameters may lie, by the likelihood itself.

use super::likelihood::{Likelihood, unknown};
use super::search::{FARTHEST, Found, SearchError, search_from};
use crate::progress::Progress;
use unknown::COUNT;

/// 95 % of a Gaussian lie within so many standard deviations.
pub const TWO_SIDED: f64 = 1.959_963_984_540_054;

/// How near the likelihood has to come to what it falls to at the end of an interval, in standard deviations.
const NEAR: f64 = 0.02;

/// Attempts to come as near.
const ATTEMPTS: usize = 8;

/// The ends of an interval of 95 % of a logarithm, from its likeliest value; infinite where nothing sets one.
pub type Ends = [f64; 2];

/// The intervals of all parameters by their profiles: where ln p, with all others as likely as they can be, has fallen by ½·1.96².
///
/// Far from the maximum the likelihood of what is hardly known is no Gaussian: it has a limit on one side and none on the other, or bends.
/// Fisher's information knows its curvature at the top alone.
pub fn profiles(
    likelihood: &Likelihood,
    found: &Found,
    progress: &dyn Progress,
) -> Result<[Ends; COUNT], SearchError> {
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
    found: &Found,
    (index, side): (usize, f64),
    progress: &dyn Progress,
) -> Result<f64, SearchError> {
    let deviation = found.covariance.standard_deviation(index);
    let room = FARTHEST - side * found.logs[index];
    // √(2·fall) of ln p grows in proportion to the distance where it is Gaussian: the next attempt follows from the last one.
    let (mut inside, mut outside) = ((0.0, 0.0), None::<(f64, f64)>);
    let mut distance = TWO_SIDED * deviation;
    for _ in 0..ATTEMPTS {
        distance = distance.min(room);
        let fallen = fallen(likelihood, found, (index, side * distance), progress)?;
        if (fallen - TWO_SIDED).abs() < NEAR {
            return Ok(distance);
        }
        if fallen > TWO_SIDED {
            outside = Some((distance, fallen));
        } else {
            inside = (distance, fallen);
            if distance >= room {
                return Ok(f64::INFINITY);
            }
        }
        distance = match outside {
            Some(outside) => {
                let share = (TWO_SIDED - inside.1) / (outside.1 - inside.1);
                // Never so near to an end that is known that nothing would be learnt.
                inside.0 + share.clamp(0.05, 0.95) * (outside.0 - inside.0)
            }
            None => inside.0 * (1.1 * TWO_SIDED / inside.1.max(0.5 * TWO_SIDED)),
        };
    }
    Ok(outside.map_or(f64::INFINITY, |(distance, _)| distance))
}

/// √(2·fall) of ln p with a logarithm so far from its likeliest value; infinite where there is no filter.
fn fallen(
    likelihood: &Likelihood,
    found: &Found,
    (index, by): (usize, f64),
    progress: &dyn Progress,
) -> Result<f64, SearchError> {
    let c = &found.covariance;
    let along = |i: usize| if i == index { by } else { by * c.get(i, index) / c.get(index, index) };
    let start = std::array::from_fn(|i| (found.logs[i] + along(i)).clamp(-FARTHEST, FARTHEST));
    let top = found.log_likelihood;
    let from = |log_likelihood: f64| (2.0 * (top - log_likelihood)).max(0.0).sqrt();
    match search_from(likelihood, start, std::array::from_fn(|i| i == index), progress) {
        Ok(there) => Ok(from(there.log_likelihood)),
        Err(SearchError::Interrupted) => Err(SearchError::Interrupted),
        Err(SearchError::Likelihood(_)) => Ok(f64::INFINITY),
    }
}
