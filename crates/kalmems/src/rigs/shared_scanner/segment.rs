//! The estimates of one segment.

use super::course::ScannerCourse;
use super::data::SegmentData;
use super::filters::FilterSettings;
use super::lock_in::LockIn;
use super::plant::{Plant, Published, affine, affine_with, staged, staged_with};
use super::settings::Settings;
use crate::config::Method;
use crate::estimate::{
    AnyFilter, EstimateError, LiteralUkf, Lookahead, Misprint, ModelAlone, Progress, Trajectory,
    TrajectoryKind, follow, judge_lock, smooth,
};
use crate::signal::extremes_of_rate;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{Covariance, Ekf, Filter, IteratedEkf, SigmaPoints, SquareRootEkf, SquareRootUkf, Ukf};

/// Runs the wanted filters over a segment, which `place` names in messages.
pub fn estimate(
    settings: &Settings,
    data: &SegmentData,
    place: &str,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    for filter in &settings.filters {
        let mut trajectories = one(&Task { settings, filter, data, place, progress })?;
        for trajectory in &mut trajectories {
            orient(trajectory, settings, data);
            let start_s = data.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
            trajectory.lock = judge_lock(
                data.time_s,
                (&trajectory.states[0].mean, data.signal),
                (&trajectory.innovation, &trajectory.nis),
                data.motion(settings),
                start_s,
            );
            if !filter.method.claims() {
                for state in &mut trajectory.states {
                    // What claims no uncertainty; zeros would look like a claim.
                    state.sd.clear();
                }
            }
        }
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// One filter over one segment.
struct Task<'a> {
    settings: &'a Settings,
    filter: &'a FilterSettings,
    data: &'a SegmentData<'a>,
    place: &'a str,
    progress: &'a dyn Progress,
}

/// When the iterated filter has settled, in standard deviations.
const SETTLED: f64 = 1e-3;

/// Chooses the model by how many states the filter has: once per segment, so that the loops inside know their types.
fn one(task: &Task) -> Result<Vec<Trajectory>, EstimateError> {
    let (hardware, filter) = (&task.settings.hardware, task.filter);
    if filter.method == Method::LockIn {
        return task.lock_in();
    }
    let wrong = |why: AugmentationError| EstimateError::Model { filter: filter.name.clone(), why };
    let poles = hardware.poles.filter(|_| filter.demodulator_sd.is_some());
    match (poles, filter.tracked.len()) {
        (None, _) if filter.method == Method::SquareRootUkf => task.root::<_, 2>(&affine(hardware, filter)),
        (Some(poles), _) if filter.method == Method::SquareRootUkf => {
            task.root::<_, 4>(&staged(hardware, filter, poles))
        }
        (None, 0) if filter.method == Method::EulerEkf => task.run(&Published::new(hardware, filter)),
        (None, 0) => task.run::<_, 2>(&affine(hardware, filter)),
        (None, 1) => task.run::<_, 3>(&affine_with::<1>(hardware, filter).map_err(wrong)?),
        (None, 2) => task.run::<_, 4>(&affine_with::<2>(hardware, filter).map_err(wrong)?),
        (None, 3) => task.run::<_, 5>(&affine_with::<3>(hardware, filter).map_err(wrong)?),
        (None, 4) => task.run::<_, 6>(&affine_with::<4>(hardware, filter).map_err(wrong)?),
        (None, _) => task.run::<_, 7>(&affine_with::<5>(hardware, filter).map_err(wrong)?),
        (Some(poles), 0) => task.run::<_, 4>(&staged(hardware, filter, poles)),
        (Some(poles), 1) => task.run::<_, 5>(&staged_with::<1>(hardware, filter, poles)),
        (Some(poles), 2) => task.run::<_, 6>(&staged_with::<2>(hardware, filter, poles)),
        (Some(poles), 3) => task.run::<_, 7>(&staged_with::<3>(hardware, filter, poles)),
        (Some(poles), 4) => task.run::<_, 8>(&staged_with::<4>(hardware, filter, poles)),
        (Some(poles), _) => task.run::<_, 9>(&staged_with::<5>(hardware, filter, poles)),
    }
}

/// The filter of a method, at its start; that in square-root form for an unscented one is [`Task::root`]'s.
pub(super) fn filter_of<const N: usize>(
    method: Method,
    points: SigmaPoints<f64>,
    (mean, covariance): ([f64; N], Covariance<f64, N>),
) -> AnyFilter<N> {
    let literal = |misprint| AnyFilter::LiteralUkf(LiteralUkf::new(mean, covariance, points, misprint));
    match method {
        Method::Model => AnyFilter::ModelAlone(ModelAlone::new(mean)),
        Method::Ekf | Method::EulerEkf | Method::LockIn => AnyFilter::Ekf(Ekf::new(mean, covariance)),
        Method::IteratedEkf => AnyFilter::IteratedEkf(IteratedEkf::new(mean, covariance, SETTLED)),
        Method::SquareRootEkf => AnyFilter::SquareRootEkf(SquareRootEkf::new(mean, covariance)),
        Method::Ukf | Method::SquareRootUkf => AnyFilter::Ukf(Ukf::new(mean, covariance, points)),
        Method::UkfLiteralWeights => literal(Misprint::Weights),
        Method::UkfLiteralCrossCovariance => literal(Misprint::CrossCovariance),
        Method::UkfLiteralCovariance => literal(Misprint::Covariance),
    }
}

impl Task<'_> {
    /// Chooses the filter.
    fn run<P: Plant<N>, const N: usize>(&self, plant: &P) -> Result<Vec<Trajectory>, EstimateError> {
        let (mean, sd) = self.start::<N>()?;
        let covariance = Covariance::from_standard_deviations(sd);
        let filter = filter_of(self.filter.method, self.filter.points, (mean, covariance));
        let mut trajectories = self.follow(plant, &filter)?;
        if self.filter.method == Method::Model {
            for trajectory in &mut trajectories {
                trajectory.kind = TrajectoryKind::ModelAlone;
            }
        }
        Ok(trajectories)
    }

    /// The unscented filter in square-root form, which tracks no parameters.
    fn root<P: Plant<N>, const N: usize>(&self, plant: &P) -> Result<Vec<Trajectory>, EstimateError> {
        let (mean, sd) = self.start::<N>()?;
        let covariance = Covariance::from_standard_deviations(sd);
        self.follow(plant, &SquareRootUkf::new(mean, covariance, self.filter.points))
    }

    /// The filtered trajectory, and the smoothed ones that are wanted.
    fn follow<P: Plant<N>, F: Filter<f64, N> + Copy, const N: usize>(
        &self,
        plant: &P,
        start: &F,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let filter = self.filter;
        let course = ScannerCourse::new(plant, self.settings.hardware.noise_variance, self.data);
        let mut course = course.map_err(|why| EstimateError::Model { filter: filter.name.clone(), why })?;
        let names = (filter.key.as_str(), filter.name.as_str());
        let filtered = follow(names, *start, &mut course, &filter.states(), self.progress);
        let mut trajectories = vec![filtered.ok_or(EstimateError::Interrupted)?];
        let whole = filter.smooth.then_some((Lookahead::Whole, "smoothed"));
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        // positive; beyond the segment is its end
        let samples = |lag_s: f64| (lag_s / self.data.interval_s).round() as usize;
        let lagged = filter.lag_s.map(|lag_s| (Lookahead::Samples(samples(lag_s)), "lagged"));
        for (lookahead, word) in whole.into_iter().chain(lagged) {
            let (key, name) = (format!("{}_{word}", filter.key), format!("{}, {word}", filter.name));
            let smoothed = smooth((&key, &name), start, &mut course, &trajectories[0], lookahead);
            trajectories.push(smoothed);
        }
        Ok(trajectories)
    }

    /// The first mean and standard deviation of each state.
    fn start<const N: usize>(&self) -> Result<([f64; N], [f64; N]), EstimateError> {
        let (filter, hardware) = (self.filter, &self.settings.hardware);
        let motion = match filter.start {
            Some(start) => start,
            None => self.first_swing()?,
        };
        // The stages start where a mirror at rest at this angle would have them.
        let volts =
            hardware.readout.gain * hardware.readout.comb.capacitance(motion[0]) + hardware.readout.offset;
        let stages = filter.demodulator_sd.map(|sd| [(volts, sd); 2]);
        let angle_and_rate = motion.into_iter().zip(filter.start_sd);
        let parameters = filter.tracked.iter().map(|tracked| (0.0, tracked.sd));
        let mut all = angle_and_rate.chain(stages.into_iter().flatten()).chain(parameters);
        let states: [(f64, f64); N] = std::array::from_fn(|_| all.next().unwrap_or((0.0, 0.0)));
        Ok((states.map(|(mean, _)| mean), states.map(|(_, sd)| sd)))
    }

    /// The motion at the first sample that the first cycles of the signal show.
    fn first_swing(&self) -> Result<[f64; 2], EstimateError> {
        let lock_in = self.detector()?;
        let cycle_s = 1.0 / self.data.motion(self.settings).frequency_hz;
        let first_s = self.data.time_s.first().copied().unwrap_or(0.0);
        let end = self.data.time_s.partition_point(|t| *t < first_s + START_CYCLES * cycle_s);
        let swing = lock_in.swing(&self.data.time_s[..end], &self.data.signal[..end], None);
        swing.map(|swing| swing.at(first_s)).ok_or_else(|| EstimateError::NoStart {
            place: self.place.to_owned(),
            filter: self.filter.name.clone(),
            why: "its first cycles show no amplitude that the electrodes could make".to_owned(),
        })
    }

    fn lock_in(&self) -> Result<Vec<Trajectory>, EstimateError> {
        let names = (self.filter.key.as_str(), self.filter.name.as_str());
        Ok(vec![self.detector()?.trajectory(names, &self.filter.states::<2>(), self.data)])
    }

    fn detector(&self) -> Result<LockIn<'_>, EstimateError> {
        let hardware = &self.settings.hardware;
        let poles = hardware.poles.filter(|_| self.filter.demodulator_sd.is_some());
        let drive = self.data.drive.sine().ok_or_else(|| EstimateError::NoSteadyDrive {
            place: self.place.to_owned(),
            filter: self.filter.name.clone(),
        })?;
        Ok(LockIn::new(hardware, drive, poles))
    }
}

/// How many cycles of the motion a start from the signal takes in.
const START_CYCLES: f64 = 4.0;

/// Gives the motion the sign that the experiment states.
///
/// θ → −θ is an exact symmetry of plant and sensor, and the filters keep it: had the filter started mirrored, its
/// answer would be the mirrored one to the last bit. So the answer is mirrored, and says so. The voltages of the
/// demodulator and the parameters are the same in both.
fn orient(trajectory: &mut Trajectory, settings: &Settings, data: &SegmentData) {
    let Some(positive) = settings.first_peak_positive else { return };
    let peak = data.first_drive_peak(settings);
    let from = data.time_s.partition_point(|t| *t < peak);
    let extremes = extremes_of_rate(&data.time_s[from..], &trajectory.states[1].mean[from..]);
    if extremes.first().is_some_and(|extreme| extreme.maximum != positive) {
        trajectory.mirrored = true;
        for state in trajectory.states.iter_mut().take(2) {
            for mean in &mut state.mean {
                *mean = -*mean;
            }
        }
    }
}
