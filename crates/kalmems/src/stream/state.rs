//! What a stream keeps, so that another run can go on from it.

use super::StreamError;
use super::decode::StreamSample;
use super::recent::RecentSamples;
use crate::estimate::{PastState, Trajectory};
use crate::recording;
use crate::sealed_line::{checked, sealed_line};
use serde::{Deserialize, Serialize};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// How often the state is written.
const EVERY: Duration = Duration::from_millis(100);

/// What is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct StreamState {
    /// The experiment as it was understood; another one cannot go on from it.
    experiment: String,
    /// The time of the last sample whose every answer was given, by its bits: samples up to it need not be sent again.
    acknowledged: u64,
    past: PastState,
    /// Where all times count from, in s of the clock of the samples.
    #[serde(default = "zero")]
    origin: String,
    /// The columns of a sample.
    columns: Vec<String>,
    /// Samples of an answer until then, of which one in so many was written.
    #[serde(default)]
    given: u64,
    /// The last samples as they came, the numbers of these columns by their bits; the newest last.
    samples: Vec<Vec<u64>>,
}

/// The origin of a state that names none.
fn zero() -> String {
    recording::Instant::ZERO.to_string()
}

impl StreamState {
    /// The time of the last sample whose every answer was given, in s.
    pub(super) fn acknowledged_s(&self) -> f64 {
        f64::from_bits(self.acknowledged)
    }

    /// Where all times count from.
    pub(super) fn origin(&self) -> recording::Instant {
        self.origin.parse().unwrap_or_default()
    }

    /// Samples of an answer until then.
    pub(super) const fn given(&self) -> u64 {
        self.given
    }

    pub(super) const fn past(&self) -> &PastState {
        &self.past
    }

    /// The last samples, which the drive is interpolated through, as samples with these columns.
    pub(super) fn samples(&self, columns: &[String]) -> Vec<StreamSample> {
        let place = |name: &String| self.columns.iter().position(|own| own == name);
        let places: Vec<Option<usize>> = columns.iter().map(place).collect();
        let of = |bits: &Vec<u64>| {
            let number = |place: &Option<usize>| {
                place.and_then(|place| bits.get(place).copied()).map_or(f64::NAN, f64::from_bits)
            };
            StreamSample { sequence: None, numbers: places.iter().map(number).collect() }
        };
        self.samples.iter().map(of).collect()
    }

    /// How many samples are kept.
    pub(super) fn kept(&self) -> usize {
        self.samples.len()
    }

    /// Reads what an earlier run of the same experiment left; `None` where there is none.
    pub(super) fn read(path: &Path, experiment: &str) -> Result<Option<Self>, StreamError> {
        let wrong = |why: String| StreamError::State { path: path.display().to_string(), why };
        // A pipe would be waited for, and a link would be replaced.
        if fs::symlink_metadata(path).is_ok_and(|there| !there.is_file()) {
            return Err(wrong("it is no regular file".to_owned()));
        }
        let text = match fs::read_to_string(path) {
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            text => text.map_err(|e| wrong(e.to_string()))?,
        };
        let other = || wrong("it is no state that `kalmems stream` has written".to_owned());
        if !text.trim_start().starts_with('{') {
            return Err(other());
        }
        let state: Self = checked(text.trim_end().as_bytes()).map_err(wrong)?;
        if state.origin.parse::<recording::Instant>().is_err() {
            return Err(wrong("its origin of times is none".to_owned()));
        }
        if state.experiment != experiment {
            return Err(wrong("it was left by another experiment".to_owned()));
        }
        Ok(Some(state))
    }

    fn write(&self, path: &Path) -> std::io::Result<()> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let mut file = tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new(".")))?;
        file.write_all(sealed_line(self)?.as_bytes())?;
        file.flush()?;
        file.as_file().sync_data()?;
        file.persist(path).map_err(|e| e.error)?;
        Ok(())
    }
}

/// Keeps other streams from a state until it is dropped: a file beside it that is locked.
struct StateLock {
    path: PathBuf,
    _file: File,
}

impl StateLock {
    fn of(state: &Path) -> Result<Self, StreamError> {
        let wrong = |why: String| StreamError::State { path: state.display().to_string(), why };
        let mut name = state.file_name().unwrap_or_default().to_owned();
        name.push(".lock");
        let path = state.with_file_name(name);
        let file = OpenOptions::new().write(true).create(true).truncate(false).open(&path);
        let file = file.map_err(|e| wrong(format!("its lock `{}`: {e}", path.display())))?;
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => {
                Err(wrong("another stream goes on from it and writes to it at this moment".to_owned()))
            }
            // A browser's sandbox has no locks, and nobody else in it.
            Err(TryLockError::Error(e)) if e.kind() != ErrorKind::Unsupported => Err(wrong(e.to_string())),
            _ => Ok(Self { path, _file: file }),
        }
    }
}

impl Drop for StateLock {
    fn drop(&mut self) {
        // Whoever opens it at this moment locks a file that is gone, for which there is no other name; the next one makes its own.
        let _ = fs::remove_file(&self.path);
    }
}

/// Writes the state now and then.
pub(super) struct StateWriter {
    path: PathBuf,
    _lock: StateLock,
    experiment: String,
    columns: Vec<String>,
    recent: RecentSamples,
    /// States that wait until every answer of their samples is given.
    waiting: Vec<StreamState>,
    /// Until when each answer is given, in s.
    given_s: Vec<f64>,
    written: Instant,
}

impl StateWriter {
    /// Writes to this file, which no other stream does meanwhile; samples have these columns.
    pub(super) fn new(
        path: PathBuf,
        experiment: String,
        columns: Vec<String>,
        recent: RecentSamples,
    ) -> Result<Self, StreamError> {
        let (waiting, given_s, written) = (Vec::new(), Vec::new(), Instant::now());
        Ok(Self {
            _lock: StateLock::of(&path)?,
            path,
            experiment,
            columns,
            recent,
            waiting,
            given_s,
            written,
        })
    }

    /// The last samples as they came.
    pub(super) fn recent(&self) -> RecentSamples {
        self.recent.clone()
    }

    /// A new stretch begins, whose times may be earlier.
    pub(super) fn begin(&mut self) {
        self.waiting.clear();
        self.given_s.clear();
    }

    /// Hears that the answers of some samples were given: the last of these at `time_s`. Writes the state where it is time;
    /// the time that is acknowledged then.
    pub(super) fn given(
        &mut self,
        (trajectories, origin): (&[Trajectory], recording::Instant),
        last: impl FnOnce() -> (f64, u64, PastState),
        ends: bool,
    ) -> Result<Option<f64>, StreamError> {
        self.given_s.resize(trajectories.len(), f64::NEG_INFINITY);
        for (given_s, trajectory) in self.given_s.iter_mut().zip(trajectories) {
            *given_s = trajectory.time_s.last().copied().unwrap_or(*given_s);
        }
        // One waits at a time: the oldest that is not yet given for good, and the newest at the end.
        if self.waiting.is_empty() || ends {
            let ((time_s, given, past), samples) = (last(), self.recent.estimated());
            let experiment = self.experiment.clone();
            let (acknowledged, columns) = (time_s.to_bits(), self.columns.clone());
            let origin = origin.to_string();
            let state = StreamState { experiment, acknowledged, past, origin, columns, given, samples };
            self.waiting.push(state);
        }
        let until_s = self.given_s.iter().copied().fold(f64::INFINITY, f64::min);
        if !(ends || self.written.elapsed() >= EVERY) {
            return Ok(None);
        }
        let given = self.waiting.iter().rposition(|state| state.acknowledged_s() <= until_s);
        let Some(state) = given.map(|given| self.waiting.swap_remove(given)) else { return Ok(None) };
        self.waiting.clear();
        self.written = Instant::now();
        let written = state.write(&self.path);
        written
            .map_err(|e| StreamError::State { path: self.path.display().to_string(), why: e.to_string() })?;
        Ok(Some(state.acknowledged_s()))
    }
}
