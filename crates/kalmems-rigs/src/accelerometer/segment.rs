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
    AnyFilter, ConstantGain, EstimateError, FilterBasics, FilterPast, Motion, Past, Samples, StateSeries,
    Trajectory, TrajectoryKind, answers, follow,
};
use crate::progress::Progress;
use crate::units::kind;
use kalmems_core::{Covariance, Dynamics, Ekf, Filter, FixedGain, Scales, SchmidtEkf};
use kalmems_models::dynamics::{SensedAcceleration, UncertainMechanics};
use std::f64::consts::TAU;
use std::{array, iter};

/// Runs the filters of the settings over the new samples of a segment, and judges the lock of each trajectory.
///
/// The past is [`Past::default`] at the beginning of a segment, and is kept from one part of it to the next.
pub fn estimate(
    settings: &Settings,
    data: &SegmentData,
    samples: &Samples,
    past: &mut Past,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    let start_s = past.start_s + settings.skip_s;
    for (index, filter) in settings.filters.iter().enumerate() {
        let task = Task { filter, data, samples, progress };
        let past = past.filter(index);
        let scale = |_| task.no_gain(&"a scale of a state is no positive finite number");
        let mut trajectories = if filter.basics.method == Method::ConsiderEkf {
            task.considered(&Instrument::uncertain(&settings.hardware).map_err(scale)?, past)?
        } else if filter.basics.method == Method::Bank {
            let instrument = Instrument::sensed(&settings.hardware).map_err(scale)?;
            vec![task.bank(&settings.hardware, &instrument, past)?]
        } else if filter.known_acceleration {
            task.run(&Instrument::known(&settings.hardware).map_err(scale)?, past)?
        } else {
            task.run(&Instrument::sensed(&settings.hardware).map_err(scale)?, past)?
        };
        for (answer, trajectory) in trajectories.iter_mut().enumerate() {
            let (judge, axes) = (&mut past.answer(answer).judge, [("acceleration", motion(settings))]);
            trajectory.lock = judge.judge(trajectory, &axes, start_s, samples.ends);
            if !filter.basics.method.claims() {
                trajectory.kind = TrajectoryKind::ModelAlone;
                trajectory.claim_nothing();
            }
        }
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// How fast an acceleration of this bandwidth goes.
pub fn motion(settings: &Settings) -> Motion {
    Motion { frequency_hz: settings.hardware.sensed.prior.rate / TAU, is_driven: false }
}

/// One filter over one segment.
struct Task<'a> {
    filter: &'a FilterSettings,
    data: &'a SegmentData<'a>,
    samples: &'a Samples,
    progress: &'a dyn Progress,
}

impl Task<'_> {
    /// Chooses the filter and its way of predicting: once per segment, so that the loops inside know their types.
    fn run<D, const N: usize>(
        &self,
        instrument: &Instrument<D, N>,
        past: &mut FilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError>
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
                self.filtered(instrument, step, Ekf::new(mean, covariance), past)
            }
            Method::SteadyState => {
                let gain = FixedGain::steady_state(mean, &instrument.at_rest(h));
                let gain = fixed(&gain.map_err(|why| self.no_gain(&why))?);
                self.filtered(instrument, instrument.over(h), gain, past)
            }
            Method::Luenberger => {
                let gain = instrument.luenberger(mean, self.filter.observer_rate, h);
                let gain = fixed(&gain.map_err(|why| self.no_gain(&why))?);
                self.filtered(instrument, instrument.over(h), gain, past)
            }
            Method::KalmanBucy => {
                let (observer, point) = instrument.kalman_bucy(h).map_err(|why| self.no_gain(&why))?;
                let none = ConstantGain::without_update(mean, &point).map_err(|why| self.no_gain(&why))?;
                self.filtered(instrument, observer, none, past)
            }
            _ if self.filter.noise_memory_s.is_some() => {
                let filter = AnyFilter::of(method, points, mean, covariance);
                self.filtered(instrument, instrument.over(h), filter, past)
            }
            _ => {
                let filter = AnyFilter::of(method, points, mean, covariance);
                let mut course = AccelerometerCourse::new(instrument, self.data, instrument.over(h));
                let (basics, course) = ((&self.filter.basics, past), (&mut course, self.samples));
                let all = answers(basics, || Ok(filter), course, &states(), self.progress)?;
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
        past: &mut FilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError>
    where
        D: Dynamics<f64, N, Input: Input> + Copy,
        S: Step<D, N>,
        F: Filter<f64, N> + Clone + Send + 'static,
    {
        let begin = |memory_s: f64| {
            Box::new(NoiseEstimate::new(instrument.noise_variance, memory_s / self.data.interval_s))
        };
        let noise = self.filter.noise_memory_s.map(|memory_s| {
            let kept = past.course.take::<NoiseEstimate>();
            *kept.unwrap_or_else(|| begin(memory_s))
        });
        let mut course = AccelerometerCourse::new(instrument, self.data, step).with_noise(noise);
        let (basics, samples) = ((&self.filter.basics, &mut *past), (&mut course, self.samples));
        let followed = follow(basics, || Ok(filter), samples, &states(), self.progress)?;
        let mut trajectory = restored(followed, &instrument.scales);
        if let Some(mut noise) = course.into_noise() {
            let mut all = noise.history.drain(..).chain(iter::repeat([f64::NAN; 2]));
            let (mean, sd) = all.by_ref().take(trajectory.time_s.len()).map(|[mean, sd]| (mean, sd)).unzip();
            drop(all);
            let (name, unit) = ("noise_variance", "V2");
            trajectory.states.push(StateSeries { name, unit, kind: &kind::VOLTAGE_VARIANCE, mean, sd });
            past.course.put(Box::new(noise));
        }
        Ok(vec![trajectory])
    }

    /// With spring, damping and mass uncertain, and not estimated.
    fn considered(
        &self,
        instrument: &Instrument<UncertainMechanics<f64>, 7>,
        past: &mut FilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let (mean, covariance) = self.start(&instrument.scales);
        let filter = SchmidtEkf::new(mean, covariance, array::from_fn(|i| i >= 4));
        self.filtered(instrument, instrument.over(self.data.interval_s), filter, past)
    }

    /// Filters of several models, weighed.
    fn bank(
        &self,
        hardware: &Hardware,
        instrument: &Instrument<SensedAcceleration<f64>, 4>,
        past: &mut FilterPast,
    ) -> Result<Trajectory, EstimateError> {
        let (mean, covariance) = self.start(&instrument.scales);
        let filter = Ekf::new(mean, covariance);
        let mut course = BankCourse::new(hardware, self.data, filter, &self.filter.spread)
            .map_err(|why| self.no_gain(&why))?
            .continuing(past.course.take());
        let (basics, samples) = ((&self.filter.basics, &mut *past), (&mut course, self.samples));
        let followed = follow(basics, || Ok(filter), samples, &states(), self.progress)?;
        past.course.put(course.into_models());
        Ok(restored(followed, &instrument.scales))
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
