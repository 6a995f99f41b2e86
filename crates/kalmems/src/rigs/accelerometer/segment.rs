//! The estimates of one segment.

use super::bank::BankCourse;
use super::course::{AccelerometerCourse, Hybrid, Step};
use super::data::{Input, SegmentData};
use super::filters::{FilterSettings, states};
use super::instrument::Instrument;
use super::noise_estimate::NoiseEstimate;
use super::settings::{Hardware, Settings};
use crate::config::Method;
use crate::estimate::{
    AnyFilter, ConstantGain, EstimateError, FilterBasics, Motion, Progress, StateSeries, Trajectory,
    TrajectoryKind, answers, follow, judge_lock,
};
use crate::units::kind;
use kalmems_core::{Covariance, Dynamics, Ekf, Filter, FixedGain, Scales, SchmidtEkf};
use kalmems_models::dynamics::{SensedAcceleration, UncertainMechanics};
use std::f64::consts::TAU;
use std::{array, iter};

/// Runs the wanted filters over a segment.
pub fn estimate(
    settings: &Settings,
    data: &SegmentData,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    for filter in &settings.filters {
        let task = Task { filter, data, progress };
        let scale = |_| task.no_gain(&"a scale of a state is no positive finite number");
        let mut trajectories = if filter.basics.method == Method::ConsiderEkf {
            task.considered(&Instrument::uncertain(&settings.hardware).map_err(scale)?)?
        } else if filter.basics.method == Method::Bank {
            let instrument = Instrument::sensed(&settings.hardware).map_err(scale)?;
            vec![task.bank(&settings.hardware, &instrument)?]
        } else if filter.known_acceleration {
            task.run(&Instrument::known(&settings.hardware).map_err(scale)?)?
        } else {
            task.run(&Instrument::sensed(&settings.hardware).map_err(scale)?)?
        };
        for trajectory in &mut trajectories {
            finish(trajectory, settings, data, filter);
        }
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// How fast an acceleration of this bandwidth goes.
pub fn motion(settings: &Settings) -> Motion {
    Motion { frequency_hz: settings.hardware.sensed.prior.rate / TAU, is_driven: false }
}

/// Whether it followed the signal, and no uncertainty for what claims none.
fn finish(trajectory: &mut Trajectory, settings: &Settings, data: &SegmentData, filter: &FilterSettings) {
    let start_s = data.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
    let axes = [("acceleration", motion(settings))];
    trajectory.lock = judge_lock(trajectory, data.signal, &axes, start_s);
    if !filter.basics.method.claims() {
        trajectory.kind = TrajectoryKind::ModelAlone;
        trajectory.claim_nothing();
    }
}

/// One filter over one segment.
struct Task<'a> {
    filter: &'a FilterSettings,
    data: &'a SegmentData<'a>,
    progress: &'a dyn Progress,
}

impl Task<'_> {
    /// Chooses the filter and its way of predicting: once per segment, so that the loops inside know their types.
    fn run<D, const N: usize>(&self, instrument: &Instrument<D, N>) -> Result<Vec<Trajectory>, EstimateError>
    where
        D: Dynamics<f64, N, Input: Input> + Copy,
    {
        let h = self.data.interval_s;
        let (mean, covariance) = self.start(&instrument.scales);
        let fixed = |filter: &FixedGain<f64, N, 1>| ConstantGain::new(filter, &instrument.at_rest(h));
        let FilterBasics { method, points, .. } = self.filter.basics;
        match method {
            Method::HybridEkf => {
                let step = Hybrid::new(instrument, h).map_err(|why| self.no_gain(&why))?;
                self.filtered(instrument, step, Ekf::new(mean, covariance))
            }
            Method::SteadyState => {
                let gain = FixedGain::steady_state(mean, &instrument.at_rest(h));
                let gain = fixed(&gain.map_err(|why| self.no_gain(&why))?);
                self.filtered(instrument, instrument.over(h), gain)
            }
            Method::Luenberger => {
                let gain = instrument.luenberger(mean, self.filter.observer_rate, h);
                let gain = fixed(&gain.map_err(|why| self.no_gain(&why))?);
                self.filtered(instrument, instrument.over(h), gain)
            }
            Method::KalmanBucy => {
                let (observer, point) = instrument.kalman_bucy(h).map_err(|why| self.no_gain(&why))?;
                let none = ConstantGain::without_update(mean, &point).map_err(|why| self.no_gain(&why))?;
                self.filtered(instrument, observer, none)
            }
            _ if self.filter.noise_memory_s.is_some() => {
                let filter = AnyFilter::of(method, points, mean, covariance);
                self.filtered(instrument, instrument.over(h), filter)
            }
            _ => {
                let filter = AnyFilter::of(method, points, mean, covariance);
                let mut course = AccelerometerCourse::new(instrument, self.data, instrument.over(h));
                let all = answers(&self.filter.basics, &filter, (&mut course, h), &states(), self.progress)?;
                Ok(all.into_iter().map(|one| restored(one, &instrument.scales)).collect())
            }
        }
    }

    /// The first mean and covariance, in scaled states.
    fn start<const N: usize>(&self, scales: &Scales<f64, N>) -> ([f64; N], Covariance<f64, N>) {
        let first = |values: &[f64; 4], deviations: &[f64; 3]| {
            array::from_fn(|i| values.iter().chain(deviations).nth(i).copied().unwrap_or(0.0))
        };
        let start_sd = first(&self.filter.start_sd, &self.filter.spread);
        let covariance = Covariance::from_standard_deviations(start_sd);
        (scales.scale_state(&first(&self.filter.start, &[0.0; 3])), scales.scale_covariance(&covariance))
    }

    /// A filter that is not smoothed.
    fn filtered<D, S, F, const N: usize>(
        &self,
        instrument: &Instrument<D, N>,
        step: S,
        filter: F,
    ) -> Result<Vec<Trajectory>, EstimateError>
    where
        D: Dynamics<f64, N, Input: Input> + Copy,
        S: Step<D, N>,
        F: Filter<f64, N>,
    {
        let FilterBasics { key, name, .. } = &self.filter.basics;
        let noise = self
            .filter
            .noise_memory_s
            .map(|memory_s| NoiseEstimate::new(instrument.noise_variance, memory_s / self.data.interval_s));
        let mut course = AccelerometerCourse::new(instrument, self.data, step).with_noise(noise);
        let followed = follow((key, name), filter, &mut course, &states(), self.progress);
        let mut trajectory = restored(followed.ok_or(EstimateError::Interrupted)?, &instrument.scales);
        if let Some(noise) = course.into_noise() {
            let mut all = noise.history.iter().copied().chain(iter::repeat([f64::NAN; 2]));
            let (mean, sd) = all.by_ref().take(trajectory.time_s.len()).map(|[mean, sd]| (mean, sd)).unzip();
            let (name, unit) = ("noise_variance", "V2");
            trajectory.states.push(StateSeries { name, unit, kind: &kind::VOLTAGE_VARIANCE, mean, sd });
        }
        Ok(vec![trajectory])
    }

    /// With spring, damping and mass uncertain, and not estimated.
    fn considered(
        &self,
        instrument: &Instrument<UncertainMechanics<f64>, 7>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let (mean, covariance) = self.start(&instrument.scales);
        let filter = SchmidtEkf::new(mean, covariance, array::from_fn(|i| i >= 4));
        self.filtered(instrument, instrument.over(self.data.interval_s), filter)
    }

    /// Filters of several models, weighed.
    fn bank(
        &self,
        hardware: &Hardware,
        instrument: &Instrument<SensedAcceleration<f64>, 4>,
    ) -> Result<Trajectory, EstimateError> {
        let (mean, covariance) = self.start(&instrument.scales);
        let FilterBasics { key, name, .. } = &self.filter.basics;
        let filter = Ekf::new(mean, covariance);
        let mut course = BankCourse::new(hardware, self.data, filter, &self.filter.spread)
            .map_err(|why| self.no_gain(&why))?;
        let followed = follow((key, name), filter, &mut course, &states(), self.progress);
        Ok(restored(followed.ok_or(EstimateError::Interrupted)?, &instrument.scales))
    }

    fn no_gain(&self, why: &dyn std::fmt::Display) -> EstimateError {
        EstimateError::NoGain { filter: self.filter.basics.name.clone(), why: why.to_string() }
    }
}

/// The same in SI.
fn restored<const N: usize>(mut trajectory: Trajectory, scales: &Scales<f64, N>) -> Trajectory {
    for (state, size) in trajectory.states.iter_mut().zip(scales.sizes()) {
        for value in state.mean.iter_mut().chain(&mut state.sd) {
            *value *= size;
        }
    }
    trajectory
}
