//! The estimates of a stream, as lines and as frames.

use super::supervision::Health;
use crate::estimate::{PredictedPhase, Trajectory};
use crate::recording::TimeOrigin;
use serde::Serialize;
use std::io::{self, Write};
use std::time::Duration;

/// What each frame of an estimate begins with.
pub const SYNC: [u8; 4] = *b"kmEs";

/// What each frame begins with that tells of a zero phase before it happens.
pub const SYNC_AHEAD: [u8; 4] = *b"kmZp";

/// What the frame begins with that tells where the times of all others count from.
pub const SYNC_ORIGIN: [u8; 4] = *b"kmOr";

/// What the frame begins with that follows an estimate without a number, and says why.
pub const SYNC_REASON: [u8; 4] = *b"kmNo";

/// The reasons why an estimate has no number ([`Trajectory::reason_without_estimate`]); in a frame the place among them, from 1 on.
pub const REASONS: [&str; 3] = ["stopped", "no_signal", "not_known"];

/// Bytes of a frame before its values.
const HEAD: usize = 8;

/// Whether a file that begins with these bytes was written as the lines of a stream.
pub fn is_lines(beginning: &[u8]) -> bool {
    [b"# ".as_slice(), b"event,", b"health,"].iter().any(|own| beginning.starts_with(own))
}

/// Whether a file that begins with these bytes was written as the frames of a stream.
pub fn is_frames(beginning: &[u8]) -> bool {
    [SYNC, SYNC_AHEAD, SYNC_ORIGIN].iter().any(|own| beginning.starts_with(own))
}

/// Where estimates and events go. Each call of `write` has whole lines, or one whole frame.
#[derive(Default)]
pub struct StreamOutputs {
    /// Lines: estimates, events, and comments that name the columns.
    pub lines: Option<Box<dyn Write>>,
    /// Frames of estimates in binary.
    pub frames: Option<Box<dyn Write>>,
    /// What hears by the time of day how the stream fares, and how often.
    pub supervisor: Option<(Duration, Supervisor)>,
    /// What is told of the stream itself, its connection and its health, where no lines are written.
    pub notices: Option<Box<dyn Write>>,
}

/// Hears how a stream fares, on the thread that estimates: while it is called that thread is alive.
pub type Supervisor = Box<dyn FnMut(&Health)>;

/// Writes the estimates of all answers at the wanted rate.
pub(super) struct StreamWriter {
    outputs: StreamOutputs,
    every: u64,
    /// Samples of each answer so far, and those that another run gave.
    samples: Vec<u64>,
    before: u64,
    named: bool,
    origin_told: bool,
    /// What is written next, and its numbers.
    line: Vec<u8>,
    values: Vec<f64>,
}

impl StreamWriter {
    pub(super) fn new(outputs: StreamOutputs, every: u64) -> Self {
        Self {
            outputs,
            every: every.max(1),
            samples: Vec::new(),
            before: 0,
            named: false,
            origin_told: false,
            line: Vec::new(),
            values: Vec::new(),
        }
    }

    /// Goes on from another run, which gave so many samples of an answer.
    pub(super) const fn resume(&mut self, given: u64) {
        self.before = given;
    }

    /// Samples of the first answer so far, those of another run included.
    pub(super) fn given(&self) -> u64 {
        self.samples.first().copied().unwrap_or(self.before)
    }

    /// Writes the next samples of all answers.
    ///
    /// A line is the answer's key, the time, and mean and standard deviation of each state in SI, separated by commas; a
    /// cell is empty where there is no number, and a line without any number ends with the reason. A frame is [`SYNC`], the answer's place (u16), the number of values (u16), and
    /// these values as f64, little-endian: the time, and mean and standard deviation of each state. One without any number is followed by a frame
    /// [`SYNC_REASON`] with the time and the reason, by its place among [`REASONS`] from 1 on.
    pub(super) fn estimates(&mut self, trajectories: &[Trajectory]) -> io::Result<()> {
        self.samples.resize(trajectories.len(), self.before);
        for (place, trajectory) in trajectories.iter().enumerate() {
            let before = self.samples[place] % self.every;
            let [first, step] = [(self.every - before) % self.every, self.every]
                .map(|count| usize::try_from(count).unwrap_or(usize::MAX));
            for k in (first..trajectory.time_s.len()).step_by(step) {
                self.one(place, trajectory, k)?;
            }
            self.samples[place] += trajectory.time_s.len() as u64;
        }
        Ok(())
    }

    /// Says once where the times of all lines and frames count from, where that is not zero: a line `origin,seconds`, and
    /// behind that the date where the clock is one of the calendar; and a frame, [`SYNC_ORIGIN`] with whole seconds and the rest of them.
    pub(super) fn origin(&mut self, origin: Option<&TimeOrigin>) -> io::Result<()> {
        let (Some(origin), false) = (origin, self.origin_told) else { return Ok(()) };
        self.origin_told = true;
        if let Some(lines) = &mut self.outputs.lines {
            let utc = origin.utc.as_ref().map_or_else(String::new, |utc| format!(",{utc}"));
            lines.write_all(format!("origin,{}{utc}\n", origin.seconds).as_bytes())?;
        }
        let (whole, rest) = origin.seconds.split_once('.').unwrap_or((&origin.seconds, ""));
        let sign = if whole.starts_with('-') { "-" } else { "" };
        let [whole, rest] = [whole, &format!("{sign}0.{rest}")].map(|text| text.parse().unwrap_or(f64::NAN));
        self.values.clear();
        self.values.extend([whole, rest]);
        self.frame(SYNC_ORIGIN, 0)
    }

    /// Writes the present values as a frame: what it begins with, the answer's place (u16), the number of values (u16), and these as f64,
    /// little-endian.
    fn frame(&mut self, sync: [u8; 4], place: usize) -> io::Result<()> {
        let Some(frames) = &mut self.outputs.frames else { return Ok(()) };
        let [place, count] =
            [place, self.values.len()].map(|number| u16::try_from(number).unwrap_or(u16::MAX));
        self.line.resize(HEAD + 8 * self.values.len(), 0);
        self.line[..4].copy_from_slice(&sync);
        self.line[4..6].copy_from_slice(&place.to_le_bytes());
        self.line[6..HEAD].copy_from_slice(&count.to_le_bytes());
        let (bytes, _) = self.line[HEAD..].as_chunks_mut();
        for (k, value) in self.values.iter().enumerate() {
            bytes[k] = value.to_le_bytes();
        }
        frames.write_all(&self.line)
    }

    fn one(&mut self, place: usize, trajectory: &Trajectory, k: usize) -> io::Result<()> {
        let of = |values: &[f64]| values.get(k).copied().unwrap_or(f64::NAN);
        self.values.clear();
        self.values.push(trajectory.time_s[k]);
        for state in &trajectory.states {
            self.values.push(of(&state.mean));
            self.values.push(of(&state.sd));
        }
        let reason = trajectory.reason_without_estimate(k);
        if let Some(lines) = &mut self.outputs.lines {
            self.line.clear();
            write!(self.line, "{},{}", trajectory.key, trajectory.time_s[k])?;
            for value in &self.values[1..] {
                if value.is_finite() {
                    write!(self.line, ",{value:e}")?;
                } else {
                    write!(self.line, ",")?;
                }
            }
            if let Some(reason) = reason {
                write!(self.line, ",{reason}")?;
            }
            self.line.push(b'\n');
            lines.write_all(&self.line)?;
        }
        self.frame(SYNC, place)?;
        let Some(number) = REASONS.iter().position(|word| Some(*word) == reason) else { return Ok(()) };
        self.values.truncate(1);
        self.values.push((number + 1) as f64);
        self.frame(SYNC_REASON, place)
    }

    /// Says once what the columns are, answer by answer.
    pub(super) fn name(&mut self, trajectories: &[Trajectory]) -> io::Result<()> {
        let (Some(lines), false) = (&mut self.outputs.lines, self.named) else { return Ok(()) };
        self.named = true;
        let mut names = String::new();
        for trajectory in trajectories {
            names += &format!("# {},time_s", trajectory.key);
            for state in &trajectory.states {
                names += &format!(",{}_{},{}_sd_{}", state.name, state.unit, state.name, state.unit);
            }
            names.push('\n');
        }
        let [reasons @ .., last] = REASONS;
        names +=
            &format!("# a line without numbers ends with the reason: {} or {last}\n", reasons.join(", "));
        names += "# event,what happened, as JSON\n";
        lines.write_all(names.as_bytes())
    }

    /// Writes what happened, in an answer where it is one's: a line `event,{…}`.
    pub(super) fn events(&mut self, key: Option<&str>, events: &[impl Serialize]) -> io::Result<()> {
        self.outputs.lines.as_mut().map_or(Ok(()), |lines| write_events(lines, key, events))
    }

    /// Writes an event of the stream itself, in the same way and where there are no lines beside the frames.
    pub(super) fn notice(&mut self, notice: &impl Serialize) -> io::Result<()> {
        let StreamOutputs { lines, notices, .. } = &mut self.outputs;
        let Some(output) = lines.as_mut().or(notices.as_mut()) else { return Ok(()) };
        write_events(output, None, std::slice::from_ref(notice))?;
        output.flush()
    }

    /// Writes a zero phase that is to come as a frame with these values: when it will happen, the standard deviation of that, 1 where the angle will rise
    /// and −1 where it will fall, and the time of the sample that it is told from.
    pub(super) fn ahead(&mut self, place: usize, predicted: &PredictedPhase) -> io::Result<()> {
        let direction = if predicted.rising { 1.0 } else { -1.0 };
        self.values.clear();
        self.values.extend([predicted.time_s, predicted.sd_s, direction, predicted.told_s]);
        self.frame(SYNC_AHEAD, place)
    }

    /// Tells what hears it how the stream fares.
    pub(super) fn supervise(&mut self, health: &Health) {
        if let Some((_, supervisor)) = &mut self.outputs.supervisor {
            supervisor(health);
        }
    }

    /// Says that samples up to a time in s need not be sent again: a line `acknowledged,time`.
    pub(super) fn acknowledged(&mut self, time_s: f64) -> io::Result<()> {
        if let Some(lines) = &mut self.outputs.lines {
            lines.write_all(format!("acknowledged,{time_s}\n").as_bytes())?;
        }
        self.flush()
    }

    /// Hands on what waits in memory.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        for output in [&mut self.outputs.lines, &mut self.outputs.frames].into_iter().flatten() {
            output.flush()?;
        }
        Ok(())
    }
}

fn write_events(output: &mut impl Write, key: Option<&str>, events: &[impl Serialize]) -> io::Result<()> {
    for event in events {
        let mut value = serde_json::to_value(event)?;
        if let (Some(key), Some(object)) = (key, value.as_object_mut()) {
            object.insert("estimator".to_owned(), key.into());
        }
        output.write_all(format!("event,{value}\n").as_bytes())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::TrajectoryKind;
    use crate::units::kind;
    use std::cell::RefCell;
    use std::rc::Rc;

    #[derive(Clone, Default)]
    struct Bytes(Rc<RefCell<Vec<u8>>>);

    impl Write for Bytes {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.borrow_mut().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn an_estimate_without_a_number_says_why_among_lines_and_frames() {
        let (lines, frames) = (Bytes::default(), Bytes::default());
        let outputs = StreamOutputs {
            lines: Some(Box::new(lines.clone())),
            frames: Some(Box::new(frames.clone())),
            ..StreamOutputs::default()
        };
        let (time_s, signal) = ([0.5, 0.75, 1.0], [1.0, f64::NAN, 1.0]);
        let states = [("angle", "rad", &kind::ANGLE)];
        let samples = (&time_s[..], &signal[..], &(0..3));
        let mut trajectory = Trajectory::blank(("ekf", "EKF"), TrajectoryKind::Filtered, samples, &states);
        (trajectory.states[0].mean[0], trajectory.states[0].sd[0]) = (0.25, 0.125);
        StreamWriter::new(outputs, 1).estimates(&[trajectory]).unwrap();
        let lines = String::from_utf8(lines.0.take()).unwrap();
        assert_eq!(lines, "ekf,0.5,2.5e-1,1.25e-1\nekf,0.75,,,no_signal\nekf,1,,,not_known\n");
        let (mut rest, mut found) = (&frames.0.take()[..], Vec::new());
        while let Some((head, values)) = rest.split_first_chunk::<HEAD>() {
            let (values, after) = values.split_at(8 * usize::from(head[6]));
            let number = |bytes: &[u8]| f64::from_le_bytes(bytes.try_into().unwrap());
            found.push((head[..4].to_vec(), values.chunks(8).map(number).collect::<Vec<f64>>()));
            rest = after;
        }
        let of = |sync: &[u8], values: &[f64]| (sync.to_vec(), values.to_vec());
        assert_eq!(found[0], of(b"kmEs", &[0.5, 0.25, 0.125]));
        assert!(found[1].1[0] == 0.75 && found[1].1[1..].iter().all(|value| value.is_nan()));
        assert_eq!(found[2], of(b"kmNo", &[0.75, 2.0]));
        assert_eq!((found[4].clone(), found.len()), (of(b"kmNo", &[1.0, 3.0]), 5));
    }
}
