//! A second answer of a filter: what it would have said of each sample, had it known later ones.

use super::engine::DerivedQuantities;
use super::gate::Decisions;
use super::linked::LinkedFilter;
use super::{
    AnyKnownStateStep, Course, FilterFailure, FilterStop, Filtering, Restart, SampleCounts, StepCounts,
    Trajectory, TrajectoryKind,
};
use crate::progress::Pace;
use crate::progress::Progress;
use kalmems_core::smooth::{self, Backward, Smoothed, SmoothingError, smooth_interval};
use kalmems_core::{FilterError, Mat, StateTransition};
use std::ops::Range;

/// The smoothed answer of a filter on its way.
///
/// Innovations, NIS and counts are taken over from the filter. Where it stopped, or the smoother has to, the answer says so
/// and has no numbers from there on.
pub(super) enum Smoother<const N: usize> {
    /// Each state given all samples of the segment (fixed interval); in a segment that comes in parts, given those of its own
    /// part and of the next one.
    Whole(PendingPart<N>),
    /// Each state given so many later samples, fewer at the end (fixed lag). It could be had while samples arrive, that
    /// much late.
    Lagged(Lagged<N>),
}

/// New samples and what a filter made of them.
pub(super) struct FilteredPart<'a, const N: usize> {
    /// The filter at the first of them, not yet corrected by it.
    pub(super) entry: &'a LinkedFilter<N>,
    /// Which of the course's samples they are.
    pub(super) fresh: &'a Range<usize>,
    /// Whether the segment ends with them.
    pub(super) ends: bool,
    /// What the filter made of them.
    pub(super) filtered: &'a Trajectory,
    /// What another run of the filter rejected of them and of those of the part before, where that is followed.
    pub(super) decided: Option<&'a Decisions>,
}

impl<const N: usize> Smoother<N> {
    /// What is known for good of these samples and those before that it did not give yet. `None` where the work was stopped.
    pub(super) fn take(
        &mut self,
        (key, name): (&str, &str),
        course: &mut dyn Course,
        part: &FilteredPart<N>,
        progress: &dyn Progress,
    ) -> Option<Trajectory> {
        let begun = std::time::Instant::now();
        let mut filtered = Trajectory {
            key: key.to_owned(),
            name: name.to_owned(),
            kind: TrajectoryKind::Smoothed,
            ..part.filtered.clone()
        };
        for state in &mut filtered.states {
            state.mean.fill(f64::NAN);
            state.sd.fill(f64::NAN);
        }
        let mut answer = match self {
            Self::Whole(whole) => whole.take(course, part, filtered, progress),
            Self::Lagged(lagged) => lagged.take(course, part, filtered, progress),
        }?;
        answer.seconds_per_step = begun.elapsed().as_secs_f64() / part.fresh.len().max(1) as f64;
        Some(answer)
    }
}

/// The sample at which it stopped, and why; no reason where it was stopped from outside.
type SmoothingStop = (usize, Option<FilterError>);

/// Enters a smoothed state of sample `k`, a row of the course.
fn keep<const N: usize>(
    answer: &mut Trajectory,
    derived: Option<&DerivedQuantities>,
    (k, row): (usize, usize),
    smoothed: &Smoothed<f64, N>,
) {
    // Where the filter had stopped there is nothing to smooth.
    if answer.time_s.get(k).is_some_and(|time_s| answer.is_stopped_at(*time_s)) {
        return;
    }
    let covariance = smoothed.covariance();
    answer.keep(derived, (k, row), &smoothed.mean, &|i, j| covariance.get(i, j));
}

/// Where an answer stopped.
fn failed(answer: &Trajectory, (sample, why): SmoothingStop) -> Option<FilterFailure> {
    Some(FilterFailure { time_s: answer.time_s.get(sample).copied().unwrap_or(f64::NAN), why: why? })
}

/// The part before the present one, which waits for what comes after it.
pub(super) struct PendingPart<const N: usize> {
    waiting: Option<(LinkedFilter<N>, Trajectory)>,
}

impl<const N: usize> PendingPart<N> {
    pub(super) fn new() -> Self {
        Self { waiting: None }
    }

    fn take(
        &mut self,
        course: &mut dyn Course,
        part: &FilteredPart<N>,
        filtered: Trajectory,
        progress: &dyn Progress,
    ) -> Option<Trajectory> {
        let before = self.waiting.take();
        let waited = before.as_ref().map_or(0, |(_, answer)| answer.time_s.len());
        let failure = filtered.failure;
        let (start, mut answer) = match before {
            Some((mut start, mut answer)) => {
                start.follow(part.decided);
                answer.counts = filtered.counts;
                answer.append(filtered);
                (start, answer)
            }
            None => (part.entry.clone().without_step_watch(), filtered),
        };
        let given = if part.ends { answer.time_s.len() } else { waited };
        answer.failure = failure;
        if given > 0 {
            let first = part.fresh.start - waited;
            let window = first..part.fresh.end;
            let derived = course.derived();
            let way = FilterWay { breaks: SmoothingBreaks::of(&answer), steps: answer.steps.clone() };
            let each = |k: usize, smoothed: &Smoothed<f64, N>| {
                if k < given {
                    keep(&mut answer, derived.as_ref(), (k, first + k), smoothed);
                }
            };
            if let Err(stopped) = whole(&start, (course, progress), (&window, way), each) {
                answer.failure = Some(failed(&answer, stopped)?);
            }
        }
        if part.ends {
            return Some(answer);
        }
        let known = answer.take_front(given);
        self.waiting = Some((part.entry.clone().without_step_watch(), answer));
        Some(known)
    }
}

/// Every sample of a window given all of it, in memory that grows with the root of their number.
fn whole<const N: usize>(
    start: &LinkedFilter<N>,
    (course, progress): (&mut dyn Course, &dyn Progress),
    (window, way): (&Range<usize>, FilterWay),
    mut keep: impl FnMut(usize, &Smoothed<f64, N>),
) -> Result<(), SmoothingStop> {
    let block = window.len().isqrt() + 1;
    let mut checkpoints = vec![start.clone(); block];
    let mut steps = vec![Backward::identity(); block];
    let each = |k: usize, smoothed: &Smoothed<f64, N>| {
        keep(k, smoothed);
        Ok(())
    };
    let mut repeated = SmoothedCourse::new(course, window.clone(), way, progress);
    smooth_interval(start, &mut repeated, &mut checkpoints, &mut steps, each).map_err(|e| match e {
        SmoothingError::Course { sample, cause } => (sample, cause),
        SmoothingError::Step { sample, cause } => (sample, Some(cause)),
        // There are block² > n places.
        SmoothingError::Storage { samples, .. } => (samples, Some(FilterError::NonFiniteState)),
    })
}

/// The filter once more, the backward steps of the last samples, and the answers that these wait for.
pub(super) struct Lagged<const N: usize> {
    filter: Option<LinkedFilter<N>>,
    window: LagWindow<N>,
    waiting: Option<Trajectory>,
    /// Where the smoother itself stopped.
    failure: Option<FilterFailure>,
}

impl<const N: usize> Lagged<N> {
    pub(super) fn new(lag: usize) -> Self {
        let window = LagWindow { lag, older: Vec::new(), newer: Vec::new(), product: None };
        Self { filter: None, window, waiting: None, failure: None }
    }

    fn take(
        &mut self,
        course: &mut dyn Course,
        part: &FilteredPart<N>,
        filtered: Trajectory,
        progress: &dyn Progress,
    ) -> Option<Trajectory> {
        let failure = filtered.failure;
        let (waited, mut answer) = match self.waiting.take() {
            Some(mut answer) => {
                let waited = answer.time_s.len();
                answer.counts = filtered.counts;
                answer.append(filtered);
                (waited, answer)
            }
            None => (0, filtered),
        };
        let lag = self.window.lag;
        let given = if part.ends { answer.time_s.len() } else { answer.time_s.len().saturating_sub(lag) };
        if self.failure.is_none()
            && let Err(stopped) = self.pass((course, progress), part, waited, &mut answer)
        {
            self.failure = Some(failed(&answer, stopped)?);
        }
        answer.failure = self.failure.or(failure);
        if part.ends {
            return Some(answer);
        }
        let known = answer.take_front(given);
        self.waiting = Some(answer);
        Some(known)
    }

    /// Takes the filter through the new samples; `waited` answers of earlier ones are not given yet.
    fn pass(
        &mut self,
        (course, progress): (&mut dyn Course, &dyn Progress),
        part: &FilteredPart<N>,
        waited: usize,
        answer: &mut Trajectory,
    ) -> Result<(), SmoothingStop> {
        // A loss is known a cycle later: what the lag has given by then would depend on how long the parts are.
        let breaks = SmoothingBreaks { lost_s: Vec::new(), ..SmoothingBreaks::of(answer) };
        let way = FilterWay { breaks, steps: part.filtered.steps.clone() };
        let derived = course.derived();
        let row = |k: usize| (part.fresh.start + k).saturating_sub(waited);
        let mut keep =
            |k: usize, smoothed: &Smoothed<f64, N>| keep(answer, derived.as_ref(), (k, row(k)), smoothed);
        let begun = self.filter.is_some();
        let filter = self.filter.get_or_insert_with(|| part.entry.clone().without_step_watch());
        filter.follow(part.decided);
        let n = part.fresh.len();
        let mut repeated = SmoothedCourse::new(course, part.fresh.clone(), way, progress);
        for k in 0..n {
            let place = waited + k;
            let at = |why| (place, why);
            let by_filter = |why| (place, Some(why));
            if begun || k > 0 {
                let before = filter.gaussian();
                let link = smooth::SmoothingCourse::advance(&mut repeated, filter, k).map_err(at)?;
                self.window.push(Backward::new(&before, &link, &filter.gaussian().mean).map_err(by_filter)?);
            }
            smooth::SmoothingCourse::correct(&mut repeated, filter, k).map_err(at)?;
            let last = part.ends && k + 1 == n;
            if place >= self.window.lag || last {
                let now = Smoothed::newest(&filter.gaussian()).map_err(by_filter)?;
                if place >= self.window.lag {
                    keep(place - self.window.lag, &self.window.oldest(&now));
                }
                if last {
                    self.window.rest(&now, place, &mut keep);
                }
            }
        }
        Ok(())
    }
}

/// The last `lag` backward steps, so divided that a sample costs two products whatever the lag is: steps taken
/// together are again a step (van Herk, Pattern Recognition Letters 13, 517, 1992, for maxima).
struct LagWindow<const N: usize> {
    lag: usize,
    /// From a step to the end of the older part; the oldest step last.
    older: Vec<Backward<f64, N>>,
    /// The single steps after the older part, the newest last.
    newer: Vec<Backward<f64, N>>,
    /// Their product.
    product: Option<Backward<f64, N>>,
}

impl<const N: usize> LagWindow<N> {
    fn push(&mut self, step: Backward<f64, N>) {
        self.product = Some(self.product.map_or(step, |product| product.after(&step)));
        self.newer.push(step);
    }

    /// The state `lag` samples before the one that is known as `now`; asked once per sample.
    fn oldest(&mut self, now: &Smoothed<f64, N>) -> Smoothed<f64, N> {
        if self.lag == 0 {
            self.newer.clear();
            return *now;
        }
        let recent = self.product.map_or(*now, |product| product.apply(now));
        if let Some(product) = self.older.pop() {
            return product.apply(&recent);
        }
        // The newer part has become as long as the lag: it is the older one from here on, less its first step.
        for step in self.newer.drain(..).rev() {
            self.older.push(self.older.last().map_or(step, |later| step.after(later)));
        }
        self.older.pop();
        self.product = None;
        recent
    }

    /// The states that did not become old enough until the last sample.
    fn rest(&self, now: &Smoothed<f64, N>, last: usize, keep: &mut impl FnMut(usize, &Smoothed<f64, N>)) {
        let (mut state, mut sample) = (*now, last);
        keep(sample, &state);
        for step in self.newer.iter().rev() {
            state = step.apply(&state);
            sample -= 1;
            keep(sample, &state);
        }
        for product in &self.older {
            sample -= 1;
            keep(sample, &product.apply(&state));
        }
    }
}

/// Where nothing passes from a sample to those before it, in the order of time.
struct SmoothingBreaks {
    /// Where the filter was started again: nothing passes onwards either.
    restarts: Vec<Restart>,
    /// Where a loss of the signal began, by the time of the sample in s.
    lost_s: Vec<f64>,
    /// Where the filter had stopped: it stays as it is there.
    stops: Vec<FilterStop>,
}

impl SmoothingBreaks {
    fn of(answer: &Trajectory) -> Self {
        Self { restarts: answer.restarts.clone(), lost_s: answer.lost_s.clone(), stops: answer.stops.clone() }
    }

    /// Whether the filter had stopped at this time in s.
    fn stopped_at(&self, time_s: f64) -> bool {
        self.stops.iter().any(|stop| stop.covers(time_s))
    }
}

/// A step from which nothing passes to the state before it.
fn apart<const N: usize>(filter: &LinkedFilter<N>) -> StateTransition<f64, N> {
    StateTransition { transition: Mat::zero(), noise: filter.gaussian().covariance }
}

/// How the filter went: what its smoother has to do likewise.
struct FilterWay {
    breaks: SmoothingBreaks,
    steps: StepCounts,
}

/// Some samples of a course as the smoothers of the core take them.
struct SmoothedCourse<'a> {
    course: &'a mut dyn Course,
    window: Range<usize>,
    progress: &'a dyn Progress,
    pace: Pace,
    /// Steps that were taken.
    counts: SampleCounts,
    taken: usize,
    way: FilterWay,
    /// Steps from sample to sample that the course takes.
    divided: usize,
}

impl<'a> SmoothedCourse<'a> {
    fn new(
        course: &'a mut dyn Course,
        window: Range<usize>,
        way: FilterWay,
        progress: &'a dyn Progress,
    ) -> Self {
        let (pace, counts) = (Pace::default(), SampleCounts::default());
        Self { course, window, progress, pace, counts, taken: 0, way, divided: 0 }
    }
}

impl<const N: usize> smooth::SmoothingCourse<f64, LinkedFilter<N>, N> for SmoothedCourse<'_> {
    /// Nothing where the work was stopped from outside.
    type Error = Option<FilterError>;

    fn samples(&self) -> usize {
        self.window.len()
    }

    fn advance(
        &mut self,
        filter: &mut LinkedFilter<N>,
        sample: usize,
    ) -> Result<StateTransition<f64, N>, Self::Error> {
        self.taken += 1;
        let taken = self.taken.saturating_add(self.counts.bridged);
        if self.pace.stops(taken, self.progress, self.window.len() as u64) {
            return Err(None);
        }
        filter.forget();
        let row = self.window.start + sample;
        let time_s = self.course.time_s().get(row).copied().unwrap_or(f64::NAN);
        let steps = self.way.steps.at(time_s);
        if steps != self.divided {
            self.course.divide(steps);
            self.divided = steps;
        }
        let SmoothingBreaks { restarts, lost_s, stops } = &self.way.breaks;
        if restarts.is_empty() && lost_s.is_empty() && stops.is_empty() {
            self.course.advance(filter, row, &mut self.counts)?;
            return filter.link().ok_or(Some(FilterError::NonFiniteState));
        }
        if self.way.breaks.stopped_at(time_s) {
            return Ok(apart(filter));
        }
        let restart = restarts.iter().find(|restart| restart.time_s == time_s);
        let known = restart.map(|restart| AnyKnownStateStep::from(&restart.known));
        if let Some(known) = known.as_ref().filter(|_| stops.iter().any(|stop| stop.until_s == time_s)) {
            self.course.begin_again(filter, known)?;
            return Ok(apart(filter));
        }
        self.course.advance(filter, row, &mut self.counts)?;
        // Nothing of what was before the start goes through it, and nothing of what comes behind it.
        known.map_or(Ok(()), |known| filter.take_over(&known))?;
        let link = filter.link().ok_or(Some(FilterError::NonFiniteState))?;
        Ok(if lost_s.contains(&time_s) { apart(filter) } else { link })
    }

    fn correct(&mut self, filter: &mut LinkedFilter<N>, sample: usize) -> Result<(), Self::Error> {
        let k = self.window.start + sample;
        let time_s = self.course.time_s().get(k).copied().unwrap_or(f64::NAN);
        if self.way.breaks.stopped_at(time_s) {
            return Ok(());
        }
        filter.at(time_s);
        self.course.correct(filter, k, &mut self.counts)?;
        Ok(())
    }
}
