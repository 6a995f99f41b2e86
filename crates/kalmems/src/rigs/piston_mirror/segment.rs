//! The estimates of one segment.

use super::course::PhasorCourse;
use super::data::SegmentData;
use super::phasor::{Drifting, Phasor, STATES, Steady};
use super::plates::distance_at;
use super::settings::{FilterSettings, Motion, Settings};
use super::start::{BatchStart, batch_start, wrapped};
use crate::estimate::{
    self, AnyFilter, EstimateError, Progress, StateName, Trajectory, TrajectoryKind, answers, judge_lock,
};
use crate::units::kind;
use kalmems_core::{Covariance, Mat};

/// Runs the wanted filters over a segment, which `place` names in messages, and says how fast it moves.
pub fn estimate(
    settings: &Settings,
    data: &SegmentData,
    place: &str,
    progress: &dyn Progress,
) -> Result<(Vec<Trajectory>, estimate::Motion), EstimateError> {
    let mut all = Vec::new();
    let mut frequency_hz = None;
    for filter in &settings.filters {
        let task = Task { settings, filter, data, place, progress };
        let mut trajectories = task.run()?;
        for trajectory in &mut trajectories {
            frequency_hz = frequency_hz.or_else(|| found_frequency(trajectory));
            for phase in trajectory.states.iter_mut().filter(|state| state.name == "phase") {
                phase.mean.iter_mut().for_each(|phase| *phase = wrapped(*phase));
            }
        }
        all.append(&mut trajectories);
    }
    // Where no filter says it, the signal does.
    let frequency_hz = match frequency_hz {
        Some(frequency_hz) => frequency_hz,
        None => Task { settings, filter: &settings.filters[0], data, place, progress }.batch()?.mean[1],
    };
    let motion = estimate::Motion { frequency_hz, is_driven: false };
    let start_s = data.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
    for trajectory in &mut all {
        trajectory.lock = judge_lock(trajectory, data.signal, &[("position", motion)], start_s);
    }
    Ok((all, motion))
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
    fn run(&self) -> Result<Vec<Trajectory>, EstimateError> {
        let plates = self.settings.hardware.plates;
        match self.filter.motion {
            Motion::None => Ok(vec![self.inversion()]),
            Motion::Steady { density, start } => {
                let (mean, covariance, rest) = if let Some((mean, sd, rest)) = start {
                    (mean, Covariance::from_standard_deviations(sd), rest)
                } else {
                    let batch = self.batch()?;
                    let [a, f, phase, rest, _] = batch.mean;
                    ([a, f, phase], widened(&batch.covariance), rest)
                };
                let names = std::array::from_fn(|i| STATES[i]);
                self.follow::<_, 3>(&Steady::new(plates, rest, density), &names, mean, covariance)
            }
            Motion::Drifting { density, start } => {
                let (mean, covariance) = if let Some((mean, sd)) = start {
                    (mean, Covariance::from_standard_deviations(sd))
                } else {
                    let batch = self.batch()?;
                    (batch.mean, with_rate(&widened(&batch.covariance), RATE_SD * batch.mean[0]))
                };
                self.follow::<_, 5>(&Drifting::new(plates, density), &STATES, mean, covariance)
            }
        }
    }

    /// The filtered trajectory, and the smoothed ones that are wanted.
    fn follow<P: Phasor<N>, const N: usize>(
        &self,
        phasor: &P,
        states: &[StateName; N],
        mean: [f64; N],
        covariance: Covariance<f64, N>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let filter = &self.filter.basics;
        let start = AnyFilter::of(filter.method, filter.points, mean, covariance);
        let mut course = PhasorCourse::new(phasor, self.data);
        answers(filter, &start, (&mut course, self.data.interval_s), states, self.progress)
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
        let mut trajectory = Trajectory::blank(names, TrajectoryKind::LockIn, self.data.time_s, &states);
        let noise = self.data.noise_variance.sqrt();
        for (k, capacitance) in self.data.signal.iter().enumerate() {
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
