//! The estimates of one record.

use super::course::{Channel, StageCourse};
use super::filters::FilterSettings;
use super::identification::motion_by;
use super::settings::Settings;
use crate::config::Method;
use crate::estimate::{
    AnyFilter, EstimateError, ITERATIONS, Lookahead, ModelAlone, Motion, Progress, StateName, Trajectory,
    TrajectoryKind, follow, judge_lock, smooth,
};
use crate::signal::{Sine, fit_sine_at};
use crate::units::kind;
use kalmems_core::{Covariance, Ekf, IteratedEkf, SquareRootEkf, Ukf};
use std::f64::consts::TAU;

/// One record as the filters see it.
#[derive(Clone, Debug)]
pub struct Samples<'a> {
    /// The record, for messages.
    pub place: &'a str,
    /// When, in s.
    pub time_s: &'a [f64],
    /// The usual interval in s.
    pub interval_s: f64,
    /// The drive at each sample in V.
    pub drive: &'a [f64],
    /// The sine that it follows.
    pub drive_sine: Sine,
    /// Which electrodes there are signals of, as places in the hardware.
    pub electrodes: &'a [usize],
    /// The signals of these in V, without what the drive alone makes of them.
    pub signals: Vec<Vec<f64>>,
}

/// The states, as trajectories name them.
const STATES: [StateName; 2] = [("angle", "rad", &kind::ANGLE), ("rate", "rad_per_s", &kind::ANGULAR_RATE)];

/// When the iterated filter has settled, in standard deviations.
const SETTLED: f64 = 1e-3;

/// How many cycles a start from the signals looks at.
const CYCLES: f64 = 2.0;

/// Runs the wanted filters over a record.
pub fn estimate(
    settings: &Settings,
    samples: &Samples,
    progress: &dyn Progress,
) -> Result<Vec<Trajectory>, EstimateError> {
    let motion = Motion { frequency_hz: samples.drive_sine.frequency_hz, is_driven: true };
    let start_s = samples.time_s.first().copied().unwrap_or(0.0) + settings.skip_s;
    let mut all = Vec::new();
    for filter in &settings.filters {
        let (mut trajectories, signal) = one(settings, filter, samples, progress)?;
        for trajectory in &mut trajectories {
            trajectory.lock = judge_lock(trajectory, &signal, &[("angle", motion)], start_s);
            if filter.method == Method::Model {
                trajectory.kind = TrajectoryKind::ModelAlone;
                trajectory.claim_nothing();
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

/// One filter, smoothed where that is wanted, and the signal that its innovations are of.
fn one(
    settings: &Settings,
    filter: &FilterSettings,
    samples: &Samples,
    progress: &dyn Progress,
) -> Result<(Vec<Trajectory>, Vec<f64>), EstimateError> {
    let channels = channels(settings, filter, samples)?;
    let mean = match filter.start {
        Some(start) => start,
        None => start_from(&channels, samples, filter)?,
    };
    let covariance = Covariance::from_standard_deviations(filter.start_sd);
    let start = match filter.method {
        Method::Model => AnyFilter::ModelAlone(ModelAlone::new(mean)),
        Method::Ukf => AnyFilter::Ukf(Ukf::new(mean, covariance, filter.points)),
        Method::IteratedEkf => {
            AnyFilter::IteratedEkf(IteratedEkf::<_, 2, ITERATIONS>::new(mean, covariance, SETTLED))
        }
        Method::SquareRootEkf => AnyFilter::SquareRootEkf(SquareRootEkf::new(mean, covariance)),
        // The settings let no other method through.
        _ => AnyFilter::Ekf(Ekf::new(mean, covariance)),
    };
    let time = (samples.time_s, samples.interval_s);
    let stage = settings.hardware.stage;
    let mut course = StageCourse::new(time, samples.drive, &channels, stage, filter.density);
    let names = (filter.key.as_str(), filter.name.as_str());
    let filtered = follow(names, start, &mut course, &STATES, progress).ok_or(EstimateError::Interrupted)?;
    let mut trajectories = vec![filtered];
    let whole = filter.smooth.then_some((Lookahead::Whole, "smoothed"));
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // positive; beyond the record is its end
    let lag = |lag_s: f64| (lag_s / samples.interval_s).round() as usize;
    let lagged = filter.lag_s.map(|lag_s| (Lookahead::Samples(lag(lag_s)), "lagged"));
    for (lookahead, word) in whole.into_iter().chain(lagged) {
        let (key, name) = (format!("{}_{word}", filter.key), format!("{}, {word}", filter.name));
        let smoothed = smooth((&key, &name), &start, &mut course, &trajectories[0], lookahead);
        trajectories.push(smoothed);
    }
    let signal = channels.into_iter().next().map(|channel| channel.signal).unwrap_or_default();
    Ok((trajectories, signal))
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
                filter: filter.name.clone(),
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
    let frequency_hz = samples.drive_sine.frequency_hz;
    let first = samples.time_s.first().copied().unwrap_or(0.0);
    let end = samples.time_s.partition_point(|t| *t <= first + CYCLES / frequency_hz);
    let found = channels.iter().find_map(|channel| {
        let sine = fit_sine_at(&samples.time_s[..end], &channel.signal[..end], frequency_hz)?;
        Some(motion_by(&channel.current.plate, channel.current.gain, &sine))
    });
    let motion = found.ok_or_else(|| EstimateError::NoStart {
        place: samples.place.to_owned(),
        filter: filter.name.clone(),
        why: "no signal has samples in the first two cycles".to_owned(),
    })?;
    let rate = TAU * frequency_hz;
    let (sine, cosine) = (rate * first + motion.phase_rad).sin_cos();
    Ok([motion.amplitude * cosine, -motion.amplitude * rate * sine])
}
