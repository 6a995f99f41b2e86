//! The estimates of one record.

use super::course::{Channel, StageCourse};
use super::filters::FilterSettings;
use super::identification::motion_by;
use super::settings::Settings;
use crate::config::Method;
use crate::estimate::{
    self, AnyFilter, ConstantGainOf, EstimateError, FilterPast, Known, Motion, Past, Reading, StateName,
    Step, Trajectory, follow,
};
use crate::progress::Progress;
use crate::signal::{Sine, fit_sine_at};
use crate::units::kind;
use std::f64::consts::TAU;
use std::ops::Range;

/// A part of a record as the filters see it.
#[derive(Clone, Debug)]
pub struct Samples<'a> {
    /// The record, for messages.
    pub place: &'a str,
    /// When, in s.
    pub time_s: &'a [f64],
    /// Which of them are new, and the usual interval.
    pub taken: estimate::Samples,
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
}

/// The states, as trajectories name them.
const STATES: [StateName; 2] = [("angle", "rad", &kind::ANGLE), ("rate", "rad_per_s", &kind::ANGULAR_RATE)];

/// How many cycles a start from the signals looks at.
const CYCLES: f64 = 2.0;

/// Runs the wanted filters over the new samples of a record.
pub fn estimate(
    settings: &Settings,
    samples: &Samples,
    past: &mut Past,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let motion = Motion { frequency_hz: samples.drive_hz, is_driven: true };
    let start_s = past.start_s + settings.skip_s;
    let mut all = Vec::new();
    for (index, filter) in settings.filters.iter().enumerate() {
        let past = past.filter(index);
        let mut trajectories = one(settings, filter, samples, past, progress)?;
        for (answer, trajectory) in trajectories.iter_mut().enumerate() {
            let judge = &mut past.answer(answer).judge;
            trajectory.lock = judge.judge(trajectory, &[("angle", motion)], start_s, samples.taken.ends);
            if filter.basics.method == Method::Model {
                trajectory.mark_model_alone();
            } else {
                correct(trajectory, settings.hardware.correction);
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

/// One filter, smoothed where that is wanted.
fn one(
    settings: &Settings,
    filter: &FilterSettings,
    samples: &Samples,
    past: &mut FilterPast,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let channels = channels(settings, filter, samples)?;
    let start = || {
        let mean = filter.start.map_or_else(|| start_from(&channels, samples, filter), Ok)?;
        Ok(Known::apart(mean.into_iter().zip(filter.start_sd)))
    };
    let gain = match filter.basics.method {
        Method::SteadyState => Some(ConstantGainOf::Settled),
        Method::Luenberger => {
            let interval_s = samples.taken.interval_s;
            Some(ConstantGainOf::Poles { corner: filter.observer_rate, interval_s })
        }
        _ => None,
    };
    if gain.is_some() && channels.len() > 1 {
        return Err(no_gain(filter, "it is for one signal; name one in `channels`".to_owned()));
    }
    let time = (samples.time_s, samples.taken.interval_s);
    let stage = settings.hardware.stage;
    let mut course = StageCourse::new(time, (samples.drive, samples.sines), &channels, stage, filter.density);
    let begin = |left: Option<Known>| match gain {
        None => filter.basics.begin(left, start),
        Some(gain) => {
            let known = left.map_or_else(start, Ok)?;
            let process = stage.exact(samples.taken.interval_s, filter.density);
            let (rest, channel) = (Step::new(&process, &[0.0]), &channels[0]);
            let point = (&rest as _, &Reading::<_, 2>(&channel.current) as _, channel.noise_variance);
            // Of the motion at rest: what a sample tells of the rate hangs on the angle by its square alone.
            let at_rest = Known::apart([(0.0, 0.0); 2]);
            let filtering = AnyFilter::of_constant_gain(gain, (&at_rest, &known), point);
            filtering.map_err(|why| no_gain(filter, why))
        }
    };
    follow((&filter.basics, past), begin, (&mut course, &samples.taken), &STATES, progress)
}

fn no_gain(filter: &FilterSettings, why: String) -> EstimateError {
    EstimateError::NoGain { filter: filter.basics.name.clone(), why }
}

/// The channels that a filter takes, in the order of its file or of the recording.
fn channels(
    settings: &Settings,
    filter: &FilterSettings,
    samples: &Samples,
) -> Result<Vec<Channel>, EstimateError> {
    let wanted = if filter.electrodes.is_empty() { samples.electrodes } else { &filter.electrodes };
    let one = |electrode: &usize| {
        let described = &settings.hardware.channels[*electrode];
        let place = samples.electrodes.iter().position(|e| e == electrode);
        let signal =
            place.map(|place| samples.signals[place].clone()).ok_or_else(|| EstimateError::NoStart {
                place: samples.place.to_owned(),
                filter: filter.basics.name.clone(),
                why: format!("the recording has no channel `{}`", described.meaning()),
            })?;
        Ok(Channel {
            current: described.current,
            // The settings were refused where it is not known.
            noise_variance: described.noise_variance.unwrap_or(1.0),
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
    channels: &[Channel],
    samples: &Samples,
    filter: &FilterSettings,
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
    let (sine, cosine) = (rate * first + motion.phase_rad).sin_cos();
    Ok([motion.amplitude * cosine, -motion.amplitude * rate * sine])
}
