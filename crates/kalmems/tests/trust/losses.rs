//! Signals that are lost for a while: when that is said, and how good the estimate is behind it.

use crate::devices::Setting;
use crate::outliers::signals::{DEVICES, Of, noise, signals};
use crate::parts;
use crate::piston_motions::{followed, piston, piston_at};
use crate::side_by_side::side_by_side;
use kalmems::config::Experiment;
use kalmems::estimate::{LockEvent, Trajectory, TrajectoryKind};
use kalmems::evaluate::Grade;
use kalmems::progress::Silent;
use kalmems::results::{EstimatorMetrics, Metrics};
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, WhiteNoise};
use kalmems::workflow::estimate_computed;
use std::f64::consts::TAU;

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

impl Loss {
    fn words(self) -> String {
        match self {
            Dropped(count) => format!("{count} samples missing"),
            Burst => "a burst of 1 ms".to_owned(),
            Unplugged(cycles) => format!("cable out for {cycles:.0} cycles"),
            ForGood => "cable out to the end".to_owned(),
        }
    }
}

pub const LOSSES: [Loss; 4] = [Dropped(100), Burst, Unplugged(50.0), ForGood];

/// When it happens, in parts of the recording behind the settling time.
const PLACE: f64 = 0.3;

impl Loss {
    /// The rows of the samples that are wrong.
    fn spoil(
        self,
        values: &mut [f64],
        times: &[f64],
        (skip_s, motion_hz, seed): (f64, f64, u64),
    ) -> [f64; 2] {
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

/// Settings by which a recording lasts for some hundred cycles behind the loss.
pub fn longer(of: Of) -> Vec<Setting<'static>> {
    let duration = |text: &str| vec![("simulate.duration", format!("\"{text}\""))];
    match of.name() {
        "shared scanner" => duration("48 ms"),
        "micro-stage" => duration("160 ms"),
        "threshold scanner" => duration("400 ms"),
        "accelerometer" => duration("5 s"),
        "piston mirror" => {
            let mut settings = duration("1.4 s");
            settings.push(("estimate.skip", "\"0.2 s\"".to_owned()));
            settings.push(("simulate.sampling_rate", "\"20 kHz\"".to_owned()));
            settings.push(("simulate.integration_rate", "\"20 kHz\"".to_owned()));
            // The tables are of the filters.
            settings.push(("estimate.filter.0.smooth", "false".to_owned()));
            settings
        }
        _ => Vec::new(),
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

    fn passes(&self) -> bool {
        self.metrics.grade.is_some_and(|grade| grade <= Grade::PassesWithRemarks)
    }
}

/// What came of a loss over several recordings: of each, in cycles, when the loss was known and when the signal was found again, and the error
/// over that of the same samples without the loss.
struct LossCell {
    of: Of,
    loss: Loss,
    known: Vec<f64>,
    found_again: Vec<f64>,
    restarted: usize,
    ratios: Vec<f64>,
    passed: usize,
    no_estimate: usize,
    wrong: Vec<String>,
}

impl LossCell {
    fn of(of: Of, loss: Loss) -> Self {
        Self {
            of,
            loss,
            known: Vec::new(),
            found_again: Vec::new(),
            restarted: 0,
            ratios: Vec::new(),
            passed: 0,
            no_estimate: 0,
            wrong: Vec::new(),
        }
    }

    fn take(&mut self, seed: u64, clean: &LossOutcome, found: &LossOutcome) {
        let cycles = |time_s: f64, from_s: f64| (time_s - from_s) * found.motion_hz;
        self.known.extend(found.first_loss().map(|[_, known_s]| cycles(known_s, found.happened_s[0])));
        self.found_again.extend(found.first_return_s().map(|time_s| cycles(time_s, found.happened_s[1])));
        self.restarted += usize::from(!found.trajectory.restarts.is_empty());
        self.ratios.push(found.error / clean.error);
        let passes = found.passes();
        self.passed += usize::from(passes);
        self.no_estimate += usize::from(!found.trajectory.lock.is_usable());
        // The loop of an accelerometer holds its signal near zero: noise about the mean is what the filter expects.
        let claims_nothing = !found.trajectory.lock.is_usable() || self.of.name() == "accelerometer";
        let is_right = match self.loss {
            ForGood => claims_nothing && !passes,
            _ => found.error <= 2.0 * clean.error || !passes,
        };
        if !is_right {
            self.wrong.push(format!(
                "seed {seed}: {:.2} times the error, {:?}",
                found.error / clean.error,
                found.metrics.grade
            ));
        }
    }

    /// The row of the book.
    fn row(&self) -> String {
        let of_all = |values: &[f64]| {
            let mut values: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
            values.sort_by(f64::total_cmp);
            match (values.get(values.len() / 2), values.last()) {
                (Some(median), Some(largest)) => format!("{median:.2} ({largest:.2})"),
                _ => "–".to_owned(),
            }
        };
        format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            self.of.name(),
            self.loss.words(),
            of_all(&self.known),
            of_all(&self.found_again),
            self.restarted,
            of_all(&self.ratios),
            self.passed,
            self.no_estimate,
        )
    }
}

/// A frequency that steps by a part in a thousand is named within two cycles, and a hundred cycles later the estimate is as good as without.
#[test]
fn a_step_of_the_frequency_is_named_and_followed() {
    const STEP_S: f64 = 0.6;
    let steady = |time_s: f64| [5e-4, TAU * 500.0 * time_s + 0.7];
    let steps = |time_s: f64| [5e-4, TAU * (500.0 * time_s + 0.5 * (time_s - STEP_S).max(0.0)) + 0.7];
    let from_s = STEP_S + 100.0 / 500.0;
    let (_, clean) = followed(&piston(1, steady), from_s, steady);
    let (found, error) = followed(&piston(1, steps), from_s, steps);
    println!("{:?}: {error:.2e} m, {clean:.2e} m without", found.lock.events);
    let [
        LockEvent::Lost { time_s, detected_s, .. },
        LockEvent::Regained { time_s: again_s, restarted_s, .. },
    ] = found.lock.events[..]
    else {
        panic!("{:?}", found.lock)
    };
    assert!((STEP_S - 2e-3..STEP_S + 3.0 * 2e-3).contains(&time_s) && detected_s <= time_s + 2.1e-3);
    assert!(restarted_s.is_some() && again_s < STEP_S + 25.0 * 2e-3);
    assert!(found.lock.is_usable() && error <= 2.0 * clean, "{error:e} {clean:e}");
}

/// While a motion that nothing drives has stopped it is no estimate, and noise is never taken for a motion.
#[test]
fn a_motion_that_stops_and_starts_is_lost_and_found() {
    let moves =
        |time_s: f64| [if (0.5..0.7).contains(&time_s) { 0.0 } else { 5e-4 }, TAU * 500.0 * time_s + 0.7];
    let steady = |time_s: f64| [5e-4, TAU * 500.0 * time_s + 0.7];
    let from_s = 0.7 + 100.0 / 500.0;
    let (_, clean) = followed(&piston(2, steady), from_s, steady);
    let (found, error) = followed(&piston(2, moves), from_s, moves);
    println!("{:?}: {error:.2e} m, {clean:.2e} m without", found.lock.events);
    let [LockEvent::Lost { time_s, .. }, LockEvent::Regained { time_s: again_s, .. }] = found.lock.events[..]
    else {
        panic!("{:?}", found.lock)
    };
    assert!((0.498..0.506).contains(&time_s) && (0.7..0.8).contains(&again_s), "{:?}", found.lock);
    assert!(found.lock.is_usable() && error <= 2.0 * clean, "{error:e} {clean:e}");
    let (stopped, _) =
        followed(&piston(2, |t| [if t < 0.5 { 5e-4 } else { 0.0 }, TAU * 500.0 * t + 0.7]), 0.5, steady);
    assert!(!stopped.lock.is_usable() && stopped.lock.events.len() == 1, "{:?}", stopped.lock);
}

/// What is smoothed before a loss is what it is of a recording that ends there, be the loss over again or not.
#[test]
fn what_is_smoothed_before_a_loss_rests_on_the_samples_before_it() {
    const LOSS_S: f64 = 0.6;
    let at = |time_s: f64| 1e-3 + 5e-4 * (TAU * 500.0 * time_s + 0.7).cos();
    // The smoothed position where the cable is out from the loss to this time in s.
    let smoothed = |duration: &str, until_s: f64| {
        let settings = [
            ("estimate.filter.0.smooth", "true".to_owned()),
            ("simulate.duration", format!("\"{duration}\"")),
        ];
        let is_out = |time_s: f64| (LOSS_S..until_s).contains(&time_s);
        let (experiment, simulated) =
            piston_at(&settings, 4, |time_s| if is_out(time_s) { 1e-3 } else { at(time_s) });
        let rig = published().rig(&experiment).unwrap();
        let recording = simulated.recorded(&rig.layout(&experiment, 0).unwrap()).unwrap();
        let found = rig.estimate(&experiment, 0, &recording, &Silent).unwrap().swap_remove(0).trajectories;
        found.into_iter().find(|trajectory| trajectory.kind == TrajectoryKind::Smoothed).unwrap()
    };
    for until_s in [0.7, f64::INFINITY] {
        let found = smoothed("1.4 s", until_s);
        let Some(LockEvent::Lost { time_s: lost_s, .. }) = found.lock.events.first() else {
            panic!("{:?}", found.lock)
        };
        // Of the last samples before it the noise decides whether they were lost too.
        assert!((LOSS_S - 5e-4..LOSS_S + 1e-9).contains(lost_s), "{lost_s}");
        let ending = smoothed(&format!("{} s", lost_s - 5e-5), f64::INFINITY);
        let [own, expected] = [&found, &ending].map(|trajectory| trajectory.state("position").unwrap());
        let mut square = 0.0;
        for (k, time_s) in ending.time_s.iter().enumerate() {
            assert!((own.mean[k] - expected.mean[k]).abs() < 1e-6 * expected.sd[k], "{time_s}");
            square += ((own.mean[k] - at(*time_s)) / own.sd[k]).powi(2);
        }
        let in_sd = (square / ending.time_s.len() as f64).sqrt();
        println!("out until {until_s} s: errors of {in_sd:.2} claimed deviations");
        assert!(in_sd < 1.5, "{in_sd}");
    }
}

/// In parts the filters lose and find the signal as over the whole recording, to the last bit.
fn is_the_same_in_parts(devices: impl IntoIterator<Item = Of>) {
    for of in devices {
        let (experiment, mut simulated) = of.recorded(&longer(of), 690);
        let rig = published().rig(&experiment).unwrap();
        let recording =
            |simulated: &ComputedRecording| simulated.recorded(&rig.layout(&experiment, 0).unwrap()).unwrap();
        let clean = rig.estimate(&experiment, 0, &recording(&simulated), &Silent).unwrap();
        let (motion_hz, skip_s) = (clean[0].motion.frequency_hz, clean[0].skip_s);
        let signal = &signals(&experiment)[0];
        assert!(simulated.change_recorded(signal, |values, times| {
            Unplugged(50.0).spoil(values, times, (skip_s, motion_hz, 690));
        }));
        let recording = recording(&simulated);
        let found = rig.estimate(&experiment, 0, &recording, &Silent).unwrap();
        println!("{}: {:?}", of.name(), found[0].trajectories[0].lock.events);
        assert!(!found[0].trajectories[0].lock.held(), "{}", of.name());
        parts::same_bits_in_parts(&experiment, &recording, &[257, 4_999]);
    }
}

#[test]
fn a_loss_is_the_same_in_parts() {
    is_the_same_in_parts([Of::Published("shared scanner"), Of::Published("piston mirror")]);
}

#[test]
#[ignore = "slow: a minute in a release build"]
fn slow_a_loss_is_the_same_in_parts_of_every_device() {
    is_the_same_in_parts(DEVICES);
}

/// Twenty seeds a cell, or as many as `KALMEMS_SEEDS` says, of all devices or of those whose name has `KALMEMS_DEVICE` in it:
/// `cargo test --release -p kalmems --test trust -- --ignored slow_losses --nocapture`.
#[test]
#[ignore = "slow: half an hour on two processors"]
fn slow_losses_of_every_device() {
    let count = std::env::var("KALMEMS_SEEDS").ok().and_then(|count| count.parse::<u64>().ok());
    let wanted = std::env::var("KALMEMS_DEVICE").unwrap_or_default();
    let wanted: Vec<(Of, u64)> = DEVICES
        .into_iter()
        .filter(|of| of.name().contains(&wanted))
        .flat_map(|of| (701..=700 + count.unwrap_or(20)).map(move |seed| (of, seed)))
        .collect();
    let outcomes = side_by_side(&wanted, |(of, seed)| {
        let recorded = of.recorded(&longer(*of), *seed);
        LOSSES.map(|loss| {
            Some([outcome(&recorded, loss, false, *seed)?, outcome(&recorded, loss, true, *seed)?])
        })
    });
    let mut cells: Vec<LossCell> = Vec::new();
    for ((of, seed), outcomes) in wanted.iter().zip(&outcomes) {
        for (loss, outcome) in LOSSES.into_iter().zip(outcomes) {
            let Some([clean, found]) = outcome else { continue };
            let place = cells.iter().position(|cell| cell.of == *of && cell.loss == loss);
            let place = place.unwrap_or_else(|| {
                cells.push(LossCell::of(*of, loss));
                cells.len() - 1
            });
            cells[place].take(*seed, clean, found);
        }
    }
    println!("| device | loss | known | found again | started again | error | passed | no estimate |");
    println!("|---|---|--:|--:|--:|--:|--:|--:|");
    for cell in &cells {
        println!("{}", cell.row());
    }
    let wrong: Vec<String> = cells
        .iter()
        .filter(|cell| !cell.wrong.is_empty())
        .map(|cell| format!("{}: {:?}", cell.row(), cell.wrong))
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}
