//! The estimates of one segment.

use super::course::ThresholdCourse;
use super::filters::ThresholdFilterSettings;
use super::lock_in::swing;
use super::plant::{Mirror, MirrorPlant, by_euler};
use super::settings::ThresholdScannerSettings;
use super::without_drive;
use crate::config::{Method, Variant};
use crate::crossings::LevelCrossing;
use crate::estimate::driven::{DrivenSegment, Plant, SteadySwing, TurningGain};
use crate::estimate::{
    AnyFilter, BatchStart, Course, EstimateError, FilterPast, GainOf, MeanAndCovariance, MotionRate, Past,
    SignalStart, StartAgain, StartSearch, StartedCourse, Swing, Trajectory, answers, answers_of_bank, follow,
    lock_in, rows_to_start_again, start_again_from_signal, start_from_signal,
};
use crate::progress::Progress;
use kalmems_core::augmentation::AugmentationError;
use std::f64::consts::TAU;

/// One segment as the filters see it: signal, drive and the crossings that were found.
#[derive(Clone, Copy)]
pub struct ThresholdSamples<'a> {
    /// Time, signal and drive.
    pub data: &'a DrivenSegment<'a>,
    /// dV/dt at each sample in V/s; not a number where it is not known.
    pub drive_slope: &'a [f64],
    /// The crossings, in the order of time.
    pub crossings: &'a [LevelCrossing],
    /// Which row of the segment the first one is.
    pub first: usize,
    /// How fast the device moves.
    pub motion: MotionRate,
}

/// Runs the filters of the settings over the new samples of a segment, and judges the lock of each trajectory.
///
/// `place` names the segment in messages. The past is [`Past::default`] at the beginning of a segment, and is kept from one part of it to the next.
pub fn estimate(
    settings: &ThresholdScannerSettings,
    samples: ThresholdSamples,
    past: &mut Past,
    place: &str,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    let (data, axes) = (samples.data, [("angle", samples.motion)]);
    let start_s = data.scored_from(settings.skip_s);
    for (index, filter) in settings.filters.iter().enumerate() {
        let past = past.filter(index);
        let mut trajectories =
            ThresholdFilterTask { settings, filter, samples, place, progress }.run(past)?;
        for (answer, trajectory) in trajectories.iter_mut().enumerate() {
            trajectory.lock = past.answer(answer).judge.judge(trajectory, &axes, start_s, data.samples.ends);
        }
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// One filter over one segment.
struct ThresholdFilterTask<'a> {
    settings: &'a ThresholdScannerSettings,
    filter: &'a ThresholdFilterSettings,
    samples: ThresholdSamples<'a>,
    place: &'a str,
    progress: &'a dyn Progress,
}

impl ThresholdFilterTask<'_> {
    fn run(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let (filter, hardware) = (self.filter, &self.settings.hardware);
        let wrong = |why: AugmentationError| filter.basics.no_model(why);
        let method = filter.basics.method;
        if method == Method::LockIn {
            return Ok(vec![self.lock_in(past)]);
        }
        // A filter that goes on from another part has been started there.
        let is_begun = past.left().is_some();
        let (states, taken) = (filter.states(), &self.samples.data.samples);
        let known =
            |start: Option<&BatchStart>| start.map_or_else(|| filter.start(), |start| start.first.clone());
        if method == Method::Bank {
            let plants = MirrorPlant::side_by_side(hardware, filter).map_err(wrong)?;
            let starts = plants.iter().map(|plant| self.batch_start(plant, is_begun));
            let starts = starts.collect::<Result<Vec<_>, _>>()?;
            let mut courses: Vec<Box<dyn Course + '_>> = Vec::new();
            for (plant, start) in plants.iter().zip(&starts) {
                courses.push(Box::new(StartedCourse::new(self.course(plant, plant)?, start.as_ref())));
            }
            let start = |model: usize| Ok(known(starts.get(model).and_then(Option::as_ref)));
            let basics = (&filter.basics, past);
            return answers_of_bank(basics, start, (courses, taken), &states, self.progress);
        }
        let plant = MirrorPlant::new(hardware, filter).map_err(wrong)?;
        let euler = by_euler(hardware, filter);
        let found = self.batch_start(&plant, is_begun)?;
        let start = || Ok(known(found.as_ref()));
        // The model alone is corrected by nothing, and an observer forgets its start.
        let corrects = method != Method::Model && filter.basics.gain().is_none();
        let course = match method {
            Method::EulerEkf => self.course(&plant, &euler)?,
            _ => self.course(&plant, &plant)?,
        };
        let by_signal = self.by_signal();
        let course = StartedCourse::new(course, found.as_ref().filter(|_| corrects));
        let mut course = course.starting_again(self.start_again(&plant, &by_signal));
        let basics = (&filter.basics, past);
        if let Some(gain) = filter.basics.gain() {
            let begin =
                |left: Option<MeanAndCovariance>| self.turning(gain, &euler.0, &left.map_or_else(start, Ok)?);
            return follow(basics, begin, (&mut course, taken), &states, self.progress);
        }
        let mut trajectories = answers(basics, start, (&mut course, taken), &states, self.progress)?;
        if method == Method::Model {
            trajectories.iter_mut().for_each(Trajectory::mark_model_alone);
        }
        Ok(trajectories)
    }

    /// The start of a model from the signal; `None` where the file states one, and where the filter has begun.
    ///
    /// Every sample counts as it is recorded, and no crossing, whatever the filter makes of them later.
    fn batch_start(&self, plant: &MirrorPlant, is_begun: bool) -> Result<Option<BatchStart>, EstimateError> {
        let (filter, data) = (self.filter, self.samples.data);
        if is_begun || !filter.from_signal {
            return Ok(None);
        }
        let by_signal = self.by_signal();
        let course = self.signal_course(plant, &by_signal);
        let mut course = course.map_err(|why| filter.basics.no_model(why))?;
        let (motion_hz, first_s) = (self.motion_hz(), data.time_s.first().copied().unwrap_or(0.0));
        let search = StartSearch {
            seeds: self.first_swing().map(|swing| swing.at(first_s).to_vec()).into_iter().collect(),
            ..self.search()
        };
        let (states, place) = (filter.states(), self.place);
        let of = SignalStart {
            place,
            basics: &filter.basics,
            states: (&states, 2),
            sizes: &[],
            cycle_s: motion_hz.recip(),
        };
        start_from_signal(&mut course, &data.samples, &search, of).map(Some)
    }

    /// The filter as its start is sought: each sample as it is recorded, and no crossing.
    fn by_signal(&self) -> ThresholdFilterSettings {
        ThresholdFilterSettings {
            variant: Variant::Full,
            signal_variance: self.settings.hardware.noise_variance,
            threshold: None,
            ..self.filter.clone()
        }
    }

    /// The course on which a start is sought.
    fn signal_course<'a>(
        &'a self,
        plant: &'a MirrorPlant,
        by_signal: &'a ThresholdFilterSettings,
    ) -> Result<ThresholdCourse<'a>, AugmentationError> {
        ThresholdCourse::new(
            (plant, plant),
            (self.settings.hardware.noise_variance, self.settings.judged_angle()),
            self.samples.data,
            self.samples.drive_slope,
            by_signal,
            (&[], self.samples.first),
        )
    }

    /// What the search for a start knows.
    fn search(&self) -> StartSearch {
        StartSearch::of_oscillation(self.filter.prior(), TAU * self.motion_hz())
    }

    /// How the filter is started again where it has lost the signal.
    fn start_again<'a>(
        &'a self,
        plant: &'a MirrorPlant,
        by_signal: &'a ThresholdFilterSettings,
    ) -> Option<StartAgain<'a>> {
        let (filter, data) = (self.filter, self.samples.data);
        let cycle_s = self.settings.hardware.natural_hz().recip();
        let rows = rows_to_start_again((cycle_s, data.interval_s), filter.states().len());
        let rule = filter.basics.reacquisition(self.motion_hz(), data.start_s, rows)?;
        let search = self.search();
        Some(StartAgain::by(rule, move |rows, _| {
            let mut course = self.signal_course(plant, by_signal).ok()?;
            start_again_from_signal(&mut course, rows, &search, &filter.basics.readout)
        }))
    }

    /// The swing that the first cycle of the signal shows.
    fn first_swing(&self) -> Option<Swing> {
        let (hardware, data) = (&self.settings.hardware, self.samples.data);
        let (motion_hz, first_s) = (self.motion_hz(), *data.time_s.first()?);
        let cycle = ..data.time_s.partition_point(|t| *t < first_s + 1.0 / motion_hz);
        let signal = without_drive(self.settings, data, self.samples.drive_slope);
        swing(&hardware.readout.comb, motion_hz, (&data.time_s[cycle], &signal[cycle]), None)
    }

    fn course<'a, P: Plant>(
        &'a self,
        plant: &'a MirrorPlant,
        moving: &'a P,
    ) -> Result<ThresholdCourse<'a>, EstimateError> {
        let course = ThresholdCourse::new(
            (plant, moving),
            (self.settings.hardware.noise_variance, self.settings.judged_angle()),
            self.samples.data,
            self.samples.drive_slope,
            self.filter,
            (self.samples.crossings, self.samples.first),
        );
        course.map_err(|why| self.filter.basics.no_model(why))
    }

    /// A filter with a gain that is constant but for the phase, that for the first cycle of the motion.
    fn turning(
        &self,
        gain: GainOf,
        mirror: &Mirror,
        known: &MeanAndCovariance,
    ) -> Result<AnyFilter, EstimateError> {
        let (basics, hardware, data) = (&self.filter.basics, &self.settings.hardware, self.samples.data);
        let (motion_hz, first_s) = (self.motion_hz(), data.time_s.first().copied().unwrap_or(0.0));
        let swing = self.first_swing();
        let swing = swing.ok_or_else(|| basics.no_gain(&"the first cycle of its signal shows no swing"))?;
        let drive = |time_s: f64| {
            let sample =
                data.time_s.partition_point(|t| *t < time_s).min(data.time_s.len().saturating_sub(1));
            data.drive.sample(sample).0
        };
        let motion = SteadySwing { swings: &[swing], drive: &drive, over_s: [first_s, 1.0 / motion_hz] };
        let samples = (data.interval_s, hardware.noise_variance);
        let found = TurningGain::<2>::new(gain, mirror, motion, known.gaussian().mean, samples);
        Ok(AnyFilter::this(found.map_err(|why| basics.no_gain(&why))?))
    }

    /// The frequency of the motion in Hz, by the first rows, so that it does not depend on what comes later.
    fn motion_hz(&self) -> f64 {
        let drive = self.samples.data.drive.first_sine();
        drive.map_or(self.settings.hardware.natural_hz(), |sine| 0.5 * sine.frequency_hz)
    }

    /// Cycle by cycle of the motion, on the signal without what the drive adds to it.
    fn lock_in(&self, past: &mut FilterPast) -> Trajectory {
        let (data, hardware) = (self.samples.data, &self.settings.hardware);
        let motion_hz = self.motion_hz();
        let signal = without_drive(self.settings, data, self.samples.drive_slope);
        let signals = [&signal[..]];
        let windows = data.windows(&signals, 1.0 / motion_hz);
        let detect = |time_s: &[f64], signals: &[&[f64]], before: &[Swing]| {
            let samples = (time_s, *signals.first()?);
            Some(vec![swing(&hardware.readout.comb, motion_hz, samples, before.first())?])
        };
        lock_in((&self.filter.basics, past), &windows, &self.filter.states(), detect)
    }
}
