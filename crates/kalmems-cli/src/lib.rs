//! The `kalmems` command as a library: arguments, progress and exit codes, for a program that knows other devices beside the
//! published ones. What it does is in the library `kalmems`.
//!
//! ```no_run
//! // With a rig of one's own: `published().clone().with(MyRig)`.
//! kalmems_cli::run(kalmems::rigs::published());
//! ```
//!
//! Exit codes: 0 success; 1 the data or the configuration is wrong, or no filter gave an estimate; 2 usage; 3 under
//! `--strict`, an estimate failed its consistency test; 4 the connection that samples came over broke; 5 some recordings of a batch could
//! not be estimated; 6 no filter had an estimate when a stream ended; 130 interrupted; 141 nobody reads a stream's
//! lines any more.

// Both panic where nobody reads: `print` and `tell!` are for that.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod args;
mod commands;
mod experiment;
mod interrupt;
mod progress;
mod target;
mod tell;
mod terminal;

use args::{Command, CommandLine};
use clap::Parser;
use kalmems::recording::panic_is_caught;
use kalmems::rigs::Workbench;
use std::ffi::OsString;
use std::process::ExitCode;

/// How a command ended, other than well.
#[derive(Debug)]
enum CommandEnding {
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

/// Does what the arguments of the program say with the devices of this workbench, and gives the program's exit code.
pub fn run(workbench: &Workbench) -> ExitCode {
    ExitCode::from(run_with(workbench, std::env::args_os()))
}

/// The same with these arguments, of which the first is the name of the program, in a process that is the command's alone: it ends the process
/// where an interruption is not followed soon. The exit code.
pub fn run_with(workbench: &Workbench, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    tell_of_unexpected_panics_alone();
    run_arguments(workbench, arguments.into_iter().collect(), true)
}

/// The same in a process that handles interruptions itself and goes on afterwards: no handler of signals is set, and
/// [`interrupt_command`] asks the command to end. One command at a time.
pub fn run_within(workbench: &Workbench, arguments: impl IntoIterator<Item = OsString>) -> u8 {
    interrupt::forget();
    run_arguments(workbench, arguments.into_iter().collect(), false)
}

/// Asks the command that [`run_within`] runs on another thread to end; it returns soon after.
pub fn interrupt_command() {
    interrupt::request();
}

/// Does what the arguments say, in a process that is the command's alone or not.
fn run_arguments(workbench: &Workbench, arguments: Vec<OsString>, owns_process: bool) -> u8 {
    let commands_terminal =
        arguments.iter().any(|argument| argument.to_string_lossy().contains(tell::is_command));
    let arguments = match CommandLine::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(told) if commands_terminal => {
            tell::line(format_args!("{}", told.render().to_string().trim_end()));
            return u8::try_from(told.exit_code()).unwrap_or(2);
        }
        Err(told) => {
            // Of a usage error, or help that was asked for. Where nobody reads it, it is lost.
            let _ = told.print();
            return u8::try_from(told.exit_code()).unwrap_or(2);
        }
    };
    tell::set_quiet(arguments.quiet);
    if owns_process {
        interrupt::listen();
    }
    let ending = match &arguments.command {
        #[cfg(feature = "parquet-results")]
        Command::Batch(arguments) => commands::batch::run(workbench, arguments),
        Command::Calibrate(arguments) => commands::calibrate::run(arguments),
        Command::Compare(arguments) => commands::compare::run(arguments),
        Command::Completions(arguments) => commands::completions::run(arguments),
        Command::Diagnose(arguments) => commands::diagnose::run(workbench, arguments),
        Command::Expand(arguments) => commands::expand::run(workbench, arguments),
        Command::Estimate(arguments) => commands::estimate::run(workbench, arguments),
        Command::Export(arguments) => commands::export::run(workbench, arguments),
        Command::Help(arguments) => commands::help::run(workbench, arguments),
        Command::Image(arguments) => commands::image::run(arguments),
        Command::Identify(arguments) => commands::identify::run(workbench, arguments),
        Command::Inspect(arguments) => commands::inspect::run(workbench, arguments),
        Command::Man(arguments) => commands::man::run(arguments),
        Command::New(arguments) => commands::new::run(workbench, arguments),
        #[cfg(feature = "papers")]
        Command::Reproduce(arguments) => commands::reproduce::run(arguments),
        Command::Simulate(arguments) => commands::simulate::run(workbench, arguments),
        Command::Merge(arguments) => commands::study::merge(workbench, arguments),
        Command::Schema(arguments) => commands::schema::run(workbench, arguments),
        Command::Spectrum(arguments) => commands::spectrum::run(workbench, arguments),
        Command::Stream(arguments) => commands::stream::run(workbench, arguments),
        Command::Study(arguments) => commands::study::run(workbench, arguments),
        #[cfg(not(target_family = "wasm"))]
        Command::View(arguments) => commands::view::run(arguments),
    };
    let (message, code) = match ending {
        Ok(()) => return 0,
        Err(CommandEnding::Told(code)) => return code,
        Err(CommandEnding::Wrong(message)) => (message, 1),
        Err(CommandEnding::NotConsistent(message)) => (message, 3),
        Err(CommandEnding::Paused(message)) => (message, interrupt::EXIT_CODE),
        Err(CommandEnding::Interrupted) => {
            ("interrupted; nothing was written".to_owned(), interrupt::EXIT_CODE)
        }
    };
    tell::line(format_args!("error: {message}"));
    code
}

/// From now on a panic that a damaged file causes in a reader's library is told as the error that it becomes, and not twice.
pub fn tell_of_unexpected_panics_alone() {
    let tell = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !panic_is_caught() {
            tell(panic);
        }
    }));
}

/// Prints a result as JSON, with a line break at its end.
fn print_json(result: &impl serde::Serialize) -> Result<(), CommandEnding> {
    let mut json = serde_json::to_string_pretty(result).map_err(|e| CommandEnding::Wrong(e.to_string()))?;
    // They stand within its texts alone, where each has an escape of its own.
    while let Some(letter) = json.chars().find(|letter| tell::is_command(*letter)) {
        json = json.replace(letter, &format!("\\u{:04x}", u32::from(letter)));
    }
    print(&(json + "\n"))
}

/// Prints a result as JSON or as text.
fn print_result(
    as_json: bool,
    result: &impl serde::Serialize,
    text: impl FnOnce() -> String,
) -> Result<(), CommandEnding> {
    if as_json { print_json(result) } else { print(&text()) }
}

/// Prints to standard output. A reader that closes the pipe early has what it wanted.
fn print(text: &str) -> Result<(), CommandEnding> {
    use std::io::{ErrorKind, Write};
    let mut out = std::io::stdout().lock();
    let shown = tell::visible(text);
    match out.write_all(terminal::coloured(&shown).as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => {
            Err(CommandEnding::Wrong(format!("cannot write to standard output: {e}")))
        }
        _ => Ok(()),
    }
}
