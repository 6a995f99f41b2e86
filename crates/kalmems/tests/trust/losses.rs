//! Signals that are lost for a while: when that is said, and how good the estimate is behind it.

use crate::outliers::signals::{DEVICES, Of, noise, signals};
use kalmems::config::Experiment;
use kalmems::estimate::{LockEvent, Trajectory};
use kalmems::evaluate::Grade;
use kalmems::progress::Silent;
use kalmems::results::{EstimatorMetrics, Metrics};
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, WhiteNoise};
use kalmems::workflow::estimate_computed;

/// What happens to the first signal of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loss {
    /// So many samples in a row are missing.
    Dropped(usize),
    /// The samples of a millisecond are off by 5 to 100 standard deviations of the noise, to either side.
    Burst,
    /// The cable is out for so many cycles of the motion: noise about the mean of the signal.
    Unplugged(f64),
    /// From then on the cable is out.
    ForGood,
}

use Loss::{Burst, Dropped, ForGood, Unplugged};

pub const LOSSES: [Loss; 4] = [Dropped(100), Burst, Unplugged(50.0), ForGood];

/// When it happens, in parts of the recording behind the settling time.
const PLACE: f64 = 0.3;

impl Loss {
    /// The rows of the samples that are wrong.
    fn spoil(self, values: &mut [f64], times: &[f64], (skip_s, motion_hz, seed): (f64, f64, u64)) -> [f64; 2] {
        let from = times.partition_point(|time| *time < times[0] + skip_s);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a row
        let place = from + ((times.len() - from) as f64 * PLACE) as usize;
        let sd = noise(values);
        let mut chance = WhiteNoise::new(seed, 78);
        let mean = values[from..].iter().sum::<f64>() / (values.len() - from) as f64;
        let until = |time_s: f64| times.partition_point(|time| *time < times[place] + time_s);
        match self {
            Dropped(count) => {
                values[place..place + count].fill(f64::NAN);
                [times[place], times[place + count]]
            }
            Burst => {
                let end = until(1e-3);
                for value in &mut values[place..end] {
                    let size = 5.0 * 20_f64.powf((chance.sample() * 1e6).rem_euclid(1.0));
                    *value += if chance.sample() < 0.0 { -size * sd } else { size * sd };
                }
                [times[place], times[end]]
            }
            Unplugged(cycles) => {
                let end = until(cycles / motion_hz);
                values[place..end].iter_mut().for_each(|value| *value = mean + sd * chance.sample());
                [times[place], times[end]]
            }
            ForGood => {
                values[place..].iter_mut().for_each(|value| *value = mean + sd * chance.sample());
                [times[place], f64::INFINITY]
            }
        }
    }
}

/// What came of a recording.
pub struct LossOutcome {
    /// When the loss began and ended, in s.
    pub happened_s: [f64; 2],
    pub trajectory: Trajectory,
    pub metrics: EstimatorMetrics,
    /// The root mean square error of what the device is for, from 100 cycles behind the loss on.
    pub error: f64,
    pub motion_hz: f64,
}

/// The recording of a device with this loss, or without one but judged over the same samples.
pub fn outcome(
    (experiment, simulated): &(Experiment, ComputedRecording),
    loss: Loss,
    happens: bool,
    seed: u64,
) -> Option<LossOutcome> {
    let clean = estimate_computed(published(), experiment, simulated, &Silent).ok()?;
    let motion_hz = clean.recordings[0].segments[0].estimate.motion.frequency_hz;
    let skip_s = experiment.estimate.as_ref().unwrap().skip.si();
    let (mut simulated, mut happened_s) = (simulated.clone(), [f64::NAN; 2]);
    let signal = &signals(experiment)[0];
    assert!(simulated.change_recorded(signal, |values, times| {
        let mut spoilt = values.to_vec();
        happened_s = loss.spoil(&mut spoilt, times, (skip_s, motion_hz, seed));
        if happens {
            values.copy_from_slice(&spoilt);
        }
    }));
    let found = estimate_computed(published(), experiment, &simulated, &Silent);
    let found = found.unwrap_or_else(|why| panic!("{why}"));
    let metrics = Metrics::of(&found).estimators().next().unwrap().clone();
    let segment = &found.recordings[0].segments[0];
    let from_s = happened_s[1] + 100.0 / motion_hz;
    let errors = segment.errors[0].as_ref().map(|errors| &errors.error);
    let errors = errors.or_else(|| segment.values[0].values().next().map(|value| &value.error)).unwrap();
    let late = errors.time_s.iter().zip(&errors.error).filter(|(time, _)| **time >= from_s);
    let late: Vec<f64> = late.map(|(_, error)| *error).filter(|error| error.is_finite()).collect();
    let error = (late.iter().map(|error| error * error).sum::<f64>() / late.len() as f64).sqrt();
    let trajectory = segment.estimate.trajectories[0].clone();
    Some(LossOutcome { happened_s, trajectory, metrics, error, motion_hz })
}

impl LossOutcome {
    fn first_loss(&self) -> Option<[f64; 2]> {
        self.trajectory.lock.events.iter().find_map(|event| match event {
            LockEvent::Lost { time_s, detected_s, .. } => Some([*time_s, *detected_s]),
            _ => None,
        })
    }

    fn first_return_s(&self) -> Option<f64> {
        self.trajectory.lock.events.iter().find_map(|event| match event {
            LockEvent::Regained { time_s, .. } => Some(*time_s),
            _ => None,
        })
    }

    fn row(&self, of: Of, loss: Loss, clean: f64) -> String {
        let cycles = |time_s: Option<f64>, from_s: f64| {
            time_s.map_or_else(
                || "–".to_owned(),
                |time_s| format!("{:.1}", (time_s - from_s) * self.motion_hz),
            )
        };
        let lost = self.first_loss();
        format!(
            "| {} | {loss:?} | {} | {} | {} | {} | {:.2} | {:?} | {} |",
            of.name(),
            cycles(lost.map(|lost| lost[0]), self.happened_s[0]),
            cycles(lost.map(|lost| lost[1]), self.happened_s[0]),
            cycles(self.first_return_s(), self.happened_s[1]),
            self.trajectory.restarts.len(),
            self.error / clean,
            self.metrics.grade,
            self.metrics.counts.lost,
        )
    }
}

/// Twenty seeds a cell: `cargo test --release -p kalmems --test trust -- --ignored slow_losses --nocapture`.
#[test]
#[ignore = "slow: half an hour on two processors"]
fn slow_losses_of_every_device() {
    let count = std::env::var("KALMEMS_SEEDS").ok().and_then(|count| count.parse::<u64>().ok());
    println!("| device | loss | begun | known | back | starts | error | grade | left out |");
    let mut wrong = Vec::new();
    for of in DEVICES {
        for seed in 701..=700 + count.unwrap_or(20) {
            let recorded = of.recorded(&[], seed);
            for loss in LOSSES {
                let Some(clean) = outcome(&recorded, loss, false, seed) else { continue };
                let Some(found) = outcome(&recorded, loss, true, seed) else { continue };
                let row = found.row(of, loss, clean.error);
                println!("{row}");
                let passes = found.metrics.grade.is_some_and(|grade| grade <= Grade::PassesWithRemarks);
                let claims_nothing = loss == ForGood && !found.trajectory.lock.is_usable();
                let is_right = match loss {
                    ForGood => claims_nothing && !passes,
                    _ => found.error <= 2.0 * clean.error || !passes,
                };
                if !is_right {
                    wrong.push(row);
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
