//! Faults of samples that arrive, at the beginning, while a filter settles, behind that, behind a stop, and two soon after another: good samples
//! are estimated again soon, and each fault is told.

use super::example;
use super::faults::{PERIOD, SETTLED, experiment, truth};
use kalmems::recording::{Finding, FindingKind};
use kalmems::rigs::published;
use kalmems::stream::{Connection, END_MARK, StreamOutputs, StreamSummary, stream};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;
use std::collections::VecDeque;
use std::io::{self, ErrorKind, Read, Write};
use std::sync::{Arc, Mutex};

/// What is wrong with some samples, or with the way that they come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// The drive is off, with one sample missing within.
    DriveOff,
    /// A signal that no converter gives, in V.
    Spike(i32),
    /// A drive that no amplifier gives, the power of ten of it in V.
    Drive(i32),
    /// A time that is another one.
    Time,
    /// Samples that never come: over few of them the motion is predicted, behind many the estimate begins anew.
    Gap,
    LongGap,
    /// No signal.
    Silence,
    /// A signal that is noise.
    Noise,
    /// Lines or frames of which a part is another one.
    Damage,
    /// The last samples come again.
    Again,
    /// The connection is reset in the middle of a sample, and is there again later.
    Reset,
    /// The clock jumps while the device goes on.
    Ahead,
    Back,
}

const ALL: [Fault; 13] = [
    Fault::DriveOff,
    Fault::Spike(1000),
    Fault::Drive(100),
    Fault::Time,
    Fault::Gap,
    Fault::LongGap,
    Fault::Silence,
    Fault::Noise,
    Fault::Damage,
    Fault::Again,
    Fault::Reset,
    Fault::Ahead,
    Fault::Back,
];

/// Samples that come again.
const REPEATED: usize = 200;

/// The clock's and the counter's number of the first sample; the counter begins anew on the way.
const FIRST: i64 = 40_000;
const FIRST_NUMBER: usize = 60_000;

impl Fault {
    /// How many samples are wrong.
    const fn length(self) -> usize {
        match self {
            Self::DriveOff => 3000,
            Self::Spike(_) | Self::Drive(_) | Self::Time => 1,
            Self::Gap | Self::Silence | Self::Reset => 500,
            Self::LongGap => 9000,
            Self::Noise => 7000,
            Self::Damage => 3,
            Self::Again | Self::Ahead | Self::Back => 0,
        }
    }

    /// By how many samples the clock is another one behind it.
    const fn jump(self) -> i64 {
        match self {
            Self::Ahead => 50_000,
            Self::Back => -30_000,
            _ => 0,
        }
    }

    /// Whether its samples never come.
    const fn is_gap(self) -> bool {
        matches!(self, Self::Gap | Self::LongGap | Self::Reset)
    }

    /// Makes the sample wrong that is so many behind the first wrong one.
    fn apply(self, place: usize, sample: &mut [f64; 3], chance: &mut Pcg64) {
        match self {
            Self::DriveOff => {
                sample[1] = 0.0;
                if place == 1500 {
                    (sample[1], sample[2]) = (f64::NAN, f64::NAN);
                }
            }
            Self::Spike(volts) => sample[2] = f64::from(volts),
            Self::Drive(decades) => sample[1] = 10_f64.powi(decades),
            Self::Time => sample[0] += 1e4,
            Self::Silence => sample[2] = f64::NAN,
            Self::Noise => {
                let mut uniform = || (chance.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
                sample[2] = 1.6 + 0.014 * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0);
            }
            _ => {}
        }
    }
}

/// How samples come.
#[derive(Clone, Copy, Debug)]
enum Form {
    Text,
    Frames,
    CountedFrames,
}

impl Form {
    fn table(self) -> String {
        let frames = |sequence: &str| {
            format!(
                "[stream.input.frames]\nsync = \"a55a\"\nfields = [{sequence}\"f64 time_s\", \"f64 drive_V\", \"f64 cap_V\"]"
            )
        };
        match self {
            Self::Text => TEXT.to_owned(),
            Self::Frames => frames(""),
            Self::CountedFrames => frames("\"u16 sequence\", "),
        }
    }

    fn bytes(self, number: usize, sample: [f64; 3]) -> Vec<u8> {
        if matches!(self, Self::Text) {
            let cells = sample.map(|x| if x.is_nan() { String::new() } else { format!("{x:e}") });
            return (cells.join(",") + "\n").into_bytes();
        }
        let mut bytes = vec![0xa5, 0x5a];
        if matches!(self, Self::CountedFrames) {
            bytes.extend_from_slice(&u16::try_from(number % 65_536).unwrap().to_le_bytes());
        }
        bytes.extend(sample.iter().flat_map(|x| x.to_le_bytes()));
        bytes
    }
}

const TEXT: &str = "[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"cap_V\"]";

/// What comes over a connection from one reset to the next.
struct Pieces(Arc<Mutex<VecDeque<Vec<u8>>>>);

impl Connection for Pieces {
    fn open(&mut self) -> io::Result<Option<Box<dyn Read + Send>>> {
        let piece = self.0.lock().unwrap().pop_front().ok_or(ErrorKind::ConnectionRefused)?;
        Ok(Some(Box::new(io::Cursor::new(piece).chain(Broken))))
    }

    fn reopens(&self) -> bool {
        true
    }
}

struct Broken;

impl Read for Broken {
    fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
        Err(ErrorKind::ConnectionReset.into())
    }
}

/// What is sent, and what of it a stream has to count.
#[derive(Default)]
struct Sent {
    pieces: VecDeque<Vec<u8>>,
    misplaced: u64,
    damaged: u64,
    repeated: u64,
    /// Samples that never come or are damaged, and those that are missing between the times of two that come.
    never: u64,
    dropped: u64,
    clock_back: u64,
    new_stretch: u64,
    empty_drive: u64,
    empty_signal: u64,
    /// Absurd signals, absurd drives and samples of noise that come.
    spikes: u64,
    drives: u64,
    noise: u64,
    /// The time of the last one that came, in samples.
    before: Option<i64>,
}

/// The longest gap in samples that is predicted over: 100 cycles.
const LONGEST: i64 = 6424;

impl Sent {
    /// Another good sample comes, with this time in samples.
    fn comes(&mut self, time: i64) {
        let Some(before) = self.before.replace(time) else {
            (self.never, self.dropped) = (0, 0);
            return;
        };
        let missing = time - before - 1;
        self.clock_back += u64::from(missing < 0);
        self.new_stretch += u64::from(!(0..LONGEST).contains(&missing));
        self.dropped += u64::try_from(missing).unwrap_or(0);
    }

    fn apply(&mut self, faults: &[(Fault, usize)], sample: &mut [f64; 3], chance: &mut Pcg64) {
        for (fault, place) in faults {
            fault.apply(*place, sample, chance);
            self.noise += u64::from(*fault == Fault::Noise);
        }
        self.spikes += u64::from(sample[2].abs() >= 100.0);
        self.drives += u64::from(sample[1].abs() >= 1e6);
        self.empty_drive += u64::from(sample[1].is_nan());
        self.empty_signal += u64::from(sample[2].is_nan());
    }
}

/// The example's samples again and again, with faults, each from a sample on.
fn sent(count: usize, faults: &[(Fault, usize)], form: Form) -> Sent {
    let text = std::fs::read_to_string(example("recording.csv")).unwrap();
    let rows: Vec<[f64; 2]> = (text.lines().skip(1).take(usize::try_from(PERIOD).unwrap()))
        .map(|line| {
            let mut cells = line.split(',').skip(1).map(|cell| cell.parse().unwrap());
            std::array::from_fn(|_| cells.next().unwrap())
        })
        .collect();
    let (mut sent, mut piece, mut last) = (Sent::default(), Vec::new(), VecDeque::new());
    let (mut clock, mut chance) = (FIRST, Pcg64::new(31, 32));
    for k in 0..count {
        let [drive, signal] = rows[k % rows.len()];
        let begin = || faults.iter().filter(|(_, from)| *from == k).map(|(fault, _)| *fault);
        clock += begin().map(Fault::jump).sum::<i64>();
        let time = clock + i64::try_from(k).unwrap();
        let mut sample = [time as f64 * 1e-6, drive, signal];
        for fault in begin() {
            match fault {
                Fault::Again => {
                    sent.repeated += last.len() as u64;
                    piece.extend(last.iter().flatten());
                }
                Fault::Ahead | Fault::Back => last.clear(),
                Fault::Reset => {
                    let whole = form.bytes(FIRST_NUMBER + k, sample);
                    piece.extend_from_slice(&whole[..whole.len() / 2]);
                    sent.pieces.push_back(std::mem::take(&mut piece));
                }
                _ => {}
            }
        }
        let within = |(fault, from): &(Fault, usize)| {
            (*from..from + fault.length()).contains(&k).then(|| (*fault, k - from))
        };
        let present: Vec<(Fault, usize)> = faults.iter().filter_map(within).collect();
        let is = |wanted: Fault| present.iter().any(|(fault, _)| *fault == wanted);
        if present.iter().any(|(fault, _)| fault.is_gap()) {
            sent.never += 1;
            continue;
        }
        if is(Fault::Damage) {
            let mut bytes = form.bytes(FIRST_NUMBER + k, sample);
            bytes[0] = b'?';
            piece.extend_from_slice(&bytes);
            (sent.damaged, sent.never) = (sent.damaged + 1, sent.never + 1);
            continue;
        }
        if is(Fault::Time) {
            Fault::Time.apply(0, &mut sample, &mut chance);
            piece.extend_from_slice(&form.bytes(FIRST_NUMBER + k, sample));
            sent.misplaced += 1;
            continue;
        }
        sent.comes(time);
        sent.apply(&present, &mut sample, &mut chance);
        let bytes = form.bytes(FIRST_NUMBER + k, sample);
        piece.extend_from_slice(&bytes);
        // What was damaged on the way is not sent again.
        last.push_back(bytes);
        if last.len() > REPEATED {
            last.pop_front();
        }
    }
    piece.extend_from_slice(END_MARK);
    sent.pieces.push_back(piece);
    sent
}

#[derive(Clone, Default)]
struct Lines(Arc<Mutex<Vec<u8>>>);

impl Write for Lines {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn streamed(pieces: VecDeque<Vec<u8>>, form: Form) -> (StreamSummary, String) {
    let table = form.table();
    let changes = [(TEXT, &*table), ("every = 10", "every = 1"), ("phase = true", "reconnect = \"10 s\"")];
    let lines = Lines::default();
    let outputs = StreamOutputs { lines: Some(Box::new(lines.clone())), ..StreamOutputs::default() };
    let input = Box::new(Pieces(Arc::new(Mutex::new(pieces))));
    let summary = stream(published(), &experiment(&changes), input, outputs, None, &|| false);
    let text = String::from_utf8(lines.0.lock().unwrap().clone()).unwrap();
    (summary.unwrap_or_else(|e| panic!("{e}")), text)
}

/// Streams samples with faults, each from a sample on, and finds all that follow the last one by 100 cycles right, and each fault told once.
fn judge(faults: &[(Fault, usize)], form: Form, truth: &[f64]) {
    let place = format!("{faults:?} {form:?}");
    let ends = faults.iter().map(|(fault, from)| from + fault.length()).max().unwrap();
    let from = ends + usize::try_from(SETTLED).unwrap();
    let mut sent = sent(from + 3000, faults, form);
    let (summary, lines) = streamed(std::mem::take(&mut sent.pieces), form);
    // It ends as a stream without a fault: with the exit code 0.
    assert!(summary.ends_with_estimate && summary.broken.is_none() && !summary.interrupted, "{place}");
    let clock = FIRST + faults.iter().map(|(fault, _)| fault.jump()).sum::<i64>();
    let mut counts = [0_usize; 3];
    // The times of the last clock are the last ones.
    for line in lines.lines().rev().filter(|line| line.starts_with("ekf,")) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |place: usize| cells[place].parse::<f64>().unwrap_or(f64::NAN);
        let (time_s, angle, sd) = (number(1), number(2), number(3));
        // No line without numbers is without a reason.
        assert!(
            angle.is_finite() || cells.last().is_some_and(|reason| !reason.is_empty()),
            "{place}: {line}"
        );
        #[allow(clippy::cast_possible_truncation)] // a sample's number
        let sample = (time_s * 1e6).round() as i64 - clock;
        let Some(sample) = usize::try_from(sample).ok().filter(|sample| (from..from + 2000).contains(sample))
        else {
            continue;
        };
        if counts[0] == 2000 {
            continue;
        }
        let sign = if (sample / truth.len()).is_multiple_of(2) { 1.0 } else { -1.0 };
        let expected = sign * truth[sample % truth.len()];
        counts[0] += 1;
        counts[1] += usize::from((angle - expected).abs() <= 3.0 * sd && sd < 5e-3);
        counts[2] += usize::from((angle + expected).abs() <= 3.0 * sd && sd < 5e-3);
    }
    assert_eq!(counts[0], 2000, "{place}");
    let share = counts[1].max(counts[2]) as f64 / 2000.0;
    assert!(share >= 0.98, "{place}: {share} within three standard deviations");
    told_once(faults, form, (&summary, &lines, &sent));
}

/// Finds that each fault is told once, by a count or an event of its own.
fn told_once(faults: &[(Fault, usize)], form: Form, (summary, lines, sent): (&StreamSummary, &str, &Sent)) {
    let place = format!("{faults:?} {form:?}");
    let is = |wanted: Fault| faults.iter().filter(|(fault, _)| *fault == wanted).count() as u64;
    let events = |name: &str| lines.matches(&format!("event,{{\"event\":\"{name}\"")).count() as u64;
    let (received, order) = (&summary.received, &summary.received.order);
    let damaged = if matches!(form, Form::Text) {
        received.damaged_lines
    } else {
        received.damaged_bytes / form.bytes(0, [0.0; 3]).len() as u64
    };
    // The counter of frames tells what never came, and the times what is missing between them.
    let dropped = if matches!(form, Form::CountedFrames) { sent.never } else { sent.dropped };
    let empty = |column: &str| -> u64 {
        let of_column = |finding: &&Finding| {
            finding.kind == FindingKind::Missing && finding.column.as_deref() == Some(column)
        };
        summary.diagnosis.iter().filter(of_column).map(|finding| finding.count as u64).sum()
    };
    let reset = is(Fault::Reset);
    for (what, found, expected) in [
        ("misplaced", order.misplaced, sent.misplaced),
        ("dropped", order.dropped, dropped),
        ("late", order.late + order.too_late, 0),
        ("damaged", damaged, sent.damaged),
        ("duplicated", order.duplicated, sent.repeated),
        ("breaks", received.breaks, reset),
        ("cut off", received.cut_off, reset),
        ("disconnected", events("disconnected"), reset),
        ("reconnected", events("reconnected"), reset),
        ("clock_back", events("clock_back"), sent.clock_back),
        ("new_stretch", events("new_stretch"), sent.new_stretch),
        ("noise_only_over", events("noise_only_over"), events("noise_only")),
        ("empty drives", empty("drive_V"), sent.empty_drive),
        ("empty signals", empty("cap_V"), sent.empty_signal),
    ] {
        assert_eq!(found, expected, "{place}: {what}\n{}", events_of(lines));
    }
    told_by_the_filter(faults, &place, (summary, lines, sent));
}

/// Finds that what a filter says of its samples is said once.
fn told_by_the_filter(
    faults: &[(Fault, usize)],
    place: &str,
    (summary, lines, sent): (&StreamSummary, &str, &Sent),
) {
    // The smoother that follows the filter says the same again.
    let of_filter = |name: &str| {
        let begins = format!("event,{{\"event\":\"{name}\"");
        let is_own = |line: &&str| line.starts_with(&begins) && line.ends_with("\"estimator\":\"ekf\"}");
        lines.lines().filter(is_own).count() as u64
    };
    let [stopped, disturbed, rejected, not_estimated, noise_only] =
        ["stopped", "disturbed", "rejected", "not_estimated", "noise_only"].map(|name| {
            let of_stream = lines.matches(&format!("event,{{\"event\":\"{name}\"")).count() as u64;
            if matches!(name, "not_estimated" | "noise_only") { of_stream } else { of_filter(name) }
        });
    assert_eq!(summary.stopped, stopped, "{place}");
    assert_eq!((summary.disturbed, summary.restarted), (disturbed, of_filter("restarted")), "{place}");
    let lost = lines.matches("\"kind\":\"lost\"").count() as u64;
    // What else is wrong with the samples leaves the filter as it is.
    let of_way = |fault: &Fault| matches!(fault, Fault::Time | Fault::Damage | Fault::Again);
    let others: Vec<Fault> = faults.iter().map(|(fault, _)| *fault).filter(|fault| !of_way(fault)).collect();
    let (told, expected) = match others[..] {
        [] => (stopped + disturbed + rejected + noise_only + lost, 0),
        // A drive that a number can hold disturbs as a sample does, and a filter that was disturbed at the end of its settling time rejects others.
        [Fault::Drive(..100)] => (disturbed, sent.drives),
        [Fault::Drive(_)] => (stopped + not_estimated, sent.drives),
        [Fault::Spike(_)] => (if disturbed > 0 { disturbed } else { rejected }, sent.spikes),
        [Fault::Noise] => (noise_only, u64::from(sent.noise > 0)),
        _ => (0, 0),
    };
    assert_eq!(told, expected, "{place}\n{}", events_of(lines));
    let unknown = stopped + not_estimated;
    let acting = others.len() as u64;
    for (what, is_so) in [
        // Nothing is told more often than there is something that it could be of.
        ("disturbed", disturbed <= acting.max(sent.spikes + sent.drives)),
        ("not estimated", not_estimated <= acting),
        ("lost", lost <= acting),
        ("stopped", stopped <= sent.spikes + sent.drives),
        ("drive", sent.drives == 0 || unknown + disturbed > 0),
        ("spike", sent.spikes == 0 || rejected + disturbed + unknown + lost > 0),
        ("noise", noise_only <= faults.iter().filter(|(fault, _)| *fault == Fault::Noise).count() as u64),
        // Long enough for what looks at a hundred cycles, unless nothing is estimated meanwhile.
        ("all noise", sent.noise < Fault::Noise.length() as u64 || noise_only + lost + unknown > 0),
    ] {
        assert!(is_so, "{place}: {what}\n{}", events_of(lines));
    }
}

/// What happened but for zero phases.
fn events_of(lines: &str) -> String {
    let events = lines.lines().filter(|line| line.starts_with("event,") && !line.contains("zero_phase"));
    events.collect::<Vec<_>>().join("\n")
}

fn period_of_truth() -> Vec<f64> {
    let mut truth = truth();
    truth.truncate(usize::try_from(PERIOD).unwrap());
    truth
}

#[test]
fn good_samples_are_estimated_within_100_cycles_of_a_fault_wherever_it_is_and_however_they_come() {
    let truth = period_of_truth();
    for fault in ALL {
        // At the beginning, while the filter settles, and later.
        for from in [100, 5000, 15_000] {
            judge(&[(fault, from)], Form::Text, &truth);
        }
        for form in [Form::Frames, Form::CountedFrames] {
            judge(&[(fault, 100)], form, &truth);
            judge(&[(fault, 5000)], form, &truth);
        }
        // While a filter is stopped, and behind that.
        for behind in [100, 300] {
            judge(&[(Fault::Drive(100), 12_000), (fault, 12_000 + behind)], Form::CountedFrames, &truth);
        }
    }
}

/// Any sample of the settling time may be absurd, and any drive.
#[test]
fn good_samples_are_estimated_within_100_cycles_of_an_absurd_sample_anywhere_in_the_settling_time() {
    let truth = period_of_truth();
    let spikes = [1000, -1000, 100, 1_000_000].map(Fault::Spike);
    let drives = [6, 12, 100].map(Fault::Drive);
    for fault in spikes.into_iter().chain(drives) {
        for from in [0, 1, 2, 3, 5, 8, 13, 30, 100, 300, 1000, 2150, 7990] {
            judge(&[(fault, from)], Form::Text, &truth);
        }
    }
}

/// Each fault followed by each, some while the filter settles, and some soon and some late after each other, as `by` chooses.
fn judge_pairs(form: Form, by: usize) {
    let truth = period_of_truth();
    for (k, one) in ALL.into_iter().enumerate() {
        for (l, other) in ALL.into_iter().enumerate() {
            let first = [1000, 12_000][(k + l + by) % 2];
            let second = first + one.length() + [40, 900, 6000][(2 * k + l + by) % 3];
            judge(&[(one, first), (other, second)], form, &truth);
        }
    }
}

/// Where one fault comes with another one: within it, at its end, and so many samples later.
const NEAR: [Option<usize>; 4] = [None, Some(0), Some(1), Some(20)];

/// Each fault with each at once, at the beginning and later, as `by` chooses.
fn judge_near_pairs(form: Form, by: usize) {
    let truth = period_of_truth();
    for (k, one) in ALL.into_iter().enumerate() {
        for (l, other) in ALL.into_iter().enumerate() {
            let chosen = 13 * k + l + by;
            // Samples as few as are waited for, before a clock jumps, have a wrong time.
            let is_jump = one.jump() != 0 || other.jump() != 0;
            let many = |samples: usize| if is_jump { samples.max(100) } else { samples };
            let first = many([0, 1, 5, 30, 100, 1000][(chosen / 4 + k) % 6]);
            let later = NEAR[chosen % 4].filter(|later| *later > 0).map_or(0, many);
            let length = if NEAR[chosen % 4].is_some() { one.length() } else { one.length() / 2 };
            let second = first + length + later;
            judge(&[(one, first), (other, second)], form, &truth);
        }
    }
}

#[test]
fn good_samples_are_estimated_within_100_cycles_of_two_faults_at_once() {
    judge_near_pairs(Form::Text, 0);
}

#[test]
fn good_samples_are_estimated_within_100_cycles_of_two_faults_within_20_ms() {
    judge_pairs(Form::Text, 0);
}

/// At other places and other distances as well.
#[test]
#[ignore = "slow"]
fn slow_good_samples_are_estimated_within_100_cycles_of_two_faults_however_they_come() {
    for (form, by) in [(Form::Text, 1), (Form::Frames, 0), (Form::CountedFrames, 1)] {
        judge_pairs(form, by);
    }
    for (form, by) in [(Form::Text, 1), (Form::Frames, 2), (Form::CountedFrames, 3), (Form::Text, 9)] {
        judge_near_pairs(form, by);
    }
}
