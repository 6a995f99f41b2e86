//! `kalmems man`.

use super::help::command_of;
use crate::args::ManArguments;
use crate::{Ending, print};
use clap_mangen::Man;

pub fn run(arguments: &ManArguments) -> Result<(), Ending> {
    let command = command_of(&arguments.command).ok_or_else(|| {
        let name = arguments.command.join(" ");
        Ending::Wrong(format!(
            "found the command `{name}`, which is not known; `kalmems --help` lists the commands"
        ))
    })?;
    let mut page = Vec::new();
    Man::new(command).render(&mut page).map_err(|e| Ending::Wrong(format!("no manual page: {e}")))?;
    print(&String::from_utf8_lossy(&page))
}
