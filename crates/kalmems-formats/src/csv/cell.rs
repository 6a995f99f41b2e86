//! One cell: its bytes as a number, or what else it is.

use super::grouped::grouped;
use crate::{CellFinding, refuse_if, sentinels};
use std::io::Write as _;

/// The minus sign of typography, U+2212, which spreadsheets and `matplotlib` write.
const MINUS: &[u8] = "−".as_bytes();

/// Reads cells the slow way, with memory that is used again.
#[derive(Debug, Default)]
pub struct CellReader {
    scratch: Vec<u8>,
}

/// Whether the digits of a column stand in groups of three, as far as its cells have shown it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct DigitGroups {
    /// A cell had groups that can mean nothing else.
    pub(super) are_sure: bool,
}

impl CellReader {
    /// The finite number in a cell whose decimal point is `point`, times 10^`power` and rounded once, or what is wrong with it.
    pub fn read(&mut self, cell: &[u8], point: u8, power: i32) -> Result<f64, CellFinding> {
        let cell = cell.trim_ascii();
        refuse_if(cell.is_empty(), || CellFinding::Missing)?;
        // PicoScope writes what is beyond its range like this.
        let unsigned = cell.strip_prefix(b"-").or_else(|| cell.strip_prefix(MINUS)).unwrap_or(cell);
        refuse_if(unsigned == b"\xe2\x88\x9e", || CellFinding::Infinite(excerpt(cell)))?;
        refuse_if(point != b'.' && cell.contains(&b'.'), || CellFinding::Text(excerpt(cell)))?;
        self.scratch.clear();
        let mut rest = cell;
        while let Some((byte, behind)) = rest.split_first() {
            let minus = rest.strip_prefix(MINUS);
            self.scratch.push(match byte {
                _ if minus.is_some() => b'-',
                byte if *byte == point => b'.',
                byte => *byte,
            });
            rest = minus.unwrap_or(behind);
        }
        let Ok(number) = fast_float2::parse::<f64, _>(&self.scratch) else {
            let no_value = sentinels::of_word(cell, || excerpt(cell));
            return Err(no_value.unwrap_or_else(|| CellFinding::Text(excerpt(cell))));
        };
        refuse_if(number.is_nan(), || CellFinding::Nan(excerpt(cell)))?;
        if let Some(no_value) = sentinels::of_number(number, || excerpt(cell)) {
            return Err(no_value);
        }
        let number = if power == 0 { number } else { self.shift(power).unwrap_or(number) };
        if number.is_finite() { Ok(number) } else { Err(CellFinding::Infinite(excerpt(cell))) }
    }

    /// The same of a column whose digits may stand in groups. One that may be another number as well counts where others of its column can
    /// not.
    pub(super) fn read_in_groups(
        &mut self,
        cell: &[u8],
        point: u8,
        power: i32,
        groups: &mut DigitGroups,
    ) -> Result<f64, CellFinding> {
        let found = self.read(cell, point, power);
        if !matches!(found, Err(CellFinding::Text(_))) {
            return found;
        }
        let Some(number) = grouped(cell.trim_ascii(), point) else { return found };
        groups.are_sure |= !number.is_ambiguous;
        if groups.are_sure { self.read(&number.plain, point, power) } else { found }
    }

    /// The number in the scratch times a power of ten. `None` for `inf`, which has no exponent to change.
    fn shift(&mut self, power: i32) -> Option<f64> {
        let end = self.scratch.iter().position(|b| matches!(b, b'e' | b'E')).unwrap_or(self.scratch.len());
        let exponent = match self.scratch.get(end + 1..) {
            None => 0,
            // An exponent that does not fit i32 is far beyond any number; the sign alone decides.
            Some(text) => match std::str::from_utf8(text).ok()?.parse::<i32>() {
                Ok(exponent) => exponent,
                Err(_) if text.starts_with(b"-") => i32::MIN,
                Err(_) => i32::MAX,
            },
        };
        self.scratch.truncate(end);
        write!(self.scratch, "e{}", exponent.saturating_add(power)).ok()?;
        fast_float2::parse(&self.scratch).ok()
    }
}

/// A cell in a message, shortened.
pub(crate) fn excerpt(cell: &[u8]) -> String {
    const LONGEST: usize = 40;
    // A character has four bytes at most; a cell can be long.
    let begin = cell.get(..cell.len().min(4 * LONGEST + 4)).unwrap_or_default();
    let text = String::from_utf8_lossy(begin.trim_ascii());
    let mut short: String =
        text.chars().take(LONGEST).map(|c| if c.is_control() { '\u{fffd}' } else { c }).collect();
    if text.chars().nth(LONGEST).is_some() {
        short.push('…');
    }
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, power: i32) -> Result<f64, CellFinding> {
        CellReader::default().read(text.as_bytes(), b'.', power)
    }

    #[test]
    fn what_a_cell_is() {
        let text = |text: &str| Err(CellFinding::Text(text.to_owned()));
        let infinite = |text: &str| Err(CellFinding::Infinite(text.to_owned()));
        for (cell, value) in [
            ("1.5", Ok(1.5)),
            (" -1.5e3 ", Ok(-1500.0)),
            ("+.5", Ok(0.5)),
            ("5.", Ok(5.0)),
            ("−1.5e−3", Ok(-1.5e-3)),
            ("−∞", infinite("−∞")),
            ("", Err(CellFinding::Missing)),
            (" \r", Err(CellFinding::Missing)),
            ("NaN", Err(CellFinding::Nan("NaN".to_owned()))),
            ("-nan", Err(CellFinding::Nan("-nan".to_owned()))),
            ("inf", infinite("inf")),
            ("-Infinity", infinite("-Infinity")),
            ("-∞", infinite("-∞")),
            ("1e999", infinite("1e999")),
            ("1,5", text("1,5")),
            ("1.2.3", text("1.2.3")),
            ("0x10", text("0x10")),
            ("1 V", text("1 V")),
            ("-", text("-")),
            ("e5", text("e5")),
        ] {
            assert_eq!(read(cell, 0), value, "{cell:?}");
        }
        for (cell, value) in [
            ("inf", infinite("inf")),
            ("2e306", infinite("2e306")),
            ("1e308", Err(CellFinding::Overload("1e308".to_owned()))),
            ("1e-99999999999", Ok(0.0)),
            ("1e99999999999", infinite("1e99999999999")),
            ("17.86", Ok(17.86e3)),
        ] {
            assert_eq!(read(cell, 3), value, "{cell:?}");
        }
    }

    #[test]
    fn a_decimal_comma_is_no_group_of_thousands() {
        let mut cells = CellReader::default();
        assert_eq!(cells.read(b"1,5e-3", b',', -3), Ok(1.5e-6));
        assert_eq!(cells.read(b"1.5", b',', 0), Err(CellFinding::Text("1.5".to_owned())));
        assert_eq!(cells.read(b"1.234,5", b',', 0), Err(CellFinding::Text("1.234,5".to_owned())));
    }

    #[test]
    fn long_cells_are_shortened() {
        assert_eq!(excerpt("ä".repeat(1000).as_bytes()), "ä".repeat(40) + "…");
        assert_eq!(excerpt(b" a\x07b "), "a\u{fffd}b");
    }
}
