//! Signals as a laboratory has them: what each impairment costs an estimate, and whether the answer is refused, doubted or passed then.

use crate::devices::put;
use crate::motions::{Driven, Motion};
use crate::outliers::signals::{DEVICES, Of, Outcome, noise, signals};
use crate::side_by_side::side_by_side;
use kalmems::config::Experiment;
use kalmems::estimate::EstimateError;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::ComputedRecording;
use std::f64::consts::TAU;

/// What is wrong with the first signal, or with what the filter is told.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Impairment {
    /// So many samples in a row are missing.
    Missing(usize),
    /// All samples of so many s are.
    NanBurst(f64),
    /// The frequency of the drive steps by this part in the middle of the recording.
    DriveSteps(f64),
    /// So large a part of its range, from below, is what the converter has.
    Clipped(f64),
    /// It is so many standard deviations of its noise higher.
    Offset(f64),
    /// The variance of its noise is told so many times as large as it is.
    NoiseTold(f64),
    /// A line of this frequency in Hz, as strong as so many times the noise within a band of 1 Hz.
    Hum(f64, f64),
    /// A part of its square, as large at its peaks as so large a part of them.
    SecondHarmonic(f64),
    /// The start is off by so many of the standard deviations that it is told with.
    Start(f64),
}

use Impairment::{Clipped, DriveSteps, Hum, Missing, NanBurst, NoiseTold, Offset, SecondHarmonic, Start};

const IMPAIRMENTS: [Impairment; 18] = [
    Missing(10),
    Missing(100),
    NanBurst(1e-3),
    DriveSteps(1e-3),
    Clipped(0.9),
    Offset(1.0),
    Offset(10.0),
    Offset(100.0),
    NoiseTold(0.01),
    NoiseTold(100.0),
    Hum(50.0, 1.0),
    Hum(50.0, 10.0),
    Hum(50.0, 100.0),
    Hum(150.0, 1.0),
    Hum(150.0, 10.0),
    Hum(150.0, 100.0),
    SecondHarmonic(0.01),
    Start(10.0),
];

impl Impairment {
    fn words(self) -> String {
        match self {
            Missing(count) => format!("{count} samples missing"),
            NanBurst(long_s) => format!("all samples of {:.0} ms missing", 1e3 * long_s),
            DriveSteps(by) => format!("the drive's frequency steps by {by:e}"),
            Clipped(share) => format!("clipped at {} % of its range", 100.0 * share),
            Offset(sds) => format!("an offset of {sds} σ"),
            NoiseTold(factor) => format!("noise stated {factor} times as strong"),
            Hum(hz, factor) => format!("hum at {hz} Hz, {factor} times the noise in 1 Hz"),
            SecondHarmonic(share) => format!("a second harmonic of {} %", 100.0 * share),
            Start(sds) => format!("the start {sds} deviations off"),
        }
    }

    /// By how much the error may be larger: a gap is an event within which nothing is measured, and so is a step.
    fn allowed(self) -> f64 {
        if matches!(self, Missing(_) | NanBurst(_) | DriveSteps(_) | Start(_)) { 2.0 } else { 1.3 }
    }

    /// Changes the samples after the settling time; a converter clips all of them.
    fn spoil(self, values: &mut [f64], times: &[f64], skip_s: f64) {
        let from = times.partition_point(|time| *time < times[0] + skip_s);
        let sd = noise(values);
        let (low, high) =
            values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(*y), h.max(*y)));
        let interval_s = (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64;
        if let Clipped(share) = self {
            let top = low + share * (high - low);
            for y in values.iter_mut() {
                *y = y.min(top);
            }
        }
        let fresh = &mut values[from..];
        match self {
            Missing(count) => {
                let place = fresh.len() / 3;
                fresh[place..place + count].fill(f64::NAN);
            }
            NanBurst(long_s) => {
                let (place, times) = (fresh.len() / 3, &times[from..]);
                let end = times.partition_point(|time| *time < times[place] + long_s);
                fresh[place..end].fill(f64::NAN);
            }
            Offset(sds) => fresh.iter_mut().for_each(|y| *y += sds * sd),
            Hum(hz, factor) => {
                let amplitude = factor * sd * 2.0 * interval_s.sqrt();
                for (y, time) in fresh.iter_mut().zip(&times[from..]) {
                    *y += amplitude * (TAU * hz * time + 0.4).sin();
                }
            }
            SecondHarmonic(share) => {
                let (middle, peak) = (f64::midpoint(low, high), 0.5 * (high - low));
                for y in fresh {
                    *y += share * (*y - middle).powi(2) / peak;
                }
            }
            Clipped(_) | NoiseTold(_) | Start(_) | DriveSteps(_) => {}
        }
    }

    /// What of the experiment it changes: keys, their value and its unit. The true motion is that of a start which is off.
    fn told(self, of: Of, simulated: &ComputedRecording) -> Vec<(String, String)> {
        let to = |key: &str, text: String| vec![(key.to_owned(), text)];
        match (self, of) {
            (NoiseTold(factor), Of::Equations(_)) => {
                to("device.equations.noise.signal", format!("\"{:e}[V^2]\"", 1e-6 * factor))
            }
            (NoiseTold(factor), Of::Published(name)) => {
                let variance = |device: &str, value: f64| {
                    to(&format!("device.{device}.noise_variance"), format!("\"{:e} V^2\"", value * factor))
                };
                match name {
                    "shared scanner" => variance("shared_scanner.readout", 1.92e-4),
                    "threshold scanner" => variance("threshold_scanner.readout", 1.89225e-3),
                    "accelerometer" => variance("accelerometer.readout", 4.88e-9),
                    "piston mirror" => to(
                        "device.piston_mirror.readout.noise_density",
                        format!("\"{:e} aF/sqrt(Hz)\"", 0.151 * factor.sqrt()),
                    ),
                    _ => ["1A", "1B", "2A", "2B"]
                        .iter()
                        .flat_map(|name| variance(&format!("micro_stage.electrodes.{name}"), 1.6e-11))
                        .collect(),
                }
            }
            (Start(sds), of) => {
                let start = "estimate.filter.0.start";
                let with_deviation = |value: String, sd: String| {
                    vec![(start.to_owned(), value), ("estimate.filter.0.start_sd".to_owned(), sd)]
                };
                match of {
                    Of::Equations(_) => {
                        to(start, format!("{{ x = \"{:e} m\", v = \"0 m/s\" }}", 0.5e-6 * sds))
                    }
                    Of::Published("threshold scanner") => {
                        let angle = 0.09 + 0.02 * sds;
                        to(start, format!("{{ angle = \"{angle} rad\", rate = \"490 rad/s\" }}"))
                    }
                    Of::Published("accelerometer") => {
                        let x = 1e-8 * sds;
                        let text = format!(
                            "{{ displacement = \"{x:e} m\", velocity = \"0 m/s\", acceleration = \"0 m/s^2\", jerk = \"0 m/s^3\" }}"
                        );
                        to(start, text)
                    }
                    Of::Published("piston mirror") => {
                        let amplitude = 500.0 + sds;
                        let value = format!(
                            "{{ amplitude = \"{amplitude} um\", frequency = \"500 Hz\", phase = \"0.7 rad\", offset = \"1 mm\", amplitude_rate = \"0 m/s\" }}"
                        );
                        let sd = "{ amplitude = \"1 um\", frequency = \"0.1 Hz\", phase = \"10 mrad\", offset = \"1 um\", amplitude_rate = \"10 um/s\" }";
                        with_deviation(value, sd.to_owned())
                    }
                    Of::Published(name) => {
                        let columns = simulated.true_columns();
                        let first =
                            |name| columns.iter().find(|(own, _)| *own == name).map(|(_, values)| values[0]);
                        let (angle, rate) = (first("angle_rad").unwrap(), first("rate_rad_per_s").unwrap());
                        let [angle_sd, rate_sd] = match name {
                            "shared scanner" => [5e-3, 500.0],
                            _ => [5e-6, 0.05],
                        };
                        let angle = angle + angle_sd * sds;
                        with_deviation(
                            format!("{{ angle = \"{angle:e} rad\", rate = \"{rate:e} rad/s\" }}"),
                            format!("{{ angle = \"{angle_sd:e} rad\", rate = \"{rate_sd:e} rad/s\" }}"),
                        )
                    }
                }
            }
            _ => Vec::new(),
        }
    }

    /// Whether there is such a thing of a device. The drive of the micro-stage is recorded beside a steady motion; the piston mirror has none,
    /// and the feedback of the accelerometer has no frequency.
    fn applies(self, of: Of) -> bool {
        !matches!(self, DriveSteps(_)) || Driven::of(of).is_some() || of.name() == "micro-stage"
    }

    /// What comes of a recording with it.
    fn outcome(self, of: Of, (experiment, simulated): &(Experiment, ComputedRecording)) -> Outcome {
        let skip_s = experiment.estimate.as_ref().unwrap().skip.si();
        let mut simulated = simulated.clone();
        let signal = &signals(experiment)[0];
        assert!(simulated.change_recorded(signal, |values, times| self.spoil(values, times, skip_s)));
        if let DriveSteps(by) = self {
            // The model of the micro-stage is under a steady sine: it is the drive that is judged, whatever the signals are behind the step.
            let changed = simulated.change_recorded("drive", |volts, times| {
                let middle_s = times[times.len() / 2];
                for (volts, time) in volts.iter_mut().zip(times) {
                    *volts = 1.2 * (TAU * 1700.0 * (time + by * (time - middle_s).max(0.0))).sin();
                }
            });
            assert!(changed, "{}", of.name());
        }
        let told = self.told(of, &simulated);
        if told.is_empty() {
            return Outcome::of(experiment, &simulated);
        }
        let mut document: toml::Value = experiment.to_toml().unwrap().parse::<toml::Table>().unwrap().into();
        for (key, value) in &told {
            put(&mut document, key, Some(value));
        }
        let text = toml::to_string(&document).unwrap();
        let experiment =
            published().parse(&text, experiment.path()).unwrap_or_else(|e| panic!("{e}\n{text}"));
        Outcome::of(&experiment, &simulated)
    }
}

/// What came of a cell, over its seeds.
#[derive(Default)]
struct Cell {
    ratios: Vec<f64>,
    within: usize,
    /// Larger errors whose answer is doubted.
    doubted: usize,
    refused: Vec<String>,
    /// Larger errors whose answer passes.
    passed: usize,
}

impl Cell {
    fn add(&mut self, impairment: Impairment, clean: &Outcome, spoilt: &Outcome) {
        if !spoilt.refused.is_empty() {
            self.refused.push(spoilt.refused.clone());
            return;
        }
        let ratio = spoilt.error() / clean.error();
        self.ratios.push(ratio);
        if ratio <= impairment.allowed() {
            self.within += 1;
        } else if spoilt.passes() {
            self.passed += 1;
        } else {
            self.doubted += 1;
        }
    }

    fn row(&self, of: Of, impairment: Impairment) -> String {
        let mut ratios = self.ratios.clone();
        ratios.sort_by(f64::total_cmp);
        let ratio = |ratio: Option<&f64>| match ratio {
            Some(ratio) if ratio.is_finite() => format!("{ratio:.2}"),
            _ => "–".to_owned(),
        };
        format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} |",
            of.name(),
            impairment.words(),
            ratio(ratios.get(ratios.len() / 2)),
            ratio(ratios.last()),
            self.within,
            self.doubted,
            self.refused.len(),
            self.passed
        )
    }
}

/// What comes of a recording without an impairment, and with it.
type Compared = (Impairment, Outcome, Outcome);

/// Recordings of a device with each impairment, beside the one without.
fn spoilt(of: Of, seed: u64) -> Vec<Compared> {
    let recorded = of.recorded(&[], seed);
    let clean = Outcome::of(&recorded.0, &recorded.1);
    assert!(clean.passes(), "{} {seed}: {}", of.name(), clean.refused);
    let wanted = std::env::var("KALMEMS_IMPAIRMENT").unwrap_or_default();
    let impairments = IMPAIRMENTS
        .into_iter()
        .filter(|impairment| impairment.applies(of) && impairment.words().contains(&wanted));
    let compared = impairments.map(|impairment| match (impairment, Driven::of(of)) {
        // Another drive is another simulation.
        (DriveSteps(by), Some(driven)) => {
            let [steady, steps] =
                [Motion::Steady, Motion::Step(by)].map(|motion| driven.outcome(motion, seed));
            (impairment, steady, steps)
        }
        _ => (impairment, clean.clone(), impairment.outcome(of, &recorded)),
    });
    compared.collect()
}

/// Every device and impairment, twenty seeds each or as many as `KALMEMS_SEEDS` says, of all devices or of those whose name has
/// `KALMEMS_DEVICE` in it, and of all impairments or of those with `KALMEMS_IMPAIRMENT` in their words. An answer that passes is as good as without the impairment.
#[test]
#[ignore = "slow: ten minutes on two processors in a release build"]
fn slow_impairments_of_every_device() {
    let count = std::env::var("KALMEMS_SEEDS").ok().and_then(|count| count.parse::<u64>().ok());
    let seeds = 601..=600 + count.unwrap_or(20);
    let device = std::env::var("KALMEMS_DEVICE").unwrap_or_default();
    let wanted: Vec<(Of, u64)> = DEVICES
        .iter()
        .filter(|of| of.name().contains(&device))
        .flat_map(|of| seeds.clone().map(|seed| (*of, seed)))
        .collect();
    let mut cells: Vec<(Of, Impairment, Cell)> = Vec::new();
    let outcomes = side_by_side(&wanted, |(of, seed)| spoilt(*of, *seed));
    for ((of, _), outcomes) in wanted.iter().zip(&outcomes) {
        for (impairment, clean, outcome) in outcomes {
            let place = cells.iter().position(|(device, other, _)| device == of && other == impairment);
            let place = place.unwrap_or_else(|| {
                cells.push((*of, *impairment, Cell::default()));
                cells.len() - 1
            });
            cells[place].2.add(*impairment, clean, outcome);
        }
    }
    println!("| device | signal | error, median | largest | within | doubted | refused | passed |");
    println!("|---|---|---|---|---|---|---|---|");
    for (of, impairment, cell) in &cells {
        println!("{}", cell.row(*of, *impairment));
        if let Some(why) = cell.refused.first() {
            println!("    {why}");
        }
    }
    let passed: Vec<String> =
        cells.iter().filter(|(.., cell)| cell.passed > 0).map(|(of, i, cell)| cell.row(*of, *i)).collect();
    assert!(passed.is_empty(), "{passed:#?}");
}

/// A clipped signal would be taken for the motion, and so would the drive in its place: neither is estimated with any device.
#[test]
fn a_signal_that_is_clipped_or_another_channel_is_refused_by_name() {
    for of in DEVICES.iter().filter(|of| matches!(of, Of::Published(_))) {
        let (experiment, simulated) = of.recorded(&[], 640);
        // Eight samples in a row at the rail tell clipping; noise at 0.9 of the peak leaves fewer with some devices.
        let clipped = Clipped(0.5).outcome(*of, &(experiment.clone(), simulated.clone()));
        assert!(clipped.refused.contains("is clipped in "), "{}: {}", of.name(), clipped.refused);
        let mut twice = simulated.clone();
        let mut first = Vec::new();
        let signal = &signals(&experiment)[0];
        assert!(twice.change_recorded(signal, |values, _| first = values.to_vec()));
        let others = ["drive", "feedback", "signal_1B"];
        let other = others.into_iter().find(|other| {
            experiment.recordings[0].channels.column(other).is_some()
                && twice.change_recorded(other, |values, _| {
                    values.iter_mut().zip(&first).for_each(|(to, from)| *to = -from);
                })
        });
        // The piston mirror has one channel.
        let Some(other) = other else {
            assert_eq!(of.name(), "piston mirror");
            continue;
        };
        let rig = published().rig(&experiment).unwrap();
        let recording = twice.recorded(&rig.layout(&experiment, 0).unwrap()).unwrap();
        let why = rig.estimate(&experiment, 0, &recording, &Silent).unwrap_err();
        let EstimateError::Repeated { found, .. } = &why else { panic!("{} {other}: {why}", of.name()) };
        assert!(found.contains("with the other sign in every row"), "{found}");
    }
}
