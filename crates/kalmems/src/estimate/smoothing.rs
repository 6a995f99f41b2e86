//! A second answer of a filter: what it would have said of each sample, had it known later ones.

use super::engine::Derived;
use super::{Counts, Course, Failure, Trajectory, TrajectoryKind};
use kalmems_core::smooth::{self, Backward, IntervalError, Smoothed, smooth_interval};
use kalmems_core::update::Policy;
use kalmems_core::{Covariance, Filter, FilterError, Gaussian, Innovation, Link, Measurement, Process};

/// How many later samples a smoothed state knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lookahead {
    /// All of the segment (fixed interval).
    Whole,
    /// So many, fewer at the end (fixed lag). It could be had while samples arrive, that much late.
    Samples(usize),
}

/// Smooths the answer that a filter gave, from the filter as it started and the same course.
///
/// `filtered` is what [`follow`](super::follow) made of them; innovations, NIS and counts are taken over from it.
/// Where the filter stopped, or the smoother has to, the answer says so and has no numbers.
pub fn smooth<F: Filter<f64, N> + Clone, C: Course<N>, const N: usize>(
    (key, name): (&str, &str),
    start: &F,
    course: &mut C,
    filtered: &Trajectory,
    lookahead: Lookahead,
) -> Trajectory {
    let mut answer = Trajectory {
        key: key.to_owned(),
        name: name.to_owned(),
        kind: TrajectoryKind::Smoothed,
        ..filtered.clone()
    };
    for state in &mut answer.states {
        state.mean.fill(f64::NAN);
        state.sd.fill(f64::NAN);
    }
    if answer.failure.is_some() {
        return answer;
    }
    let begun = std::time::Instant::now();
    let derived = course.derived();
    let mut keep = |k: usize, smoothed: &Smoothed<f64, N>| {
        let covariance = smoothed.covariance();
        for (i, state) in answer.states.iter_mut().take(N).enumerate() {
            state.mean[k] = smoothed.mean[i];
            state.sd[k] = covariance.standard_deviation(i);
        }
        Derived::keep(derived.as_ref(), &mut answer, k, &smoothed.mean, &covariance);
    };
    let linked = Linked::new(start.clone());
    let result = match lookahead {
        Lookahead::Whole => whole(&linked, course, &mut keep),
        Lookahead::Samples(lag) => lagged(linked, course, lag, &mut keep),
    };
    let n = answer.time_s.len();
    answer.seconds_per_step = begun.elapsed().as_secs_f64() / n.max(1) as f64;
    if let Err((sample, why)) = result {
        let time_s = answer.time_s.get(sample).copied().unwrap_or(f64::NAN);
        answer.failure = Some(Failure { time_s, why });
    }
    answer
}

/// The sample at which it stopped, and why.
type Stopped = (usize, FilterError);

/// Every sample given all of them, in memory that grows with the root of their number.
fn whole<F: Filter<f64, N> + Clone, C: Course<N>, const N: usize>(
    start: &Linked<F, N>,
    course: &mut C,
    keep: &mut impl FnMut(usize, &Smoothed<f64, N>),
) -> Result<(), Stopped> {
    let block = course.time_s().len().isqrt() + 1;
    let mut checkpoints = vec![start.clone(); block];
    let mut steps = vec![Backward::identity(); block];
    let each = |k: usize, smoothed: &Smoothed<f64, N>| {
        keep(k, smoothed);
        Ok(())
    };
    smooth_interval(start, &mut Repeated(course), &mut checkpoints, &mut steps, each).map_err(|e| match e {
        IntervalError::Course { sample, cause } | IntervalError::Step { sample, cause } => (sample, cause),
        // There are block² > n places.
        IntervalError::Storage { samples, .. } => (samples, FilterError::NonFiniteState),
    })
}

/// Every sample given `lag` later ones.
fn lagged<F: Filter<f64, N> + Clone, C: Course<N>, const N: usize>(
    mut filter: Linked<F, N>,
    course: &mut C,
    lag: usize,
    keep: &mut impl FnMut(usize, &Smoothed<f64, N>),
) -> Result<(), Stopped> {
    let n = course.time_s().len();
    let mut repeated = Repeated(course);
    let mut window = Window { lag, older: Vec::new(), newer: Vec::new(), product: None };
    for k in 0..n {
        let at = |why| (k, why);
        if k > 0 {
            let before = gaussian(&filter);
            let link = smooth::Course::advance(&mut repeated, &mut filter, k).map_err(at)?;
            window.push(Backward::new(&before, &link, filter.mean()).map_err(at)?);
        }
        smooth::Course::correct(&mut repeated, &mut filter, k).map_err(at)?;
        if k >= lag || k + 1 == n {
            let now = Smoothed::newest(&gaussian(&filter)).map_err(at)?;
            if k >= lag {
                keep(k - lag, &window.oldest(&now));
            }
            if k + 1 == n {
                window.rest(&now, k, keep);
            }
        }
    }
    Ok(())
}

/// The last `lag` backward steps, so divided that a sample costs two products whatever the lag is: steps taken
/// together are again a step (van Herk, Pattern Recognition Letters 13, 517, 1992, for maxima).
struct Window<const N: usize> {
    lag: usize,
    /// From a step to the end of the older part; the oldest step last.
    older: Vec<Backward<f64, N>>,
    /// The single steps after the older part, the newest last.
    newer: Vec<Backward<f64, N>>,
    /// Their product.
    product: Option<Backward<f64, N>>,
}

impl<const N: usize> Window<N> {
    fn push(&mut self, step: Backward<f64, N>) {
        self.product = Some(self.product.map_or(step, |product| after(&product, &step)));
        self.newer.push(step);
    }

    /// The state `lag` samples before the one that is known as `now`; asked once per sample.
    fn oldest(&mut self, now: &Smoothed<f64, N>) -> Smoothed<f64, N> {
        if self.lag == 0 {
            self.newer.clear();
            return *now;
        }
        let recent = self.product.map_or(*now, |product| apply(&product, now));
        if let Some(product) = self.older.pop() {
            return apply(&product, &recent);
        }
        // The newer part has become as long as the lag: it is the older one from here on, less its first step.
        for step in self.newer.drain(..).rev() {
            self.older.push(self.older.last().map_or(step, |later| after(&step, later)));
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
            state = apply(step, &state);
            sample -= 1;
            keep(sample, &state);
        }
        for product in &self.older {
            sample -= 1;
            keep(sample, &apply(product, &state));
        }
    }
}

/// Called, so that it is compiled once for each number of states.
#[inline(never)]
fn apply<const N: usize>(step: &Backward<f64, N>, later: &Smoothed<f64, N>) -> Smoothed<f64, N> {
    step.apply(later)
}

/// Likewise.
#[inline(never)]
fn after<const N: usize>(step: &Backward<f64, N>, later: &Backward<f64, N>) -> Backward<f64, N> {
    step.after(later)
}

fn gaussian<F: Filter<f64, N>, const N: usize>(filter: &F) -> Gaussian<f64, N> {
    Gaussian { mean: *filter.mean(), covariance: filter.covariance() }
}

/// A course as the smoothers of the core take it.
struct Repeated<'a, C>(&'a mut C);

impl<F: Filter<f64, N>, C: Course<N>, const N: usize> smooth::Course<f64, Linked<F, N>, N>
    for Repeated<'_, C>
{
    type Error = FilterError;

    fn samples(&self) -> usize {
        self.0.time_s().len()
    }

    fn advance(&mut self, filter: &mut Linked<F, N>, sample: usize) -> Result<Link<f64, N>, FilterError> {
        filter.forget();
        self.0.advance(filter, sample, &mut Counts::default())?;
        filter.link.ok_or(FilterError::NonFiniteState)
    }

    fn correct(&mut self, filter: &mut Linked<F, N>, sample: usize) -> Result<(), FilterError> {
        self.0.correct(filter, sample, &mut Counts::default()).map(drop)
    }
}

/// A filter that remembers how its state hangs on the state before a few predictions.
#[derive(Clone)]
pub(super) struct Linked<F, const N: usize> {
    filter: F,
    link: Option<Link<f64, N>>,
}

impl<F, const N: usize> Linked<F, N> {
    /// Without a prediction yet.
    pub(super) fn new(filter: F) -> Self {
        Self { filter, link: None }
    }

    /// Begins to remember anew.
    pub(super) fn forget(&mut self) {
        self.link = None;
    }
}

impl<F: Filter<f64, N>, const N: usize> Filter<f64, N> for Linked<F, N> {
    fn mean(&self) -> &[f64; N] {
        self.filter.mean()
    }

    fn covariance(&self) -> Covariance<f64, N> {
        self.filter.covariance()
    }

    fn predict_linked<P: Process<f64, N>>(
        &mut self,
        process: &P,
        u: &P::Input,
    ) -> Result<Link<f64, N>, FilterError> {
        let link = self.filter.predict_linked(process, u)?;
        self.link = Some(match &self.link {
            None => link,
            // x″ = F₂·(F₁·x + w₁) + w₂.
            Some(first) => Link {
                transition: link.transition.times(&first.transition),
                noise: first.noise.transformed(&link.transition).plus(&link.noise),
                taken: first.taken && link.taken,
            },
        });
        Ok(link)
    }

    fn update_where<H: Measurement<f64, N, M>, const M: usize>(
        &mut self,
        measurement: &H,
        y: &[f64; M],
        r: &Covariance<f64, M>,
        policy: &impl Policy<f64, N>,
    ) -> Result<Innovation<f64, M>, FilterError> {
        self.filter.update_where(measurement, y, r, policy)
    }
}
