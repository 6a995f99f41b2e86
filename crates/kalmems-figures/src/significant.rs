//! Numbers for people.

/// Digits in a row that a reader can still count.
const COUNTABLE: usize = 15;

/// Three significant digits, without an exponent where that can be read.
pub fn significant(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    if value.abs() >= 1e15 {
        return format!("{value:.2e}");
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to a small positive number
    let decimals = (2.0 - libm::log10(value.abs()).floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// A number in a message: all its digits, and an exponent where zeros would be hard to count.
pub fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e15).contains(&value.abs()) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// A sentence in which numbers of too many digits to count have five of them and an exponent, whatever wrote them: as `1e300` in
/// place of 301 digits. What stands in backticks is a name or a quotation and stays.
pub fn with_short_numbers(sentence: &str) -> String {
    let mut text = String::with_capacity(sentence.len());
    let mut rest = sentence;
    let mut quoted = false;
    while let Some(c) = rest.chars().next() {
        let before = text.chars().next_back();
        let numeral = numeral(rest);
        if c.is_ascii_digit() && !quoted && !before.is_some_and(is_of_word) {
            let behind = rest.get(numeral.len()..).unwrap_or_default();
            // The point behind the last number of a sentence is none of a file's ending.
            let stands_alone = !behind.strip_prefix('.').unwrap_or(behind).starts_with(is_of_word);
            text += &stands_alone.then(|| shortened(numeral)).flatten().unwrap_or_else(|| numeral.to_owned());
            rest = behind;
            continue;
        }
        quoted ^= c == '`';
        text.push(c);
        rest = rest.get(c.len_utf8()..).unwrap_or_default();
    }
    text
}

/// Whether a numeral beside this character is a part of a longer word, such as a name or a number with an exponent.
fn is_of_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '.' | '/' | '\\')
}

/// The digits that a text begins with, with a decimal point if digits follow it.
fn numeral(text: &str) -> &str {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let whole = digits(text);
    let part = text.get(whole..).and_then(|rest| rest.strip_prefix('.')).map_or(0, digits);
    text.get(..if part > 0 { whole + 1 + part } else { whole }).unwrap_or_default()
}

/// A numeral with an exponent, where it is hard to read without.
fn shortened(numeral: &str) -> Option<String> {
    if numeral.len() <= COUNTABLE {
        return None;
    }
    let value: f64 = numeral.parse().ok()?;
    if value == 0.0 || (1e-3..1e15).contains(&value) {
        return None;
    }
    let rounded = format!("{value:.4e}");
    // Without the zeros at the end of its digits.
    Some(rounded.parse::<f64>().map_or(rounded, |value| format!("{value:e}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits() {
        for (value, text) in [
            (0.018_063, "0.0181"),
            (2.694, "2.69"),
            (123.45, "123"),
            (1e-5, "0.0000100"),
            (0.0, "0"),
            (2.5e300, "2.50e300"),
        ] {
            assert_eq!(significant(value), text);
        }
    }

    #[test]
    fn all_digits_of_a_number_and_an_exponent_where_it_has_too_many() {
        for (value, text) in [
            (0.1, "0.1"),
            (-24_001.5, "-24001.5"),
            (1e300, "1e300"),
            (-1.25e-300, "-1.25e-300"),
            (0.0, "0"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn numbers_of_too_many_digits_are_shortened_wherever_they_stand_in_a_sentence() {
        for (sentence, expected) in [
            (format!("At {} Hz, that is all.", 1e300), "At 1e300 Hz, that is all.".to_owned()),
            (format!("at {:.3} mV and -{:.2}.", 1e300 / 3.0, 2e25), "at 3.3333e299 mV and -2e25.".to_owned()),
            (format!("({} V; {:.1}°)", 1e-300, 1e40), "(1e-300 V; 1e40°)".to_owned()),
            // As many digits as they need.
            ("0.30000000000000004 s after 123456789012345 s".to_owned(), String::new()),
            // Names, paths and what has an exponent already.
            (format!("`{0}` of run_{0}.csv, /{0}/a, {0}e5, 1.5e300, v{0}", "1".repeat(40)), String::new()),
            ("0.0000000000000000000".to_owned(), String::new()),
            ("ends with 7.".to_owned(), String::new()),
        ] {
            let expected = if expected.is_empty() { sentence.clone() } else { expected };
            assert_eq!(with_short_numbers(&sentence), expected);
        }
    }
}
