//! The estimates of one segment.

use super::filters::{STATES, TwoAxisFilterSettings, TwoAxisStart};
use super::plant::{both, both_models, both_with};
use super::settings::TwoAxisSettings;
use super::start::{StartError, TwoAxisBatchStart, separating_s, swings};
use super::tones::DriveTones;
use crate::config::Method;
use crate::estimate::driven::{ByEuler, DrivenSegment, Plant, SteadySwing, TurningGain};
use crate::estimate::{
    AnyFilter, Course, EstimateError, FilterPast, GainOf, MeanAndCovariance, Past, Swing, Trajectory,
    lock_in, start_again_from, with_the_sign_before,
};
use crate::progress::Progress;
use crate::shared_scanner::segment::{FilterSideOutputs, ScannerFilterRun, SearchAgain};
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
        let (time_s, volts) = (data.time_s.get(rows.clone())?, data.drive.volts().get(rows)?);
        DriveTones::of(time_s, volts, data.interval_s, resonances_hz(settings))
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
                if let Some(positive) = *positive {
                    past.orient(trajectory, 2 * axis, positive, drive.tones[axis].peak_after(start_s));
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

/// How much of the signal a start from it takes in, in s.
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
                let states = filter.basics.states(&STATES);
                self.follower().bank(&both_models(hardware, filter), &states, past, || self.start())
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
        let begin = |left: Option<MeanAndCovariance>| {
            let mean = left.map_or_else(|| self.start(), Ok)?.gaussian().mean;
            let ((time_s, signal), drive) = (self.window(), self.window_tones()?);
            let drives_hz = drive.tones.map(|tone| tone.frequency_hz);
            let found = swings(&hardware.readout, (time_s, signal), drives_hz, &[]);
            let swings = found.ok_or_else(|| basics.no_gain(&StartError::Inseparable))?;
            let over_s = [time_s.first().copied().unwrap_or(0.0), WINDOW_S];
            let motion = SteadySwing { swings: &swings, drive: &|time_s| drive.at(time_s), over_s };
            let samples = (self.data.interval_s, hardware.noise_variance);
            let found = TurningGain::<4>::new(gain, &plant, motion, mean, samples);
            Ok(AnyFilter::this(found.map_err(|why| basics.no_gain(&why))?))
        };
        self.follower().follow(&plant, &STATES, past, begin)
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
            swings(readout, (time_s, signals.first()?), drives_hz, before)
        };
        Ok(vec![lock_in((&self.filter.basics, past), &windows, &STATES, detect)])
    }

    fn run<P: Plant>(&self, plant: &P, past: &mut FilterPast) -> Result<Vec<Trajectory>, EstimateError> {
        self.follower().run(plant, &self.filter.basics.states(&STATES), past, || self.start())
    }

    fn follower(&self) -> ScannerFilterRun<'_> {
        let filter = &self.filter.basics;
        let noise_variance = self.settings.hardware.noise_variance;
        ScannerFilterRun {
            filter,
            data: self.data,
            noise_variance,
            side_outputs: FilterSideOutputs::default(),
            progress: self.progress,
            starts: Vec::new(),
            again: self.start_again(),
        }
    }

    /// How the filter is started again where it has lost the signal; the drives hold the phases of both axes, and so their signs.
    fn start_again(&self) -> Option<SearchAgain<'_>> {
        let (basics, data) = (&self.filter.basics, self.data);
        let motions = self.drive.motions().map(|(_, motion)| motion.frequency_hz);
        let slowest_hz = motions.into_iter().fold(f64::INFINITY, f64::min);
        let rule = basics.reacquisition(slowest_hz, data.start_s, rows_of_window(data.interval_s))?;
        let drives_hz = self.drive.tones.map(|tone| tone.frequency_hz);
        let readout = &self.settings.hardware.readout;
        let seek = move |course: &mut dyn Course, rows: Range<usize>, held: (f64, &[f64])| {
            let (time_s, signal) = (data.time_s.get(rows.clone())?, data.signal.get(rows.clone())?);
            let found = TwoAxisBatchStart::of(readout, time_s, signal, drives_hz).ok()?;
            let first_s = *time_s.first()?;
            let mut known = MeanAndCovariance::from((found.mean, found.covariance));
            for (axis, hz) in motions.into_iter().enumerate() {
                known = with_the_sign_before(known, 2 * axis, (first_s, TAU * hz), held);
            }
            let known = known.with(basics.parameters().iter().map(|tracked| (0.0, tracked.sd)));
            start_again_from(course, rows, &known, &basics.readout)
        };
        Some(SearchAgain { rule, seek: Box::new(seek) })
    }

    /// What is known at the first sample.
    fn start(&self) -> Result<MeanAndCovariance, EstimateError> {
        let motion = match self.filter.start {
            TwoAxisStart::Given { mean, covariance } => (mean, covariance),
            TwoAxisStart::Signal => {
                let found = self.batch_start().map_err(|why| EstimateError::NoStart {
                    place: self.place.to_owned(),
                    filter: self.filter.basics.name.clone(),
                    why: why.to_string(),
                })?;
                (found.mean, found.covariance)
            }
        };
        Ok(MeanAndCovariance::from(motion)
            .with(self.filter.basics.parameters().iter().map(|tracked| (0.0, tracked.sd))))
    }

    /// The samples that a start takes in.
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

    fn batch_start(&self) -> Result<TwoAxisBatchStart, StartError> {
        let drives_hz = self.drive.tones.map(|tone| tone.frequency_hz);
        let (time_s, signal) = self.window();
        TwoAxisBatchStart::of(&self.settings.hardware.readout, time_s, signal, drives_hz)
    }
}
