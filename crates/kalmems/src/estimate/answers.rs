//! All that is wanted of one filter over one segment.

use super::{
    Course, EstimateError, FilterBasics, Lookahead, Progress, StateName, Trajectory, follow, smooth,
};
use kalmems_core::Filter;

/// Takes a filter through a segment from its start: the filtered trajectory, and the smoothed ones that are wanted.
/// `interval_s` is the usual one between samples.
pub fn answers<F: Filter<f64, N> + Copy, C: Course<N>, const N: usize>(
    filter: &FilterBasics,
    start: &F,
    (course, interval_s): (&mut C, f64),
    states: &[StateName; N],
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let names = (filter.key.as_str(), filter.name.as_str());
    let filtered = follow(names, *start, course, states, progress);
    let mut trajectories = vec![filtered.ok_or(EstimateError::Interrupted)?];
    let whole = filter.smooth.then_some((Lookahead::Whole, "smoothed"));
    let lagged = filter.lag_samples(interval_s).map(|lag| (Lookahead::Samples(lag), "lagged"));
    for (lookahead, word) in whole.into_iter().chain(lagged) {
        let (key, name) = (format!("{}_{word}", filter.key), format!("{}, {word}", filter.name));
        trajectories.push(smooth((&key, &name), start, course, &trajectories[0], lookahead));
    }
    Ok(trajectories)
}
