//! The `kalmems` command: arguments, progress and exit codes. What it does is in the library `kalmems`.
//!
//! Exit codes: 0 success; 1 the data or the configuration is wrong, or no filter gave an estimate; 2 usage; 3 under
//! `--strict`, an estimate failed its consistency test; 4 the connection that samples came over broke; 130 interrupted.

// Both panic where nobody reads: `print` and `tell!` are for that.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod args;
mod commands;
mod interrupt;
mod progress;
mod target;
mod tell;

use args::{Arguments, Command};
use clap::Parser;
use kalmems::recording::panic_is_caught;
use std::process::ExitCode;
use tell::tell;

/// How a command ended, other than well.
enum Ending {
    /// Something is wrong; in words.
    Wrong(String),
    /// Stopped by the user.
    Interrupted,
    /// Stopped by the user, who can go on from there; in words.
    Paused(String),
    /// An estimate failed its consistency test, and the user wanted to know.
    NotConsistent(String),
    /// With this exit code, for a reason that was told.
    Told(u8),
}

fn main() -> ExitCode {
    tell_of_unexpected_panics_alone();
    let arguments = Arguments::parse();
    interrupt::listen();
    let ending = match &arguments.command {
        Command::Calibrate(arguments) => commands::calibrate::run(arguments),
        Command::Estimate(arguments) => commands::estimate::run(arguments),
        Command::Export(arguments) => commands::export::run(arguments),
        Command::Image(arguments) => commands::image::run(arguments),
        Command::Identify(arguments) => commands::identify::run(arguments),
        Command::Inspect(arguments) => commands::inspect::run(arguments),
        #[cfg(feature = "papers")]
        Command::Reproduce(arguments) => commands::reproduce::run(arguments),
        Command::Simulate(arguments) => commands::simulate::run(arguments),
        Command::Merge(arguments) => commands::study::merge(arguments),
        Command::Schema(arguments) => commands::schema::run(arguments),
        Command::Spectrum(arguments) => commands::spectrum::run(arguments),
        Command::Stream(arguments) => commands::stream::run(arguments),
        Command::Study(arguments) => commands::study::run(arguments),
    };
    let (message, code) = match ending {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Ending::Told(code)) => return ExitCode::from(code),
        Err(Ending::Wrong(message)) => (message, 1),
        Err(Ending::NotConsistent(message)) => (message, 3),
        Err(Ending::Paused(message)) => (message, interrupt::EXIT_CODE),
        Err(Ending::Interrupted) => ("interrupted; nothing was written".to_owned(), interrupt::EXIT_CODE),
    };
    tell!("error: {message}");
    ExitCode::from(code)
}

/// A panic that a damaged file causes in a reader's library is told as the error that it becomes.
fn tell_of_unexpected_panics_alone() {
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic_is_caught() {
            tell(panic);
        }
    }));
}

/// Prints to standard output. A reader that closes the pipe early has what it wanted.
fn print(text: &str) -> Result<(), Ending> {
    use std::io::{ErrorKind, Write};
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            Err(Ending::Wrong(format!("cannot write to standard output: {e}")))
        }
        _ => Ok(()),
    }
}
