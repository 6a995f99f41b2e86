//! `kalmems help`.

use crate::args::{CommandLine, HelpArguments};
use crate::{CommandEnding, print, print_json};
use clap::{Command, CommandFactory};
use kalmems::draft::names_of;
use kalmems::rigs::{Rig, Workbench};
use kalmems::topics::{TOPICS, Topic, topic};

pub fn run(workbench: &Workbench, arguments: &HelpArguments) -> Result<(), CommandEnding> {
    let words: Vec<&str> = arguments.topic.iter().map(String::as_str).collect();
    match words[..] {
        ["device", name] => of_device(workbench, name, arguments.json),
        _ if arguments.json => {
            let why = "`--json` of `help` is for the names of a device, such as `kalmems help device shared_scanner --json`";
            Err(CommandEnding::Wrong(why.to_owned()))
        }
        ["topics"] => print(&topics()),
        ["device" | "devices"] => {
            let rigs = workbench.rigs().filter(|rig| rig.template().is_some());
            let names: Vec<&str> = rigs.map(Rig::name).collect();
            print(&format!("Devices, for `kalmems help device NAME`: {}\n", names.join(", ")))
        }
        _ => {
            if let [name] = words[..]
                && let Some(topic) = topic(name)
            {
                return print(topic.text);
            }
            if let Some(mut command) = command_of(&arguments.topic) {
                return print(&command.render_long_help().to_string());
            }
            let found = words.join(" ");
            let all = topics();
            let why = format!("found the topic `{found}`, which is no command and none of these:\n{all}");
            Err(CommandEnding::Wrong(why))
        }
    }
}

/// The topics, a line each.
fn topics() -> String {
    let line = |topic: &Topic| format!("  {:26}  {}\n", topic.command(), topic.what);
    let topics: String = TOPICS.iter().map(line).collect();
    format!(
        "{topics}  kalmems help device NAME    channels, states, parameters and methods of a device\n  \
         kalmems help COMMAND        what a command does, and its options\n"
    )
}

fn of_device(workbench: &Workbench, name: &str, json: bool) -> Result<(), CommandEnding> {
    let names = names_of(workbench, name).map_err(|e| CommandEnding::Wrong(e.to_string()))?;
    if json { print_json(&names) } else { print(&names.to_string()) }
}

/// The command with this path of names, such as `calibrate gyro`, named in its help as it is called.
pub fn command_of(path: &[String]) -> Option<Command> {
    let mut command = CommandLine::command();
    command.build();
    for name in path {
        command = command.find_subcommand(name)?.clone();
    }
    Some(command)
}
