//! Names with units, as the columns of the workbench have them.

/// Words that instruments write for units.
const WORDS: [(&str, &str); 12] = [
    ("second", "s"),
    ("seconds", "s"),
    ("sec", "s"),
    ("volt", "V"),
    ("volts", "V"),
    ("amp", "A"),
    ("amps", "A"),
    ("ampere", "A"),
    ("amperes", "A"),
    ("hertz", "Hz"),
    ("watt", "W"),
    ("kelvin", "K"),
];

/// Units that are written otherwise than a name can hold them.
const SIGNS: [(&str, &str); 10] = [
    ("°", "deg"),
    ("°/s", "deg_per_s"),
    ("deg/s", "deg_per_s"),
    ("rad/s", "rad_per_s"),
    ("°C", "degC"),
    ("Ω", "ohm"),
    ("Ohm", "ohm"),
    ("m/s", "m_per_s"),
    ("m/s²", "m_per_s2"),
    ("m/s^2", "m_per_s2"),
];

/// Units that take a prefix.
const BASES: [&str; 14] = ["s", "V", "A", "Hz", "W", "F", "ohm", "m", "N", "Pa", "rad", "K", "g", "C"];
/// Units that take none.
const WHOLE: [&str; 6] = ["min", "deg", "dps", "bar", "deg_per_s", "rad_per_s"];

/// The unit that a text is, as a name ends with it.
pub(super) fn unit(text: &str) -> Option<String> {
    let text: String = text.trim().chars().map(|c| if matches!(c, 'µ' | 'μ') { 'u' } else { c }).collect();
    let lower = text.to_lowercase();
    if let Some((_, unit)) = WORDS.iter().find(|(word, _)| *word == lower) {
        return Some((*unit).to_owned());
    }
    if let Some((_, unit)) = SIGNS.iter().find(|(sign, _)| *sign == text) {
        return Some((*unit).to_owned());
    }
    let prefixed = |prefix: &str| {
        text.strip_prefix(prefix).and_then(|rest| {
            let rest = if matches!(rest, "Ω" | "Ohm") { "ohm" } else { rest };
            BASES.contains(&rest).then(|| format!("{prefix}{rest}"))
        })
    };
    if WHOLE.contains(&text.as_str()) {
        return Some(text);
    }
    ["", "p", "n", "u", "m", "k", "M", "G"].into_iter().find_map(prefixed)
}

/// The unit of a cell in a line of units: in brackets, or a unit by itself.
pub(super) fn unit_cell(cell: &str) -> Option<String> {
    let cell = cell.trim();
    match in_brackets(cell) {
        Some(("", inside)) => Some(unit(inside).unwrap_or_else(|| word(inside))),
        Some(_) => None,
        None => unit(cell),
    }
}

/// What stands before brackets at the end and what in them.
fn in_brackets(text: &str) -> Option<(&str, &str)> {
    let (open, inside) = match text.strip_suffix(')') {
        Some(inside) => ('(', inside),
        None => ('[', text.strip_suffix(']')?),
    };
    let (before, inside) = inside.rsplit_once(open)?;
    (!inside.trim().is_empty()).then_some((before.trim(), inside))
}

/// The name and the unit of a name that holds both: `Time (ms)`, `CH1 [V]`, `C1 in V`.
fn parts(name: &str) -> Option<(&str, String)> {
    let name = name.trim();
    if let Some((before, inside)) = in_brackets(name) {
        return Some((before, unit(inside)?));
    }
    if let Some(inside) = name.strip_prefix("in ") {
        return Some(("", unit(inside)?));
    }
    let (before, inside) = name.rsplit_once(" in ")?;
    Some((before, unit(inside)?))
}

/// The name of a column whose unit is in the name or stands elsewhere; a name that says no unit stays as it is.
pub(super) fn column_name(name: &str, elsewhere: Option<&str>, index: usize) -> String {
    let (before, unit) = match (parts(name), elsewhere) {
        (Some((before, unit)), _) => (before, unit),
        (None, Some(unit)) => (name, unit.to_owned()),
        (None, None) => return name.trim().to_owned(),
    };
    let before = match before.trim() {
        "" if unit.ends_with('s') && unit.len() <= 2 => "time".to_owned(),
        "" => format!("column_{}", index + 1),
        before => word(before),
    };
    if before.ends_with(&format!("_{unit}")) { before } else { format!("{before}_{unit}") }
}

/// A text without spaces.
fn word(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join("_")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_as_instruments_write_them() {
        for (text, expected) in [
            ("s", "s"),
            ("second", "s"),
            ("Volt", "V"),
            ("VOLT", "V"),
            ("mV", "mV"),
            ("µs", "us"),
            ("μV", "uV"),
            ("kΩ", "kohm"),
            ("m/s^2", "m_per_s2"),
            ("°C", "degC"),
        ] {
            assert_eq!(unit(text).as_deref(), Some(expected), "{text}");
        }
        for text in ["", "1", "left", "ok", "V1", "x", "Time"] {
            assert_eq!(unit(text), None, "{text}");
        }
    }

    #[test]
    fn names_with_units() {
        for (name, elsewhere, expected) in [
            ("Time (ms)", None, "Time_ms"),
            ("CH1 [V]", None, "CH1_V"),
            ("CH1(V)", None, "CH1_V"),
            ("C1 in V", None, "C1_V"),
            ("in s", None, "time_s"),
            ("Channel A", Some("mV"), "Channel_A_mV"),
            ("cap_V", Some("V"), "cap_V"),
            ("cap_V", None, "cap_V"),
            ("CH1 (left)", None, "CH1 (left)"),
            ("drive in phase", None, "drive in phase"),
            ("", Some("V"), "column_3_V"),
        ] {
            assert_eq!(column_name(name, elsewhere, 2), expected, "{name}");
        }
    }
}
