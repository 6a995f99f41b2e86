//! Names of columns with units, from one line or from two.

use crate::name::{in_brackets, join, parts, with_unit};
use crate::unit_spellings::unit_ending;

/// The unit of a cell in a line of units: in brackets, or a unit by itself; empty where a mark says that there is none.
pub(super) fn unit_cell(cell: &str) -> Option<String> {
    let cell = cell.trim();
    match in_brackets(cell) {
        Some(("", inside)) => Some(unit_ending(inside).unwrap_or_else(|| inside.trim().to_owned())),
        None if cell == "-" => Some(String::new()),
        // A row of ones.
        None if cell == "1" => None,
        _ => unit_ending(cell),
    }
}

/// The name of a column whose unit is in the name or stands elsewhere; a name that says no unit stays as it is.
pub(super) fn column_name(name: &str, elsewhere: Option<&str>, index: usize) -> String {
    let name = name.trim();
    let elsewhere = elsewhere.filter(|unit| !unit.is_empty());
    match (parts(name), elsewhere) {
        (Some((before, unit)), _) => join(&unnamed(before, &unit, index), &unit),
        // An ending is one already.
        (None, Some(unit)) if unit.contains('_') => join(&unnamed(name, unit, index), unit),
        (None, Some(unit)) => with_unit(&unnamed(name, unit, index), unit),
        (None, None) => name.to_owned(),
    }
}

/// Whether a name says its unit in any way: `cap_V`, `cap (V)`.
pub(super) fn says_unit(name: &str) -> bool {
    let ending = || name.rsplit_once('_').is_some_and(|(_, word)| unit_ending(word).is_some());
    parts(name).is_some() || ending()
}

/// A name for what has none: what is in seconds is the time.
fn unnamed(name: &str, unit: &str, index: usize) -> String {
    match name.trim() {
        "" if unit.ends_with('s') && unit.len() <= 2 => "time".to_owned(),
        "" => format!("column_{}", index + 1),
        name => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_units() {
        for (name, elsewhere, expected) in [
            ("Time (ms)", None, "Time_ms"),
            ("CH1 [Volts]", None, "CH1_V"),
            ("Ucap / V", None, "Ucap_V"),
            ("in s", None, "time_s"),
            ("Channel A", Some("mV"), "Channel A_mV"),
            ("Channel A", None, "Channel A"),
            ("cap_V", Some("V"), "cap_V"),
            ("Accel X", Some("m_per_s2"), "Accel X_m_per_s2"),
            ("cap_V", None, "cap_V"),
            ("CH1 (left)", None, "CH1 (left)"),
            ("drive in phase", None, "drive in phase"),
            ("", Some("V"), "column_3_V"),
            ("index", Some(""), "index"),
        ] {
            assert_eq!(column_name(name, elsewhere, 2), expected, "{name}");
        }
    }

    #[test]
    fn cells_that_are_units() {
        for (cell, unit) in [("(V)", "V"), ("[Volts]", "V"), ("mV", "mV"), ("(counts)", "counts"), ("-", "")]
        {
            assert_eq!(unit_cell(cell).as_deref(), Some(unit), "{cell}");
        }
        for cell in ["CH1 (V)", "1.5", "1", "left", ""] {
            assert_eq!(unit_cell(cell), None, "{cell}");
        }
    }
}
