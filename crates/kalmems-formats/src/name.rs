//! Names of columns with their units.

use crate::stated_clock::names_a_time;
use crate::unit_spellings::unit_ending;

/// Names with units for so many columns that have none, as the list that `columns` in the experiment file may be.
pub fn example_names(columns: usize) -> String {
    const MOST: usize = 32;
    let channels = (1..columns.max(2)).map(|channel| format!("\"ch{channel}_V\""));
    let time = (columns > 1).then(|| "\"time_s\"".to_owned());
    let mut names: Vec<String> = time.into_iter().chain(channels).take(MOST).collect();
    if columns > MOST {
        names.push("…".to_owned());
    }
    format!("[{}]", names.join(", "))
}

/// The name of a column whose unit a format keeps elsewhere, in an attribute or in brackets: `cap_V` for `cap` and
/// `Volts`. A name that ends with the unit already stays as it is. A word that is no known unit is joined as it stands,
/// so that a message can name it; a text of several words, such as `From Custom Scale`, is none.
pub(crate) fn with_unit(name: &str, unit: &str) -> String {
    let unit = unit.trim();
    // An attribute may hold `[V]`.
    let unit =
        in_brackets(unit).filter(|(before, _)| before.is_empty()).map_or(unit, |(_, inside)| inside.trim());
    match unit_ending(unit) {
        Some(ending) => join(name, &ending),
        None if unit.is_empty() || !unit.chars().all(char::is_alphabetic) => one_line(name),
        None => join(name, unit),
    }
}

/// A name and the ending that is its unit.
pub(crate) fn join(name: &str, ending: &str) -> String {
    let name = one_line(name);
    // As an ending of what is no time these are words of a name, such as a minimum: the unit is spelt out.
    let ending = match ending {
        "min" if !names_a_time(&name) => "minutes",
        "h" if !names_a_time(&name) => "hours",
        other => other,
    };
    if name.strip_suffix(ending).is_some_and(|rest| rest.ends_with('_')) {
        return name;
    }
    // The longest ending that is a unit counts, so that `Channel_A` in V must not become `Channel_A_V`, ampere-volt.
    match name.rsplit_once('_') {
        Some((before, last)) if continues_a_unit(last) => format!("{before} {last}_{ending}"),
        _ => format!("{name}_{ending}"),
    }
}

/// Whether a word at the end of a name would be taken for a part of the unit behind it.
fn continues_a_unit(word: &str) -> bool {
    let symbol = word.trim_end_matches(|c: char| c.is_ascii_digit());
    word == "per" || !symbol.is_empty() && unit_ending(symbol).is_some()
}

/// The name and the unit of a name that holds both: `Time (ms)`, `CH1 [V]`, `Ucap / V`, `Time, s`, `C1 in V`. `None`
/// where it says none in one of these ways: `Channel A` is not in ampere.
pub(crate) fn parts(name: &str) -> Option<(&str, String)> {
    let name = name.trim();
    if let Some((before, inside)) = in_brackets(name) {
        let before = before.trim_end_matches(['/', ',', '_']).trim_end();
        // The `1` of `q[1]` and `CH (1)` is an index.
        let unit = unit_ending(inside).filter(|unit| unit != "1")?;
        return Some((before.strip_suffix(" in").unwrap_or(before), unit));
    }
    if let Some(inside) = name.strip_prefix("in ") {
        return Some(("", unit_ending(inside)?));
    }
    // As Rigol writes: `CH1V`.
    if let Some(channel) = name.strip_suffix('V')
        && channel.strip_prefix("CH").is_some_and(|digits| digits.parse::<u8>().is_ok())
    {
        return Some((channel, "V".to_owned()));
    }
    if let Some((before, after)) = name.rsplit_once(" in ").or_else(|| name.rsplit_once(", ")) {
        return Some((before, unit_ending(after)?));
    }
    let (before, after) = name.rsplit_once('/')?;
    let unit = unit_ending(after)?;
    // `rate deg/s` is a rate in deg/s and not an angle in s; of `V/s` nobody knows.
    if let Some((words, last)) = before.rsplit_once(char::is_whitespace)
        && !before.ends_with(char::is_whitespace)
        && let Some(quotient) = unit_ending(&format!("{last}/{after}"))
    {
        return Some((words, quotient));
    }
    let quotient = unit_ending(before).is_some() && !name.contains(char::is_whitespace);
    (!before.trim().is_empty() && !quotient).then_some((before, unit))
}

/// What stands before brackets at the end and what in them.
pub(crate) fn in_brackets(text: &str) -> Option<(&str, &str)> {
    let (open, close, inside) = [('(', ')'), ('[', ']'), ('{', '}')]
        .into_iter()
        .find_map(|(open, close)| Some((open, close, text.strip_suffix(close)?)))?;
    // The bracket that this one closes: `a (m/(s s))`.
    let mut depth = 0;
    let begin = inside.char_indices().rev().find(|(_, c)| {
        depth += i32::from(*c == close) - i32::from(*c == open);
        depth < 0
    });
    let (before, inside) = inside.split_at(begin?.0);
    let inside = inside.strip_prefix(open)?;
    (!inside.trim().is_empty()).then_some((before.trim(), inside))
}

/// A name without white space but single blanks.
fn one_line(name: &str) -> String {
    name.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_joined_once() {
        for (name, unit, expected) in [
            ("cap", "V", "cap_V"),
            ("cap", "Volts", "cap_V"),
            ("cap_V", "V", "cap_V"),
            ("cap_V", "Volts", "cap_V"),
            (" cap ", " V ", "cap_V"),
            ("cap", "", "cap"),
            // Ends with the letter, not with the unit.
            ("EMV", "V", "EMV_V"),
            // A word of a name must not become a part of the unit.
            ("Channel A", "V", "Channel A_V"),
            ("Channel_A", "V", "Channel A_V"),
            ("x_s2", "V", "x s2_V"),
            ("gain_per", "V", "gain per_V"),
            ("CH_1", "V", "CH_1_V"),
            ("left_cap", "pF", "left_cap_pF"),
            // Words that are no units are named as they are.
            ("cap", "counts", "cap_counts"),
            ("cap", "From Custom Scale", "cap"),
            ("cap", "arb. V", "cap"),
            ("pos", "min", "pos_minutes"),
            ("time", "h", "time_h"),
        ] {
            assert_eq!(with_unit(name, unit), expected, "{name} {unit}");
        }
    }

    #[test]
    fn names_that_hold_a_unit() {
        for (name, before, unit) in [
            ("Time (ms)", "Time", "ms"),
            ("CH1 [V]", "CH1", "V"),
            ("CH1(V)", "CH1", "V"),
            ("Ucap_[V]", "Ucap", "V"),
            ("Ucap / V", "Ucap", "V"),
            ("Ucap/V", "Ucap", "V"),
            ("a / (m/s²)", "a", "m_per_s2"),
            ("a in (m/s²)", "a", "m_per_s2"),
            ("a (V/sqrt(Hz))", "a", "V_per_rtHz"),
            ("rate deg/s", "rate", "deg_per_s"),
            ("t/s", "t", "s"),
            ("Time, s", "Time", "s"),
            ("C1 in V", "C1", "V"),
            ("in s", "", "s"),
            ("(V)", "", "V"),
            ("Temperature (°C)", "Temperature", "degC"),
        ] {
            assert_eq!(parts(name).map(|(b, u)| (b.trim(), u)), Some((before, unit.to_owned())), "{name}");
        }
        for name in [
            "Channel A",
            "CH1",
            "cap_V",
            "CH1 (left)",
            "drive in phase",
            "V/ms",
            "deg/s",
            "a/b",
            "/V",
            "V(out)",
            "q[1]",
            "gyro_rad[1]",
            "CH (1)",
            "()",
            "",
            "on, off",
        ] {
            assert_eq!(parts(name), None, "{name}");
        }
    }
}
