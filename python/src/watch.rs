//! How far long work is, and how it is stopped from Python.

use kalmems::progress::Progress;
use pyo3::prelude::*;
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// How long Python is not asked whether it was interrupted.
const PATIENCE: Duration = Duration::from_millis(50);

/// Asks Python now and then whether a signal came, and tells a function how far the work is.
pub struct Watch {
    heard: Option<Py<PyAny>>,
    state: Mutex<State>,
}

struct State {
    asked: Instant,
    what: String,
    total: u64,
    error: Option<PyErr>,
}

impl Watch {
    /// With a function of `(what, done, total)`, or none.
    pub fn new(heard: Option<Py<PyAny>>) -> Self {
        let state = State { asked: Instant::now(), what: String::new(), total: 0, error: None };
        Self { heard, state: Mutex::new(state) }
    }

    /// What stopped the work: what Python raised.
    pub fn error(&self) -> Option<PyErr> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner).error.take()
    }

    /// Whether Python wants the work to stop.
    pub fn stops(&self, done: Option<u64>) -> bool {
        let (what, total) = {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            if state.error.is_some() {
                return true;
            }
            if state.asked.elapsed() < PATIENCE {
                return false;
            }
            state.asked = Instant::now();
            (state.what.clone(), state.total)
        };
        let asked = Python::attach(|py| {
            py.check_signals()?;
            match (&self.heard, done) {
                (Some(heard), Some(done)) => heard.call1(py, (what, done, total)).map(|_| ()),
                _ => Ok(()),
            }
        });
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.asked = Instant::now();
        state.error = asked.err();
        state.error.is_some()
    }
}

impl Progress for Watch {
    fn begin(&self, what: &str, total: u64) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        what.clone_into(&mut state.what);
        state.total = total;
    }

    fn reached(&self, done: u64) -> ControlFlow<()> {
        if self.stops(Some(done)) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}
