//! Long work: how far it is, and how Python stops it.

use kalmems::progress::Progress;
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How long Python is not asked whether it was interrupted.
pub const PATIENCE: Duration = Duration::from_millis(25);

/// How long work has to end that was stopped. What does not look in time goes on behind the scenes until it does, and what it gives is dropped.
const GRACE: Duration = Duration::from_millis(75);

/// As much as the main thread of a program has.
pub const STACK: usize = 8 << 20;

/// How far work is, and whether it is to stop.
#[derive(Default)]
pub struct Watch {
    is_stopped: AtomicBool,
    reached: Mutex<Reached>,
}

#[derive(Clone, Default, PartialEq)]
struct Reached {
    what: String,
    done: u64,
    total: u64,
}

impl Watch {
    /// Whether the work is to stop. Work that changes files asks before it puts them in their place.
    pub fn is_stopped(&self) -> bool {
        self.is_stopped.load(Ordering::Relaxed)
    }

    fn reached(&self) -> MutexGuard<'_, Reached> {
        self.reached.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Watch {
    fn begin(&self, what: &str, total: u64) {
        *self.reached() = Reached { what: what.to_owned(), done: 0, total };
    }

    fn reached(&self, done: u64) -> ControlFlow<()> {
        Watch::reached(self).done = done;
        if self.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Does work on a thread of its own. Meanwhile Python's handlers of signals run on this one, and `heard` is called on it with
/// `(what, done, total)`; what either raises stops the work, and is raised.
pub fn done<T: Send + 'static>(
    py: Python<'_>,
    heard: Option<Py<PyAny>>,
    work: impl FnOnce(&Watch) -> T + Send + 'static,
) -> PyResult<T> {
    let watch = Arc::new(Watch::default());
    let (send, found) = sync_channel(1);
    let own = Arc::clone(&watch);
    let work = move || {
        // Nobody takes it where the work was given up.
        let _ = send.send(work(&own));
    };
    let thread = thread::Builder::new().name("kalmems".to_owned()).stack_size(STACK).spawn(work)?;
    py.detach(move || {
        let mut told = Reached::default();
        loop {
            match found.recv_timeout(PATIENCE) {
                Ok(found) => return Ok(found),
                Err(RecvTimeoutError::Timeout) => {}
                // It has panicked.
                Err(RecvTimeoutError::Disconnected) => match thread.join() {
                    Err(panic) => resume_unwind(panic),
                    Ok(()) => unreachable!("a thread that ends gives what it found"),
                },
            }
            let reached = watch.reached().clone();
            let asked = Python::attach(|py| {
                py.check_signals()?;
                match &heard {
                    Some(heard) if reached != told => {
                        let Reached { what, done, total } = &reached;
                        heard.call1(py, (what, done, total)).map(|_| ())
                    }
                    _ => Ok(()),
                }
            });
            told = reached;
            if let Err(error) = asked {
                watch.is_stopped.store(true, Ordering::Relaxed);
                let _ = found.recv_timeout(GRACE);
                return Err(error);
            }
        }
    })
}

/// Asks Python now and then, on the thread of the work itself, whether a signal came.
pub struct Signals(Mutex<Asked>);

struct Asked {
    at: Instant,
    error: Option<PyErr>,
}

impl Signals {
    /// Asks for the first time after a while.
    pub fn new() -> Self {
        Self(Mutex::new(Asked { at: Instant::now(), error: None }))
    }

    /// What stopped the work: what Python raised.
    pub fn error(&self) -> Option<PyErr> {
        self.asked().error.take()
    }

    /// Whether Python wants the work to stop.
    pub fn stop(&self) -> bool {
        let mut asked = self.asked();
        if asked.error.is_none() && asked.at.elapsed() >= PATIENCE {
            asked.error = Python::attach(|py| py.check_signals()).err();
            asked.at = Instant::now();
        }
        asked.error.is_some()
    }

    fn asked(&self) -> MutexGuard<'_, Asked> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
