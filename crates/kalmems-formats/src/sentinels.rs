//! What instruments write where they measured no value: numbers and words, a closed list with their sources.

use crate::CellFinding;
use crate::decimal::Shift;
use crate::element::{Element, ElementKind, shortest};
use crate::records::AbsentRows;

/// What a number or a word of the list stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SentinelMeaning {
    /// A value beyond the range of the instrument.
    Overload,
    /// No value.
    Nothing,
}

use SentinelMeaning::{Nothing, Overload};

impl SentinelMeaning {
    fn finding(self, text: String) -> CellFinding {
        match self {
            Overload => CellFinding::Overload(text),
            Nothing => CellFinding::Nan(text),
        }
    }
}

/// The smallest of the numbers; in a file of measured values no other is as large.
const SMALLEST: f64 = 9.9e37;

/// Numbers of either sign.
const NUMBERS: [(f64, SentinelMeaning); 10] = [
    // SCPI-1999, volume 1, 7.2.1.4 and 7.2.1.5: INFinity, NINFinity and NAN of all instruments that speak it.
    (9.9e37, Overload),
    (9.91e37, Nothing),
    // The largest numbers of 32 and 64 bits (IEEE 754), with which drivers fill what was not measured.
    (3.402_823_466_385_288_6e38, Overload),
    (f64::MAX, Overload),
    (1e308, Overload),
    // Power meters and recorders: full digits with the largest exponent of two places. Those of Hioki write 7 instead of 9 where a channel is
    // switched off.
    (1.999_99e101, Overload),
    (9.999_9e102, Overload),
    (9.999_99e102, Overload),
    (9.999_99e103, Overload),
    (7.777_77e103, Nothing),
];

/// Words in capitals, without signs and dots: of multimeters and their programs, as they show them on their displays, a letter or a zero
/// before the L.
const OVERLOAD_WORDS: &str =
    "OL 0L OVL OVLD OVER OVERLOAD OVERLD OVERFLOW OVRFLW OVERRANGE OVRNG +OVER -OVER UNDERRANGE";

/// The same of recorders, spreadsheets, pandas and SQL.
const NOTHING_WORDS: &str = "NULL NONE N/A #N/A NA NODATA INVALID";

/// What a word says of a value that was not measured; `None` where it is none of the list. `text` is the cell for a message.
pub(crate) fn of_word(cell: &[u8], text: impl FnOnce() -> String) -> Option<CellFinding> {
    const LONGEST: usize = 12;
    if cell.len() > LONGEST {
        return None;
    }
    let dashes = cell.len() > 1 && cell.iter().all(|byte| matches!(byte, b'-' | b'.'));
    let stars = cell.len() > 1 && cell.iter().all(|byte| *byte == b'*');
    if dashes && cell.contains(&b'-') || stars {
        // Dashes of a display that shows no value; stars of a field that is too narrow for it (FORTRAN).
        return Some(if stars { Overload } else { Nothing }.finding(text()));
    }
    let word: Vec<u8> =
        cell.iter().filter(|byte| !matches!(byte, b'.' | b' ')).map(u8::to_ascii_uppercase).collect();
    let unsigned = word.strip_prefix(b"-").or_else(|| word.strip_prefix(b"+")).unwrap_or(&word);
    let is_in = |words: &str| words.split(' ').any(|known| known.as_bytes() == unsigned);
    let meaning =
        if is_in(OVERLOAD_WORDS) { Some(Overload) } else { is_in(NOTHING_WORDS).then_some(Nothing) };
    meaning.map(|meaning| meaning.finding(text()))
}

/// What a number says of a value that was not measured; `None` where it is none of the list.
pub(crate) fn of_number(number: f64, text: impl FnOnce() -> String) -> Option<CellFinding> {
    if number.abs() < SMALLEST {
        return None;
    }
    let known = NUMBERS.iter().find(|(known, _)| *known == number.abs())?;
    Some(known.1.finding(text()))
}

/// From which size on a number times a power of ten may be one of the list.
pub(crate) fn limit(power: i32) -> f64 {
    0.999 * SMALLEST * 10_f64.powi(power)
}

/// Takes the numbers of an element, times a power of ten, out that say that no value was measured: those of the list, rounded to 32 bits
/// where the element is, and the ends of 16 bits, at which a converter stays. Other lengths are those of no converter, or their ends are too
/// common.
pub(crate) fn take_out(element: Element, power: i32, numbers: &mut [f64], absent: &mut AbsentRows) {
    let listed = |as_kept: fn(f64) -> f64| {
        let both = |(number, meaning): (f64, SentinelMeaning)| {
            [-1.0, 1.0].map(|sign| (sign * as_kept(number), meaning))
        };
        NUMBERS.into_iter().flat_map(both).collect::<Vec<_>>()
    };
    let known = match (element.kind, element.bytes) {
        #[allow(clippy::cast_possible_truncation)] // as the element has it
        (ElementKind::Float, 4) => listed(|number| f64::from(number as f32)),
        (ElementKind::Float, 8) => listed(|number| number),
        (ElementKind::Signed, 2) => vec![(-32_768.0, Overload), (32_767.0, Overload)],
        (ElementKind::Unsigned, 2) => vec![(65_535.0, Overload)],
        (ElementKind::Pcm, 2) => vec![(-1.0, Overload), (32_767.0 / 32_768.0, Overload)],
        _ => return,
    };
    let mut shift = Shift::new(power);
    let known: Vec<(f64, f64, SentinelMeaning)> =
        known.into_iter().map(|(kept, meaning)| (shift.float(kept), kept, meaning)).collect();
    let least = known.iter().map(|(shifted, ..)| shifted.abs()).fold(f64::INFINITY, f64::min);
    // Counted without a branch: in nearly all blocks there is none.
    if numbers.iter().filter(|number| number.abs() >= least).count() == 0 {
        return;
    }
    for (row, number) in numbers.iter_mut().enumerate().filter(|(_, n)| n.abs() >= least && n.is_finite()) {
        if let Some((_, kept, meaning)) = known.iter().find(|(shifted, ..)| shifted == number) {
            *number = f64::NAN;
            absent.push((row, meaning.finding(shortest(*kept))));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_numbers_of_the_list_are_recognised_and_others_are_not() {
        let word = |cell: &str| of_word(cell.as_bytes(), || cell.to_owned());
        for cell in ["OL", "-OL", "0.L", "O.L", "ovld", "OVERLOAD", "***"] {
            assert_eq!(word(cell), Some(CellFinding::Overload(cell.to_owned())), "{cell}");
        }
        for cell in ["---", "--", "-.--", "n/a", "null", "#N/A"] {
            assert_eq!(word(cell), Some(CellFinding::Nan(cell.to_owned())), "{cell}");
        }
        for cell in ["-", "high", "OLD", "", "1.5", "*", "..", "overloaded once"] {
            assert_eq!(word(cell), None, "{cell}");
        }
        let number = |number: f64| of_number(number, String::new);
        assert_eq!(number(-9.9e37), Some(CellFinding::Overload(String::new())));
        assert_eq!(number("9.91E37".parse().unwrap()), Some(CellFinding::Nan(String::new())));
        assert_eq!(number("199.999E+99".parse().unwrap()), Some(CellFinding::Overload(String::new())));
        // As drivers, power meters and recorders write them.
        for cell in ["1e308", "-1e308", "9999.9E+99", "9999.99E+99", "-9999.99E+99", "99999.9E+99"] {
            assert_eq!(number(cell.parse().unwrap()), Some(CellFinding::Overload(String::new())), "{cell}");
        }
        for cell in ["77777.7E+99", "-77777.7E+99"] {
            assert_eq!(number(cell.parse().unwrap()), Some(CellFinding::Nan(String::new())), "{cell}");
        }
        for other in [0.0, 9.9e36, 9.8e37, 1e100, f64::NAN] {
            assert_eq!(number(other), None, "{other}");
        }
    }

    #[test]
    fn the_ends_of_sixteen_bits_are_no_values_and_those_of_other_lengths_are() {
        let taken = |kind, bytes, mut numbers: Vec<f64>| {
            let mut absent = Vec::new();
            take_out(Element::little(kind, bytes), 0, &mut numbers, &mut absent);
            absent.into_iter().map(|(row, _)| row).collect::<Vec<_>>()
        };
        assert_eq!(taken(ElementKind::Signed, 2, vec![-32768.0, 0.0, 32767.0, 32766.0]), [0, 2]);
        assert_eq!(taken(ElementKind::Unsigned, 2, vec![0.0, 65535.0]), [1]);
        assert!(taken(ElementKind::Signed, 1, vec![-128.0, 127.0]).is_empty());
        assert!(taken(ElementKind::Signed, 4, vec![-32768.0]).is_empty());
        assert_eq!(
            taken(ElementKind::Float, 4, vec![f64::from(9.9e37_f32), 1.0, f64::from(f32::MAX)]),
            [0, 2]
        );
        assert_eq!(taken(ElementKind::Float, 8, vec![9.9e37, f64::INFINITY, f64::MAX]), [0, 2]);
        // In millivolts, as a message shows it in the unit of the file.
        let (mut numbers, mut absent) = (vec![9.9e34, 32.767], Vec::new());
        take_out(Element::little(ElementKind::Float, 8), -3, &mut numbers, &mut absent);
        take_out(Element::little(ElementKind::Signed, 2), -3, &mut numbers, &mut absent);
        let overload = |text: &str| CellFinding::Overload(text.to_owned());
        assert_eq!(absent, [(0, overload("9.9e37")), (1, overload("32767"))]);
    }
}
