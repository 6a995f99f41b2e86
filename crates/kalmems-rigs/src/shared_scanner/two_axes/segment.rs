//! The estimates of one segment.

use super::filters::{STATES, TwoAxisFilterSettings, TwoAxisStart};
use super::lock_in::{LineError, separating_s, swings};
use super::plant::{both, both_models, both_with};
use super::run::{SearchAgain, TwoAxisFilterRun};
use super::settings::TwoAxisSettings;
use super::tones::{DriveTones, TwoSines};
use crate::config::Method;
use crate::estimate::driven::{ByEuler, DrivenCourse, DrivenSegment, Plant, SteadySwing, TurningGain};
use crate::estimate::{
    AnyFilter, BatchStart, Course, EstimateError, FilterPast, GainOf, MeanAndCovariance, Past, SignalStart,
    StartSearch, StatePrior, StatedSign, Swing, Trajectory, lock_in, rows_to_start_again,
    start_again_from_signal, start_from_signal, with_the_sign_before,
};
use crate::progress::Progress;
use kalmems_core::Covariance;
use kalmems_core::augmentation::AugmentationError;
use std::f64::consts::TAU;
use std::ops::Range;

/// The drives of x and y as the samples that were there first show them: all of these, or of drives that change those before the end of the
/// settling time, from which on signs are told by the drives' phases.
pub fn first_tones(
    settings: &TwoAxisSettings,
    data: &DrivenSegment,
    place: &str,
) -> Result<DriveTones, EstimateError> {
    let of = |rows: Range<usize>| {
        let (time_s, volts) = (data.time_s.get(rows.clone())?, data.drive.volts().get(rows.clone())?);
        let fit =
            || TwoSines::of(time_s, volts, data.interval_s).map_or_else(Vec::new, |found| found.0.into());
        let sines = data.drive.fitted_sines(&rows, 2, fit);
        DriveTones::among(&TwoSines(sines.try_into().ok()?), resonances_hz(settings))
    };
    let found = || {
        let end = data.time_s.partition_point(|time_s| *time_s < data.scored_from(settings.skip_s));
        let end = end.max(rows_of_window(data.interval_s)).min(data.time_s.len());
        let settled = end.saturating_sub(rows_of_window(data.interval_s))..end;
        of(0..data.time_s.len()).or_else(|| Some(DriveTones { is_steady: false, ..of(settled)? }))
    };
    found().ok_or_else(|| EstimateError::NotTwoSines { place: place.to_owned() })
}

/// Runs the wanted filters over both axes of the new samples of a segment, which `place` names in messages.
///
/// Trajectories have the states `angle_x`, `rate_x`, `angle_y` and `rate_y`.
pub fn estimate(
    settings: &TwoAxisSettings,
    (place, drive): (&str, &DriveTones),
    data: &DrivenSegment,
    past: &mut Past,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let motions = drive.motions();
    let start_s = data.scored_from(settings.skip_s);
    let mut trajectories = Vec::new();
    for (index, filter) in settings.filters.iter().enumerate() {
        let past = past.filter(index);
        let mut found = TwoAxisFilterTask { settings, filter, data, drive, place, progress }.one(past)?;
        for (answer, trajectory) in found.iter_mut().enumerate() {
            let past = past.answer(answer);
            for (axis, positive) in settings.first_peak_positive.iter().enumerate() {
                let (rate, states) = (2 * axis + 1, vec![2 * axis, 2 * axis + 1]);
                if let Some(is_positive) = *positive {
                    let sign = StatedSign { axis, rate, states, is_positive };
                    past.orient(trajectory, &sign, drive.tones[axis].peak_after(start_s));
                } else {
                    trajectory.hidden_signs.push(states);
                }
            }
            trajectory.lock = past.judge.judge(trajectory, &motions, start_s, data.samples.ends);
        }
        trajectories.append(&mut found);
    }
    Ok(trajectories)
}

/// The free resonances of x and y.
pub fn resonances_hz(settings: &TwoAxisSettings) -> [f64; 2] {
    let scanner = &settings.hardware.scanner;
    [scanner.x, scanner.y].map(|axis| axis.resonator.natural_rate() / TAU)
}

/// How much of the signal a lock-in takes in, in s.
pub const WINDOW_S: f64 = 2e-3;

/// The rows that it has, at this interval in s.
pub fn rows_of_window(interval_s: f64) -> usize {
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive count, saturating
    let rows = (WINDOW_S / interval_s).ceil() as usize;
    rows
}

/// One filter over one segment.
struct TwoAxisFilterTask<'a> {
    settings: &'a TwoAxisSettings,
    filter: &'a TwoAxisFilterSettings,
    data: &'a DrivenSegment<'a>,
    drive: &'a DriveTones,
    place: &'a str,
    progress: &'a dyn Progress,
}

impl TwoAxisFilterTask<'_> {
    /// Chooses the model: once per segment, so that the loops inside know their types.
    fn one(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let (hardware, filter) = (&self.settings.hardware, self.filter);
        match filter.basics.method {
            Method::LockIn => self.lock_in(past),
            _ if let Some(gain) = filter.basics.gain() => self.turning(gain, past),
            Method::Bank => {
                let (models, is_begun) = (both_models(hardware, filter), past.left().is_some());
                let starts = models.iter().map(|model| self.batch_start(model, is_begun));
                let follower =
                    TwoAxisFilterRun { starts: starts.collect::<Result<_, _>>()?, ..self.follower() };
                follower.bank(&models, &filter.basics.states(&STATES), past, || Ok(self.given()))
            }
            Method::EulerEkf => self.run(&ByEuler(both(hardware, filter)), past),
            _ if filter.basics.tracked.is_empty() => self.run(&both(hardware, filter), past),
            _ => {
                let plant = both_with(hardware, filter).map_err(|why| filter.basics.no_model(why))?;
                self.run(&plant, past)
            }
        }
    }

    /// With a gain that is constant but for the phases, that for the motion at the segment's beginning.
    fn turning(&self, gain: GainOf, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let (basics, hardware) = (&self.filter.basics, &self.settings.hardware);
        let plant = both(hardware, self.filter);
        let start = self.batch_start(&plant, past.left().is_some())?;
        let begin = |left: Option<MeanAndCovariance>| {
            let mean = left.unwrap_or_else(|| self.given()).gaussian().mean;
            let ((time_s, signal), drive) = (self.window(), self.window_tones()?);
            let drives_hz = drive.tones.map(|tone| tone.frequency_hz);
            let swings = swings(&hardware.readout, (time_s, signal), drives_hz, &[]);
            let swings = swings.map_err(|why| basics.no_gain(&why))?;
            let over_s = [time_s.first().copied().unwrap_or(0.0), WINDOW_S];
            let motion = SteadySwing { swings: &swings, drive: &|time_s| drive.at(time_s), over_s };
            let samples = (self.data.interval_s, hardware.noise_variance);
            let found = TurningGain::<4>::new(gain, &plant, motion, mean, samples);
            Ok(AnyFilter::this(found.map_err(|why| basics.no_gain(&why))?))
        };
        self.follower().started(start).follow(&plant, &STATES, past, begin)
    }

    /// Both axes at once, in windows that tell the lines of one drive apart from those of the other.
    fn lock_in(&self, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let (readout, data) = (&self.settings.hardware.readout, self.data);
        let drives_hz = match past.numbers[..] {
            [x, y] => [x, y],
            _ => self.window_tones()?.tones.map(|tone| tone.frequency_hz),
        };
        past.numbers = drives_hz.to_vec();
        let length_s = separating_s(drives_hz);
        if length_s > WINDOW_S {
            let why = format!(
                "the lock-in `{}` would need windows of {:.2e} s to tell the lines of the two drives and of their harmonics apart; \
                 both axes are taken to swing steadily for {WINDOW_S:.0e} s at most: move the drives apart, or use `ekf`",
                self.filter.basics.name, length_s
            );
            return Err(EstimateError::Unfit { place: self.place.to_owned(), why });
        }
        let signals = [data.signal];
        let windows = data.windows(&signals, length_s);
        let detect = |time_s: &[f64], signals: &[&[f64]], before: &[Swing]| {
            swings(readout, (time_s, signals.first()?), drives_hz, before).ok()
        };
        Ok(vec![lock_in((&self.filter.basics, past), &windows, &STATES, detect)])
    }

    fn run<P: Plant>(&self, plant: &P, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        let follower = self.follower().started(self.batch_start(plant, past.left().is_some())?);
        follower.run(plant, &self.filter.basics.states(&STATES), past, || Ok(self.given()))
    }

    /// The start of a model by all of the first samples; `None` where it is stated otherwise, and where the filter has begun.
    fn batch_start<P: Plant>(&self, plant: &P, is_begun: bool) -> Result<Option<BatchStart>, EstimateError> {
        let (basics, data) = (&self.filter.basics, self.data);
        if is_begun || !matches!(self.filter.start, TwoAxisStart::Signal) {
            return Ok(None);
        }
        // Of an axis that stands still, every small motion has the same likelihood.
        let swings = self.swings_in(self.window()).map_err(|why| EstimateError::NoStart {
            place: self.place.to_owned(),
            filter: basics.name.clone(),
            why: why.to_string(),
        })?;
        let first_s = data.time_s.first().copied().unwrap_or(0.0);
        let search = self.search(vec![swings.iter().flat_map(|swing| swing.at(first_s)).collect()]);
        let mut course = self.course(plant).map_err(|why| basics.no_model(why))?;
        let (states, cycle_s) = (basics.states(&STATES), self.slowest_hz().recip());
        let of =
            SignalStart { place: self.place, basics, states: (&states, STATES.len()), sizes: &[], cycle_s };
        start_from_signal(&mut course, &data.samples, &search, of).map(Some)
    }

    fn course<'c, P: Plant>(&'c self, plant: &'c P) -> Result<DrivenCourse<'c, P>, AugmentationError> {
        DrivenCourse::new(plant, self.settings.hardware.noise_variance, self.data)
    }

    /// The swings that a lock-in finds in some samples.
    fn swings_in(&self, window: (&[f64], &[f64])) -> Result<Vec<Swing>, LineError> {
        let drives_hz = self.drive.tones.map(|tone| tone.frequency_hz);
        swings(&self.settings.hardware.readout, window, drives_hz, &[])
    }

    /// What the search for a start knows: the oscillations of both axes, and from where it is sought as well. Signal and torque are those of either
    /// motion mirrored as well, so that either sign is taken.
    fn search(&self, seeds: Vec<Vec<f64>>) -> StartSearch {
        let unknown = [StatePrior { mean: 0.0, sd: None }; STATES.len()];
        let prior: Vec<StatePrior> = unknown.into_iter().chain(self.filter.basics.priors()).collect();
        let shape = |(axis, motion_hz): (usize, f64)| {
            let only = |place: usize, value: f64| {
                (0..prior.len()).map(|i| if i == place { value } else { 0.0 }).collect::<Vec<f64>>()
            };
            [only(2 * axis, 1.0), only(2 * axis + 1, TAU * motion_hz)]
        };
        StartSearch {
            shapes: self.motions_hz().into_iter().enumerate().map(shape).collect(),
            mirrored: vec![vec![0, 1], vec![2, 3]],
            seeds,
            is_symmetric: true,
            prior,
            ..StartSearch::default()
        }
    }

    fn follower(&self) -> TwoAxisFilterRun<'_> {
        let filter = &self.filter.basics;
        let noise_variance = self.settings.hardware.noise_variance;
        TwoAxisFilterRun {
            filter,
            data: self.data,
            noise_variance,
            progress: self.progress,
            starts: Vec::new(),
            again: self.start_again(),
        }
    }

    /// The frequencies of both motions, as the drives have them.
    fn motions_hz(&self) -> [f64; 2] {
        self.drive.motions().map(|(_, motion)| motion.frequency_hz)
    }

    fn slowest_hz(&self) -> f64 {
        self.motions_hz().into_iter().fold(f64::INFINITY, f64::min)
    }

    /// How the filter is started again where it has lost the signal; the drives hold the phases of both axes, and so their signs.
    fn start_again(&self) -> Option<SearchAgain<'_>> {
        let (basics, data, slowest_hz) = (&self.filter.basics, self.data, self.slowest_hz());
        let states = basics.states(&STATES).len();
        let rows = rows_to_start_again((slowest_hz.recip(), data.interval_s), states);
        let rule = basics.reacquisition(slowest_hz, data.start_s, rows)?;
        let seek = move |course: &mut dyn Course, rows: Range<usize>, held: (f64, &[f64])| {
            let behind_s = data.time_s.get(rows.end).copied()?;
            let mut known = start_again_from_signal(course, rows, &self.search(Vec::new()), &basics.readout)?;
            for (axis, hz) in self.motions_hz().into_iter().enumerate() {
                known = with_the_sign_before(known, 2 * axis, (behind_s, TAU * hz), held);
            }
            Some(known)
        };
        Some(SearchAgain { rule, seek: Box::new(seek) })
    }

    /// What is stated of the first sample; rest where nothing is, and what the signal tells takes its place.
    fn given(&self) -> MeanAndCovariance {
        let motion = match self.filter.start {
            TwoAxisStart::Given { mean, covariance } => (mean, covariance),
            TwoAxisStart::Signal => ([0.0; 4], Covariance::zero()),
        };
        let parameters = self.filter.basics.parameters().iter().map(|tracked| (0.0, tracked.sd));
        MeanAndCovariance::from(motion).with(parameters)
    }

    /// The first samples, as many as a lock-in takes in.
    fn window(&self) -> (&[f64], &[f64]) {
        let first = self.data.time_s.first().copied().unwrap_or(0.0);
        let end = self.data.time_s.partition_point(|t| *t <= first + WINDOW_S);
        (&self.data.time_s[..end], &self.data.signal[..end])
    }

    /// The drives in that window alone, so that they do not depend on how many samples there are behind it.
    fn window_tones(&self) -> Result<DriveTones, EstimateError> {
        let (time_s, _) = self.window();
        let (volts, interval_s) = (&self.data.drive.volts()[..time_s.len()], self.data.interval_s);
        let found = DriveTones::of(time_s, volts, interval_s, resonances_hz(self.settings));
        found.ok_or_else(|| EstimateError::NotTwoSines { place: self.place.to_owned() })
    }
}
