//! How units and numbers are written.

/// Text for XML and HTML. Characters that XML cannot hold become U+FFFD.
pub(crate) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(printable(c)),
        }
    }
    out
}

/// The first clause of a finding, up to where it goes into particulars.
pub fn first_clause(text: &str) -> &str {
    let ends = ["; ", ". "].iter().filter_map(|end| text.find(end));
    ends.min().and_then(|end| text.get(..end)).unwrap_or(text)
}

/// A text of at most so many characters; a longer one ends with "…" after a whole word.
pub fn cut_to(text: &str, room: usize) -> String {
    if text.chars().count() <= room {
        return text.to_owned();
    }
    let kept: String = text.chars().take(room.saturating_sub(2)).collect();
    let kept = kept.rsplit_once(' ').map_or(kept.as_str(), |(kept, _)| kept);
    format!("{} …", kept.trim_end_matches([',', ':', ' ']))
}

/// The character itself, or U+FFFD for one that controls a terminal or is none.
pub(crate) fn printable(c: char) -> char {
    if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') { '\u{fffd}' } else { c }
}

/// A label as it stands in a table header: `rms error (deg)`.
pub(crate) fn with_unit(label: &str, unit: &str) -> String {
    with_printed_unit(label, &unit_sign(unit))
}

/// The same for a unit that is already as printed.
pub(crate) fn with_printed_unit(label: &str, unit: &str) -> String {
    match (label.trim(), unit) {
        (label, "") => label.to_owned(),
        ("", unit) => format!("({unit})"),
        (label, unit) => format!("{label} ({unit})"),
    }
}

/// A unit in print: `V^2/Hz` becomes `V²/Hz`, `F/sqrt(Hz)` becomes `F/√Hz`, `1` nothing.
pub fn unit_sign(unit: &str) -> String {
    let unit = unit.trim();
    if unit == "1" {
        return String::new();
    }
    let mut out = String::new();
    let mut rest = unit;
    while let Some(c) = rest.chars().next() {
        if let Some((word, after)) = rest.strip_prefix("sqrt(").and_then(|r| r.split_once(')')) {
            let simple = word.chars().all(char::is_alphabetic);
            let brackets = if simple { ["√", ""] } else { ["√(", ")"] };
            out.extend([brackets[0], word, brackets[1]]);
            rest = after;
            continue;
        }
        rest = &rest[c.len_utf8()..];
        match c {
            '^' => {
                let end = rest
                    .char_indices()
                    .find(|(i, c)| !(c.is_ascii_digit() || (*i == 0 && *c == '-')))
                    .map_or(rest.len(), |(i, _)| i);
                let (exponent, after) = rest.split_at(end);
                // A half power stays as it is written.
                if exponent.is_empty() || after.starts_with('.') {
                    out.push('^');
                } else {
                    out.extend(exponent.chars().map(superscript));
                    rest = after;
                }
            }
            '*' | ' ' => out.push('·'),
            c => out.push(c),
        }
    }
    out.replace("Ohm", "Ω").replace("ohm", "Ω")
}

/// `10⁻⁶`.
pub(crate) fn power_of_ten(exponent: i32) -> String {
    format!("10{}", exponent.to_string().chars().map(superscript).collect::<String>())
}

fn superscript(c: char) -> char {
    match c {
        '0' => '⁰',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        '-' => '⁻',
        c => c,
    }
}

/// `count · 10^exponent` in full, without rounding: `decimal(-250, -2)` is `−2.50`.
pub(crate) fn decimal(count: i64, exponent: i32) -> String {
    let sign = if count < 0 { "−" } else { "" };
    let digits = count.unsigned_abs().to_string();
    let places = usize::try_from(-i64::from(exponent)).unwrap_or(0);
    if places > 0 {
        let padded = format!("{digits:0>width$}", width = places + 1);
        let (whole, fraction) = padded.split_at(padded.len() - places);
        return format!("{sign}{whole}.{fraction}");
    }
    let zeros = if count == 0 { 0 } else { usize::try_from(exponent).unwrap_or(0) };
    format!("{sign}{digits}{}", "0".repeat(zeros))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_as_printed() {
        for (unit, sign) in [
            ("s", "s"),
            ("1", ""),
            ("", ""),
            ("V^2/Hz", "V²/Hz"),
            ("F/sqrt(Hz)", "F/√Hz"),
            ("V/sqrt(m s)", "V/√(m s)"),
            ("kg m^2", "kg·m²"),
            ("s^-1", "s⁻¹"),
            ("V^0.5", "V^0.5"),
            ("kohm", "kΩ"),
            ("^", "^"),
            ("sqrt(", "sqrt("),
        ] {
            assert_eq!(unit_sign(unit), sign, "{unit}");
        }
        assert_eq!(with_unit("ratio", "1"), "ratio");
        assert_eq!(with_unit("error", "deg"), "error (deg)");
        assert_eq!(power_of_ten(-12), "10⁻¹²");
    }

    #[test]
    fn decimals_in_full() {
        for (count, exponent, text) in [
            (22_050, -3, "22.050"),
            (-250, -2, "−2.50"),
            (5, -3, "0.005"),
            (0, -1, "0.0"),
            (0, 3, "0"),
            (15, 2, "1500"),
            (i64::MIN, 0, "−9223372036854775808"),
        ] {
            assert_eq!(decimal(count, exponent), text);
        }
    }

    #[test]
    fn nothing_escapes_the_markup() {
        assert_eq!(
            escape("<script>\"a\" & 'b'\u{1b}[2J\0"),
            "&lt;script&gt;&quot;a&quot; &amp; &#39;b&#39;\u{fffd}[2J\u{fffd}"
        );
    }
}
