//! Faults of samples that arrive, at the beginning, while a filter settles, behind that, and two soon after another: good samples are estimated
//! again soon, and each fault is told.

use super::example;
use super::faults::{PERIOD, SETTLED, experiment, truth};
use kalmems::rigs::published;
use kalmems::stream::{OpenedConnection, StreamOutputs, StreamSummary, stream};
use std::io::{self, Write};
use std::sync::{Arc, Mutex};

/// What is wrong with some samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// The drive is off, with one sample missing within.
    DriveOff,
    /// A signal that no converter gives.
    Spike,
    /// A drive that no amplifier gives.
    Drive,
    /// A time that is another one.
    Time,
    /// Samples that never come.
    Gap,
    /// No signal.
    Silence,
}

const ALL: [Fault; 6] =
    [Fault::DriveOff, Fault::Spike, Fault::Drive, Fault::Time, Fault::Gap, Fault::Silence];

impl Fault {
    /// How many samples are wrong.
    fn length(self) -> usize {
        match self {
            Self::DriveOff => 3000,
            Self::Spike | Self::Drive | Self::Time => 1,
            Self::Gap | Self::Silence => 500,
        }
    }

    /// Makes samples wrong from one on.
    fn apply(self, samples: &mut [[f64; 3]], from: usize) {
        let wrong = &mut samples[from..from + self.length()];
        match self {
            Self::DriveOff => {
                for sample in wrong.iter_mut() {
                    sample[1] = 0.0;
                }
                (wrong[1500][1], wrong[1500][2]) = (f64::NAN, f64::NAN);
            }
            Self::Spike => wrong[0][2] = 1000.0,
            Self::Drive => wrong[0][1] = 1e100,
            Self::Time => wrong[0][0] += 1e4,
            Self::Gap => wrong.iter_mut().for_each(|sample| sample[0] = f64::INFINITY),
            Self::Silence => wrong.iter_mut().for_each(|sample| sample[2] = f64::NAN),
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

    /// The bytes of samples; those without a time are not sent.
    fn bytes(self, samples: &[[f64; 3]]) -> Vec<u8> {
        let mut bytes = Vec::new();
        for (number, sample) in samples.iter().enumerate().filter(|(_, sample)| sample[0].is_finite()) {
            if matches!(self, Self::Text) {
                let cells = sample.map(|x| if x.is_nan() { String::new() } else { format!("{x:e}") });
                bytes.extend_from_slice((cells.join(",") + "\n").as_bytes());
                continue;
            }
            bytes.extend_from_slice(&[0xa5, 0x5a]);
            if matches!(self, Self::CountedFrames) {
                bytes.extend_from_slice(&u16::try_from(number % 65_536).unwrap().to_le_bytes());
            }
            for x in sample {
                bytes.extend_from_slice(&x.to_le_bytes());
            }
        }
        bytes
    }
}

const TEXT: &str = "[stream.input.text]\ncolumns = [\"time_s\", \"drive_V\", \"cap_V\"]";

/// The example's samples again and again.
fn samples(count: usize) -> Vec<[f64; 3]> {
    let text = std::fs::read_to_string(example("recording.csv")).unwrap();
    let rows: Vec<[f64; 3]> = (text.lines().skip(1).take(usize::try_from(PERIOD).unwrap()))
        .map(|line| {
            let mut cells = line.split(',').map(|cell| cell.parse().unwrap());
            std::array::from_fn(|_| cells.next().unwrap())
        })
        .collect();
    (0..count).map(|k| [k as f64 * 1e-6, rows[k % rows.len()][1], rows[k % rows.len()][2]]).collect()
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

fn streamed(samples: &[[f64; 3]], form: Form) -> (StreamSummary, String) {
    let experiment = experiment(&[(TEXT, &form.table()), ("every = 10", "every = 1")]);
    let lines = Lines::default();
    let outputs = StreamOutputs { lines: Some(Box::new(lines.clone())), ..StreamOutputs::default() };
    let input = Box::new(OpenedConnection::new(io::Cursor::new(form.bytes(samples))));
    let summary = stream(published(), &experiment, input, outputs, None, &|| false);
    let text = String::from_utf8(lines.0.lock().unwrap().clone()).unwrap();
    (summary.unwrap_or_else(|e| panic!("{e}")), text)
}

/// Streams samples with faults, each from a sample on, and finds all that follow the last one by 100 cycles right.
fn judge(faults: &[(Fault, usize)], form: Form, truth: &[f64]) {
    let place = format!("{faults:?} {form:?}");
    let ends = faults.iter().map(|(fault, from)| from + fault.length()).max().unwrap();
    let from = ends + usize::try_from(SETTLED).unwrap();
    // A filter that began late is not judged by less than its settling time.
    let mut samples = samples(from + 12_000);
    for (fault, from) in faults {
        fault.apply(&mut samples, *from);
    }
    let (summary, lines) = streamed(&samples, form);
    assert!(summary.ends_with_estimate, "{place}");
    let mut counts = [0_usize; 3];
    for line in lines.lines().filter(|line| line.starts_with("ekf,")) {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |place: usize| cells[place].parse::<f64>().unwrap_or(f64::NAN);
        let (time_s, angle, sd) = (number(1), number(2), number(3));
        // No line without numbers is without a reason.
        assert!(
            angle.is_finite() || cells.last().is_some_and(|reason| !reason.is_empty()),
            "{place}: {line}"
        );
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a sample's number
        let sample = (time_s * 1e6).round() as usize;
        if !(from..from + 2000).contains(&sample) {
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
    // Each fault is told once.
    let events = |name: &str| lines.matches(&format!("{{\"event\":\"{name}\"")).count() as u64;
    let is = |wanted: Fault| faults.iter().filter(|(fault, _)| *fault == wanted).count() as u64;
    assert_eq!(summary.received.order.misplaced, is(Fault::Time), "{place}");
    assert!(summary.received.order.dropped >= 500 * is(Fault::Gap), "{place}");
    // A drive that is no drive may be what stands in for a missing one soon after.
    let stops = if is(Fault::Drive) + is(Fault::Spike) > 0 { faults.len() as u64 } else { 0 };
    assert!(events("stopped") <= stops, "{place}");
    assert!(events("not_estimated") <= faults.len() as u64, "{place}");
    if is(Fault::Drive) > 0 {
        assert!(events("stopped") + events("not_estimated") > 0, "{place}");
    }
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
        for from in [100, 5000, 15_000] {
            judge(&[(fault, from)], Form::Text, &truth);
        }
        for form in [Form::Frames, Form::CountedFrames] {
            judge(&[(fault, 5000)], form, &truth);
        }
    }
}

#[test]
fn good_samples_are_estimated_within_100_cycles_of_two_faults_within_20_ms() {
    let truth = period_of_truth();
    for (k, one) in ALL.into_iter().enumerate() {
        for (l, other) in ALL.into_iter().enumerate() {
            // Some while the filter settles, and some soon and some late after each other.
            let first = [1000, 12_000][(k + l) % 2];
            let second = first + one.length() + [40, 900, 6000][(2 * k + l) % 3];
            judge(&[(one, first), (other, second)], Form::Text, &truth);
        }
    }
}
