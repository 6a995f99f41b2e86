//! The estimates of one segment.

use super::filters::FilterSettings;
use super::lock_in::LockIn;
use super::plant::{Published, affine, affine_with, staged, staged_with};
use super::settings::Settings;
use crate::config::Method;
use crate::estimate::driven::{DrivenCourse, DrivenSegment, Plant};
use crate::estimate::{
    AnyFilter, EstimateError, FilterBasics, Progress, StateName, Trajectory, TrajectoryKind, answers,
    judge_lock,
};
use crate::signal::extremes_of_rate;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{Covariance, Filter, SquareRootUkf};

/// Runs the wanted filters over a segment, which `place` names in messages.
pub fn estimate(
    settings: &Settings,
    data: &DrivenSegment,
    place: &str,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    for filter in &settings.filters {
        let mut trajectories = one(&Task { settings, filter, data, place, progress })?;
        for trajectory in &mut trajectories {
            if let Some(positive) = settings.first_peak_positive {
                orient(trajectory, 0, positive, data.first_drive_peak(settings.skip_s));
            }
            let axes = [("angle", data.motion(settings.hardware.natural_hz()))];
            let start_s = data.scored_from(settings.skip_s);
            trajectory.lock = judge_lock(trajectory, data.signal, &axes, start_s);
        }
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// One filter over one segment.
struct Task<'a> {
    settings: &'a Settings,
    filter: &'a FilterSettings,
    data: &'a DrivenSegment<'a>,
    place: &'a str,
    progress: &'a dyn Progress,
}

/// Chooses the model by how many states the filter has: once per segment, so that the loops inside know their types.
fn one(task: &Task) -> Result<Vec<Trajectory>, EstimateError> {
    let (hardware, filter) = (&task.settings.hardware, task.filter);
    let method = filter.basics.method;
    if method == Method::LockIn {
        return task.lock_in();
    }
    let wrong = |why: AugmentationError| filter.basics.no_model(why);
    let poles = hardware.poles.filter(|_| filter.demodulator_sd.is_some());
    match (poles, filter.basics.tracked.len()) {
        (None, _) if method == Method::SquareRootUkf => task.root::<_, 2>(&affine(hardware, filter)),
        (Some(poles), _) if method == Method::SquareRootUkf => {
            task.root::<_, 4>(&staged(hardware, filter, poles))
        }
        (None, 0) if method == Method::EulerEkf => task.run(&Published::new(hardware, filter)),
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

/// A filter of one axis or two on its way through a segment.
pub struct Follower<'a> {
    /// The filter.
    pub filter: &'a FilterBasics,
    /// The segment.
    pub data: &'a DrivenSegment<'a>,
    /// The variance of the signal's noise per sample, in V².
    pub noise_variance: f64,
    /// Where it says how far it has come.
    pub progress: &'a dyn Progress,
}

impl Follower<'_> {
    /// Chooses the filter and follows it from this mean and covariance.
    pub fn run<P: Plant<N>, const N: usize>(
        &self,
        plant: &P,
        states: &[StateName; N],
        start: ([f64; N], Covariance<f64, N>),
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let FilterBasics { method, points, .. } = *self.filter;
        let filter = AnyFilter::of(method, points, start.0, start.1);
        let mut trajectories = self.follow(plant, states, &filter)?;
        if method == Method::Model {
            for trajectory in &mut trajectories {
                trajectory.kind = TrajectoryKind::ModelAlone;
                trajectory.claim_nothing();
            }
        }
        Ok(trajectories)
    }

    /// Follows this filter.
    fn follow<P: Plant<N>, F: Filter<f64, N> + Copy, const N: usize>(
        &self,
        plant: &P,
        states: &[StateName; N],
        start: &F,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let course = DrivenCourse::new(plant, self.noise_variance, self.data);
        let mut course = course.map_err(|why| self.filter.no_model(why))?;
        answers(self.filter, start, (&mut course, self.data.interval_s), states, self.progress)
    }
}

impl Task<'_> {
    fn follower(&self) -> Follower<'_> {
        let (filter, noise_variance) = (&self.filter.basics, self.settings.hardware.noise_variance);
        Follower { filter, data: self.data, noise_variance, progress: self.progress }
    }

    /// The filters but one.
    fn run<P: Plant<N>, const N: usize>(&self, plant: &P) -> Result<Vec<Trajectory>, EstimateError> {
        self.follower().run(plant, &self.filter.states(), self.start()?)
    }

    /// The unscented filter in square-root form, which tracks no parameters.
    fn root<P: Plant<N>, const N: usize>(&self, plant: &P) -> Result<Vec<Trajectory>, EstimateError> {
        let (mean, covariance) = self.start()?;
        let filter = SquareRootUkf::new(mean, covariance, self.filter.basics.points);
        self.follower().follow(plant, &self.filter.states(), &filter)
    }

    /// The first mean and covariance.
    fn start<const N: usize>(&self) -> Result<([f64; N], Covariance<f64, N>), EstimateError> {
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
        let parameters = filter.basics.tracked.iter().map(|tracked| (0.0, tracked.sd));
        let mut all = angle_and_rate.chain(stages.into_iter().flatten()).chain(parameters);
        let states: [(f64, f64); N] = std::array::from_fn(|_| all.next().unwrap_or((0.0, 0.0)));
        Ok((states.map(|(mean, _)| mean), Covariance::from_standard_deviations(states.map(|(_, sd)| sd))))
    }

    /// The motion at the first sample that the first cycles of the signal show.
    fn first_swing(&self) -> Result<[f64; 2], EstimateError> {
        let lock_in = self.detector()?;
        let cycle_s = 1.0 / self.data.motion(self.settings.hardware.natural_hz()).frequency_hz;
        let first_s = self.data.time_s.first().copied().unwrap_or(0.0);
        let end = self.data.time_s.partition_point(|t| *t < first_s + START_CYCLES * cycle_s);
        let swing = lock_in.swing(&self.data.time_s[..end], &self.data.signal[..end], None);
        swing.map(|swing| swing.at(first_s)).ok_or_else(|| EstimateError::NoStart {
            place: self.place.to_owned(),
            filter: self.filter.basics.name.clone(),
            why: "its first cycles show no amplitude that the electrodes could make".to_owned(),
        })
    }

    fn lock_in(&self) -> Result<Vec<Trajectory>, EstimateError> {
        let names = (self.filter.basics.key.as_str(), self.filter.basics.name.as_str());
        let mut trajectory = self.detector()?.trajectory(names, &self.filter.states::<2>(), self.data);
        trajectory.claim_nothing();
        Ok(vec![trajectory])
    }

    fn detector(&self) -> Result<LockIn<'_>, EstimateError> {
        let hardware = &self.settings.hardware;
        let poles = hardware.poles.filter(|_| self.filter.demodulator_sd.is_some());
        let drive = self.data.drive.sine().ok_or_else(|| EstimateError::NoSteadyDrive {
            place: self.place.to_owned(),
            filter: self.filter.basics.name.clone(),
        })?;
        Ok(LockIn::new(hardware, drive, poles))
    }
}

/// How many cycles of the motion a start from the signal takes in.
const START_CYCLES: f64 = 4.0;

/// Gives the motion whose angle and rate begin at `first` the sign of its first turning point after the drive's peak.
///
/// θ → −θ is an exact symmetry of plant and sensor, and the filters keep it: had the filter started mirrored, its
/// answer would be the mirrored one to the last bit. So the answer is mirrored, and says so. The voltages of the
/// demodulator and the parameters are the same in both.
pub fn orient(trajectory: &mut Trajectory, first: usize, positive: bool, peak_s: f64) {
    let from = trajectory.time_s.partition_point(|t| *t < peak_s);
    let extremes = extremes_of_rate(&trajectory.time_s[from..], &trajectory.states[first + 1].mean[from..]);
    if extremes.first().is_some_and(|extreme| extreme.maximum != positive) {
        trajectory.mirrored = true;
        for mean in trajectory.states[first..first + 2].iter_mut().flat_map(|state| &mut state.mean) {
            *mean = -*mean;
        }
    }
}
