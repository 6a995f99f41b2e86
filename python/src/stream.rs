//! Estimates of samples while they arrive.

use crate::errors::{Raise, failed};
use kalmems::rigs::published;
use kalmems::stream::{OpenedConnection, StreamError, StreamOutputs, StreamSummary, stream as estimated};
use pyo3::prelude::*;
use std::io::{self, ErrorKind, Read, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Pieces of samples that wait to be read; who feeds more waits.
const WAITING: usize = 64;

/// How long Python is not asked whether it was interrupted.
const PATIENCE: Duration = Duration::from_millis(50);

type Ended = Result<StreamSummary, StreamError>;

/// A stream that is being estimated on a thread of its own.
#[pyclass(frozen, module = "kalmems._kalmems")]
pub struct Stream {
    samples: Mutex<Option<SyncSender<Vec<u8>>>>,
    lines: Mutex<Receiver<Vec<u8>>>,
    stop: Arc<AtomicBool>,
    thread: Mutex<Option<JoinHandle<Ended>>>,
}

#[pymethods]
impl Stream {
    /// Begins to estimate samples as the table `stream` of an experiment says.
    #[new]
    #[pyo3(signature = (text, path, state=None))]
    fn new(py: Python<'_>, text: &str, path: PathBuf, state: Option<PathBuf>) -> PyResult<Self> {
        let experiment = published().parse(text, &path).map_err(|error| error.raise(py))?;
        let (samples, arriving) = sync_channel(WAITING);
        let (told, lines) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let work = move || {
            let connection = Box::new(OpenedConnection::new(Fed { arriving, rest: Vec::new(), taken: 0 }));
            let outputs = StreamOutputs { lines: Some(Box::new(Told(told))), ..StreamOutputs::default() };
            let stop = || stopped.load(Ordering::Relaxed);
            estimated(published(), &experiment, connection, outputs, state.as_deref(), &stop)
        };
        let thread = std::thread::Builder::new().name("stream".to_owned()).spawn(work)?;
        Ok(Self {
            samples: Mutex::new(Some(samples)),
            lines: Mutex::new(lines),
            stop,
            thread: Mutex::new(Some(thread)),
        })
    }

    /// Hands samples over as they come, in whatever pieces; waits where too many wait already. `False` where nobody takes them any more.
    fn feed(&self, py: Python<'_>, samples: Vec<u8>) -> PyResult<bool> {
        let mut samples = samples;
        loop {
            let sent = match &*locked(&self.samples) {
                Some(sender) => sender.try_send(samples),
                None => return Ok(false),
            };
            match sent {
                Ok(()) => return Ok(true),
                Err(TrySendError::Disconnected(_)) => return Ok(false),
                Err(TrySendError::Full(back)) => samples = back,
            }
            py.detach(|| std::thread::sleep(Duration::from_millis(1)));
            py.check_signals()?;
        }
    }

    /// Says that no more samples come.
    fn close(&self) {
        locked(&self.samples).take();
    }

    /// Stops the work where it is.
    fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
        self.close();
    }

    /// The next lines; `None` where `wait` says not to wait and none are there. Nothing at the end of the stream.
    fn lines(&self, py: Python<'_>, wait: bool) -> PyResult<Option<Vec<u8>>> {
        loop {
            let received = py.detach(|| {
                let lines = locked(&self.lines);
                let first = lines.recv_timeout(if wait { PATIENCE } else { Duration::ZERO })?;
                // Whatever else is there already.
                Ok(lines.try_iter().fold(first, |mut all, more| {
                    all.extend(more);
                    all
                }))
            });
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
        let Some(thread) = locked(&self.thread).take() else { return Ok(None) };
        let ended = py.detach(|| thread.join());
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

impl Drop for Stream {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn locked<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Samples that Python hands over, as something that is read.
struct Fed {
    arriving: Receiver<Vec<u8>>,
    rest: Vec<u8>,
    taken: usize,
}

impl Read for Fed {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.taken == self.rest.len() {
            match self.arriving.recv_timeout(PATIENCE) {
                Ok(samples) => (self.rest, self.taken) = (samples, 0),
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
                Err(RecvTimeoutError::Timeout) => return Err(ErrorKind::WouldBlock.into()),
            }
        }
        let left = self.rest.get(self.taken..).unwrap_or_default();
        let count = left.len().min(buffer.len());
        buffer[..count].copy_from_slice(&left[..count]);
        self.taken += count;
        Ok(count)
    }
}

/// Lines for Python.
struct Told(std::sync::mpsc::Sender<Vec<u8>>);

impl Write for Told {
    fn write(&mut self, lines: &[u8]) -> io::Result<usize> {
        self.0.send(lines.to_vec()).map_err(|_| io::Error::from(ErrorKind::BrokenPipe))?;
        Ok(lines.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
