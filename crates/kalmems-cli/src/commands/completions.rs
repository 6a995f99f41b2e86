//! `kalmems completions`.

use crate::args::{Arguments, CompletionsArguments};
use crate::{Ending, print};
use clap::CommandFactory;

pub fn run(arguments: &CompletionsArguments) -> Result<(), Ending> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut Arguments::command(), "kalmems", &mut script);
    print(&String::from_utf8_lossy(&script))
}
