//! `kalmems man`.

use super::help::command_of;
use crate::args::ManArguments;
use crate::{CommandEnding, print};
use clap_mangen::Man;

pub fn run(arguments: &ManArguments) -> Result<(), CommandEnding> {
    let command = command_of(&arguments.command).ok_or_else(|| {
        let name = arguments.command.join(" ");
        CommandEnding::Wrong(format!(
            "found the command `{name}`, which is not known; `kalmems --help` lists the commands"
        ))
    })?;
    let mut page = Vec::new();
    Man::new(command).render(&mut page).map_err(|e| CommandEnding::Wrong(format!("no manual page: {e}")))?;
    print(&String::from_utf8_lossy(&page))
}
