//! The estimates of one segment.

use super::bank::{AccelerometerBank, AccelerometerBankCourse};
use super::course::{AccelerometerCourse, Hybrid, Prediction};
use super::data::{AccelerometerSegment, ModelInput};
use super::filters::{AccelerometerFilterSettings, INVERTED, MOST_STATES, states};
use super::instrument::Instrument;
use super::noise_estimate::NoiseEstimate;
use super::settings::{AccelerometerHardware, AccelerometerSettings};
use crate::config::Method;
use crate::estimate::{
    AnyFilter, BatchStart, ConstantGain, EstimateError, FilterPast, MeanAndCovariance, MotionRate, Past,
    ReadoutState, SampleSelection, SignalStart, StartAgain, StartSearch, StartedCourse, StateFilter,
    StatePrior, StateSeries, Trajectory, follow, inversion, rows_to_start_again, start_again_from_signal,
    start_from_signal,
};
use crate::progress::Progress;
use crate::units::kind;
use kalmems_core::{
    Covariance, Dual, Dynamics, Ekf, Euler, FixedGain, Gaussian, Process, Scales, SchmidtEkf,
};
use kalmems_models::dynamics::{SensedAcceleration, UncertainMechanics};
use std::f64::consts::TAU;
use std::{array, iter};

/// What is kept of a segment from one part of it to the next.
#[derive(Default)]
pub struct AccelerometerPast {
    /// What every device keeps.
    pub segment: Past,
    /// One per filter.
    adaptive: Vec<AdaptiveState>,
}

impl AccelerometerPast {
    /// Begins another segment; see [`SignalSegment::of`](crate::estimate::SignalSegment::of) for what every device keeps.
    pub fn begin(&mut self) {
        self.adaptive.clear();
    }
}

/// What a filter has learnt of the instrument.
#[derive(Default)]
struct AdaptiveState {
    /// The variance of the readout's noise.
    noise: Option<NoiseEstimate>,
    /// How likely each model of a bank is, and the filters of all.
    bank: Option<Box<AccelerometerBank>>,
}

/// What is kept of one filter.
struct AccelerometerFilterPast<'p> {
    filter: &'p mut FilterPast,
    adaptive: &'p mut AdaptiveState,
}

/// Runs the filters of the settings over the new samples of a segment, and judges the lock of each trajectory.
///
/// `place` names the segment in messages. The past is that of [`Default`] at the beginning of a segment, and is kept from one part of it to
/// the next.
pub fn estimate(
    settings: &AccelerometerSettings,
    data: &AccelerometerSegment,
    samples: &SampleSelection,
    past: &mut AccelerometerPast,
    place: &str,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    let (begun_s, start_s) = (past.segment.start_s, past.segment.start_s + settings.skip_s);
    past.adaptive.resize_with(settings.filters.len(), AdaptiveState::default);
    for ((index, filter), adaptive) in settings.filters.iter().enumerate().zip(&mut past.adaptive) {
        let device = &settings.hardware;
        let task = AccelerometerFilterTask { filter, device, data, samples, begun_s, place, progress };
        let past = past.segment.filter(index);
        let kept = AccelerometerFilterPast { filter: &mut *past, adaptive };
        let scale = |_| filter.basics.no_gain(&"a scale of a state is no positive finite number");
        let mut trajectories = if filter.basics.method == Method::DirectInversion {
            vec![task.inversion(&settings.hardware)]
        } else if filter.basics.method == Method::ConsiderEkf {
            task.considered(&Instrument::uncertain(&settings.hardware).map_err(scale)?, kept)?
        } else if filter.basics.method == Method::Bank {
            let instrument = Instrument::sensed(&settings.hardware).map_err(scale)?;
            task.bank(&settings.hardware, &instrument, kept)?
        } else if filter.known_acceleration {
            task.run(&Instrument::known(&settings.hardware).map_err(scale)?, kept)?
        } else {
            task.run(&Instrument::sensed(&settings.hardware).map_err(scale)?, kept)?
        };
        for (answer, trajectory) in trajectories.iter_mut().enumerate() {
            let (judge, axes) = (&mut past.answer(answer).judge, [("acceleration", motion(settings))]);
            trajectory.lock = judge.judge(trajectory, &axes, start_s, samples.ends);
            if filter.basics.method == Method::Model {
                trajectory.mark_model_alone();
            }
        }
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// How fast an acceleration of this bandwidth goes.
pub fn motion(settings: &AccelerometerSettings) -> MotionRate {
    MotionRate { frequency_hz: settings.hardware.sensed.prior.rate / TAU, is_driven: false }
}

/// One filter over one segment.
struct AccelerometerFilterTask<'a> {
    filter: &'a AccelerometerFilterSettings,
    device: &'a AccelerometerHardware,
    data: &'a AccelerometerSegment<'a>,
    samples: &'a SampleSelection,
    /// When the segment began, in s.
    begun_s: f64,
    place: &'a str,
    progress: &'a dyn Progress,
}

impl AccelerometerFilterTask<'_> {
    /// Chooses the filter and its way of predicting: once per segment, so that the loops inside know their types.
    fn run<D, const N: usize>(
        &self,
        instrument: &Instrument<D, N>,
        past: AccelerometerFilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError>
    where
        D: Dynamics<f64, N, Input: ModelInput> + Copy,
        AnyFilter: From<Box<dyn StateFilter<N>>>,
    {
        let h = self.data.interval_s;
        let found = self.batch_start(instrument, past.filter.left().is_some())?;
        let known = self.start(&instrument.scales, found.as_ref());
        let found = found.as_ref();
        let mean = known.gaussian::<N>().mean;
        let fixed = |filter: &FixedGain<f64, N, 1>| ConstantGain::new(filter, &instrument.at_rest(h));
        match self.filter.basics.method {
            Method::HybridEkf => {
                let step = Hybrid::new(instrument, h).map_err(|why| self.filter.basics.no_gain(&why))?;
                self.filtered(instrument, step, past, found, |left| {
                    self.filter.basics.begin(left, || Ok(known))
                })
            }
            Method::EulerEkf => {
                let rate_hz = instrument.euler_rate_hz();
                if h * rate_hz >= 1.0 {
                    let filter = self.filter.basics.name.clone();
                    return Err(EstimateError::EulerUnstable { filter, interval_s: h, rate_hz });
                }
                let noise = *instrument.over(h).noise().covariance();
                let step = Euler::new(instrument.dynamics, h, noise);
                self.filtered(instrument, step, past, found, |left| {
                    self.filter.basics.begin(left, || Ok(known))
                })
            }
            Method::SteadyState => {
                let gain = FixedGain::steady_state(mean, &instrument.at_rest(h));
                let gain = fixed(&gain.map_err(|why| self.filter.basics.no_gain(&why))?);
                self.filtered(instrument, instrument.divided(h, 1), past, None, |_| Ok(AnyFilter::this(gain)))
            }
            Method::Luenberger => {
                let gain = instrument.luenberger(mean, self.filter.basics.observer_rate, h);
                let gain = fixed(&gain.map_err(|why| self.filter.basics.no_gain(&why))?);
                self.filtered(instrument, instrument.divided(h, 1), past, None, |_| Ok(AnyFilter::this(gain)))
            }
            Method::KalmanBucy => {
                let (observer, point) =
                    instrument.kalman_bucy(h).map_err(|why| self.filter.basics.no_gain(&why))?;
                let none = ConstantGain::without_update(mean, &point)
                    .map_err(|why| self.filter.basics.no_gain(&why))?;
                self.filtered(instrument, observer, past, None, |_| Ok(AnyFilter::this(none)))
            }
            _ => self.filtered(instrument, instrument.divided(h, 1), past, found, |left| {
                self.filter.basics.begin(left, || Ok(known))
            }),
        }
    }

    /// Each sample by itself: the displacement that its voltage means, and the acceleration that holds the mass there against spring
    /// and plates under the feedback until then. It is that of the device as far as it changes slowly against the mass.
    fn inversion(&self, hardware: &AccelerometerHardware) -> Trajectory {
        let (data, device) = (self.data, &hardware.sensed.device);
        let noise = hardware.noise_variance.sqrt();
        let rows = (data.time_s, data.signal, self.samples);
        inversion(&self.filter.basics, rows, &INVERTED, |k, volts| {
            let x = Dual::<f64, 1>::variable(hardware.readout.displacement(volts), 0);
            let [per_metre] = hardware.readout.voltage(x).gradient();
            let still = Dual::constant(0.0);
            let held = -device.response(x, still, still, data.feedback(k.saturating_sub(1)));
            let [stiffness] = held.gradient();
            let sd = noise / per_metre;
            volts.is_finite().then_some([(x.value(), sd.abs()), (held.value(), (stiffness * sd).abs())])
        })
    }

    /// The start from the signal, in scaled states; `None` where the file states one, and where the filter has begun.
    fn batch_start<D, const N: usize>(
        &self,
        instrument: &Instrument<D, N>,
        is_begun: bool,
    ) -> Result<Option<BatchStart>, EstimateError>
    where
        D: Dynamics<f64, N, Input: ModelInput> + Copy,
    {
        let filter = self.filter;
        if is_begun || !filter.from_signal {
            return Ok(None);
        }
        let search = self.search(instrument);
        let (interval_s, names) = (self.data.interval_s, states(N));
        let of = SignalStart {
            place: self.place,
            basics: &filter.basics,
            states: (names, N),
            sizes: instrument.scales.sizes(),
            cycle_s: TAU / instrument.fastest(),
        };
        let mut course = AccelerometerCourse::new(instrument, self.data, instrument.divided(interval_s, 1));
        start_from_signal(&mut course, self.samples, &search, of).map(Some)
    }

    /// What the search for a start knows, in scaled states: of the acceleration and its rate as much as the device's table says of them.
    fn search<D, const N: usize>(&self, instrument: &Instrument<D, N>) -> StartSearch
    where
        D: Dynamics<f64, N, Input: ModelInput> + Copy,
    {
        let (filter, prior) = (self.filter, self.device.sensed.prior);
        let stated = filter.start_sd.iter().zip([0.0, 0.0, prior.rms, prior.rms * prior.rate]);
        // What is stated of a start that is stated is not of a later one.
        let sds =
            stated.map(|(stated, usual)| if *stated > 0.0 && filter.from_signal { *stated } else { usual });
        let sds = sds.chain(filter.spread).zip(instrument.scales.sizes());
        let known = sds.map(|(sd, size)| StatePrior { mean: 0.0, sd: (sd > 0.0).then_some(sd / size) });
        let readout = filter.basics.readout.iter().map(ReadoutState::prior);
        StartSearch { prior: known.chain(readout).collect(), ..StartSearch::default() }
    }

    /// How the filter is started again where it has lost the signal.
    fn start_again<'b, D, const N: usize>(
        &'b self,
        instrument: &'b Instrument<D, N>,
    ) -> Option<StartAgain<'b>>
    where
        D: Dynamics<f64, N, Input: ModelInput> + Copy,
    {
        let (basics, interval_s) = (&self.filter.basics, self.data.interval_s);
        let rows = rows_to_start_again((TAU / instrument.fastest(), interval_s), MOST_STATES);
        let motion_hz = self.device.sensed.prior.rate / TAU;
        let rule = basics.reacquisition(motion_hz, self.begun_s, rows)?;
        let search = self.search(instrument);
        Some(StartAgain::by(rule, move |rows, _| {
            let mut course =
                AccelerometerCourse::new(instrument, self.data, instrument.divided(interval_s, 1));
            start_again_from_signal(&mut course, rows, &search, &basics.readout)
        }))
    }

    /// What is known at first, in scaled states.
    fn start<const N: usize>(
        &self,
        scales: &Scales<f64, N>,
        found: Option<&BatchStart>,
    ) -> MeanAndCovariance {
        if let Some(found) = found {
            return found.first.clone();
        }
        let first = |values: &[f64; 4], deviations: &[f64; 3]| {
            array::from_fn(|i| values.iter().chain(deviations).nth(i).copied().unwrap_or(0.0))
        };
        let start_sd = first(&self.filter.start_sd, &self.filter.spread);
        let covariance = Covariance::from_standard_deviations(start_sd);
        let mean = scales.scale_state(&first(&self.filter.start, &[0.0; 3]));
        MeanAndCovariance::from((mean, scales.scale_covariance(&covariance)))
    }

    /// What a filter that is made so says, in SI.
    fn filtered<D, S, const N: usize>(
        &self,
        instrument: &Instrument<D, N>,
        prediction: S,
        past: AccelerometerFilterPast,
        start: Option<&BatchStart>,
        begin_filter: impl FnOnce(Option<MeanAndCovariance>) -> Result<AnyFilter, EstimateError>,
    ) -> Result<Vec<Trajectory>, EstimateError>
    where
        D: Dynamics<f64, N, Input: ModelInput> + Copy,
        S: Prediction<D, N>,
    {
        let begin =
            |memory_s: f64| NoiseEstimate::new(instrument.noise_variance, memory_s / self.data.interval_s);
        let noise = self
            .filter
            .noise_memory_s
            .map(|memory_s| past.adaptive.noise.take().unwrap_or_else(|| begin(memory_s)));
        let course = AccelerometerCourse::new(instrument, self.data, prediction).with_noise(noise);
        // The model alone is corrected by nothing.
        let corrects = self.filter.basics.method != Method::Model;
        let course = StartedCourse::new(course, start.filter(|_| corrects));
        let mut course = course.starting_again(self.start_again(instrument));
        let (basics, way) = ((&self.filter.basics, past.filter), (&mut course as _, self.samples));
        let mut all = follow(basics, begin_filter, way, states(N), self.progress)?;
        for trajectory in &mut all {
            restore(trajectory, &instrument.scales);
        }
        if let Some(mut noise) = course.into_inner().into_noise() {
            let history = noise.history.drain(..).chain(iter::repeat([f64::NAN; 2]));
            let (mean, sd) = history.take(all[0].time_s.len()).map(|[mean, sd]| (mean, sd)).unzip();
            let (name, unit) = ("noise_variance", "V2");
            all[0].states.push(StateSeries { name, unit, kind: &kind::VOLTAGE_VARIANCE, mean, sd });
            past.adaptive.noise = Some(noise);
        }
        Ok(all)
    }

    /// With spring, damping and mass uncertain, and not estimated.
    fn considered(
        &self,
        instrument: &Instrument<UncertainMechanics<f64>, 7>,
        past: AccelerometerFilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let found = self.batch_start(instrument, past.filter.left().is_some())?;
        let known = self.start(&instrument.scales, found.as_ref());
        let Gaussian { mean, covariance } = known.gaussian::<7>();
        let filter = SchmidtEkf::new(mean, covariance, array::from_fn(|i| i >= 4));
        let process = instrument.divided(self.data.interval_s, 1);
        self.filtered(instrument, process, past, found.as_ref(), |_| Ok(AnyFilter::this(filter)))
    }

    /// Filters of several models, weighed.
    fn bank(
        &self,
        hardware: &AccelerometerHardware,
        instrument: &Instrument<SensedAcceleration<f64>, 4>,
        past: AccelerometerFilterPast,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let mut found = self.batch_start(instrument, past.filter.left().is_some())?;
        if let Some(found) = &mut found {
            // The models weigh the same samples once more: from ten of the standard deviations that these say, they add half a percent.
            found.first.lower.iter_mut().for_each(|entry| *entry *= 100.0);
        }
        let Gaussian { mean, covariance } = self.start(&instrument.scales, found.as_ref()).gaussian();
        let filter = Ekf::new(mean, covariance);
        let mut course = AccelerometerBankCourse::new(hardware, self.data, filter, &self.filter.spread)
            .map_err(|why| self.filter.basics.no_gain(&why))?
            .continuing(past.adaptive.bank.take());
        let (basics, way) = ((&self.filter.basics, past.filter), (&mut course as _, self.samples));
        let mut all = follow(basics, |_| Ok(AnyFilter::this(filter)), way, states(4), self.progress)?;
        past.adaptive.bank = Some(course.into_models());
        for trajectory in &mut all {
            restore(trajectory, &instrument.scales);
        }
        Ok(all)
    }
}

/// Brings the states to SI.
fn restore<const N: usize>(trajectory: &mut Trajectory, scales: &Scales<f64, N>) {
    for (state, size) in trajectory.states.iter_mut().zip(scales.sizes()) {
        for value in state.mean.iter_mut().chain(&mut state.sd) {
            *value *= size;
        }
    }
}
