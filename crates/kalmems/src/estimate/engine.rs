//! The one loop that takes a filter through a segment.

use super::smoothing::Linked;
use super::{Counts, Failure, Lock, Progress, StateSeries, Trajectory, TrajectoryKind};
use crate::units::Kind;
use kalmems_core::{Covariance, Filter, FilterError, Innovation, Measurement};
use std::ops::ControlFlow;
use std::time::Instant;

/// What a filter meets on its way through one segment: how to get from one sample to the next, and what was
/// measured there.
pub trait Course<const N: usize> {
    /// How the signal depends on the state.
    type Measurement: Measurement<f64, N, 1>;

    /// Time of each sample in s.
    fn time_s(&self) -> &[f64];

    /// The signal; not a number where it is missing.
    fn signal(&self) -> &[f64];

    /// The measurement and its noise variance.
    fn measurement(&self) -> (&Self::Measurement, f64);

    /// What is said of each sample beside the states, where there is something.
    fn derived(&self) -> Option<Derived<N>> {
        None
    }

    /// Enters what is known of the whole at the end of a filter's way, where there is something.
    fn conclude(&self, trajectory: &mut Trajectory) {
        let _ = trajectory;
    }

    /// Predicts from sample `to − 1` to sample `to`, and counts what was not there.
    fn advance<F: Filter<f64, N>>(
        &mut self,
        filter: &mut F,
        to: usize,
        counts: &mut Counts,
    ) -> Result<(), FilterError>;

    /// Corrects a filter by what is known at sample `k`: by the signal, if there is one.
    #[inline(never)]
    fn correct<F: Filter<f64, N>>(
        &mut self,
        filter: &mut F,
        k: usize,
        counts: &mut Counts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        let _ = counts;
        let y = self.signal()[k];
        if !y.is_finite() {
            return Ok(None);
        }
        let (measurement, variance) = self.measurement();
        filter.update(measurement, &[y], &Covariance::from_variances([variance])).map(Some)
    }
}

/// Quantities that follow from the states, such as a position from an amplitude and a phase.
#[derive(Clone, Copy, Debug)]
pub struct Derived<const N: usize> {
    /// What they are.
    pub names: [StateName; 2],
    /// What they need to know beside the states.
    pub parameter: f64,
    /// How they follow.
    pub compute: Compute<N>,
}

/// Mean and standard deviation of two quantities, from a parameter, the mean of the states and their covariance.
pub type Compute<const N: usize> = fn(f64, &[f64; N], &Covariance<f64, N>) -> [(f64, f64); 2];

impl<const N: usize> Derived<N> {
    /// The names of the states, and of what follows from them.
    pub(super) fn after(derived: Option<&Self>, states: &[StateName; N]) -> Vec<StateName> {
        states.iter().copied().chain(derived.into_iter().flat_map(|derived| derived.names)).collect()
    }

    /// Enters what follows from the states of sample `k` behind them.
    pub(super) fn keep(
        derived: Option<&Self>,
        trajectory: &mut Trajectory,
        k: usize,
        mean: &[f64; N],
        covariance: &Covariance<f64, N>,
    ) {
        let Some(derived) = derived else { return };
        let values = (derived.compute)(derived.parameter, mean, covariance);
        for (state, (mean, sd)) in trajectory.states.iter_mut().skip(N).zip(values) {
            state.mean[k] = mean;
            state.sd[k] = sd;
        }
    }
}

/// Samples between two looks at the progress.
const CHUNK: usize = 65_536;

/// A state of a trajectory: its name, its SI unit as column names have it, and what it is.
pub type StateName = (&'static str, &'static str, &'static Kind);

impl Trajectory {
    /// A trajectory without a number yet, over these times.
    pub(crate) fn blank(
        (key, name): (&str, &str),
        kind: TrajectoryKind,
        time_s: &[f64],
        states: &[StateName],
    ) -> Self {
        let n = time_s.len();
        let blank = || vec![f64::NAN; n];
        Self {
            key: key.to_owned(),
            name: name.to_owned(),
            kind,
            states: states
                .iter()
                .map(|&(name, unit, kind)| StateSeries { name, unit, kind, mean: blank(), sd: blank() })
                .collect(),
            innovation: blank(),
            innovation_sd: blank(),
            nis: blank(),
            log_likelihood: blank(),
            crossings_log_likelihood: 0.0,
            counts: Counts { samples: n, ..Counts::default() },
            lock: Lock::default(),
            mirrored: false,
            failure: None,
            seconds_per_step: f64::NAN,
            time_s: time_s.to_vec(),
        }
    }
}

/// Takes a filter through a segment and records what it says. `None` where the work was stopped.
///
/// A prediction or an update that is refused for another reason than a missing sample ends the trajectory: it
/// says where and why, and has no numbers from there on.
pub fn follow<F: Filter<f64, N>, C: Course<N>, const N: usize>(
    names: (&str, &str),
    filter: F,
    course: &mut C,
    states: &[StateName; N],
    progress: &dyn Progress,
) -> Option<Trajectory> {
    let mut trajectory = Trajectory::blank(
        names,
        TrajectoryKind::Filtered,
        course.time_s(),
        &Derived::after(course.derived().as_ref(), states),
    );
    let n = trajectory.time_s.len();
    // Remembers what only a smoother needs; so that a filter is compiled once for both.
    let mut filter = Linked::new(filter);
    progress.begin(names.1, n as u64);
    let started = Instant::now();
    for k in 0..n {
        if k % CHUNK == 0 && progress.reached(k as u64) == ControlFlow::Break(()) {
            return None;
        }
        if let Err(why) = step(&mut filter, course, k, &mut trajectory) {
            trajectory.failure = Some(Failure { time_s: trajectory.time_s[k], why });
            break;
        }
    }
    course.conclude(&mut trajectory);
    trajectory.seconds_per_step = started.elapsed().as_secs_f64() / n.max(1) as f64;
    if progress.reached(n as u64) == ControlFlow::Break(()) {
        return None;
    }
    Some(trajectory)
}

/// One sample: prediction from the last one, update if there is a signal.
fn step<F: Filter<f64, N>, C: Course<N>, const N: usize>(
    filter: &mut Linked<F, N>,
    course: &mut C,
    k: usize,
    trajectory: &mut Trajectory,
) -> Result<(), FilterError> {
    if k > 0 {
        filter.forget();
        course.advance(filter, k, &mut trajectory.counts)?;
    }
    match course.correct(filter, k, &mut trajectory.counts)? {
        Some(innovation) => {
            trajectory.innovation[k] = innovation.residual[0];
            trajectory.innovation_sd[k] = innovation.covariance.standard_deviation(0);
            trajectory.nis[k] = innovation.nis;
            trajectory.log_likelihood[k] = innovation.log_likelihood();
            trajectory.counts.updates += usize::from(innovation.taken);
        }
        None => trajectory.counts.without_signal += 1,
    }
    for (i, state) in trajectory.states.iter_mut().take(N).enumerate() {
        state.mean[k] = filter.mean()[i];
        state.sd[k] = filter.covariance().standard_deviation(i);
    }
    Derived::keep(course.derived().as_ref(), trajectory, k, filter.mean(), &filter.covariance());
    Ok(())
}
