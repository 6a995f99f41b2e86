//! The estimates of one record.

use super::course::{StageChannel, StageCourse, StageObserver};
use super::feedthrough_error::FeedthroughError;
use super::filters::StageFilterSettings;
use super::identification::motion_by;
use super::lock_in::swing;
use super::plant::{ExactStageStep, StagePlant, of_channel, stage, with_parameters};
use super::settings::StageSettings;
use crate::config::Method;
use crate::estimate::driven::{ByEuler, ParameterPlaces, PlainModel, Plant, side_by_side};
use crate::estimate::{
    self, AnyFilter, BatchStart, ConstantGain, Course, EstimateError, FilterPast, GainOf, LockInWindows,
    MeanAndCovariance, MotionRate, Past, SignalStart, StartAgain, StartSearch, StartedCourse, StateName,
    StatePrior, Swing, Trajectory, answers_of_bank, begun, follow, kalman_bucy, lock_in,
    start_again_from_signal, start_from_signal,
};
use crate::progress::Progress;
use crate::signal::{Sine, fit_sine_at};
use crate::units::kind;
use kalmems_core::Nodes;
use kalmems_core::Portable;
use kalmems_core::augmentation::AugmentationError;
use std::f64::consts::TAU;
use std::ops::Range;

/// A part of a record as the filters see it.
#[derive(Clone, Debug)]
pub struct StageSamples<'a> {
    /// The record, for messages.
    pub place: &'a str,
    /// When, in s.
    pub time_s: &'a [f64],
    /// Which of them are new, and the usual interval.
    pub taken: estimate::SampleSelection,
    /// The drive at each sample in V.
    pub drive: &'a [f64],
    /// The sines that it follows, each with the samples that it is for.
    pub sines: &'a [(Range<usize>, Sine)],
    /// The frequency that it had at the record's beginning, in Hz.
    pub drive_hz: f64,
    /// Which electrodes there are signals of, as places in the hardware.
    pub electrodes: &'a [usize],
    /// The signals of these in V, without what the drive alone makes of them.
    pub signals: Vec<Vec<f64>>,
    /// The standard deviation of each component of the sines that were taken off them, in V for each volt of the drive; 0 of what is stated.
    pub feedthrough_sd: Vec<f64>,
}

/// The states, as trajectories name them.
const STATES: [StateName; 2] = [("angle", "rad", &kind::ANGLE), ("rate", "rad_per_s", &kind::ANGULAR_RATE)];

/// How many cycles a start from the signals looks at.
const CYCLES: f64 = 2.0;

/// Runs the wanted filters over the new samples of a record.
pub fn estimate(
    settings: &StageSettings,
    samples: &StageSamples,
    past: &mut Past,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let motion = MotionRate { frequency_hz: samples.drive_hz, is_driven: true };
    let (begun_s, start_s) = (past.start_s, past.start_s + settings.skip_s);
    let mut all = Vec::new();
    for (index, filter) in settings.filters.iter().enumerate() {
        let past = past.filter(index);
        let channels = channels(settings, filter, samples)?;
        let feedthrough = FeedthroughError::of(&channels, samples);
        let mut trajectories =
            StageFilterTask { settings, filter, samples, begun_s, channels, progress }.run(past)?;
        for (answer, trajectory) in trajectories.iter_mut().enumerate() {
            let judge = &mut past.answer(answer).judge;
            trajectory.lock = judge.judge(trajectory, &[("angle", motion)], start_s, samples.taken.ends);
            if filter.basics.method == Method::Model {
                trajectory.mark_model_alone();
            } else {
                correct(trajectory, settings.hardware.correction);
                let [scale, _] = settings.hardware.correction;
                if let Some(error) = &feedthrough {
                    error.widen(trajectory, samples, scale);
                }
            }
        }
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// The rate without the scale factor and bias that it was found to have.
fn correct(trajectory: &mut Trajectory, [scale, bias]: [f64; 2]) {
    for state in trajectory.states.iter_mut().filter(|state| state.name == "rate") {
        state.mean.iter_mut().for_each(|rate| *rate = (*rate - bias) / scale);
        state.sd.iter_mut().for_each(|sd| *sd /= scale);
    }
}

/// One filter over one record.
struct StageFilterTask<'a> {
    settings: &'a StageSettings,
    filter: &'a StageFilterSettings,
    samples: &'a StageSamples<'a>,
    /// When the record began, in s.
    begun_s: f64,
    channels: Vec<StageChannel<'a>>,
    progress: &'a dyn Progress,
}

impl StageFilterTask<'_> {
    /// Chooses the model, smoothed where that is wanted.
    fn run(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let filter = self.filter;
        let basics = &filter.basics;
        let Some(first) = self.channels.first() else {
            let why =
                "no electrode of the recording has a signal; name the column of at least one".to_owned();
            return Err(EstimateError::Unfit { place: self.samples.place.to_owned(), why });
        };
        let wrong = |why: AugmentationError| basics.no_model(why);
        if basics.method.has_fixed_gain() && self.channels.len() > 1 {
            return Err(basics.no_gain(&"it is for one signal; name one in `channels`"));
        }
        let of_each = |channel: &StageChannel| stage(self.settings.hardware.stage, filter, channel);
        let stages: Vec<StagePlant> = self.channels.iter().map(of_each).collect();
        let begin = |left| basics.begin(left, || self.start());
        match basics.method {
            Method::LockIn => return Ok(vec![self.lock_in(past)]),
            Method::Bank => return self.bank(&stages, past),
            Method::EulerEkf => {
                let plants: Vec<_> = stages.into_iter().map(ByEuler).collect();
                return self.follow(&plants, None, past, begin);
            }
            _ if !basics.tracked.is_empty() => {
                let with = |stage| with_parameters(stage, &basics.tracked);
                let plants = stages.iter().map(with).collect::<Result<Vec<_>, _>>().map_err(wrong)?;
                return self.follow(&plants, None, past, begin);
            }
            _ => {}
        }
        let plants: Vec<_> = stages.into_iter().map(ExactStageStep).collect();
        let interval_s = self.samples.taken.interval_s;
        let Some(gain) = basics.gain() else { return self.follow(&plants, None, past, begin) };
        if let GainOf::Continuous = gain {
            let PlainModel { dynamics, readout, noise } = plants[0].0;
            let found = kalman_bucy((dynamics, readout), (&noise, first.noise_variance), interval_s, 0.0);
            let (observer, point) = found.map_err(|why| basics.no_gain(&why))?;
            return self.follow(&plants, Some(Box::new(observer)), past, |left| {
                let mean = left.map_or_else(|| self.start(), Ok)?.gaussian::<2>().mean;
                let none = ConstantGain::without_update(mean, &point);
                Ok(AnyFilter::this(none.map_err(|why| basics.no_gain(&why))?))
            });
        }
        self.follow(&plants, None, past, |left| {
            let known = left.map_or_else(|| self.start(), Ok)?;
            let process = plants[0].over(interval_s).map_err(wrong)?;
            let nodes = Nodes::held(0.0);
            let (rest, sensor) = (plants[0].under(&process, &nodes), plants[0].sensor());
            // Of the motion at rest: what a sample tells of the rate depends on the angle by its square alone.
            let at_rest = MeanAndCovariance::apart([(0.0, 0.0); 2]);
            let point = (&rest as _, &sensor as _, first.noise_variance);
            let filtering = AnyFilter::of_constant_gain((gain, interval_s), (&at_rest, &known), point);
            filtering.map_err(|why| basics.no_gain(&why))
        })
    }

    /// Follows the filter that `begin` makes.
    fn follow<P: Plant>(
        &self,
        plants: &[P],
        observer: Option<Box<StageObserver>>,
        past: &mut FilterPast,
        begin: impl FnOnce(Option<MeanAndCovariance>) -> Result<AnyFilter, EstimateError>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let (basics, states) = (&self.filter.basics, self.filter.basics.states(&STATES));
        let found = self.batch_start(plants, past.left().is_some())?;
        // An observer forgets its start.
        let corrects = basics.gain().is_none();
        let course = self.course(plants)?.observed_by(observer);
        let course = StartedCourse::new(course, found.as_ref().filter(|_| corrects));
        let mut course = course.starting_again(self.start_again(plants));
        let way = (&mut course as _, &self.samples.taken);
        let begin = |left| begin(begun(left, found.as_ref()));
        follow((basics, past), begin, way, &states, self.progress)
    }

    /// The start of a model by all of the first samples; `None` where it is stated otherwise, and where the filter has begun.
    fn batch_start<P: Plant>(
        &self,
        plants: &[P],
        is_begun: bool,
    ) -> Result<Option<BatchStart>, EstimateError> {
        let StageSamples { place, ref taken, drive_hz, .. } = *self.samples;
        let basics = &self.filter.basics;
        if is_begun || !self.filter.by_batch {
            return Ok(None);
        }
        let seed = start_from(&self.channels, self.samples, self.filter)?.to_vec();
        let search = StartSearch { seeds: vec![seed], ..self.search() };
        let states = basics.states(&STATES);
        let of = SignalStart { place, basics, states: (&states, 2), sizes: &[], cycle_s: drive_hz.recip() };
        start_from_signal(&mut self.course(plants)?, taken, &search, of).map(Some)
    }

    /// What the search for a start knows.
    fn search(&self) -> StartSearch {
        let free = [StatePrior { mean: 0.0, sd: None }; 2];
        let prior = free.into_iter().chain(self.filter.basics.priors()).collect();
        StartSearch::of_oscillation(prior, TAU * self.samples.drive_hz)
    }

    /// How the filter is started again where it has lost the signal.
    fn start_again<'b, P: Plant>(&'b self, plants: &'b [P]) -> Option<StartAgain<'b>> {
        let StageSamples { ref taken, drive_hz, .. } = *self.samples;
        let natural_s = self.settings.hardware.natural_hz().recip();
        let rows = self.filter.rows_to_start_again((natural_s, taken.interval_s));
        let rule = self.filter.basics.reacquisition(drive_hz, self.begun_s, rows)?;
        let search = self.search();
        Some(StartAgain::by(rule, move |rows, _| {
            let mut course = self.course(plants).ok()?;
            start_again_from_signal(&mut course, rows, &search, &self.filter.basics.readout)
        }))
    }

    fn course<'b, P: Plant>(&'b self, plants: &'b [P]) -> Result<StageCourse<'b, P>, EstimateError> {
        let course = StageCourse::new(self.samples, &self.channels, plants);
        course.map_err(|why| self.filter.basics.no_model(why))
    }

    /// Filters of several models side by side.
    fn bank(&self, stages: &[StagePlant], past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let basics = &self.filter.basics;
        let enters: ParameterPlaces = [|parameter| parameter.in_motion, |parameter| parameter.in_readout];
        let varied = |stage| side_by_side(stage, &of_channel(stage, &basics.tracked), enters);
        let mut of_channels: Vec<_> = stages.iter().map(|stage| varied(stage).into_iter()).collect();
        // By channels first; the bank has them by models.
        let mut models: Vec<Vec<ExactStageStep>> = Vec::new();
        while let Some(model) = of_channels.iter_mut().map(|all| all.next().map(ExactStageStep)).collect() {
            models.push(model);
        }
        let is_begun = past.left().is_some();
        let starts = models.iter().map(|model| self.batch_start(model, is_begun));
        let starts = starts.collect::<Result<Vec<_>, _>>()?;
        let mut courses: Vec<Box<dyn Course + '_>> = Vec::new();
        for (model, start) in models.iter().zip(&starts) {
            courses.push(Box::new(StartedCourse::new(self.course(model)?, start.as_ref())));
        }
        let start = |model: usize| {
            let found = starts.get(model).and_then(Option::as_ref);
            begun(None, found).map_or_else(|| self.start(), Ok)
        };
        let (way, states) = ((courses, &self.samples.taken), basics.states(&STATES));
        answers_of_bank((basics, past), start, way, &states, self.progress)
    }

    /// Cycle by cycle of the drive, over all channels.
    fn lock_in(&self, past: &mut FilterPast) -> Trajectory {
        let StageSamples { time_s, ref taken, drive_hz, .. } = *self.samples;
        let signals: Vec<&[f64]> = self.channels.iter().map(|channel| channel.signal).collect();
        let (start_s, length_s) = (self.begun_s, 1.0 / drive_hz);
        let windows = LockInWindows { time_s, signals: &signals, samples: taken, start_s, length_s };
        let detect = |time_s: &[f64], signals: &[&[f64]], _: &[Swing]| {
            let channels = self.channels.iter().zip(signals);
            let channels = channels.map(|(channel, signal)| StageChannel { signal, ..*channel });
            Some(vec![swing(drive_hz, time_s, channels)?])
        };
        lock_in((&self.filter.basics, past), &windows, &STATES, detect)
    }

    /// What is known at the first sample.
    fn start(&self) -> Result<MeanAndCovariance, EstimateError> {
        let filter = self.filter;
        let mean = filter.start.map_or_else(|| start_from(&self.channels, self.samples, filter), Ok)?;
        let parameters = filter.basics.parameters().iter().map(|tracked| (0.0, tracked.sd));
        Ok(MeanAndCovariance::apart(mean.into_iter().zip(filter.start_sd).chain(parameters)))
    }
}

/// The channels that a filter takes, in the order of its file or of the recording.
fn channels<'a>(
    settings: &'a StageSettings,
    filter: &StageFilterSettings,
    samples: &'a StageSamples,
) -> Result<Vec<StageChannel<'a>>, EstimateError> {
    let wanted = if filter.electrodes.is_empty() { samples.electrodes } else { &filter.electrodes };
    let one = |electrode: &usize| {
        let described = &settings.hardware.channels[*electrode];
        let place = samples.electrodes.iter().position(|e| e == electrode);
        let signal =
            place.map(|place| samples.signals[place].as_slice()).ok_or_else(|| EstimateError::NoStart {
                place: samples.place.to_owned(),
                filter: filter.basics.name.clone(),
                why: format!("the recording has no channel `{}`", described.meaning()),
            })?;
        Ok(StageChannel {
            name: &described.name,
            current: described.current,
            // The settings were refused where it is not known.
            noise_variance: described.noise_variance.unwrap_or(1.0),
            feedthrough_sd: place.map_or(0.0, |place| samples.feedthrough_sd[place]),
            signal,
        })
    };
    wanted.iter().map(one).collect()
}

/// Where the first cycles of the first signal say that the motion starts.
///
/// Its fundamental over what a small angle makes of it: a few percent off at the largest motion, which the filter mends
/// within a cycle.
fn start_from(
    channels: &[StageChannel],
    samples: &StageSamples,
    filter: &StageFilterSettings,
) -> Result<[f64; 2], EstimateError> {
    let frequency_hz = samples.drive_hz;
    let first = samples.time_s.first().copied().unwrap_or(0.0);
    let end = samples.time_s.partition_point(|t| *t <= first + CYCLES / frequency_hz);
    let found = channels.iter().find_map(|channel| {
        let sine = fit_sine_at(&samples.time_s[..end], &channel.signal[..end], frequency_hz)?;
        Some(motion_by(&channel.current.plate, channel.current.gain, &sine))
    });
    let motion = found.ok_or_else(|| EstimateError::NoStart {
        place: samples.place.to_owned(),
        filter: filter.basics.name.clone(),
        why: "no signal has samples in the first two cycles".to_owned(),
    })?;
    let rate = TAU * frequency_hz;
    let (sine, cosine) = (rate * first + motion.phase_rad).portable_sin_cos();
    Ok([motion.amplitude * cosine, -motion.amplitude * rate * sine])
}
