//! One filter over the new samples of a segment.

use super::course::{EquationCourse, EquationSegment};
use super::filter_settings::EquationFilterSettings;
use super::model::{EquationModel, Interval, StepRoom};
use super::own_device::OwnDevice;
use super::own_filter::OwnFilter;
use super::phase_lock::{LoopOf, phase_lock};
use super::phases::PhaseCourse;
use super::settings::EquationSettings;
use super::sine::QuantitySine;
use super::start::start_of;
use crate::config::Method;
use crate::estimate::driven::HYBRID_STEPS;
use crate::estimate::{
    AnyFilter, BatchStart, Course, EstimateError, FilterPast, FilterSideOutputs, MeanAndCovariance,
    NoiseEstimate, Sensor, StartedCourse, Trajectory, Transition, answers_of_bank, begun, follow,
};
use crate::progress::{Progress, Silent};
use kalmems_core::Nodes;

/// One filter over the new samples.
pub struct EquationFilterTask<'a> {
    /// The device.
    pub own: &'a OwnDevice,
    /// The sine that its motion is, where it is one.
    pub sine: Option<&'a QuantitySine>,
    /// How long it has to settle, in s.
    pub skip_s: f64,
    /// What the file says of the filter.
    pub filter: &'a EquationFilterSettings,
    /// Its models: one, but for a bank.
    pub models: &'a [EquationModel],
    /// What it gives besides its states.
    pub side_outputs: FilterSideOutputs,
    /// What makes it, if it is one of the caller's own.
    pub own_filter: Option<&'a OwnFilter>,
    /// The samples.
    pub data: &'a EquationSegment<'a>,
    /// Who follows the work.
    pub progress: &'a dyn Progress,
}

impl<'a> EquationFilterTask<'a> {
    /// A filter by itself, in silence.
    pub fn of(
        settings: &'a EquationSettings,
        filter: &'a EquationFilterSettings,
        models: &'a [EquationModel],
        data: &'a EquationSegment<'a>,
    ) -> Self {
        Self {
            own: &filter.own,
            sine: settings.sine.as_ref(),
            skip_s: settings.skip_s,
            filter,
            models,
            side_outputs: FilterSideOutputs::default(),
            own_filter: None,
            data,
            progress: &Silent,
        }
    }
}

impl EquationFilterTask<'_> {
    /// Its trajectory, and the smoothed ones that are wanted.
    pub fn follow(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let basics = &self.filter.basics;
        let states = basics.states(self.own.states());
        if let Some(inverse) = &self.filter.inverse {
            return Ok(self.inversion(inverse, self.own.states()).into_iter().collect());
        }
        if let Some(sine) = self.sine.filter(|_| basics.method == Method::LockIn) {
            return Ok(vec![self.lock_in_of_sine(sine, past)?]);
        }
        if basics.method == Method::LockIn {
            return Ok(vec![self.lock_in(past, self.own.states())?]);
        }
        if basics.method == Method::EulerEkf {
            self.require_slow()?;
        }
        let channels = self.channels();
        let steps = if basics.method == Method::HybridEkf { HYBRID_STEPS } else { 1 };
        // A filter that goes on from another run has been started there.
        let starts: Vec<Option<BatchStart>> = if past.left().is_none() {
            let of_model = |model| self.start(model, &channels, steps);
            let starts = self.models.iter().map(of_model).collect::<Result<Vec<_>, _>>()?;
            if let Some(Some(start)) = starts.first() {
                past.began_by(start, self.data.time_s);
            }
            starts
        } else {
            vec![past.start_among(self.data.time_s)]
        };
        let by_swing = if past.left().is_none() { self.start_by_swing()? } else { None };
        let known = |index: usize| {
            let from_signal = start_of(&starts, index).map(|start| start.first.clone());
            from_signal.or_else(|| by_swing.clone()).or_else(|| self.filter.stated()).unwrap_or_default()
        };
        let used = (&*channels, &*self.filter.events);
        let course_of = |(index, model), phases, noise| {
            let course = EquationCourse::new(model, (self.data, &self.own.between), used, steps)
                .answering(&self.own.device)
                .telling_phases(self.side_outputs.phase_rate(), phases)
                .moving_points(basics.method.is_unscented())
                .taking_samples_for(self.filter.signal_variance)
                .estimating_noise(noise)
                .taking_signal(self.filter.variant);
            // The model alone is corrected by nothing, wherever it starts.
            let corrects = basics.method != Method::Model;
            let started = StartedCourse::new(course, start_of(&starts, index).filter(|_| corrects));
            started.starting_again(self.start_again(model, &channels, steps))
        };
        if basics.method == Method::Bank {
            let courses = self.models.iter().enumerate();
            let courses =
                courses.map(|model| -> Box<dyn Course + '_> { Box::new(course_of(model, None, None)) });
            let way = (courses.collect(), &self.data.samples);
            return answers_of_bank((basics, past), |index| Ok(known(index)), way, &states, self.progress);
        }
        let Some(model) = self.models.first() else { return Ok(Vec::new()) };
        let turns = self.own.swings() > 0 && basics.parameters().is_empty();
        if (self.sine.is_some() || turns) && basics.gain().is_some() && past.numbers.is_empty() {
            past.numbers = known(0).mean;
            if turns {
                past.numbers = self.operating(&past.numbers);
            }
        }
        let operating = past.numbers.clone();
        let predictor = self.side_outputs.predictor(basics, self.data.samples.interval_s, past)?;
        let (from_s, interval_s) = (self.side_outputs.from_s, self.data.samples.interval_s);
        let phases = predictor.map(|predictor| PhaseCourse::new(predictor, from_s, interval_s));
        let noise = self.noise(past);
        let mut course = course_of((0, model), phases, noise);
        let way = (&mut course as _, &self.data.samples);
        // A start from the signal has the states of the readout, as what another run left has.
        let begin =
            |left| self.begin((begun(left, start_of(&starts, 0)), known(0), operating), model, &channels);
        let mut all = follow((basics, &mut *past), begin, way, &states, self.progress)?;
        let (phases, noise) = course.into_inner().into_kept();
        (past.predictor, past.noise) = (phases.map(PhaseCourse::into_predictor), noise);
        if basics.method == Method::Model {
            all.iter_mut().for_each(Trajectory::mark_model_alone);
        }
        if let Some(sine) = self.sine {
            sine.turn_back(self.own, &mut all);
        }
        // Of a number that is not estimated no deviation is claimed: zeros would look like a claim.
        let named = self.own.device.quantities();
        let stated: Vec<&str> =
            model.stated_quantities().filter_map(|k| Some(&*named.get(k)?.name)).collect();
        let series = all.iter_mut().flat_map(|trajectory| &mut trajectory.states);
        series.filter(|state| stated.contains(&state.name)).for_each(|state| state.sd.clear());
        Ok(all)
    }

    /// Refuses a device some of whose motion decays faster than Euler's method follows it, |1 + λ·h| < 1.
    fn require_slow(&self) -> Result<(), EstimateError> {
        let decays = self.own.modes.iter().filter(|mode| !mode.oscillates() && mode.growth < 0.0);
        let rate_hz = decays.map(|mode| -0.5 * mode.growth).fold(0.0, f64::max);
        let interval_s = self.data.samples.interval_s;
        if interval_s * rate_hz < 1.0 {
            return Ok(());
        }
        let filter = self.filter.basics.name.clone();
        Err(EstimateError::EulerUnstable { filter, interval_s, rate_hz })
    }

    /// The variance of a sample as it was estimated until here, where the filter estimates it.
    fn noise(&self, past: &mut FilterPast) -> Option<NoiseEstimate> {
        let memory_s = self.filter.noise_memory_s?;
        let channel = self.channels().first().and_then(|place| self.data.channels.get(*place))?;
        let begun = || NoiseEstimate::new(channel.variance, memory_s / self.data.samples.interval_s);
        let mut noise = past.noise.take().unwrap_or_else(begun);
        noise.going_on();
        Some(noise)
    }

    /// The channels that correct it.
    pub fn channels(&self) -> Vec<usize> {
        let wanted = &self.filter.measures;
        let all = 0..self.data.channels.len();
        if wanted.is_empty() {
            return all.collect();
        }
        let place = |measure: &usize| self.data.channels.iter().position(|c| c.measure == *measure);
        wanted.iter().filter_map(place).collect()
    }

    fn begin(
        &self,
        (left, start, operating): (Option<MeanAndCovariance>, MeanAndCovariance, Vec<f64>),
        model: &EquationModel,
        channels: &[usize],
    ) -> Result<AnyFilter, EstimateError> {
        let basics = &self.filter.basics;
        if let Some(make) = self.own_filter.and_then(OwnFilter::take) {
            return Ok(make(left.unwrap_or(start)));
        }
        let Some(gain) = basics.gain() else { return basics.begin(left, || Ok(start)) };
        let interval_s = self.data.samples.interval_s;
        let Some(channel) = channels.first().and_then(|place| self.data.channels.get(*place)) else {
            return Err(basics.no_gain(&"it has no channel"));
        };
        let known = left.unwrap_or(start);
        if let Some(sine) = self.sine {
            let of = LoopOf {
                roles: sine.roles(),
                at: operating,
                measure: channel.measure,
                interval_s,
                variance: channel.variance,
            };
            return phase_lock((self.own, model), gain, &known, &of).map_err(|why| basics.no_gain(&why));
        }
        if self.own.swings() > 0 && basics.parameters().is_empty() {
            return self.turning((gain, &known, &operating), model, channel);
        }
        let made = |rest: &MeanAndCovariance, step: &dyn Transition, sensor: &dyn Sensor| {
            let point = (step, sensor, channel.variance);
            AnyFilter::of_constant_gain((gain, interval_s), (rest, &known), point)
        };
        at_rest(self.own, model, (channel.measure, interval_s), made).map_err(|why| basics.no_gain(&why))
    }
}

/// What is made of a model at rest under no input: of where that is, of the step over an interval in s, and of a measurement.
pub fn at_rest<R>(
    own: &OwnDevice,
    model: &EquationModel,
    (measure, interval_s): (usize, f64),
    made: impl FnOnce(&MeanAndCovariance, &dyn Transition, &dyn Sensor) -> R,
) -> R {
    let rest = MeanAndCovariance::apart(own.rest.iter().map(|at| (*at, 0.0)));
    under_no_input(own, (model, &rest.mean), (measure, interval_s), |step, sensor| made(&rest, step, sensor))
}

/// What is made of a model at a state under no input: of the step over an interval in s, and of a measurement.
pub fn under_no_input<R>(
    own: &OwnDevice,
    (model, mean): (&EquationModel, &[f64]),
    (measure, interval_s): (usize, f64),
    made: impl FnOnce(&dyn Transition, &dyn Sensor) -> R,
) -> R {
    let interval = Interval::of(interval_s);
    let inputs = vec![0.0; own.device.inputs().len()];
    let mut room = StepRoom::default();
    let step = model.under(&interval, Nodes::held(&inputs), mean, &mut room);
    made(&step, &model.sensor(measure, &inputs))
}
