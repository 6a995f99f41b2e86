//! A stream on a thread of its own, whose samples are pushed and whose lines are taken, for programs in other languages.

use super::{OpenedConnection, StreamError, StreamOutputs, StreamSummary, stream};
use crate::config::Experiment;
use crate::rigs::Workbench;
use std::io::{self, ErrorKind, Read, Write};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, TrySendError, channel, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

/// Pieces of samples that wait to be read.
const WAITING: usize = 64;
/// How long the estimating thread waits for samples before it looks whether it is to stop.
const PATIENCE: Duration = Duration::from_millis(50);

/// A stream that is being estimated. One thread may push samples while another takes lines.
pub struct PushedStream {
    samples: Mutex<Option<SyncSender<Vec<u8>>>>,
    lines: Mutex<Receiver<Vec<u8>>>,
    stop: Arc<AtomicBool>,
    thread: Mutex<Option<JoinHandle<Result<StreamSummary, StreamError>>>>,
}

/// What became of a piece of samples.
pub enum Push {
    /// It is read.
    Taken,
    /// 64 pieces wait; this is the piece.
    Full(Vec<u8>),
    /// Nobody takes any more.
    Ended,
}

impl PushedStream {
    /// Begins to estimate samples as the table `stream` of an experiment says; goes on from the file `state`, and leaves its own there.
    ///
    /// # Errors
    /// Where no thread can be started.
    pub fn begin(
        workbench: &'static Workbench,
        experiment: Experiment,
        state: Option<PathBuf>,
    ) -> io::Result<Self> {
        let (samples, arriving) = sync_channel(WAITING);
        let (told, lines) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let work = move || {
            let input = PushedSamples { arriving, rest: Vec::new(), taken: 0 };
            let connection = Box::new(OpenedConnection::new(input));
            let outputs =
                StreamOutputs { lines: Some(Box::new(TakenLines(told))), ..StreamOutputs::default() };
            let stop = || stopped.load(Ordering::Relaxed);
            stream(workbench, &experiment, connection, outputs, state.as_deref(), &stop)
        };
        let thread = Mutex::new(Some(Builder::new().name("kalmems stream".to_owned()).spawn(work)?));
        Ok(Self { samples: Mutex::new(Some(samples)), lines: Mutex::new(lines), stop, thread })
    }

    /// Hands bytes over as an instrument sends them, in pieces of any length.
    pub fn try_push(&self, piece: Vec<u8>) -> Push {
        let sent = locked(&self.samples).as_ref().map(|sender| sender.try_send(piece));
        match sent {
            Some(Ok(())) => Push::Taken,
            Some(Err(TrySendError::Full(piece))) => Push::Full(piece),
            Some(Err(TrySendError::Disconnected(_))) | None => Push::Ended,
        }
    }

    /// The same, which waits while 64 pieces wait; whether the piece is taken.
    pub fn push(&self, piece: Vec<u8>) -> bool {
        let sender = locked(&self.samples).clone();
        sender.is_some_and(|sender| sender.send(piece).is_ok())
    }

    /// Says that no more samples come.
    pub fn close(&self) {
        locked(&self.samples).take();
    }

    /// Stops the work after the present samples.
    pub fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
        self.close();
    }

    /// The bytes of the lines that are there, waiting for the first for so long.
    ///
    /// # Errors
    /// Where none came, and where none comes any more.
    pub fn lines(&self, wait: Duration) -> Result<Vec<u8>, RecvTimeoutError> {
        let lines = locked(&self.lines);
        let mut all = lines.recv_timeout(wait)?;
        lines.try_iter().for_each(|more| all.extend(more));
        Ok(all)
    }

    /// Waits for the end of the work: what came of it; `None` the second time, and an error within where it ended unexpectedly.
    pub fn end(&self) -> Option<std::thread::Result<Result<StreamSummary, StreamError>>> {
        let thread = locked(&self.thread).take();
        thread.map(JoinHandle::join)
    }
}

impl Drop for PushedStream {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Samples that are pushed, as something that is read.
struct PushedSamples {
    arriving: Receiver<Vec<u8>>,
    rest: Vec<u8>,
    taken: usize,
}

impl Read for PushedSamples {
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

/// Lines for who takes them.
struct TakenLines(Sender<Vec<u8>>);

impl Write for TakenLines {
    fn write(&mut self, lines: &[u8]) -> io::Result<usize> {
        self.0.send(lines.to_vec()).map_err(|_| io::Error::from(ErrorKind::BrokenPipe))?;
        Ok(lines.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
