//! All that is wanted of one filter over one part of a segment.

use super::engine::Followed;
use super::past::FilterPast;
use super::smoothing::{FilteredPart, Lagged, Smoother, Whole};
use super::{Course, EstimateError, FilterBasics, SignalSegment, StateName, Trajectory};
use crate::progress::Progress;
use kalmems_core::Filter;
use std::any::Any;
use std::ops::Range;

/// Which samples of a course are to be taken.
#[derive(Clone, Debug)]
pub struct Samples {
    /// Those that are new.
    pub fresh: Range<usize>,
    /// Whether the segment ends with the last of them.
    pub ends: bool,
    /// The usual interval between them in s.
    pub interval_s: f64,
}

impl Samples {
    /// All that there are, so many of this interval in s.
    pub const fn whole(count: usize, interval_s: f64) -> Self {
        Self { fresh: 0..count, ends: true, interval_s }
    }
}

impl SignalSegment<'_> {
    /// Its samples.
    pub fn samples(&self) -> Samples {
        Samples { fresh: self.fresh.clone(), ends: self.ends, interval_s: self.interval_s }
    }
}

/// A filter and its smoothers on their way.
struct Run<F, const N: usize> {
    followed: Followed<F, N>,
    smoothers: Vec<(&'static str, Smoother<F, N>)>,
}

/// Takes a filter through new samples: the filtered trajectory, and the smoothed ones that are wanted, as far as they are known.
///
/// It goes on where the past left it; `start` gives the filter at the first sample of the segment.
pub fn answers<F, C, const N: usize>(
    (filter, past): (&FilterBasics, &mut FilterPast),
    start: impl FnOnce() -> Result<F, EstimateError>,
    (course, samples): (&mut C, &Samples),
    states: &[StateName; N],
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError>
where
    F: Filter<f64, N> + Clone + Any + Send,
    C: Course<N>,
{
    let mut run = if let Some(run) = past.run.take::<Run<F, N>>() {
        run
    } else {
        let whole = filter.smooth.then(|| ("smoothed", Smoother::Whole(Whole::new())));
        let lag = filter.lag_samples(samples.interval_s);
        let lagged = lag.map(|lag| ("lagged", Smoother::Lagged(Lagged::new(lag))));
        let smoothers = whole.into_iter().chain(lagged).collect();
        Box::new(Run { followed: begun(past, start()?)?, smoothers })
    };
    let names = (filter.key.as_str(), filter.name.as_str());
    let filtered = run.followed.follow(names, course, &samples.fresh, states, progress);
    let mut trajectories = vec![filtered.ok_or(EstimateError::Interrupted)?];
    for (word, smoother) in &mut run.smoothers {
        let (key, name) = (format!("{}_{word}", filter.key), format!("{}, {word}", filter.name));
        let entry = run.followed.entry();
        let (fresh, ends) = (&samples.fresh, samples.ends);
        let part = FilteredPart { entry, fresh, ends, filtered: &trajectories[0] };
        let answer = smoother.take((&key, &name), course, &part, progress);
        trajectories.push(answer.ok_or(EstimateError::Interrupted)?);
    }
    past.left = Some(run.followed.state());
    past.run.put(run);
    Ok(trajectories)
}

/// A filter at the beginning of its way, or where it was left in another run.
fn begun<F: Filter<f64, N> + Clone, const N: usize>(
    past: &mut FilterPast,
    start: F,
) -> Result<Followed<F, N>, EstimateError> {
    match past.left() {
        Some(left) => {
            Followed::resumed(start, left).map_err(|why| EstimateError::Resumed { why: why.to_string() })
        }
        None => Ok(Followed::new(start)),
    }
}

/// Takes a filter through new samples without smoothing, likewise.
pub fn follow<F, C, const N: usize>(
    (filter, past): (&FilterBasics, &mut FilterPast),
    start: impl FnOnce() -> Result<F, EstimateError>,
    (course, samples): (&mut C, &Samples),
    states: &[StateName; N],
    progress: &dyn Progress,
) -> Result<Trajectory, EstimateError>
where
    F: Filter<f64, N> + Clone + Any + Send,
    C: Course<N>,
{
    let mut followed = match past.run.take::<Followed<F, N>>() {
        Some(followed) => followed,
        None => Box::new(begun(past, start()?)?),
    };
    let names = (filter.key.as_str(), filter.name.as_str());
    let trajectory = followed.follow(names, course, &samples.fresh, states, progress);
    past.left = Some(followed.state());
    past.run.put(followed);
    trajectory.ok_or(EstimateError::Interrupted)
}
