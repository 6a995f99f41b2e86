//! The estimates of one segment.

use super::filters::{FilterSettings, STATES, Start};
use super::plant::{both, both_with};
use super::settings::Settings;
use super::start::{BatchStart, StartError};
use super::tones::DriveTones;
use crate::estimate::driven::{Augmentation, DrivenSegment, Plant};
use crate::estimate::{EstimateError, Progress, Trajectory, judge_lock};
use crate::rigs::shared_scanner::segment::{Follower, orient};
use kalmems_core::{Covariance, Mat};
use kalmems_models::dynamics::TwoAxisDriveGain;
use kalmems_models::readout::TwoAxisComb;
use std::f64::consts::TAU;

/// What the filters say of one segment.
#[derive(Clone, Debug)]
pub struct TwoAxisEstimate {
    /// The drives of x and y.
    pub drive: DriveTones,
    /// One per answer, with the states `angle_x`, `rate_x`, `angle_y` and `rate_y`.
    pub trajectories: Vec<Trajectory>,
}

/// Runs the wanted filters over both axes of a segment, which `place` names in messages.
pub fn estimate(
    settings: &Settings,
    place: &str,
    data: &DrivenSegment,
    progress: &dyn Progress,
) -> Result<TwoAxisEstimate, EstimateError> {
    let drive = DriveTones::of(data.time_s, data.drive.volts(), data.interval_s, resonances_hz(settings))
        .ok_or_else(|| EstimateError::NotTwoSines { place: place.to_owned() })?;
    let motions = drive.motions();
    let slowest_hz = motions.iter().map(|(_, motion)| motion.frequency_hz).fold(f64::INFINITY, f64::min);
    data.require_cycles(place, settings.skip_s, slowest_hz)?;
    let start_s = data.scored_from(settings.skip_s);
    let mut trajectories = Vec::new();
    for filter in &settings.filters {
        let mut found = Task { settings, filter, data, drive: &drive, place, progress }.one()?;
        for trajectory in &mut found {
            for (axis, positive) in settings.first_peak_positive.iter().enumerate() {
                if let Some(positive) = *positive {
                    orient(trajectory, 2 * axis, positive, drive.tones[axis].peak_after(start_s));
                }
            }
            trajectory.lock = judge_lock(trajectory, data.signal, &motions, start_s);
        }
        trajectories.append(&mut found);
    }
    Ok(TwoAxisEstimate { drive, trajectories })
}

/// The free resonances of x and y.
fn resonances_hz(settings: &Settings) -> [f64; 2] {
    let scanner = &settings.hardware.scanner;
    [scanner.x, scanner.y].map(|axis| axis.resonator.natural_rate() / TAU)
}

/// How much of the signal a start from it takes in, in s.
const WINDOW_S: f64 = 2e-3;

/// One filter over one segment.
struct Task<'a> {
    settings: &'a Settings,
    filter: &'a FilterSettings,
    data: &'a DrivenSegment<'a>,
    drive: &'a DriveTones,
    place: &'a str,
    progress: &'a dyn Progress,
}

impl Task<'_> {
    /// Chooses the model by how many states the filter has: once per segment, so that the loops inside know their types.
    fn one(&self) -> Result<Vec<Trajectory>, EstimateError> {
        match self.filter.basics.tracked.len() {
            0 => self.run::<_, 4>(&both(&self.settings.hardware, self.filter)),
            1 => self.with::<1, 5>(),
            2 => self.with::<2, 6>(),
            3 => self.with::<3, 7>(),
            4 => self.with::<4, 8>(),
            5 => self.with::<5, 9>(),
            6 => self.with::<6, 10>(),
            _ => self.with::<7, 11>(),
        }
    }

    /// With `A` parameters as states.
    fn with<const A: usize, const N: usize>(&self) -> Result<Vec<Trajectory>, EstimateError>
    where
        Augmentation<TwoAxisDriveGain<f64>, TwoAxisComb<f64>, 4, A>: Plant<N>,
    {
        let plant = both_with::<A>(&self.settings.hardware, self.filter);
        self.run::<_, N>(&plant.map_err(|why| self.filter.basics.no_model(why))?)
    }

    fn run<P: Plant<N>, const N: usize>(&self, plant: &P) -> Result<Vec<Trajectory>, EstimateError> {
        let filter = &self.filter.basics;
        let noise_variance = self.settings.hardware.noise_variance;
        let follower = Follower { filter, data: self.data, noise_variance, progress: self.progress };
        follower.run(plant, &filter.states(&STATES), self.start()?)
    }

    /// Mean and covariance at the first sample.
    fn start<const N: usize>(&self) -> Result<([f64; N], Covariance<f64, N>), EstimateError> {
        let (motion, covariance) = match &self.filter.start {
            Start::Given { mean, covariance } => (*mean, *covariance),
            Start::Signal => {
                let found = self.batch_start().map_err(|why| EstimateError::NoStart {
                    place: self.place.to_owned(),
                    filter: self.filter.basics.name.clone(),
                    why: why.to_string(),
                })?;
                (found.mean, found.covariance)
            }
        };
        let mut mean = [0.0; N];
        let mut lower = Mat::zero();
        for i in 0..motion.len() {
            mean[i] = motion[i];
            for j in 0..=i {
                lower.0[i][j] = covariance.get(i, j);
            }
        }
        for (i, tracked) in self.filter.basics.tracked.iter().enumerate() {
            let i = motion.len() + i;
            lower.0[i][i] = tracked.sd * tracked.sd;
        }
        Ok((mean, Covariance::from_lower(lower)))
    }

    fn batch_start(&self) -> Result<BatchStart, StartError> {
        let first = self.data.time_s.first().copied().unwrap_or(0.0);
        let end = self.data.time_s.partition_point(|t| *t <= first + WINDOW_S);
        let drives_hz = self.drive.tones.map(|tone| tone.frequency_hz);
        let (time_s, signal) = (&self.data.time_s[..end], &self.data.signal[..end]);
        BatchStart::of(&self.settings.hardware.readout, time_s, signal, drives_hz)
    }
}
