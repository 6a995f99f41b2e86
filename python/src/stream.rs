//! Estimates of samples while they arrive.

use crate::errors::{Raise, failed};
use kalmems::rigs::published;
use kalmems::stream::{Push, PushedStream, StreamError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

/// How long Python is not asked whether it was interrupted.
const PATIENCE: Duration = Duration::from_millis(50);

/// A stream that is being estimated on a thread of its own.
#[pyclass(frozen, module = "kalmems._kalmems")]
pub struct Stream(PushedStream);

#[pymethods]
impl Stream {
    /// Begins to estimate samples as the table `stream` of an experiment says.
    #[new]
    #[pyo3(signature = (text, path, state=None))]
    fn new(py: Python<'_>, text: &str, path: PathBuf, state: Option<PathBuf>) -> PyResult<Self> {
        let experiment = published().parse(text, &path).map_err(|error| error.raise(py))?;
        Ok(Self(PushedStream::begin(published(), experiment, state)?))
    }

    /// Hands samples over as they come, in whatever pieces; waits where too many wait already. `False` where nobody takes them any more.
    fn feed(&self, py: Python<'_>, samples: Vec<u8>) -> PyResult<bool> {
        let mut samples = samples;
        loop {
            match self.0.try_push(samples) {
                Push::Taken => return Ok(true),
                Push::Ended => return Ok(false),
                Push::Full(back) => samples = back,
            }
            py.detach(|| std::thread::sleep(Duration::from_millis(1)));
            py.check_signals()?;
        }
    }

    /// Says that no more samples come.
    fn close(&self) {
        self.0.close();
    }

    /// Stops the work where it is.
    fn stop(&self) {
        self.0.stop();
    }

    /// The next lines; `None` where `wait` says not to wait and none are there. Nothing at the end of the stream.
    fn lines(&self, py: Python<'_>, wait: bool) -> PyResult<Option<Vec<u8>>> {
        loop {
            let received = py.detach(|| self.0.lines(if wait { PATIENCE } else { Duration::ZERO }));
            match received {
                Ok(lines) => return Ok(Some(lines)),
                Err(RecvTimeoutError::Disconnected) => return Ok(Some(Vec::new())),
                Err(RecvTimeoutError::Timeout) if !wait => return Ok(None),
                Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            }
        }
    }

    /// What came of the stream, once it has ended, as JSON.
    fn summary(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let Some(ended) = py.detach(|| self.0.end()) else { return Ok(None) };
        match ended {
            Ok(Ok(summary)) => serde_json::to_string(&summary).map(Some).map_err(|error| failed(py, &error)),
            Ok(Err(StreamError::Config(error))) => Err(error.raise(py)),
            Ok(Err(StreamError::Read(error))) => Err(error.raise(py)),
            Ok(Err(StreamError::Estimate(error))) => Err(error.raise(py)),
            Ok(Err(error)) => Err(failed(py, &error)),
            Err(_) => Err(failed(py, &"the stream ended unexpectedly")),
        }
    }
}
