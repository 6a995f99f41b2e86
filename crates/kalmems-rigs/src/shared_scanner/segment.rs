//! The estimates of one segment.

use super::filters::ScannerFilterSettings;
use super::lock_in::LockIn;
use super::plant::{affine, affine_models, affine_with, staged, staged_models, staged_with};
use super::settings::ScannerSettings;
use crate::config::Method;
use crate::estimate::driven::{
    ByEuler, DrivenCourse, DrivenSegment, HYBRID_STEPS, Plant, SteadySwing, TurningGain,
};
use crate::estimate::{
    AnyFilter, BatchStart, Course, EstimateError, FilterBasics, FilterPast, FilterSideOutputs, GainOf,
    MeanAndCovariance, Past, Reacquisition, SideOutputs, SignalStart, StartAgain, StartSearch, StartedCourse,
    StateName, StatePrior, StatedSign, Swing, Trajectory, answers_of_bank, begun, follow, lock_in,
    rows_to_start_again, start_again_from_signal, start_from_signal, with_the_sign_before,
};
use crate::progress::Progress;
use crate::signal::Sine;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{Covariance, Filter, Gaussian};
use std::f64::consts::TAU;
use std::ops::Range;

/// Runs the filters of the settings over the new samples of a segment, and gives each trajectory the sign of the motion and
/// the judgement of its lock.
///
/// `place` names the segment in messages. The past is [`Past::default`] at the beginning of a segment, and is kept from one
/// part of it to the next.
pub fn estimate(
    settings: &ScannerSettings,
    side_outputs: &SideOutputs,
    data: &DrivenSegment,
    past: &mut Past,
    place: &str,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    let start_s = data.scored_from(settings.skip_s);
    // By the first rows, so that it does not depend on what comes later.
    let first_hz =
        data.drive.first_sine().map_or(settings.hardware.natural_hz(), |sine| 0.5 * sine.frequency_hz);
    let rate = *past.motion_rate.get_or_insert(TAU * first_hz);
    for (index, filter) in settings.filters.iter().enumerate() {
        let past = past.filter(index);
        // Without a stated sign it is as the filter has it.
        let mirrored = settings.first_peak_positive.map_or(Some(false), |_| past.is_mirrored());
        let side_outputs = side_outputs.of_filter(index, (rate, mirrored), start_s);
        let mut trajectories =
            one(&ScannerFilterTask { settings, filter, data, place, side_outputs, progress }, past)?;
        judge(settings, data, past, &mut trajectories);
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// Follows a filter of the caller's own over the new samples of a segment, as [`estimate`] follows those of the settings.
///
/// All but the filter is that of the rig, as the settings and the table `filter` say it: the model of the scanner with its
/// process noise, the drive between the samples, samples that are missing, the readout and its noise, name and start of the
/// filter, its smoothers, the sign of the motion and the judgement of its lock. `make` makes the filter from the first mean,
/// angle in rad and rate in rad/s, and their covariance. A filter of another kind, or with another rule of adaptation, is so
/// compared with those of the rig by itself alone.
///
/// The past is [`FilterPast::default`] at the beginning of a segment, and is kept from one part of it to the next; where it is
/// that of a filter in another run, `make` is given what that left. Refused is a table with more states than angle and rate,
/// and one of a method without a process: `model` and `lock_in`. With the method `euler_ekf` the process is Euler's method.
///
/// ```
/// use kalmems_core::SquareRootEkf;
/// use kalmems_engines::estimate::{FilterPast, SegmentPart, Past, SignalSegment, driven::DrivenSegment};
/// use kalmems_engines::progress::Silent;
/// use kalmems_engines::{recording::SampledRecording, units::kind};
/// use kalmems_rigs::shared_scanner::{ScannerSettings, estimate_segment_with};
/// # use std::path::Path;
///
/// # let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
/// let experiment = kalmems_rigs::published().load(&root.join("examples/shared_scanner/experiment.toml"))?;
/// let settings = ScannerSettings::of(&experiment)?;
/// let file = experiment.resolve(&experiment.recording(0)?.file);
/// let recording = SampledRecording::read(&file, &kalmems_rigs::published().rig(&experiment)?.layout(&experiment, 0)?)?;
///
/// let (part, mut past) = (SegmentPart::whole(&recording, &recording.segments()[0]), Past::default());
/// let samples = SignalSegment::of(&part, ("cap_V", &kind::VOLTAGE), settings.skip_s, &mut past)?;
/// let data = DrivenSegment::of(&samples, "drive_V", &mut past, &Silent)?;
/// let ekf = settings.filters.iter().find(|filter| filter.basics.key == "ekf").ok_or("no EKF")?;
/// let past = &mut FilterPast::default();
/// let found = estimate_segment_with(&settings, ekf, &data, past, "the example", &Silent, SquareRootEkf::new)?;
/// assert!(found[0].failure.is_none() && found[0].lock.events.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn estimate_with<F: Filter<f64, 2> + Clone + Send + 'static>(
    settings: &ScannerSettings,
    filter: &ScannerFilterSettings,
    data: &DrivenSegment,
    past: &mut FilterPast,
    place: &str,
    progress: &dyn Progress,
    make: impl FnOnce([f64; 2], Covariance<f64, 2>) -> F,
) -> Result<Vec<Trajectory>, EstimateError> {
    let basics = &filter.basics;
    let other = [
        (!basics.method.claims(), "a method without a process"),
        (!basics.tracked.is_empty(), "parameters as states"),
        (filter.demodulator_sd.is_some(), "the demodulator's stages as states"),
        (!basics.readout.is_empty(), "the readout's constants as states"),
    ];
    if let Some((_, found)) = other.into_iter().find(|(is, _)| *is) {
        return Err(EstimateError::NotAngleAndRate { filter: basics.name.clone(), found });
    }
    let side_outputs = FilterSideOutputs::default();
    let task = ScannerFilterTask { settings, filter, data, place, side_outputs, progress };
    let begin = |left: Option<MeanAndCovariance>| {
        let Gaussian { mean, covariance } = left.map_or_else(|| task.start(), Ok)?.gaussian();
        Ok(AnyFilter::this(make(mean, covariance)))
    };
    let is_begun = past.left().is_some();
    let plant = affine(&settings.hardware, filter);
    let follower = task.follower().started(task.batch_start(&plant, is_begun)?);
    let mut trajectories = if basics.method == Method::EulerEkf {
        follower.follow(&ByEuler(plant), &filter.states(), past, begin)?
    } else {
        follower.follow(&plant, &filter.states(), past, begin)?
    };
    judge(settings, data, past, &mut trajectories);
    Ok(trajectories)
}

/// Gives the trajectories of one filter the sign of the motion, where it is stated, and judges their lock.
fn judge(
    settings: &ScannerSettings,
    data: &DrivenSegment,
    past: &mut FilterPast,
    trajectories: &mut [Trajectory],
) {
    let axes = [("angle", data.motion(settings.hardware.natural_hz()))];
    for (answer, trajectory) in trajectories.iter_mut().enumerate() {
        let past = past.answer(answer);
        if let Some(is_positive) = settings.first_peak_positive {
            let sign = StatedSign { axis: 0, rate: 1, states: vec![0, 1], is_positive };
            past.orient(trajectory, &sign, data.first_drive_peak(settings.skip_s));
        } else {
            trajectory.hidden_signs = vec![vec![0, 1]];
        }
        let start_s = data.scored_from(settings.skip_s);
        trajectory.lock = past.judge.judge(trajectory, &axes, start_s, data.samples.ends);
    }
}

/// One filter over one segment.
struct ScannerFilterTask<'a> {
    settings: &'a ScannerSettings,
    filter: &'a ScannerFilterSettings,
    data: &'a DrivenSegment<'a>,
    place: &'a str,
    side_outputs: FilterSideOutputs,
    progress: &'a dyn Progress,
}

/// Chooses the model: once per segment, so that the loops inside know their types.
fn one(task: &ScannerFilterTask, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
    let (hardware, filter) = (&task.settings.hardware, task.filter);
    let method = filter.basics.method;
    let wrong = |why: AugmentationError| filter.basics.no_model(why);
    let poles = hardware.poles.filter(|_| filter.demodulator_sd.is_some());
    match (poles, filter.basics.tracked.is_empty()) {
        _ if method == Method::LockIn => task.lock_in(past),
        _ if let Some(gain) = filter.basics.gain() => task.turning(gain, past),
        (None, _) if method == Method::Bank => task.bank(&affine_models(hardware, filter), past),
        (Some(poles), _) if method == Method::Bank => {
            task.bank(&staged_models(hardware, filter, poles), past)
        }
        (None, _) if method == Method::EulerEkf => task.run(&ByEuler(affine(hardware, filter)), past),
        (None, true) => task.run(&affine(hardware, filter), past),
        (None, false) => task.run(&affine_with(hardware, filter).map_err(wrong)?, past),
        (Some(poles), true) => task.run(&staged(hardware, filter, poles), past),
        (Some(poles), false) => task.run(&staged_with(hardware, filter, poles).map_err(wrong)?, past),
    }
}

/// How a start is sought again.
pub struct SearchAgain<'a> {
    /// When, by which rows.
    pub rule: Reacquisition,
    /// On a course, in these rows, with the time in s and the state at which the signal was not lost yet: what is known at the row behind them.
    #[allow(clippy::type_complexity)] // the rows and the state of one search
    pub seek: Box<dyn Fn(&mut dyn Course, Range<usize>, (f64, &[f64])) -> Option<MeanAndCovariance> + 'a>,
}

/// A filter of one axis or two on its way through a segment.
pub struct ScannerFilterRun<'a> {
    /// The filter.
    pub filter: &'a FilterBasics,
    /// The segment.
    pub data: &'a DrivenSegment<'a>,
    /// The variance of the signal's noise per sample, in V².
    pub noise_variance: f64,
    /// What it gives besides the states.
    pub side_outputs: FilterSideOutputs,
    /// Where it says how far it has come.
    pub progress: &'a dyn Progress,
    /// Where it starts, or each model of a bank does, where all of the first samples say that.
    pub starts: Vec<Option<BatchStart>>,
    /// How its start is sought again where it has lost the signal.
    pub again: Option<SearchAgain<'a>>,
}

impl ScannerFilterRun<'_> {
    /// Likewise, from a start that all of the first samples have told.
    #[must_use]
    pub fn started(self, start: Option<BatchStart>) -> Self {
        Self { starts: vec![start], ..self }
    }

    /// The start of the model with this place.
    fn start(&self, model: usize) -> Option<&BatchStart> {
        self.starts.get(model).and_then(Option::as_ref)
    }

    /// Follows the filter, at first from what `start` says.
    pub fn run<P: Plant>(
        &self,
        plant: &P,
        states: &[StateName],
        past: &mut FilterPast,
        start: impl FnOnce() -> Result<MeanAndCovariance, EstimateError>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let mut trajectories = self.follow(plant, states, past, |left| self.filter.begin(left, start))?;
        if self.filter.method == Method::Model {
            trajectories.iter_mut().for_each(Trajectory::mark_model_alone);
        }
        Ok(trajectories)
    }

    /// Follows a filter for each of these models side by side, and what they say together.
    pub fn bank<P: Plant>(
        &self,
        plants: &[P],
        states: &[StateName],
        past: &mut FilterPast,
        start: impl Fn() -> Result<MeanAndCovariance, EstimateError>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let course = |(model, plant)| -> Result<Box<dyn Course + '_>, EstimateError> {
            let course = DrivenCourse::new(plant, self.noise_variance, self.data);
            let course = course.map_err(|why| self.filter.no_model(why))?;
            Ok(Box::new(StartedCourse::new(course, self.start(model))))
        };
        let courses = plants.iter().enumerate().map(course).collect::<Result<Vec<_>, _>>()?;
        let way = (courses, &self.data.samples);
        let start = |model| begun(None, self.start(model)).map_or_else(&start, Ok);
        answers_of_bank((self.filter, past), start, way, states, self.progress)
    }

    /// Follows the filter that `begin` makes.
    pub fn follow<P: Plant>(
        &self,
        plant: &P,
        states: &[StateName],
        past: &mut FilterPast,
        begin: impl FnOnce(Option<MeanAndCovariance>) -> Result<AnyFilter, EstimateError>,
    ) -> Result<Vec<Trajectory>, EstimateError> {
        let outputs = self.side_outputs;
        let course = DrivenCourse::new(plant, self.noise_variance, self.data);
        let course = match self.filter.method {
            Method::HybridEkf => course.and_then(|course| course.in_steps(HYBRID_STEPS)),
            _ => course,
        };
        let course = course.map_err(|why| self.filter.no_model(why))?.with_phase(outputs.phase_rate());
        let predictor = outputs.predictor(self.filter, self.data.interval_s, past)?;
        let course = course.predicting_phases(predictor, outputs.from_s);
        // An observer forgets its start.
        let corrects = self.filter.gain().is_none();
        let course = StartedCourse::new(course, self.start(0).filter(|_| corrects));
        let again = self.again.as_ref().map(|again| {
            StartAgain::by(again.rule, |rows, held| {
                let mut course = DrivenCourse::new(plant, self.noise_variance, self.data).ok()?;
                (again.seek)(&mut course, rows, held)
            })
        });
        let mut course = course.starting_again(again);
        let begin = |left| begin(begun(left, self.start(0)));
        let told =
            follow((self.filter, past), begin, (&mut course, &self.data.samples), states, self.progress);
        past.predictor = course.into_inner().into_phase_predictor();
        told
    }
}

impl ScannerFilterTask<'_> {
    fn follower(&self) -> ScannerFilterRun<'_> {
        let (filter, noise_variance) = (&self.filter.basics, self.settings.hardware.noise_variance);
        let (data, side_outputs, progress) = (self.data, self.side_outputs, self.progress);
        let (starts, again) = (Vec::new(), self.start_again());
        ScannerFilterRun { filter, data, noise_variance, side_outputs, progress, starts, again }
    }

    fn bank<P: Plant>(&self, plants: &[P], past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let is_begun = past.left().is_some();
        let starts = plants.iter().map(|plant| self.batch_start(plant, is_begun));
        let follower = ScannerFilterRun { starts: starts.collect::<Result<_, _>>()?, ..self.follower() };
        follower.bank(plants, &self.filter.states(), past, || self.start())
    }

    fn run<P: Plant>(&self, plant: &P, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let follower = self.follower().started(self.batch_start(plant, past.left().is_some())?);
        follower.run(plant, &self.filter.states(), past, || self.start())
    }

    /// The start of a model by all of the first samples; `None` where it is stated otherwise, and where the filter has begun.
    ///
    /// Signal and torque are those of the mirrored motion as well, so that either sign is taken.
    fn batch_start<P: Plant>(&self, plant: &P, is_begun: bool) -> Result<Option<BatchStart>, EstimateError> {
        let (filter, hardware, data) = (self.filter, &self.settings.hardware, self.data);
        if is_begun || !filter.by_batch {
            return Ok(None);
        }
        let motion_hz = data.motion(hardware.natural_hz()).frequency_hz;
        let first_s = data.time_s.first().copied().unwrap_or(0.0);
        let stages = self.stages();
        // Without a steady drive there is no lock-in, and the search begins at its own phases.
        let swing = self.data.drive.first_sine().and_then(|_| self.first_swing().ok());
        let seed = |(swing, _): (Swing, f64)| {
            let [angle, rate] = swing.at(first_s);
            [angle, rate].into_iter().chain(vec![self.volts(angle); stages]).collect()
        };
        let search = StartSearch { seeds: swing.map(seed).into_iter().collect(), ..self.search() };
        let course = DrivenCourse::new(plant, hardware.noise_variance, data);
        let mut course = course.map_err(|why| filter.basics.no_model(why))?;
        let (states, place) = (filter.states(), self.place);
        let (basics, cycle_s) = (&filter.basics, motion_hz.recip());
        let of = SignalStart { place, basics, states: (&states, 2 + stages), sizes: &[], cycle_s };
        start_from_signal(&mut course, &data.samples, &search, of).map(Some)
    }

    /// How the filter is started again where it has lost the signal.
    fn start_again(&self) -> Option<SearchAgain<'_>> {
        let (filter, data) = (self.filter, self.data);
        let (search, natural_hz) = (self.search(), self.settings.hardware.natural_hz());
        let rows = rows_to_start_again((natural_hz.recip(), data.interval_s), filter.states().len());
        let driven_hz = data.drive.first_sine().map(|sine| 0.5 * sine.frequency_hz);
        let rule = filter.basics.reacquisition(driven_hz.unwrap_or(natural_hz), data.start_s, rows)?;
        let seek = move |course: &mut dyn Course, rows: Range<usize>, held: (f64, &[f64])| {
            let time_s = data.time_s.get(rows.end).copied()?;
            let found = start_again_from_signal(course, rows, &search, &filter.basics.readout)?;
            // Signal and torque are those of the mirrored motion as well; the drive holds its phase, and so its sign.
            Some(match driven_hz {
                Some(hz) => with_the_sign_before(found, 0, (time_s, TAU * hz), held),
                None => found,
            })
        };
        Some(SearchAgain { rule, seek: Box::new(seek) })
    }

    /// The voltage that a mirror at rest at this angle has.
    fn volts(&self, angle: f64) -> f64 {
        let readout = &self.settings.hardware.readout;
        readout.gain * readout.comb.capacitance(angle) + readout.offset
    }

    /// Stages of the demodulator that are states.
    fn stages(&self) -> usize {
        if self.filter.demodulator_sd.is_some() { 2 } else { 0 }
    }

    /// What the search for a start knows.
    fn search(&self) -> StartSearch {
        let motion_hz = self.data.motion(self.settings.hardware.natural_hz()).frequency_hz;
        let prior = |mean: f64| StatePrior { mean, sd: None };
        let prior = [prior(0.0); 2].into_iter().chain(vec![prior(self.volts(0.0)); self.stages()]);
        let prior = prior.chain(self.filter.basics.priors()).collect();
        StartSearch { is_symmetric: true, ..StartSearch::of_oscillation(prior, TAU * motion_hz) }
    }

    /// What is known at the first sample.
    fn start(&self) -> Result<MeanAndCovariance, EstimateError> {
        let (filter, hardware) = (self.filter, &self.settings.hardware);
        let motion = if let Some(start) = filter.start {
            start
        } else {
            let (swing, _) = self.first_swing()?;
            swing.at(self.data.time_s.first().copied().unwrap_or(0.0))
        };
        // The stages start where a mirror at rest at this angle would have them.
        let volts =
            hardware.readout.gain * hardware.readout.comb.capacitance(motion[0]) + hardware.readout.offset;
        let stages = filter.demodulator_sd.map(|sd| [(volts, sd); 2]);
        let parameters = filter.basics.parameters().iter().map(|tracked| (0.0, tracked.sd));
        let motion = motion.into_iter().zip(filter.start_sd);
        Ok(MeanAndCovariance::apart(motion.chain(stages.into_iter().flatten()).chain(parameters)))
    }

    /// The motion that the first cycles of the signal show, and how long they last in s.
    fn first_swing(&self) -> Result<(Swing, f64), EstimateError> {
        let lock_in = self.detector()?;
        let cycle_s = 1.0 / self.data.motion(self.settings.hardware.natural_hz()).frequency_hz;
        let first_s = self.data.time_s.first().copied().unwrap_or(0.0);
        let end = self.data.time_s.partition_point(|t| *t < first_s + START_CYCLES * cycle_s);
        let swing = lock_in.swing(&self.data.time_s[..end], &self.data.signal[..end], None);
        swing.map(|swing| (swing, START_CYCLES * lock_in.cycle_s())).ok_or_else(|| EstimateError::NoStart {
            place: self.place.to_owned(),
            filter: self.filter.basics.name.clone(),
            why: "its first cycles show no amplitude that the electrodes could make".to_owned(),
        })
    }

    /// With a gain that is constant but for the phase, that for the motion at the segment's beginning.
    fn turning(&self, gain: GainOf, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let (filter, hardware) = (self.filter, &self.settings.hardware);
        let plant = affine(hardware, filter);
        let found = self.batch_start(&plant, past.left().is_some())?;
        let begin = |left: Option<MeanAndCovariance>| {
            let (mean, drive) = (left.map_or_else(|| self.start(), Ok)?.gaussian().mean, self.drive()?);
            let (swing, length_s) = self.first_swing()?;
            let over_s = [self.data.time_s.first().copied().unwrap_or(0.0), length_s];
            let motion = SteadySwing { swings: &[swing], drive: &|time_s| drive.at(time_s), over_s };
            let samples = (self.data.interval_s, hardware.noise_variance);
            let found = TurningGain::<2>::new(gain, &plant, motion, mean, samples);
            Ok(AnyFilter::this(found.map_err(|why| filter.basics.no_gain(&why))?))
        };
        self.follower().started(found).follow(&plant, &filter.states(), past, begin)
    }

    fn lock_in(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let (detector, data) = (self.detector()?, self.data);
        let signals = [data.signal];
        let windows = data.windows(&signals, detector.cycle_s());
        let detect = |time_s: &[f64], signals: &[&[f64]], before: &[Swing]| {
            Some(vec![detector.swing(time_s, signals.first()?, before.first())?])
        };
        let filter = (&self.filter.basics, past);
        Ok(vec![lock_in(filter, &windows, &self.filter.states(), detect)])
    }

    fn detector(&self) -> Result<LockIn<'_>, EstimateError> {
        let hardware = &self.settings.hardware;
        let poles = hardware.poles.filter(|_| self.filter.demodulator_sd.is_some());
        Ok(LockIn::new(hardware, self.drive()?, poles))
    }

    /// The sine of the drive, which has to be steady.
    fn drive(&self) -> Result<&Sine, EstimateError> {
        self.data.drive.first_sine().ok_or_else(|| EstimateError::NoSteadyDrive {
            place: self.place.to_owned(),
            filter: self.filter.basics.name.clone(),
        })
    }
}

/// How many cycles of the motion a start from the signal takes in.
const START_CYCLES: f64 = 4.0;
