//! The command `kalmems`.

use crate::watch::{PATIENCE, STACK};
use kalmems::rigs::published;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;

/// Does what these arguments say, of which the first is the name of the program; its exit code.
///
/// With `owns_process` the process is the command's alone, which then handles interruptions itself. Without it the handlers of Python stay, and what
/// they raise is raised once the command has ended.
#[pyfunction]
#[pyo3(signature = (arguments, owns_process=false))]
pub fn run_command(py: Python<'_>, arguments: Vec<OsString>, owns_process: bool) -> PyResult<u8> {
    if owns_process {
        return Ok(py.detach(|| kalmems_cli::run_with(published(), arguments)));
    }
    py.detach(|| {
        thread::scope(|scope| {
            let (ended, end) = channel();
            let work = move || {
                let code = kalmems_cli::run_within(published(), arguments);
                // Nobody waits where the main thread was ended.
                let _ = ended.send(());
                code
            };
            let command = thread::Builder::new().name("kalmems".to_owned()).stack_size(STACK);
            let command = command.spawn_scoped(scope, work)?;
            let mut raised = None;
            while let Err(RecvTimeoutError::Timeout) = end.recv_timeout(PATIENCE) {
                if raised.is_none()
                    && let Err(error) = Python::attach(|py| py.check_signals())
                {
                    raised = Some(error);
                    kalmems_cli::interrupt_command();
                }
            }
            let code = command.join();
            match raised {
                Some(error) => Err(error),
                None => code.map_err(|_| PyRuntimeError::new_err("the command ended unexpectedly")),
            }
        })
    })
}
