//! The estimates of one segment.

use super::course::TwoAxisCourse;
use super::filters::{FilterSettings, STATES, Start};
use super::lock::judge;
use super::settings::Settings;
use super::start::{BatchStart, StartError};
use super::tones::DriveTones;
use crate::estimate::{EstimateError, Progress, Trajectory, TrajectoryKind, follow};
use crate::rigs::shared_scanner::data::SegmentData;
use crate::rigs::shared_scanner::drive::Drive;
use crate::rigs::shared_scanner::segment::filter_of;
use crate::signal::{extremes_of_rate, usual_interval};
use kalmems_core::Covariance;
use std::f64::consts::TAU;

/// The samples of one segment.
#[derive(Clone, Copy, Debug)]
pub struct Samples<'a> {
    /// The recording and its segment, for messages.
    pub place: &'a str,
    /// When, in s.
    pub time_s: &'a [f64],
    /// The drive in V.
    pub drive: &'a [f64],
    /// The demodulated signal in V; not a number where it is missing.
    pub signal: &'a [f64],
}

/// What the filters say of one segment.
#[derive(Clone, Debug)]
pub struct TwoAxisEstimate {
    /// The drives of x and y.
    pub drive: DriveTones,
    /// One per filter, with the states `angle_x`, `rate_x`, `angle_y` and `rate_y`.
    pub trajectories: Vec<Trajectory>,
}

/// Runs the wanted filters over both axes.
pub fn estimate(
    settings: &Settings,
    samples: Samples,
    progress: &dyn Progress,
) -> Result<TwoAxisEstimate, EstimateError> {
    let Samples { place, time_s, drive, signal } = samples;
    let interval_s = usual_interval(time_s);
    let tones = DriveTones::of(time_s, drive, interval_s, resonances_hz(settings))
        .ok_or_else(|| EstimateError::NotTwoSines { place: place.to_owned() })?;
    let data = SegmentData { time_s, signal, drive: Drive::new(time_s, drive, interval_s), interval_s };
    let run = Run { settings, data: &data, tones: &tones, progress };
    let mut trajectories = Vec::new();
    for filter in &settings.filters {
        let start = run.start(&filter.start).map_err(|why| EstimateError::NoStart {
            place: place.to_owned(),
            filter: filter.name.clone(),
            why: why.to_string(),
        })?;
        let mut trajectory = run.follow(filter, start)?;
        if !filter.method.claims() {
            trajectory.kind = TrajectoryKind::ModelAlone;
            for state in &mut trajectory.states {
                // The model alone claims no uncertainty; zeros would look like a claim.
                state.sd.clear();
            }
        }
        trajectories.push(trajectory);
    }
    Ok(TwoAxisEstimate { drive: tones, trajectories })
}

/// The free resonances of x and y.
fn resonances_hz(settings: &Settings) -> [f64; 2] {
    let scanner = &settings.hardware.scanner;
    [scanner.x, scanner.y].map(|axis| axis.resonator.natural_rate() / TAU)
}

/// How much of the signal a start from it takes in, in s.
const WINDOW_S: f64 = 2e-3;

struct Run<'a> {
    settings: &'a Settings,
    data: &'a SegmentData<'a>,
    tones: &'a DriveTones,
    progress: &'a dyn Progress,
}

impl Run<'_> {
    /// Mean and covariance at the first sample.
    fn start(&self, start: &Start) -> Result<([f64; 4], Covariance<f64, 4>), StartError> {
        match start {
            Start::Given { mean, covariance } => Ok((*mean, *covariance)),
            Start::Signal => {
                let first = self.data.time_s.first().copied().unwrap_or(0.0);
                let end = self.data.time_s.partition_point(|t| *t <= first + WINDOW_S);
                let drives_hz = self.tones.tones.map(|tone| tone.frequency_hz);
                let (time_s, signal) = (&self.data.time_s[..end], &self.data.signal[..end]);
                let found = BatchStart::of(&self.settings.hardware.readout, time_s, signal, drives_hz)?;
                Ok((found.mean, found.covariance))
            }
        }
    }

    fn follow(
        &self,
        filter: &FilterSettings,
        start: ([f64; 4], Covariance<f64, 4>),
    ) -> Result<Trajectory, EstimateError> {
        let mut course = TwoAxisCourse::new(self.settings, filter.acceleration_density, self.data);
        let names = (filter.key.as_str(), filter.name.as_str());
        let at_start = filter_of(filter.method, filter.points, start);
        let mut trajectory =
            follow(names, at_start, &mut course, &STATES, self.progress).ok_or(EstimateError::Interrupted)?;
        let start_s = self.data.time_s.first().copied().unwrap_or(0.0) + self.settings.skip_s;
        self.orient(&mut trajectory, start_s);
        trajectory.lock = judge(&trajectory, self.data.signal, self.tones, start_s);
        Ok(trajectory)
    }

    /// Gives each axis the sign that the experiment states.
    ///
    /// Either axis mirrored is an exact symmetry of plant and sensor, and the filters keep it; so an answer of the
    /// other sign is mirrored, and says so.
    fn orient(&self, trajectory: &mut Trajectory, start_s: f64) {
        for (axis, positive) in self.settings.first_peak_positive.iter().enumerate() {
            let Some(positive) = *positive else { continue };
            let peak = self.tones.tones[axis].peak_after(start_s);
            let from = self.data.time_s.partition_point(|t| *t < peak);
            let rate = &trajectory.states[2 * axis + 1].mean;
            let first = extremes_of_rate(&self.data.time_s[from..], &rate[from..]).first().copied();
            if first.is_some_and(|extreme| extreme.maximum != positive) {
                trajectory.mirrored = true;
                for mean in trajectory.states[2 * axis..2 * axis + 2].iter_mut().flat_map(|s| &mut s.mean) {
                    *mean = -*mean;
                }
            }
        }
    }
}
