//! A device of a rig, written out as differential equations.

use std::fmt::Write as _;

/// The table `[device.equations]` that says what a rig's device table says, for a reader to change.
///
/// States, inputs, measurements and the parameters that filters have as states keep the names that they have in the experiment.
#[derive(Clone, Debug, Default)]
pub struct Expansion {
    /// Its tables as TOML, each with its header.
    pub text: String,
    /// Keys of a process noise, and the states whose rates it is the noise of.
    pub noise: Vec<(&'static str, &'static str)>,
    /// What filters of the rig call the signals that correct them, and the measurements of the equations that they are.
    pub channels: Vec<(String, String)>,
    /// The table `[estimate.events]`: where the times of its events come from.
    pub events: toml::Table,
    /// Of each filter of the experiment, how it uses the events.
    pub filter_events: Vec<toml::Table>,
    /// What the rig has and the equations have not, in sentences.
    pub notes: Vec<String>,
}

impl Expansion {
    /// Adds a table with texts by their names.
    pub fn table(&mut self, name: &str, entries: &[(&str, &str)]) {
        self.begin(name);
        for (name, text) in entries {
            // Writing to a string cannot fail.
            let _ = writeln!(self.text, "{} = {}", quoted(name), toml::Value::from(*text));
        }
    }

    /// Adds a table with numbers by their names, each in SI with its unit.
    pub fn numbers(&mut self, name: &str, entries: &[(&str, f64, &str)]) {
        self.begin(name);
        for (name, value, unit) in entries {
            let text = format!("{value:?} {unit}");
            let _ = writeln!(self.text, "{} = {}", quoted(name), toml::Value::from(text.trim_end()));
        }
    }

    fn begin(&mut self, name: &str) {
        let _ = writeln!(self.text, "\n[device.equations.{name}]");
    }
}

/// A key as TOML has it: in quotes, where it is no word.
fn quoted(name: &str) -> String {
    let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
    if name.chars().all(is_word) { name.to_owned() } else { format!("\"{name}\"") }
}
