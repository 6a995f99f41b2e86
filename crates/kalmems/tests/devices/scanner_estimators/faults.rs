//! A device whose samples arrive over a connection with faults: each is told, and the estimate is right again soon.

use super::example;
use kalmems::config::Experiment;
use kalmems::rigs::published;
use kalmems::stream::{Connection, END_MARK, StreamOutputs, StreamSummary, stream};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;
use std::collections::{BTreeMap, VecDeque};
use std::io::{self, ErrorKind, Read, Write};
use std::sync::{Arc, Mutex};

/// The example's recording repeats after 20 ms: 627 cycles of the drive, and 313.5 of the motion, whose sign the signal does not
/// show. Its reference is the truth, with the other sign in each second period.
pub const PERIOD: u64 = 20_000;

/// Samples in 100 cycles of the motion.
pub const SETTLED: u64 = 6380;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    /// The connection is reset in the middle of a line; it is there again when so many samples are gone.
    Reset(u64),
    /// So many samples never come.
    Drop(u64),
    /// The clock jumps by so many samples, on or back, while the device goes on.
    Jump(i64),
    /// The signal is noise for so many samples.
    Noise(u64),
    /// So many lines are damaged.
    Damage(u64),
    /// The time of one sample is another one.
    Absurd(&'static str),
    /// The last so many samples come again.
    Again(u64),
}

const KINDS: [[Kind; 2]; 8] = [
    // Within 100 cycles the estimate goes on; behind a longer gap it begins anew.
    [Kind::Reset(3000), Kind::Reset(25_000)],
    [Kind::Drop(500), Kind::Drop(9000)],
    [Kind::Jump(50_000), Kind::Jump(86_400_000_000)],
    [Kind::Jump(-30_000), Kind::Jump(-400)],
    [Kind::Noise(7000), Kind::Noise(7000)],
    [Kind::Damage(3), Kind::Damage(1)],
    [Kind::Absurd("1e300"), Kind::Absurd("9e9")],
    [Kind::Again(200), Kind::Again(3000)],
];

/// The longest gap in samples that is predicted over: 100 cycles.
const LONGEST: u64 = 6424;

/// What the device sends: a period of drives and signals, as text.
struct Script {
    rows: Vec<String>,
    /// The sample that comes next, how many were sent, and how many are to be.
    next: u64,
    sent: u64,
    wanted: u64,
    /// How far the clock is off, in samples.
    off: i64,
    /// Samples from fault to fault, and how many faults there were.
    every: u64,
    faults: u64,
    most: u64,
    noise_until: u64,
    damage: u64,
    absurd: Option<&'static str>,
    chance: Pcg64,
    /// What waits to be read, and whether the connection breaks then.
    bytes: VecDeque<u8>,
    broken: bool,
    /// Whether the end was sent.
    ended: bool,
    lines: VecDeque<String>,
    log: Arc<Mutex<Log>>,
    expected: BTreeMap<&'static str, u64>,
}

/// What the judge needs to know: samples by their number in runs of one offset of the clock, and where faults ended.
#[derive(Default)]
struct Log {
    /// The first sample of each run, and its offset.
    runs: VecDeque<(u64, i64)>,
    /// From which sample on the estimate must be right, until when, and which fault was before.
    right: VecDeque<(u64, u64, Kind)>,
}

impl Script {
    fn new(wanted: u64, faults: u64, log: Arc<Mutex<Log>>) -> Self {
        let text = std::fs::read_to_string(example("recording.csv")).unwrap();
        let rows = text.lines().skip(1).take(usize::try_from(PERIOD).unwrap());
        log.lock().unwrap().runs.push_back((0, 0));
        Self {
            rows: rows.map(|line| line.split_once(',').unwrap().1.to_owned()).collect(),
            next: 0,
            sent: 0,
            wanted,
            off: 0,
            every: wanted / (faults + 2),
            faults: 0,
            most: faults,
            noise_until: 0,
            damage: 0,
            absurd: None,
            chance: Pcg64::new(11, 12),
            bytes: VecDeque::new(),
            broken: false,
            ended: false,
            lines: VecDeque::new(),
            log,
            expected: BTreeMap::new(),
        }
    }

    fn expect(&mut self, what: &'static str, count: u64) {
        *self.expected.entry(what).or_default() += count;
    }

    fn send(&mut self, line: String) {
        self.bytes.extend(line.as_bytes());
        self.bytes.push_back(b'\n');
        self.lines.push_back(line);
        if self.lines.len() > 3000 {
            self.lines.pop_front();
        }
    }

    /// Sends the next sample, or lets something go wrong.
    fn step(&mut self) {
        if self.faults < self.most && self.sent >= self.every * (self.faults + 2) {
            let (round, place) = (self.faults / 8, usize::try_from(self.faults % 8).unwrap());
            let kind = KINDS[place][usize::try_from(round % 2).unwrap()];
            self.faults += 1;
            self.go_wrong(kind);
            return;
        }
        let micro = u64::try_from(i64::try_from(self.next).unwrap() + self.off).unwrap();
        let row = &self.rows[usize::try_from(self.next % PERIOD).unwrap()];
        let drive = row.split_once(',').unwrap().0;
        let time = format!("{}.{:06}", micro / 1_000_000, micro % 1_000_000);
        let line = if let Some(time) = self.absurd.take() {
            format!("{time},{row}")
        } else if self.damage > 0 {
            self.damage -= 1;
            [format!("{time},{drive}"), format!("{time},{drive},1.?8"), format!("{time},,{row}")]
                [usize::try_from(self.damage % 3).unwrap()]
            .clone()
        } else if self.next < self.noise_until {
            let mut uniform = || (self.chance.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
            let normal = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
            format!("{time},{drive},{:.5}", 1.6 + 0.014 * normal)
        } else {
            format!("{time},{row}")
        };
        self.send(line);
        self.next += 1;
        self.sent += 1;
    }

    fn go_wrong(&mut self, kind: Kind) {
        match kind {
            Kind::Reset(gone) => {
                // Half a line.
                let row = &self.rows[usize::try_from(self.next % PERIOD).unwrap()];
                let half = format!("0.0{}", &row[..5]);
                self.bytes.extend(half.as_bytes());
                self.broken = true;
                self.next += gone;
                for what in ["breaks", "reconnections", "cut_off", "disconnected", "reconnected"] {
                    self.expect(what, 1);
                }
                self.gone(gone);
            }
            Kind::Drop(gone) => {
                self.next += gone;
                self.gone(gone);
            }
            Kind::Jump(by) => {
                self.off += by;
                self.log.lock().unwrap().runs.push_back((self.next, self.off));
                if by > 0 {
                    self.gone(by.unsigned_abs());
                } else {
                    self.expect("steps_back", 1);
                    self.expect("clock_back", 1);
                    self.expect("new_stretch", 1);
                }
            }
            Kind::Noise(count) => {
                self.noise_until = self.next + count;
                self.expect("noise_only", 1);
                self.expect("noise_only_over", 1);
            }
            Kind::Damage(count) => {
                self.damage = count;
                self.expect("damaged_lines", count);
                self.expect("dropped", count);
            }
            Kind::Absurd(time) => {
                self.absurd = Some(time);
                self.expect("misplaced", 1);
                self.expect("dropped", 1);
            }
            Kind::Again(count) => {
                let from = self.lines.len() - usize::try_from(count).unwrap().min(self.lines.len());
                let again: Vec<String> = self.lines.iter().skip(from).cloned().collect();
                self.expect("duplicated", again.len() as u64);
                for line in again {
                    self.bytes.extend(line.as_bytes());
                    self.bytes.push_back(b'\n');
                }
            }
        }
        let ends = self.next.max(self.noise_until);
        let until = self.next + self.every;
        self.log.lock().unwrap().right.push_back((ends + SETTLED, until, kind));
    }

    /// So many samples never come, as far as the times tell.
    fn gone(&mut self, count: u64) {
        self.expect("dropped", count);
        self.expect("new_stretch", u64::from(count >= LONGEST));
    }
}

/// The connection to the device.
struct Wire(Arc<Mutex<Script>>);

impl Connection for Wire {
    fn open(&mut self) -> io::Result<Option<Box<dyn Read + Send>>> {
        Ok(Some(Box::new(Self(self.0.clone()))))
    }

    fn reopens(&self) -> bool {
        true
    }
}

impl Read for Wire {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut script = self.0.lock().unwrap();
        while script.bytes.len() < buffer.len() && script.sent < script.wanted && !script.broken {
            script.step();
        }
        if script.sent == script.wanted && !std::mem::replace(&mut script.ended, true) {
            script.bytes.extend(END_MARK);
        }
        if script.bytes.is_empty() && std::mem::take(&mut script.broken) {
            return Err(ErrorKind::ConnectionReset.into());
        }
        script.bytes.read(buffer)
    }
}

/// Judges the estimates as they are written, and counts the events.
#[derive(Default)]
struct Judged {
    rest: Vec<u8>,
    events: BTreeMap<String, u64>,
    /// Estimates that were judged behind each fault, and those within three standard deviations of the truth of one sign, and
    /// of the other.
    counts: [u64; 3],
    behind: Vec<(Kind, [u64; 3])>,
    /// Sample of the last estimate.
    last: u64,
    memory: Vec<(u64, u64)>,
    lines: u64,
}

struct Judge {
    judged: Arc<Mutex<Judged>>,
    log: Arc<Mutex<Log>>,
    truth: Arc<Vec<f64>>,
}

impl Judge {
    fn line(&self, judged: &mut Judged, line: &str) {
        let (key, rest) = line.split_once(',').unwrap();
        if key == "event" {
            let event: serde_json::Value = serde_json::from_str(rest).unwrap();
            *judged.events.entry(event["event"].as_str().unwrap().to_owned()).or_default() += 1;
            return;
        }
        if key != "ekf" {
            return;
        }
        judged.lines += 1;
        if judged.lines.is_multiple_of(100_000) {
            judged.memory.push((judged.lines, resident_kib()));
        }
        let mut cells = rest.split(',').map(|cell| cell.parse::<f64>().unwrap_or(f64::NAN));
        let [time_s, angle, sd] = std::array::from_fn(|_| cells.next().unwrap());
        let mut log = self.log.lock().unwrap();
        #[allow(clippy::cast_possible_truncation)] // microseconds
        let micro = (time_s * 1e6).round() as i64;
        // The run that the time belongs to: samples go on, and end where the next run begins.
        let sample = loop {
            let (first, off) = log.runs[0];
            let sample = u64::try_from(micro - off).unwrap_or(0);
            let ends = log.runs.get(1).map_or(u64::MAX, |(first, _)| *first);
            if sample >= first && sample >= judged.last && sample < ends {
                break sample;
            }
            assert!(log.runs.len() > 1, "an estimate of no sample: {line}");
            log.runs.pop_front();
        };
        judged.last = sample;
        while let Some((_, until, kind)) = log.right.front().copied()
            && sample >= until
        {
            log.right.pop_front();
            let counts = std::mem::take(&mut judged.counts);
            judged.behind.push((kind, counts));
        }
        if log.right.front().is_none_or(|(from, ..)| sample < *from) {
            return;
        }
        let sign = if (sample / PERIOD).is_multiple_of(2) { 1.0 } else { -1.0 };
        let truth = sign * self.truth[usize::try_from(sample % PERIOD).unwrap()];
        let counts = &mut judged.counts;
        counts[0] += 1;
        counts[1] += u64::from((angle - truth).abs() <= 3.0 * sd && sd < 5e-3);
        counts[2] += u64::from((angle + truth).abs() <= 3.0 * sd && sd < 5e-3);
    }
}

impl Write for Judge {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut judged = self.judged.lock().unwrap();
        let mut rest = std::mem::take(&mut judged.rest);
        rest.extend_from_slice(bytes);
        let mut from = 0;
        while let Some(end) = rest[from..].iter().position(|byte| *byte == b'\n') {
            let line = std::str::from_utf8(&rest[from..from + end]).unwrap();
            if !line.starts_with('#') {
                self.line(&mut judged, line);
            }
            from += end + 1;
        }
        rest.drain(..from);
        judged.rest = rest;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The memory of this process, in KiB; 0 where the system does not tell.
fn resident_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmRSS:"));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0)
}

/// The example with these changes, whose filter follows the motion closely and without drifts.
pub fn experiment(changes: &[(&str, &str)]) -> Experiment {
    let path = example("stream.toml");
    let mut text = std::fs::read_to_string(&path).unwrap();
    for (from, to) in [
        ("1.1033e-4 N m", "1.10e-4 N m"),
        ("states = { stiffness = { start_sd = \"1 %\", drift = \"1e-7 1/s\" } }\n", ""),
        ("smooth_lag", "# smooth_lag"),
        ("angular_acceleration = \"1e4 rad^2/s^3\"", "angular_acceleration = \"1e8 rad^2/s^3\""),
    ]
    .iter()
    .chain(changes)
    {
        assert!(text.contains(from), "{from}");
        text = text.replacen(from, to, 1);
    }
    published().parse(&text, &path).unwrap_or_else(|e| panic!("{e}"))
}

/// The angle of the example's recording.
pub fn truth() -> Vec<f64> {
    let reference = std::fs::read_to_string(example("reference.csv")).unwrap();
    let angle = |line: &str| line.split(',').nth(1).unwrap().parse().unwrap();
    reference.lines().skip(1).map(angle).collect()
}

/// Streams so many samples with so many faults, and finds each told and the estimate right again after it.
fn with_faults(samples: u64, faults: u64) -> (StreamSummary, Judged) {
    let experiment = experiment(&[("phase = true", "reconnect = \"10 s\"\nphase = true")]);
    let log = Arc::new(Mutex::new(Log::default()));
    let script = Arc::new(Mutex::new(Script::new(samples, faults, log.clone())));
    let truth = Arc::new(truth());
    let judged = Arc::new(Mutex::new(Judged::default()));
    let judge = Judge { judged: judged.clone(), log: log.clone(), truth };
    let outputs = StreamOutputs { lines: Some(Box::new(judge)), ..StreamOutputs::default() };
    let summary = stream(published(), &experiment, Box::new(Wire(script.clone())), outputs, None, &|| false);
    let summary = summary.unwrap_or_else(|e| panic!("{e}"));
    let script = script.lock().unwrap();
    let mut judged = std::mem::take(&mut *judged.lock().unwrap());
    // The stream ends before the last one would be followed by another.
    if let Some((_, _, last)) = log.lock().unwrap().right.front() {
        judged.behind.push((*last, judged.counts));
    }
    assert_eq!((script.sent, script.faults), (samples, faults));

    // Every fault is told.
    let received = serde_json::to_value(summary.received).unwrap();
    for (what, count) in &script.expected {
        let told = received.get(what).and_then(serde_json::Value::as_u64);
        let told = told.unwrap_or_else(|| judged.events.get(*what).copied().unwrap_or(0));
        println!("{what}: {count} expected, {told} told");
    }
    for (what, count) in &script.expected {
        let told = received.get(what).and_then(serde_json::Value::as_u64);
        let told = told.unwrap_or_else(|| judged.events.get(*what).copied().unwrap_or(0));
        assert_eq!(told, *count, "{what}");
    }
    // What was sent once and not damaged is estimated.
    let lost = script.expected["damaged_lines"] + script.expected["misplaced"];
    assert_eq!(summary.estimated + summary.not_estimated + lost, samples);
    assert_eq!(summary.not_estimated, 0);
    assert!(summary.broken.is_none() && !summary.interrupted);

    // And the estimate is right again within 100 cycles.
    assert_eq!(judged.behind.len() as u64, faults);
    for (place, (kind, [count, one, other])) in judged.behind.iter().enumerate() {
        assert!(*count > 100, "{kind:?} {place}: {count}");
        let share = *one.max(other) as f64 / *count as f64;
        assert!(
            share >= 0.98,
            "behind {kind:?}, fault {place}: {share} of {count} within three standard deviations"
        );
    }
    (summary, judged)
}

#[test]
fn every_fault_of_a_stream_is_told_and_its_estimate_right_within_100_cycles() {
    with_faults(1_200_000, 80);
}

/// 10⁸ samples with 1000 faults, or as many as `KALMEMS_STREAM_SAMPLES` says. Run it by itself, as the memory is that of the whole process.
#[test]
#[ignore = "slow"]
fn slow_a_long_stream_with_1000_faults_takes_constant_memory() {
    let samples = std::env::var("KALMEMS_STREAM_SAMPLES").map_or(100_000_000, |count| count.parse().unwrap());
    let (_, judged) = with_faults(samples, 1000);
    let memory: Vec<u64> = judged.memory.iter().map(|(_, kib)| *kib).collect();
    let tenth = memory.len() / 10;
    let most = |of: &[u64]| of.iter().copied().max().unwrap();
    let (early, late) = (most(&memory[..tenth]), most(&memory[memory.len() - tenth..]));
    println!("{early} KiB in the first tenth, {late} KiB in the last one");
    assert!(late < early + 8192, "{early} KiB, then {late} KiB");
}
