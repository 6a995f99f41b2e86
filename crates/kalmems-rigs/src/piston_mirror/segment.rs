//! The estimates of one segment.

use super::course::PhasorCourse;
use super::data::SegmentData;
use super::observability::amplitude_per_rest;
use super::phase_lock::PhaseLock;
use super::phasor::{Drifting, Phasor, STATES, Steady};
use super::plates::distance_at;
use super::settings::{FilterSettings, Motion, Settings};
use super::start::{BatchStart, batch_fit, batch_start, wrapped};
use crate::config::Method;
use crate::estimate::{
    self, AnyFilter, EstimateError, FilterPast, Past, Progress, Samples, StateName, Trajectory,
    TrajectoryKind, answers, follow,
};
use crate::units::kind;
use kalmems_core::{Covariance, Mat};
use kalmems_models::readout::PhasorDetector;
use std::f64::consts::TAU;

/// Runs the wanted filters over the new samples of a segment, which `place` names in messages, and says how fast it moves.
pub fn estimate(
    settings: &Settings,
    data: &SegmentData,
    (place, samples): (&str, &Samples),
    past: &mut Past,
    progress: &dyn Progress,
) -> Result<(Vec<Trajectory>, estimate::Motion), EstimateError> {
    let mut all = Vec::new();
    let mut frequency_hz = None;
    for (index, filter) in settings.filters.iter().enumerate() {
        let task = Task { settings, filter, data, place, samples, progress };
        let mut trajectories = task.run(past.filter(index))?;
        for trajectory in &mut trajectories {
            frequency_hz = frequency_hz.or_else(|| found_frequency(trajectory));
            for phase in trajectory.states.iter_mut().filter(|state| state.name == "phase") {
                phase.mean.iter_mut().for_each(|phase| *phase = wrapped(*phase));
            }
        }
        all.push(trajectories);
    }
    // Where no filter says it, the signal does.
    let frequency_hz = match frequency_hz {
        Some(frequency_hz) => frequency_hz,
        None => {
            Task { settings, filter: &settings.filters[0], data, place, samples, progress }.batch()?.mean[1]
        }
    };
    let motion = estimate::Motion { frequency_hz, is_driven: false };
    let start_s = data.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
    for (index, trajectories) in all.iter_mut().enumerate() {
        for (answer, trajectory) in trajectories.iter_mut().enumerate() {
            let judge = &mut past.filter(index).answer(answer).judge;
            trajectory.lock = judge.judge(trajectory, &[("position", motion)], start_s, samples.ends);
        }
    }
    Ok((all.into_iter().flatten().collect(), motion))
}

/// The last frequency that a filter gave in Hz, where it can be one.
fn found_frequency(trajectory: &Trajectory) -> Option<f64> {
    let last = trajectory.state("frequency")?.mean.last().copied();
    last.filter(|frequency| frequency.is_finite() && *frequency > 0.0)
}

/// One filter over one segment.
struct Task<'a> {
    settings: &'a Settings,
    filter: &'a FilterSettings,
    data: &'a SegmentData<'a>,
    place: &'a str,
    samples: &'a Samples,
    progress: &'a dyn Progress,
}

/// How much wider than the fit of the first samples a filter starts that sees these samples again: they count a second
/// time for a hundredth.
const WIDER: f64 = 10.0;

/// What a start from the signal allows the amplitude's rate to be, relative to the amplitude, in 1/s: 30 % per minute,
/// the largest drift that was considered (Faller and Zangl, 2017, section IV), as one standard deviation.
const RATE_SD: f64 = 0.3 / 60.0;

impl Task<'_> {
    /// Chooses the model.
    fn run(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let plates = self.settings.hardware.plates;
        match self.filter.motion {
            Motion::None => Ok(vec![self.inversion()]),
            Motion::Steady { density, start } => {
                let names = std::array::from_fn(|i| STATES[i]);
                if let Some((mean, sd, rest)) = start {
                    let covariance = Covariance::from_standard_deviations(sd);
                    let steady = Steady::new(plates, rest, density);
                    return self.follow::<_, 3>(&steady, &names, past, (mean, covariance));
                }
                let batch = self.batch()?;
                let [a, f, phase, ..] = batch.mean;
                let (rest, rest_sd) = self.rest(&batch);
                let steady = Steady::new(plates, rest, density);
                let covariance = widened(&batch.covariance);
                let mut trajectories =
                    self.follow::<_, 3>(&steady, &names, past, ([a, f, phase], covariance))?;
                let taken_up = amplitude_per_rest(&plates, [a, rest]);
                for trajectory in &mut trajectories {
                    with_rest(trajectory, rest_sd, taken_up);
                }
                Ok(trajectories)
            }
            Motion::Drifting { density, start } => {
                let (mean, covariance) = if let Some((mean, sd)) = start {
                    (mean, Covariance::from_standard_deviations(sd))
                } else {
                    let batch = self.batch()?;
                    (batch.mean, with_rate(&widened(&batch.covariance), RATE_SD * batch.mean[0]))
                };
                let drifting = Drifting::new(plates, density);
                if self.filter.basics.method == Method::SteadyState {
                    let mean = if start.is_some() { mean } else { self.settled(mean) };
                    return self.lock(&drifting, past, mean);
                }
                self.follow::<_, 5>(&drifting, &STATES, past, (mean, covariance))
            }
        }
    }

    /// The phase-locked loop from a state.
    fn lock(
        &self,
        drifting: &Drifting,
        past: &mut FilterPast,
        mean: [f64; 5],
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let detector = PhasorDetector { series: self.settings.hardware.plates };
        let process = drifting.over(self.data.interval_s);
        let lock = PhaseLock::new(detector, &process, mean, self.data.noise_variance).map_err(|why| {
            EstimateError::NoGain { filter: self.filter.basics.name.clone(), why: why.to_string() }
        })?;
        let mut course = PhasorCourse::new(drifting, self.data);
        let (filter, course) = (&self.filter.basics, (&mut course, self.samples));
        Ok(vec![follow((filter, past), || Ok(lock), course, &STATES, self.progress)?])
    }

    /// The motion at the first sample from the whole settling time, in which no filter is scored; `None` where that
    /// is not longer than what a start looks at, or the fit does not settle.
    fn over_settling_time(&self, from: [f64; 5]) -> Option<BatchStart> {
        let first_s = self.data.time_s.first().copied()?;
        let end = self.data.time_s.partition_point(|t| *t < first_s + self.settings.skip_s);
        let window =
            SegmentData { time_s: &self.data.time_s[..end], signal: &self.data.signal[..end], ..*self.data };
        batch_fit(&self.settings.hardware.plates, &window, from, true).ok()
    }

    /// The rest position and its standard deviation in m, for a filter that holds it. What 20 ms leave of it a
    /// filter of three states would keep for ever, and its innovations would not show it: all of the settling time
    /// is used.
    fn rest(&self, batch: &BatchStart) -> (f64, f64) {
        let of = |fit: &BatchStart| (fit.mean[3], fit.covariance.standard_deviation(3));
        let first = of(batch);
        let longer = self.over_settling_time(batch.mean).map_or(first, |fit| of(&fit));
        if longer.1 < first.1 { longer } else { first }
    }

    /// Where a filter starts that forgets its start as slowly as a settled one does.
    fn settled(&self, from: [f64; 5]) -> [f64; 5] {
        self.over_settling_time(from).map_or(from, |fit| fit.mean)
    }

    /// The filtered trajectory, and the smoothed ones that are wanted.
    fn follow<P: Phasor<N>, const N: usize>(
        &self,
        phasor: &P,
        states: &[StateName; N],
        past: &mut FilterPast,
        (mean, covariance): ([f64; N], Covariance<f64, N>),
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let filter = &self.filter.basics;
        let start = AnyFilter::of(filter.method, filter.points, mean, covariance);
        let mut course = PhasorCourse::new(phasor, self.data);
        answers((filter, past), || Ok(start), (&mut course, self.samples), states, self.progress)
    }

    /// Where the first samples say that the motion starts.
    fn batch(&self) -> Result<BatchStart, EstimateError> {
        batch_start(&self.settings.hardware.plates, self.data).map_err(|why| EstimateError::NoStart {
            place: self.place.to_owned(),
            filter: self.filter.basics.name.clone(),
            why: why.to_string(),
        })
    }

    /// Each capacitance as a distance, with what its noise makes of it. A capacitance that no distance has is left
    /// out and counted as a missing signal.
    fn inversion(&self) -> Trajectory {
        let plates = &self.settings.hardware.plates;
        let names = (self.filter.basics.key.as_str(), self.filter.basics.name.as_str());
        let states = [("position", "m", &kind::LENGTH)];
        let mut trajectory = Trajectory::blank(
            names,
            TrajectoryKind::LockIn,
            (self.data.time_s, self.data.signal, &self.samples.fresh),
            &states,
        );
        let noise = self.data.noise_variance.sqrt();
        for (k, capacitance) in self.data.signal[self.samples.fresh.clone()].iter().enumerate() {
            match distance_at(plates, *capacitance) {
                Some(distance) => {
                    trajectory.states[0].mean[k] = distance;
                    trajectory.states[0].sd[k] = noise / plates.slope(distance).abs();
                }
                None => trajectory.counts.without_signal += 1,
            }
        }
        trajectory
    }
}

/// Adds what the uncertainty of a held rest position makes of position, velocity and amplitude to what the filter
/// says of them. The amplitude takes up what it can of a wrong rest position, per metre of it.
fn with_rest(trajectory: &mut Trajectory, rest_sd: f64, taken_up: f64) {
    let state = |name: &str| trajectory.state(name).map(|state| state.mean.clone()).unwrap_or_default();
    let (phases, frequencies) = (state("phase"), state("frequency"));
    for state in &mut trajectory.states {
        for ((sd, phase), frequency) in state.sd.iter_mut().zip(&phases).zip(&frequencies) {
            let (sine, cosine) = phase.sin_cos();
            let per_metre = match state.name {
                "amplitude" => taken_up,
                "position" => 1.0 + taken_up * cosine,
                "velocity" => -TAU * frequency * taken_up * sine,
                _ => continue,
            };
            *sd = sd.hypot(per_metre * rest_sd);
        }
    }
}

/// The upper left part of a covariance, [`WIDER`].
fn widened<const N: usize>(covariance: &Covariance<f64, 5>) -> Covariance<f64, N> {
    let full = covariance.to_full();
    Covariance::from_lower(Mat::from_fn(|i, j| WIDER * WIDER * full.0[i][j]))
}

/// The same with an uncorrelated last state of this standard deviation.
fn with_rate(covariance: &Covariance<f64, 5>, sd: f64) -> Covariance<f64, 5> {
    let of_rate = |i: usize, j: usize| if i == j { sd * sd } else { 0.0 };
    Covariance::from_lower(Mat::from_fn(
        |i, j| {
            if i == 4 || j == 4 { of_rate(i, j) } else { covariance.get(i, j) }
        },
    ))
}
