//! The estimates of one segment.

use super::course::ThresholdCourse;
use super::filters::FilterSettings;
use super::lock_in::{swing, tuned};
use super::plant::{Mirror, MirrorPlant, by_euler};
use super::settings::Settings;
use super::without_drive;
use crate::config::Method;
use crate::crossings::Crossing;
use crate::estimate::driven::{DrivenSegment, Plant, SteadySwing, TurningGain};
use crate::estimate::{
    AnyFilter, Course, EstimateError, FilterPast, GainOf, Known, Motion, Past, Swing, Trajectory, answers,
    answers_of_bank, follow, lock_in,
};
use crate::progress::Progress;
use kalmems_core::augmentation::AugmentationError;

/// One segment as the filters see it: signal, drive and the crossings that were found.
#[derive(Clone, Copy)]
pub struct Samples<'a> {
    /// Time, signal and drive.
    pub data: &'a DrivenSegment<'a>,
    /// dV/dt at each sample in V/s; not a number where it is not known.
    pub drive_slope: &'a [f64],
    /// The crossings, in the order of time.
    pub crossings: &'a [Crossing],
    /// Which row of the segment the first one is.
    pub first: usize,
    /// How fast the device moves.
    pub motion: Motion,
}

/// Runs the filters of the settings over the new samples of a segment, which messages call `place`, and judges the lock of each
/// trajectory.
///
/// The past is [`Past::default`] at the beginning of a segment, and is kept from one part of it to the next.
pub fn estimate(
    settings: &Settings,
    (samples, place): (Samples, &str),
    past: &mut Past,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let mut all = Vec::new();
    let (data, axes) = (samples.data, [("angle", samples.motion)]);
    let start_s = data.scored_from(settings.skip_s);
    for (index, filter) in settings.filters.iter().enumerate() {
        let past = past.filter(index);
        let mut trajectories = Task { settings, filter, samples, place, progress }.run(past)?;
        for (answer, trajectory) in trajectories.iter_mut().enumerate() {
            trajectory.lock = past.answer(answer).judge.judge(trajectory, &axes, start_s, data.samples.ends);
        }
        all.append(&mut trajectories);
    }
    Ok(all)
}

/// Cycles of the motion that tell its frequency at the beginning.
const START_CYCLES: f64 = 4.0;

/// One filter over one segment.
struct Task<'a> {
    settings: &'a Settings,
    filter: &'a FilterSettings,
    samples: Samples<'a>,
    place: &'a str,
    progress: &'a dyn Progress,
}

impl Task<'_> {
    fn run(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let (filter, hardware) = (self.filter, &self.settings.hardware);
        let wrong = |why: AugmentationError| filter.basics.no_model(why);
        let method = filter.basics.method;
        if method == Method::LockIn {
            return Ok(vec![self.lock_in(past)]);
        }
        let (states, start) = (filter.states(), || self.start());
        let (basics, taken) = ((&filter.basics, past), &self.samples.data.samples);
        if method == Method::Bank {
            let plants = MirrorPlant::side_by_side(hardware, filter).map_err(wrong)?;
            let course = |plant| -> Result<Box<dyn Course + '_>, EstimateError> {
                Ok(Box::new(self.course(plant, plant)?))
            };
            let courses = plants.iter().map(course).collect::<Result<_, _>>()?;
            return answers_of_bank(basics, |_| start(), (courses, taken), &states, self.progress);
        }
        let plant = MirrorPlant::new(hardware, filter).map_err(wrong)?;
        let euler = by_euler(hardware, filter);
        let mut course = match method {
            Method::EulerEkf => self.course(&plant, &euler)?,
            _ => self.course(&plant, &plant)?,
        };
        if let Some(gain) = filter.basics.gain() {
            let begin = |left: Option<Known>| self.turning(gain, &euler.0, &left.map_or_else(start, Ok)?);
            return follow(basics, begin, (&mut course, taken), &states, self.progress);
        }
        let mut trajectories = answers(basics, start, (&mut course, taken), &states, self.progress)?;
        if method == Method::Model {
            trajectories.iter_mut().for_each(Trajectory::mark_model_alone);
        }
        Ok(trajectories)
    }

    /// What is known at the first sample.
    fn start(&self) -> Result<Known, EstimateError> {
        let (filter, data) = (self.filter, self.samples.data);
        if let Some(motion) = filter.start {
            return Ok(filter.known(motion));
        }
        let first_s = data.time_s.first().copied().unwrap_or(0.0);
        let signal = without_drive(self.settings, data, self.samples.drive_slope);
        let until = |cycles: f64, motion_hz: f64| {
            let end = data.time_s.partition_point(|t| *t < first_s + cycles / motion_hz);
            (&data.time_s[..end], &signal[..end])
        };
        let stated_hz = self.motion_hz();
        // A free decay has the frequency of the device, which may be stated wrong.
        let is_free = data.drive.first_sine().is_none();
        let motion_hz = if is_free { tuned(stated_hz, until(START_CYCLES, stated_hz)) } else { stated_hz };
        let found = swing(&self.settings.hardware.readout.comb, motion_hz, until(1.0, motion_hz), None);
        let found = found.ok_or_else(|| EstimateError::NoStart {
            place: self.place.to_owned(),
            filter: filter.basics.name.clone(),
            why: "its first cycle shows no amplitude that the comb could make".to_owned(),
        })?;
        Ok(filter.known(found.at(first_s)))
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
    fn turning(&self, gain: GainOf, mirror: &Mirror, known: &Known) -> Result<AnyFilter, EstimateError> {
        let (basics, hardware, data) = (&self.filter.basics, &self.settings.hardware, self.samples.data);
        let (motion_hz, first_s) = (self.motion_hz(), data.time_s.first().copied().unwrap_or(0.0));
        let cycle = ..data.time_s.partition_point(|t| *t < first_s + 1.0 / motion_hz);
        let signal = without_drive(self.settings, data, self.samples.drive_slope);
        let found = swing(&hardware.readout.comb, motion_hz, (&data.time_s[cycle], &signal[cycle]), None);
        let swing = found.ok_or_else(|| basics.no_gain(&"the first cycle of its signal shows no swing"))?;
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
