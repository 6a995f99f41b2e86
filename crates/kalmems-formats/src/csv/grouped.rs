//! Numbers whose digits stand in groups of three: `1,234.50`, `1.234,50`, `1'234.50`.

/// A number in groups.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct GroupedNumber {
    /// Without the marks between the groups.
    pub(super) plain: Vec<u8>,
    /// Whether it may be another number as well: `1,234` may be 1.234 in another country.
    pub(super) is_ambiguous: bool,
}

/// Marks that may stand between groups, but for the decimal mark: the comma, the point, the apostrophe of Switzerland, a blank, the
/// blank that no line is broken at and its narrow one.
const MARKS: [&[u8]; 7] =
    [b",", b".", b"'", "’".as_bytes(), b" ", "\u{a0}".as_bytes(), "\u{202f}".as_bytes()];

/// A cell as such a number with this decimal mark; `None` where it is none.
pub(super) fn grouped(cell: &[u8], point: u8) -> Option<GroupedNumber> {
    let (sign, unsigned) = match cell.split_first()? {
        (b'-' | b'+', rest) => cell.split_at(cell.len() - rest.len()),
        _ => cell.split_at(0),
    };
    let (whole, fraction) = match unsigned.iter().position(|byte| *byte == point) {
        Some(place) => unsigned.split_at(place),
        None => (unsigned, &[][..]),
    };
    let digits = whole.iter().take_while(|byte| byte.is_ascii_digit()).count();
    let mark = MARKS
        .into_iter()
        .find(|mark| *mark != [point] && whole.get(digits..).is_some_and(|r| r.starts_with(mark)))?;
    let (mut plain, mut groups) = ([sign, whole.get(..digits)?].concat(), 0);
    let mut rest = whole.get(digits..)?;
    while !rest.is_empty() {
        let group = rest.strip_prefix(mark)?;
        let (three, behind) = group.split_first_chunk::<3>()?;
        if !three.iter().all(u8::is_ascii_digit) {
            return None;
        }
        plain.extend_from_slice(three);
        rest = behind;
        groups += 1;
    }
    let fraction_digits = fraction.get(1..).unwrap_or_default();
    if !(1..=3).contains(&digits) || !fraction_digits.iter().all(u8::is_ascii_digit) {
        return None;
    }
    plain.extend_from_slice(fraction);
    let is_ambiguous = groups == 1 && fraction.is_empty() && matches!(mark, b"," | b".");
    Some(GroupedNumber { plain, is_ambiguous })
}

/// Whether a text that is no number by itself may be one in groups of three digits: `1,234`, which is 1.234 elsewhere.
pub fn may_be_grouped(text: &str) -> bool {
    [b'.', b','].into_iter().any(|point| grouped(text.as_bytes(), point).is_some())
}

#[cfg(test)]
mod tests {
    use super::grouped;

    #[test]
    fn groups_of_three_digits_are_one_number_and_others_are_none() {
        for (cell, point, plain, is_ambiguous) in [
            ("1,234.50", b'.', "1234.50", false),
            ("-1.234,5", b',', "-1234,5", false),
            ("1'234", b'.', "1234", false),
            ("12 345 678", b'.', "12345678", false),
            ("1\u{202f}234,5", b',', "1234,5", false),
            ("1,234", b'.', "1234", true),
            ("1,234,567", b'.', "1234567", false),
        ] {
            let found = grouped(cell.as_bytes(), point).unwrap();
            assert_eq!(
                (found.plain.as_slice(), found.is_ambiguous),
                (plain.as_bytes(), is_ambiguous),
                "{cell}"
            );
        }
        for (cell, point) in [
            ("1234.5", b'.'),
            ("1,23.4", b'.'),
            ("1234,567", b'.'),
            ("1,2345", b'.'),
            (",123", b'.'),
            ("1,234,5", b','),
            ("1,234e5", b'.'),
            ("", b'.'),
            ("2026-03-01", b'.'),
        ] {
            assert_eq!(grouped(cell.as_bytes(), point), None, "{cell}");
        }
    }
}
