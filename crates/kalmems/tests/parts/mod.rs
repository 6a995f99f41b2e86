//! A recording as a whole, in parts, and sample by sample as it arrives: the same answers.

#![allow(dead_code)] // each test uses its part

use kalmems::config::Experiment;
use kalmems::estimate::{LockEvent, RecordedPassing, SegmentPart, Trajectory};
use kalmems::evaluate::StepErrors;
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
use kalmems::rigs::published;
use kalmems::stream::{Connection, OpenedConnection, StreamError, StreamOutputs, StreamSummary, stream};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::Rng;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{self, Read, Write};
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// What came of a recording in parts, put together.
pub struct InParts {
    pub trajectories: Vec<Trajectory>,
    pub events: Vec<LockEvent>,
    pub crossings: Vec<RecordedPassing>,
    pub remarks: Vec<String>,
}

/// Takes the first segment of a recording in parts of this length.
pub fn in_parts(experiment: &Experiment, recording: &SampledRecording, length: usize) -> InParts {
    let rig = published().rig(experiment).unwrap();
    let mut estimator = rig.considering(experiment, 0, &Silent).unwrap();
    let segment = &recording.segments()[0];
    let around = estimator.around(segment.time.interval_s().unwrap());
    let rows = segment.time.len();
    let mut all =
        InParts { trajectories: Vec::new(), events: Vec::new(), crossings: Vec::new(), remarks: Vec::new() };
    let (mut from, mut before) = (0, 0);
    while from < rows {
        let end = if from == 0 { around.head.max(length) } else { from + length }.min(rows);
        let end = if end + around.after >= rows { rows } else { end };
        let needed = around.before + if around.smooths { before } else { 0 };
        let there = from.saturating_sub(needed)..(end + around.after).min(rows);
        let part = SegmentPart {
            recording,
            segment: &segment.part(&there),
            fresh: from - there.start..end - there.start,
            begins: from == 0,
            ends: end == rows,
        };
        let estimate = estimator.take(&part).unwrap();
        all.remarks.extend(estimate.remarks);
        all.crossings.extend(estimate.crossings);
        for (i, trajectory) in estimate.trajectories.into_iter().enumerate() {
            all.events.extend(&trajectory.lock.events);
            match all.trajectories.get_mut(i) {
                None => all.trajectories.push(trajectory),
                Some(whole) => {
                    whole.time_s.extend(trajectory.time_s);
                    whole.innovation.extend(trajectory.innovation);
                    for (whole, state) in whole.states.iter_mut().zip(trajectory.states) {
                        whole.mean.extend(state.mean);
                        whole.sd.extend(state.sd);
                    }
                }
            }
        }
        before = end - from;
        from = end;
    }
    all
}

/// Finds every bit of the answers unchanged in parts of these lengths; what is smoothed over the whole, under keys that end so,
/// knows a part more and not all.
pub fn same_bits_in_parts(experiment: &Experiment, recording: &SampledRecording, lengths: &[usize]) {
    let rig = published().rig(experiment).unwrap();
    let estimate = rig.estimate(experiment, 0, recording, &Silent).unwrap().swap_remove(0);
    let whole = &estimate.trajectories;
    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    for length in lengths {
        let parts = in_parts(experiment, recording, *length);
        let told: Vec<LockEvent> = whole.iter().flat_map(|t| t.lock.events.clone()).collect();
        assert_eq!(parts.events.len(), told.len(), "{:?} {told:?}", parts.events);
        assert_eq!(parts.crossings, estimate.crossings);
        assert_eq!(parts.remarks, estimate.remarks);
        assert_eq!(parts.trajectories.len(), whole.len());
        for (part, whole) in parts.trajectories.iter().zip(whole) {
            assert_eq!(part.time_s, whole.time_s, "{} {length}", part.key);
            assert_eq!(bits(&part.innovation), bits(&whole.innovation), "{} {length}", part.key);
            for (a, b) in part.states.iter().zip(&whole.states) {
                if !part.key.ends_with("_smoothed") {
                    assert_eq!(bits(&a.mean), bits(&b.mean), "{} {} {length}", part.key, a.name);
                    assert_eq!(bits(&a.sd), bits(&b.sd), "{} {} {length}", part.key, a.name);
                    continue;
                }
                // More knowledge moves the mean by what it takes off the variance.
                for (k, (mean, whole)) in a.mean.iter().zip(&b.mean).enumerate() {
                    let (sd, least) = (a.sd[k], b.sd[k]);
                    assert!(sd > 0.999 * least, "{} {k}: {sd} {least}", a.name);
                    let moved = (sd * sd - least * least).max(0.0).sqrt();
                    let by = mean - whole;
                    // A phase is the same a turn further.
                    let by = if a.name == "phase" { by.sin() } else { by };
                    assert!(by.abs() < 6.0 * moved + 0.01 * least, "{} {length} {k}", a.name);
                }
            }
        }
    }
}

/// Gives bytes in pieces of whatever length.
pub struct Pieces {
    pub bytes: Vec<u8>,
    pub at: usize,
    chance: Pcg64,
    longest: u64,
}

impl Pieces {
    pub fn of(bytes: Vec<u8>, longest: u64) -> Self {
        Self { bytes, at: 0, chance: Pcg64::new(1, 2), longest }
    }
}

impl Read for Pieces {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let length = 1 + usize::try_from(self.chance.next_u64() % self.longest).unwrap();
        let count = length.min(buffer.len()).min(self.bytes.len() - self.at);
        buffer[..count].copy_from_slice(&self.bytes[self.at..self.at + count]);
        self.at += count;
        Ok(count)
    }
}

/// Gives bytes slowly, and kills the run that reads them at a place: from then on it writes nothing.
pub struct Killing {
    pieces: Pieces,
    place: usize,
    killed: Arc<AtomicBool>,
}

impl Killing {
    pub fn at(pieces: Pieces, place: usize) -> Self {
        Self { pieces, place, killed: Arc::default() }
    }
}

impl Read for Killing {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.pieces.at >= self.place {
            self.killed.store(true, Ordering::SeqCst);
            return Ok(0);
        }
        // Slower than the samples are taken in, so that what is acknowledged is near where the run is killed.
        std::thread::sleep(std::time::Duration::from_millis(6));
        self.pieces.read(buffer)
    }
}

/// Memory that is read while somebody else holds it.
#[derive(Clone, Default)]
struct Shared {
    bytes: Rc<RefCell<Vec<u8>>>,
    killed: Arc<AtomicBool>,
}

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.flush()?;
        self.bytes.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        if self.killed.load(Ordering::SeqCst) {
            return Err(io::Error::other("the run was killed"));
        }
        Ok(())
    }
}

/// What a stream says.
pub struct Streamed {
    /// Each answer's lines: times, and means and standard deviations of the states.
    pub answers: BTreeMap<String, Vec<Vec<f64>>>,
    pub events: Vec<serde_json::Value>,
    /// The last time until which nothing need be sent again, in s.
    pub acknowledged_s: Option<f64>,
    /// Where the times count from, where that is said.
    pub origin: Option<String>,
    pub ended: Result<StreamSummary, StreamError>,
}

/// Estimates samples while they arrive.
pub fn streamed(
    experiment: &Experiment,
    input: impl Read + Send + 'static,
    state: Option<&Path>,
) -> Streamed {
    connected(experiment, Box::new(OpenedConnection::new(input)), state, Arc::default())
}

/// Estimates samples while they arrive, until the run is killed.
pub fn killed(experiment: &Experiment, input: Killing, state: &Path) -> Streamed {
    let killed = input.killed.clone();
    connected(experiment, Box::new(OpenedConnection::new(input)), Some(state), killed)
}

/// Estimates the samples of a connection while they arrive; from when on the run is killed, it writes nothing.
pub fn connected(
    experiment: &Experiment,
    connection: Box<dyn Connection>,
    state: Option<&Path>,
    killed: Arc<AtomicBool>,
) -> Streamed {
    let lines = Shared { bytes: Rc::default(), killed };
    let outputs = StreamOutputs { lines: Some(Box::new(lines.clone())), ..StreamOutputs::default() };
    let ended = stream(published(), experiment, connection, outputs, state, &|| false);
    let text = String::from_utf8(lines.bytes.borrow().clone()).unwrap();
    let (mut answers, mut events) = (BTreeMap::<_, Vec<_>>::new(), Vec::new());
    let (mut acknowledged_s, mut origin) = (None, None);
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (key, rest) = line.split_once(',').unwrap();
        match key {
            "event" => events.push(serde_json::from_str(rest).unwrap()),
            "origin" => origin = Some(rest.to_owned()),
            "acknowledged" => acknowledged_s = Some(rest.parse().unwrap()),
            _ => {
                let numbers = rest.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
                answers.entry(key.to_owned()).or_default().push(numbers);
            }
        }
    }
    Streamed { answers, events, acknowledged_s, origin, ended }
}

/// Finds every bit of the estimate of a recording in a stream of its bytes; what the stream says besides.
pub fn same_bits_in_a_stream(
    experiment: &Experiment,
    recording: &SampledRecording,
    (bytes, longest): (&[u8], u64),
) -> (Vec<serde_json::Value>, StreamSummary) {
    let rig = published().rig(experiment).unwrap();
    let estimate = rig.estimate(experiment, 0, recording, &Silent).unwrap().swap_remove(0);
    let whole = &estimate.trajectories;
    let Streamed { answers, events, origin, ended, .. } =
        streamed(experiment, Pieces::of(bytes.to_vec(), longest), None);
    let summary = ended.unwrap_or_else(|e| panic!("{e}"));
    let said = summary.origin.as_ref().map(|origin| origin.seconds.as_str());
    assert_eq!(origin.as_deref().and_then(|origin| origin.split(',').next()), said);
    assert_eq!(answers.len(), whole.len());
    for trajectory in whole {
        let lines = &answers[&trajectory.key];
        assert_eq!(lines.len(), trajectory.time_s.len(), "{}", trajectory.key);
        for (k, line) in lines.iter().enumerate() {
            let told = || {
                std::iter::once(trajectory.time_s[k]).chain(
                    trajectory
                        .states
                        .iter()
                        .flat_map(|state| [state.mean[k], state.sd.get(k).copied().unwrap_or(f64::NAN)]),
                )
            };
            let same = |(a, b): (&f64, f64)| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
            let words = || format!("{} {k}: {line:?} {:?}", trajectory.key, told().collect::<Vec<_>>());
            assert!(line.iter().zip(told()).all(same), "{}", words());
        }
        let steps = StepErrors::of(trajectory, estimate.start_s + estimate.skip_s);
        assert_eq!(summary.step_errors.get(&trajectory.key).copied(), steps, "{}", trajectory.key);
    }
    (events, summary)
}

/// The last time of the samples that a state says need not be sent again, in s: a run may be killed after its state is written
/// and before that is said, so that where a run goes on stands here and not in what was said.
pub fn acknowledged_in(state: &Path) -> f64 {
    let state: serde_json::Value = serde_json::from_slice(&std::fs::read(state).unwrap()).unwrap();
    f64::from_bits(state["acknowledged"].as_u64().unwrap())
}

/// Kills a stream at a part of its bytes and lets another one go on: together they say what one says, to 10⁻⁶ of a standard
/// deviation, and acknowledged nothing that another one would have to say again. The events of the one, and of the two.
pub fn goes_on_after_a_kill(
    experiment: &Experiment,
    bytes: &[u8],
    at: f64,
    acknowledged_after_s: f64,
) -> [Vec<serde_json::Value>; 3] {
    let folder = tempfile::tempdir().unwrap();
    let state = folder.path().join("state.json");
    let uncut = streamed(experiment, Pieces::of(bytes.to_vec(), 1000), None);
    let whole = uncut.answers;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a place among the bytes
    let place = (at * bytes.len() as f64) as usize;
    // In some hundred pieces, so that the state is written several times.
    let killing = Killing::at(Pieces::of(bytes.to_vec(), bytes.len() as u64 / 300), place);
    let first = killed(experiment, killing, &state);
    assert!(first.ended.as_ref().unwrap_err().to_string().contains("the run was killed"));
    let said_s = first.acknowledged_s.expect("nothing was acknowledged");
    let acknowledged_s = acknowledged_in(&state);
    assert!(acknowledged_after_s < said_s && said_s <= acknowledged_s, "{said_s} {acknowledged_s}");
    // The sender sends all of it again; what was acknowledged is passed over.
    let second = streamed(experiment, Pieces::of(bytes.to_vec(), 1000), Some(&state));
    let passed_over = second.ended.as_ref().unwrap_or_else(|e| panic!("{e}")).received.passed_over;
    assert!(!whole.is_empty());
    for (key, whole) in &whole {
        let of = |lines: &[Vec<f64>]| -> BTreeMap<u64, Vec<f64>> {
            lines.iter().map(|line| (line[0].to_bits(), line[1..].to_vec())).collect()
        };
        let [first, second] = [&first, &second].map(|run| of(&run.answers[key]));
        for line in whole {
            let time_s = line[0];
            let (from, place) =
                if time_s <= acknowledged_s { (&first, "before") } else { (&second, "after") };
            let found =
                from.get(&time_s.to_bits()).unwrap_or_else(|| panic!("{key}: nothing {place} {time_s}"));
            for (found, told) in found.chunks(2).zip(line[1..].chunks(2)) {
                let ([mean, sd], [told, told_sd]) = (found, told) else { panic!("{line:?}") };
                assert!(mean.is_nan() == told.is_nan() && sd.is_nan() == told_sd.is_nan(), "{key} {time_s}");
                let size = if told_sd.is_nan() { told.abs() } else { *told_sd };
                assert!((mean - told).abs() <= 1e-6 * size || mean.is_nan(), "{key} {place}: {mean} {told}");
                assert!(
                    (sd / told_sd - 1.0).abs() < 1e-6 || told_sd.is_nan() || *told_sd == 0.0,
                    "{key} {sd}"
                );
            }
        }
        assert!(second.keys().all(|time| f64::from_bits(*time) > acknowledged_s));
        assert_eq!(passed_over + second.len() as u64, whole.len() as u64);
    }
    [uncut.events, first.events, second.events]
}
