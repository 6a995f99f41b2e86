//! A unit as it was written, without the prefixes of its symbols.

use crate::Unit;
use crate::unit::PREFIXES;

/// The unit of a value in SI that was written in this unit, as the writer has it: `V/m` of `V/um`, `N/V²` of `nN/V^2`; empty of a ratio. What
/// has no such form, as `deg` or `min`, is in base units.
pub fn si_text(written: &str) -> String {
    let Ok(unit) = Unit::parse(if written.is_empty() { "1" } else { written }) else {
        return written.to_owned();
    };
    let dimension = unit.dimension();
    let dimensions = dimension.to_string();
    if dimensions == "1" {
        return String::new();
    }
    let plain = without_prefixes(written);
    let is_si = Unit::parse(&plain)
        .is_ok_and(|found| found.dimension() == dimension && found.factor().to_bits() == 1_f64.to_bits());
    let text = if is_si { plain } else { dimensions };
    text.replace("^2", "²").replace("^3", "³")
}

/// The text of a unit with each symbol's prefix left out, where the symbol is none by itself.
fn without_prefixes(written: &str) -> String {
    let mut plain = String::new();
    let mut word = String::new();
    for letter in written.trim().chars() {
        if letter.is_alphabetic() {
            word.push(letter);
        } else {
            plain += symbol(&word);
            word.clear();
            plain.push(letter);
        }
    }
    plain + symbol(&word)
}

/// A symbol without its prefix.
fn symbol(word: &str) -> &str {
    let is_unit =
        |text: &str| Unit::symbol(text).is_some_and(|unit| unit.factor().to_bits() == 1_f64.to_bits());
    if word.is_empty() || is_unit(word) {
        return word;
    }
    PREFIXES
        .iter()
        .filter_map(|(prefix, _)| word.strip_prefix(prefix))
        .find(|rest| is_unit(rest))
        .unwrap_or(word)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_keeps_the_form_in_which_it_was_written() {
        for (written, expected) in [
            ("N/m", "N/m"),
            ("N/V^2", "N/V²"),
            ("nN/V^2", "N/V²"),
            ("V/um", "V/m"),
            ("V/pF", "V/F"),
            ("1/m^2", "1/m²"),
            ("kg m^2", "kg m²"),
            ("N s/m", "N s/m"),
            ("kHz", "Hz"),
            ("us", "s"),
            ("1/s", "1/s"),
            ("rad^2/s^3", "rad²/s³"),
            ("aF/sqrt(Hz)", "F/sqrt(Hz)"),
            ("Mohm", "ohm"),
            ("%", ""),
            ("", ""),
            ("deg", "rad"),
        ] {
            assert_eq!(si_text(written), expected, "{written}");
        }
    }
}
