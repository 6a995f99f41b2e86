//! Motions that are not steady: a motion that starts, one whose drive is switched off, and drives whose amplitude or frequency changes.

use crate::devices::{Device, Setting};
use crate::outliers::signals::{Of, Outcome};
use crate::side_by_side::side_by_side;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

/// What a drive does while a recording goes on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// It stays as it is.
    Steady,
    /// It is switched off in the middle of the recording.
    RingDown,
    /// Its amplitude changes by this part, evenly over the recording.
    Amplitude(f64),
    /// Its frequency changes by this part, evenly over the recording.
    Frequency(f64),
    /// Its frequency steps by this part in the middle of the recording.
    Step(f64),
}

use Motion::{Amplitude, Frequency, RingDown, Steady, Step};

/// How long a switch takes, in s.
const SWITCH_S: f64 = 2e-6;

/// Voltages that are sines about an offset: amplitude in V, frequency in Hz and phase in rad at 0 s of each.
struct Sines {
    offset: f64,
    tones: Vec<[f64; 3]>,
}

impl Motion {
    /// The voltage at a time, of a recording that lasts so long, in s.
    fn volts(self, sines: &Sines, time_s: f64, lasts_s: f64) -> f64 {
        let (part, late_s) = (time_s / lasts_s, time_s - 0.5 * lasts_s);
        // The time at which a steady drive would be as far as this one.
        let turned_s = match self {
            Frequency(by) => time_s * (1.0 + 0.5 * by * part),
            Step(by) => time_s + by * late_s.max(0.0),
            _ => time_s,
        };
        let scale = match self {
            RingDown => 1.0 / (1.0 + (late_s / SWITCH_S).min(700.0).exp()),
            Amplitude(by) => 1.0 + by * part,
            _ => 1.0,
        };
        let tones = sines.tones.iter().map(|[volts, hz, phase]| volts * (TAU * hz * turned_s + phase).sin());
        scale * (sines.offset + tones.sum::<f64>())
    }
}

/// A device under such a drive.
pub struct Driven {
    of: Of,
    sines: Sines,
    /// How often the file of the drive has its voltage.
    rate_hz: f64,
    lasts_s: f64,
    settings: Vec<Setting<'static>>,
}

impl Driven {
    /// A device of the matrix of impairments that is simulated under any drive.
    pub fn of(of: Of) -> Option<Self> {
        match of.name() {
            "shared scanner" => Some(Self::scanner()),
            "threshold scanner" => Some(Self::threshold()),
            "comb resonator (equations)" => Some(Self {
                of,
                sines: Sines { offset: 10.0, tones: vec![[2.0, 10.02e3, 0.0]] },
                rate_hz: 4e6,
                lasts_s: 40e-3,
                settings: Vec::new(),
            }),
            _ => None,
        }
    }

    /// The scanner on its way.
    fn scanner() -> Self {
        Self {
            of: Of::Published("shared scanner"),
            sines: Sines { offset: 90.0, tones: vec![[90.0, 31.35e3, 0.0]] },
            rate_hz: 10e6,
            lasts_s: 24e-3,
            settings: vec![("simulate.duration", "\"24 ms\"".to_owned())],
        }
    }

    fn two_axes() -> Self {
        Self {
            of: Of::Published("two axes"),
            sines: Sines { offset: 90.0, tones: vec![[90.0, 31.35e3, 0.0], [70.0, 13.08e3, 0.0]] },
            rate_hz: 10e6,
            lasts_s: 24e-3,
            settings: vec![("simulate.duration", "\"24 ms\"".to_owned())],
        }
    }

    /// From where a sweep has caught its motion.
    fn threshold() -> Self {
        const HZ: f64 = 1266.0;
        const INTERVAL_S: f64 = 2e-6;
        let caught = [("simulate.duration", "\"40 ms\"".to_owned()), ("simulate.noise", "false".to_owned())];
        let (_, simulated) = Device::named("threshold scanner").recorded_without(
            &caught,
            &["simulate.drive.capture.cut_off", "simulate.adc"],
            1,
        );
        let column = |columns: Vec<(&'static str, Vec<f64>)>, name: &str| {
            columns.into_iter().find(|(own, _)| *own == name).unwrap().1
        };
        let last = |name| *column(simulated.true_columns(), name).last().unwrap();
        let volts = column(simulated.recorded_columns(), "drive_V");
        let [before, after] = [2, 1].map(|k| volts[volts.len() - k] / 30.0 - 1.0);
        let (s, c) = (TAU * HZ * INTERVAL_S).sin_cos();
        let phase = before.atan2((after - before * c) / s) + TAU * HZ * INTERVAL_S;
        let (angle, rate) = (last("angle_rad"), last("rate_rad_per_s"));
        let start = format!("{{ angle = \"{angle:e} rad\", rate = \"{rate:e} rad/s\" }}");
        Self {
            of: Of::Published("threshold scanner"),
            sines: Sines { offset: 30.0, tones: vec![[30.0, HZ, phase]] },
            rate_hz: INTERVAL_S.recip(),
            lasts_s: 80e-3,
            settings: vec![
                ("simulate.duration", "\"80 ms\"".to_owned()),
                ("simulate.start", start),
                ("estimate.filter.0.start", "\"from_signal\"".to_owned()),
            ],
        }
    }

    /// What comes of a recording.
    pub fn outcome(&self, motion: Motion, seed: u64) -> Outcome {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("drive.csv");
        self.write(motion, &file);
        let drive = format!(
            "{{ recorded = {{ file = \"{}\", clock = {{ column = \"time_s\" }}, column = \"drive_V\" }} }}",
            file.display()
        );
        let settings = [self.settings.clone(), vec![("simulate.drive", drive)]].concat();
        let (experiment, simulated) = self.of.recorded(&settings, seed);
        Outcome::of(&experiment, &simulated)
    }

    fn write(&self, motion: Motion, file: &Path) {
        let mut text = "time_s,drive_V\n".to_owned();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a number of rows
        let rows = (self.lasts_s * self.rate_hz).ceil() as usize + 2;
        for row in 0..rows {
            let time_s = row as f64 / self.rate_hz;
            writeln!(text, "{time_s:e},{:e}", motion.volts(&self.sines, time_s, self.lasts_s)).unwrap();
        }
        std::fs::write(file, text).unwrap();
    }
}

/// What drives do, beside staying as they are.
const CHANGES: [Motion; 6] =
    [RingDown, Amplitude(-0.1), Amplitude(0.1), Frequency(-0.002), Frequency(0.002), Step(1e-3)];

impl Motion {
    fn words(self) -> String {
        match self {
            Steady => "steady".to_owned(),
            RingDown => "switched off in the middle".to_owned(),
            Amplitude(by) => format!("amplitude {:+} % over the recording", 100.0 * by),
            Frequency(by) => format!("frequency {:+} % over the recording", 100.0 * by),
            Step(by) => format!("frequency {:+} % at once", 100.0 * by),
        }
    }
}

/// Devices whose drive may be any.
fn driven() -> [Driven; 4] {
    let equations = Of::Equations("comb_resonator/simulation.toml");
    [Driven::scanner(), Driven::two_axes(), Driven::threshold(), Driven::of(equations).unwrap()]
}

/// A motion that begins at rest, by the experiment's settings, and the device.
fn start_ups() -> [(&'static str, Vec<Setting<'static>>); 3] {
    let set = |settings: &[(&'static str, &str)]| -> Vec<Setting<'static>> {
        settings.iter().map(|(key, value)| (*key, (*value).to_owned())).collect()
    };
    let scanner = set(&[
        ("simulate.start", "{ angle = \"1e-4 rad\", rate = \"0 rad/s\" }"),
        ("simulate.duration", "\"60 ms\""),
        ("estimate.skip", "\"30 ms\""),
    ]);
    let two_axes = set(&[
        (
            "simulate.start",
            "{ angle_x = \"-1e-3 rad\", rate_x = \"0 rad/s\", angle_y = \"1e-3 rad\", rate_y = \"0 rad/s\" }",
        ),
        ("simulate.duration", "\"120 ms\""),
        ("estimate.skip", "\"80 ms\""),
        (
            "estimate.filter.0.start",
            "{ angle_x = \"-1e-3 rad\", rate_x = \"0 rad/s\", angle_y = \"1e-3 rad\", rate_y = \"0 rad/s\" }",
        ),
        (
            "estimate.filter.0.start_sd",
            "{ angle_x = \"2e-4 rad\", rate_x = \"10 rad/s\", angle_y = \"2e-4 rad\", rate_y = \"5 rad/s\" }",
        ),
    ]);
    // A motion that a sweep catches.
    let threshold = set(&[
        ("simulate.start", "{ angle = \"1e-3 rad\", rate = \"0 rad/s\" }"),
        ("simulate.duration", "\"600 ms\""),
        (
            "simulate.drive",
            "{ sweep = { offset = \"30 V\", amplitude = \"30 V\", from = \"1400 Hz\", to = \"1266 Hz\" } }",
        ),
        ("estimate.skip", "\"5 ms\""),
        ("estimate.filter.0.start", "{ angle = \"0 rad\", rate = \"0 rad/s\" }"),
        ("estimate.filter.0.start_sd", "{ angle = \"5 mrad\", rate = \"20 rad/s\" }"),
    ]);
    [("shared scanner", scanner), ("two axes", two_axes), ("threshold scanner", threshold)]
}

/// How the error compares with that of the steady motion, whether it is within the claim, and how it is judged.
struct MotionCell {
    ratio: f64,
    within: Option<f64>,
    passes: bool,
    what: String,
}

impl MotionCell {
    fn of(outcome: &Outcome, steady: &Outcome, what: &str) -> Self {
        let first = outcome.first();
        let within = first.and_then(|first| first.errors.as_ref()?.angle.within_three_sigma);
        let ratio = outcome.error() / steady.error();
        let grade = first.and_then(|first| first.grade);
        let events = first.map(|first| first.lock.events.clone()).unwrap_or_default();
        let verdict = first.map(|first| first.verdict);
        let what =
            format!("{what}: {ratio:.2}, {within:?}, {grade:?}, {verdict:?}, {events:?} {}", outcome.refused);
        Self { ratio, within, passes: outcome.passes() && events.is_empty(), what }
    }

    /// In lock, with an error like that of the steady motion, or as large as claimed.
    fn is_right(&self) -> bool {
        self.passes && (self.ratio <= 1.3 || self.within.is_some_and(|within| within >= 0.99))
    }
}

/// All changes of all drives and all start-ups, of one seed.
fn cells(seed: u64) -> Vec<(String, String, MotionCell)> {
    let mut cells = Vec::new();
    for driven in driven() {
        let (name, steady) = (driven.of.name(), driven.outcome(Steady, seed));
        for motion in CHANGES {
            let what = format!("{name}, {}", motion.words());
            let cell = MotionCell::of(&driven.outcome(motion, seed), &steady, &what);
            cells.push((name.to_owned(), motion.words(), cell));
        }
        let start_up = start_ups().into_iter().find(|(own, _)| *own == name);
        if let Some((name, settings)) = start_up {
            let (experiment, simulated) = Device::named(name).recorded(&settings, &settings, seed);
            let outcome = Outcome::of(&experiment, &simulated);
            let what = format!("{name}, from rest");
            cells.push((name.to_owned(), "from rest".to_owned(), MotionCell::of(&outcome, &steady, &what)));
        }
    }
    cells
}

/// A motion that starts, rings down or follows a drive that changes is estimated in lock, and as well as a steady one.
#[test]
fn motions_that_change_are_followed() {
    for (.., cell) in cells(1) {
        println!("{}", cell.what);
        assert!(cell.is_right(), "{}", cell.what);
    }
}

/// Twenty seeds a cell, or as many as `KALMEMS_SEEDS` says.
#[test]
#[ignore = "slow: some minutes on two processors"]
fn slow_motions_of_every_device() {
    let count = std::env::var("KALMEMS_SEEDS").ok().and_then(|count| count.parse::<u64>().ok());
    let seeds: Vec<u64> = (651..=650 + count.unwrap_or(20)).collect();
    let found = side_by_side(&seeds, |seed| cells(*seed));
    println!("| device | drive | error, median | largest | right | wrong and passed |");
    println!("|---|---|---|---|---|---|");
    let mut passed = Vec::new();
    for place in 0..found[0].len() {
        let own: Vec<_> = found.iter().map(|cells| &cells[place]).collect();
        let mut ratios: Vec<f64> = own.iter().map(|(.., cell)| cell.ratio).collect();
        ratios.sort_by(f64::total_cmp);
        let right = own.iter().filter(|(.., cell)| cell.is_right()).count();
        let wrong = own.iter().filter(|(.., cell)| cell.passes && !cell.is_right());
        let wrong: Vec<&str> = wrong.map(|(.., cell)| cell.what.as_str()).collect();
        println!(
            "| {} | {} | {:.2} | {:.2} | {right} of {} | {} |",
            own[0].0,
            own[0].1,
            ratios[ratios.len() / 2],
            ratios.last().unwrap(),
            own.len(),
            wrong.len()
        );
        for (.., cell) in own.iter().filter(|(.., cell)| !cell.is_right()) {
            println!("    {}", cell.what);
        }
        passed.extend(wrong.into_iter().map(ToOwned::to_owned));
    }
    assert!(passed.is_empty(), "{passed:#?}");
}

/// The stage is modelled under a steady sine: a drive that ends is refused with the time, in the samples from which its sine is found and behind them.
#[test]
fn a_drive_of_the_micro_stage_that_ends_is_refused_with_the_time() {
    let of = Of::Published("micro-stage");
    for duration in ["12 ms", "40 ms"] {
        let settings = [("simulate.duration", format!("\"{duration}\""))];
        let (experiment, mut simulated) = of.recorded(&settings, 652);
        let mut ends_s = f64::NAN;
        assert!(simulated.change_recorded("drive", |volts, times| {
            let half = volts.len() / 2;
            ends_s = times[half];
            volts[half..].fill(0.0);
        }));
        let refused = Outcome::of(&experiment, &simulated).refused;
        let words = "the drive `drive_V` is not a steady sine behind ";
        let told_s = refused.split(words).nth(1).and_then(|rest| rest.split(' ').next()?.parse::<f64>().ok());
        println!("{refused}");
        assert!(told_s.is_some_and(|told_s| (told_s - ends_s).abs() < 1e-4), "{ends_s}: {refused}");
    }
}
