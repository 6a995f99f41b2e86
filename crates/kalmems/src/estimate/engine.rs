//! The one loop that takes a filter through a segment.

use super::{Counts, Failure, Lock, Progress, StateSeries, Trajectory};
use crate::units::Kind;
use kalmems_core::{Covariance, Filter, FilterError, Measurement};
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

    /// Predicts from sample `to − 1` to sample `to`, and counts what was not there.
    fn advance<F: Filter<f64, N>>(
        &mut self,
        filter: &mut F,
        to: usize,
        counts: &mut Counts,
    ) -> Result<(), FilterError>;
}

/// Samples between two looks at the progress.
const CHUNK: usize = 65_536;

/// Takes a filter through a segment and records what it says. `None` where the work was stopped.
///
/// A prediction or an update that is refused for another reason than a missing sample ends the trajectory: it
/// says where and why, and has no numbers from there on.
pub fn follow<F: Filter<f64, N>, C: Course<N>, const N: usize>(
    (key, name): (&'static str, &'static str),
    mut filter: F,
    course: &mut C,
    states: &[(&'static str, &'static str, &'static Kind); N],
    progress: &dyn Progress,
) -> Option<Trajectory> {
    let time_s = course.time_s().to_vec();
    let n = time_s.len();
    let blank = || vec![f64::NAN; n];
    let mut trajectory = Trajectory {
        key,
        name,
        states: states
            .iter()
            .map(|&(name, unit, kind)| StateSeries { name, unit, kind, mean: blank(), sd: blank() })
            .collect(),
        innovation: blank(),
        innovation_sd: blank(),
        nis: blank(),
        log_likelihood: blank(),
        counts: Counts { samples: n, ..Counts::default() },
        lock: Lock::default(),
        mirrored: false,
        failure: None,
        seconds_per_step: f64::NAN,
        time_s,
    };
    progress.begin(name, n as u64);
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
    trajectory.seconds_per_step = started.elapsed().as_secs_f64() / n.max(1) as f64;
    if progress.reached(n as u64) == ControlFlow::Break(()) {
        return None;
    }
    Some(trajectory)
}

/// One sample: prediction from the last one, update if there is a signal.
fn step<F: Filter<f64, N>, C: Course<N>, const N: usize>(
    filter: &mut F,
    course: &mut C,
    k: usize,
    trajectory: &mut Trajectory,
) -> Result<(), FilterError> {
    if k > 0 {
        course.advance(filter, k, &mut trajectory.counts)?;
    }
    let y = course.signal()[k];
    if y.is_finite() {
        let (measurement, variance) = course.measurement();
        let innovation = filter.update(measurement, &[y], &Covariance::from_variances([variance]))?;
        trajectory.innovation[k] = innovation.residual[0];
        trajectory.innovation_sd[k] = innovation.covariance.standard_deviation(0);
        trajectory.nis[k] = innovation.nis;
        trajectory.log_likelihood[k] = innovation.log_likelihood();
        trajectory.counts.updates += 1;
    } else {
        trajectory.counts.without_signal += 1;
    }
    for (i, state) in trajectory.states.iter_mut().enumerate() {
        state.mean[k] = filter.mean()[i];
        state.sd[k] = filter.covariance().standard_deviation(i);
    }
    Ok(())
}
