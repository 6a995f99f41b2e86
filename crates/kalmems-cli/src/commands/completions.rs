//! `kalmems completions`.

use crate::args::{CommandLine, CompletionsArguments};
use crate::{CommandEnding, print};
use clap::CommandFactory;

pub fn run(arguments: &CompletionsArguments) -> Result<(), CommandEnding> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut CommandLine::command(), "kalmems", &mut script);
    print(&String::from_utf8_lossy(&script))
}
