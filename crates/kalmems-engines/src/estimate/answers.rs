//! All that is wanted of one filter over one part of a segment.

use super::any_filter::{AnyFilter, StateFilter};
use super::engine::FilterRun;
use super::gate::{Decisions, SampleGate};
use super::past::FilterPast;
use super::smoothing::{FilteredPart, Lagged, PendingPart, Smoother};
use super::step_watch::plan_steps;
use super::{
    Course, EstimateError, FilterBasics, MeanAndCovariance, ReadoutState, SignalSegment, StateName, Tracked,
    Trajectory, WithReadout,
};
use crate::config::Method;
use crate::progress::Progress;
use kalmems_core::FilterError;
use std::ops::Range;

/// Which samples of a course are to be taken.
#[derive(Clone, Debug)]
pub struct SampleSelection {
    /// Those that are new.
    pub fresh: Range<usize>,
    /// Whether the segment ends with the last of them.
    pub ends: bool,
    /// The usual interval between them in s.
    pub interval_s: f64,
}

impl SampleSelection {
    /// All that there are, so many of this interval in s.
    pub const fn whole(count: usize, interval_s: f64) -> Self {
        Self { fresh: 0..count, ends: true, interval_s }
    }
}

impl SignalSegment<'_> {
    /// Its samples.
    pub fn samples(&self) -> SampleSelection {
        SampleSelection { fresh: self.fresh.clone(), ends: self.ends, interval_s: self.interval_s }
    }
}

/// A filter and its smoothers on their way, whatever the number of its states.
pub(super) trait AnswerRun: Send {
    /// What they say of new samples, with what another run of the filter rejected where that is followed. `None` where the work was
    /// stopped.
    fn take(
        &mut self,
        filter: &FilterBasics,
        way: (&mut dyn Course, &SampleSelection),
        decided: Option<&Decisions>,
        states: &[StateName],
        progress: &dyn Progress,
    ) -> Option<Vec<Trajectory>>;

    /// Plans how many steps it takes from one sample to the next of this course, of which these samples are the first.
    fn plan_steps(&self, course: &mut dyn Course, samples: &SampleSelection) -> usize;

    /// Takes so many from here on, or more where their error is too large and that is wanted.
    fn take_steps(&mut self, steps: usize, adapts: bool);

    /// Steps from sample to sample.
    fn steps(&self) -> usize;

    /// What the filter knows.
    fn known(&self) -> MeanAndCovariance;

    /// How it takes its samples, as numbers.
    fn watch_numbers(&self) -> Vec<f64>;

    /// What it knows of the loss of its signal, as numbers.
    fn loss_numbers(&self) -> Vec<f64>;
}

/// Of `N` states.
struct SizedAnswerRun<const N: usize> {
    followed: FilterRun<N>,
    smoothers: Vec<(&'static str, Smoother<N>)>,
    is_unscented: bool,
}

impl<const N: usize> AnswerRun for SizedAnswerRun<N> {
    fn take(
        &mut self,
        filter: &FilterBasics,
        (course, samples): (&mut dyn Course, &SampleSelection),
        decided: Option<&Decisions>,
        states: &[StateName],
        progress: &dyn Progress,
    ) -> Option<Vec<Trajectory>> {
        let names = (filter.key.as_str(), filter.name.as_str());
        self.followed.follow_decisions(decided);
        let stays_lost = filter.stays_lost;
        let mut filtered =
            self.followed.follow(names, course, &samples.fresh, states, stays_lost, progress)?;
        filtered.whitens = !matches!(filter.method, Method::ConsiderEkf | Method::Luenberger);
        filtered.gate_nis = filter.taking.largest_nis;
        filtered.parameters = filter.parameters().iter().map(Tracked::prior).collect();
        let names: Vec<&'static str> = filtered.parameters.iter().map(|prior| prior.name).collect();
        filtered.parameter_correlations = self.followed.known().correlations(states, &names);
        let mut trajectories = vec![filtered];
        for (word, smoother) in &mut self.smoothers {
            let (key, name) = (format!("{}_{word}", filter.key), format!("{}, {word}", filter.name));
            let entry = self.followed.entry();
            let (fresh, ends) = (&samples.fresh, samples.ends);
            let part = FilteredPart { entry, fresh, ends, filtered: &trajectories[0], decided };
            trajectories.push(smoother.take((&key, &name), course, &part, progress)?);
        }
        Some(trajectories)
    }

    fn plan_steps(&self, course: &mut dyn Course, samples: &SampleSelection) -> usize {
        let start = || {
            let filter = self.followed.present().clone();
            Some(Box::new(filter.watching_steps(self.is_unscented)) as _)
        };
        plan_steps(&start, course, samples)
    }

    fn take_steps(&mut self, steps: usize, adapts: bool) {
        self.followed.take_steps(steps, adapts);
    }

    fn steps(&self) -> usize {
        self.followed.steps()
    }

    fn known(&self) -> MeanAndCovariance {
        self.followed.known()
    }

    fn watch_numbers(&self) -> Vec<f64> {
        self.followed.watch_numbers()
    }

    fn loss_numbers(&self) -> Vec<f64> {
        self.followed.loss_numbers()
    }
}

/// A filter at the beginning of its way, or where it was left in another run, with the smoothers that are wanted.
pub(super) struct FilterRunStart<'a> {
    left: Option<&'a MeanAndCovariance>,
    watch: SampleGate,
    loss: &'a [f64],
    /// Whether the error of its steps is followed.
    watches_steps: bool,
    is_unscented: bool,
    smooth: bool,
    lag: Option<usize>,
}

impl FilterRunStart<'_> {
    /// Of this number of states.
    pub(super) fn of<const N: usize>(
        self,
        filter: Box<dyn StateFilter<N>>,
    ) -> Result<Box<dyn AnswerRun>, FilterError> {
        let followed = match self.left {
            Some(left) => FilterRun::resumed(filter, self.watch, left, self.loss)?,
            None => FilterRun::new(filter, self.watch),
        };
        let is_unscented = self.is_unscented;
        let followed = if self.watches_steps { followed.watching_steps(is_unscented) } else { followed };
        let whole = self.smooth.then(|| ("smoothed", Smoother::Whole(PendingPart::new())));
        let lagged = self.lag.map(|lag| ("lagged", Smoother::Lagged(Lagged::new(lag))));
        Ok(Box::new(SizedAnswerRun {
            followed,
            smoothers: whole.into_iter().chain(lagged).collect(),
            is_unscented,
        }))
    }
}

/// Takes a filter through new samples: the filtered trajectory, and the smoothed ones that are wanted, as far as they are known.
///
/// It goes on where the past left it; `start` says what is known at the first sample of the segment.
pub fn answers(
    (filter, past): (&FilterBasics, &mut FilterPast),
    start: impl FnOnce() -> Result<MeanAndCovariance, EstimateError>,
    course: (&mut dyn Course, &SampleSelection),
    states: &[StateName],
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    follow((filter, past), |left| filter.begin(left, start), course, states, progress)
}

/// The same with a filter that `begin` makes, of what was known where another run left it, if one did.
pub fn follow(
    (filter, past): (&FilterBasics, &mut FilterPast),
    begin: impl FnOnce(Option<MeanAndCovariance>) -> Result<AnyFilter, EstimateError>,
    (course, samples): (&mut dyn Course, &SampleSelection),
    states: &[StateName],
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    if !filter.readout.is_empty() {
        if course.signals().len() > 1 {
            return Err(EstimateError::SeveralReadouts { filter: filter.name.clone() });
        }
        if filter.readout.iter().any(ReadoutState::needs_drive) && course.drive(samples.fresh.start).is_none()
        {
            return Err(EstimateError::NoDriveToFeedThrough { filter: filter.name.clone() });
        }
        let all: Vec<StateName> =
            states.iter().copied().chain(filter.readout.iter().map(ReadoutState::name)).collect();
        let mut course = WithReadout::new(course, &filter.readout);
        return follow_all((filter, past), begin, (&mut course, samples), &all, progress);
    }
    follow_all((filter, past), begin, (course, samples), states, progress)
}

/// The same with a course and the names of all states that the filter has.
fn follow_all(
    (filter, past): (&FilterBasics, &mut FilterPast),
    begin: impl FnOnce(Option<MeanAndCovariance>) -> Result<AnyFilter, EstimateError>,
    (course, samples): (&mut dyn Course, &SampleSelection),
    states: &[StateName],
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut run = if let Some(run) = past.run.take() {
        run
    } else {
        let (left, lag) = (past.left().cloned(), filter.lag_samples(samples.interval_s));
        let watch = past.watch(filter, (course.time_s(), samples));
        let begun = begin(left)?.run(FilterRunStart {
            left: past.left(),
            watch,
            loss: past.loss(),
            // A search for what is wrong runs a filter many times, and asks for its innovations alone.
            watches_steps: !filter.stays_lost && filter.method.claims(),
            is_unscented: filter.method.is_unscented(),
            smooth: filter.smooth,
            lag,
        });
        begun.map_err(|why| EstimateError::Resumed { why: why.to_string() })?
    };
    if !past.is_planned {
        let steps = filter.steps.or(past.steps).unwrap_or_else(|| run.plan_steps(course, samples));
        run.take_steps(steps, filter.steps.is_none());
        past.is_planned = true;
    }
    let decided = past.decided.clone();
    let trajectories = run.take(filter, (course, samples), decided.as_ref(), states, progress);
    past.leave(run);
    trajectories.ok_or(EstimateError::Interrupted)
}
