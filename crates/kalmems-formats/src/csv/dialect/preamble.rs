//! Lines before the names: settings as `key<separator>value`, titles and marks, behind which names and rows of numbers follow.

use super::head::TextHead;
use super::marks::{self, is_number};
use super::units::{says_unit, unit_cell};
use crate::csv::split::BLANKS;
use crate::stated_clock::StatedNumbers;
use crate::{FormatError, Result};

/// Bytes of a line that is looked at.
const LONGEST: usize = 256;
/// Rows that show that there are numbers below names.
const ROWS: usize = 4;
/// Lines between names and numbers: units, and how values were made of samples.
const BELOW_NAMES: usize = 2;

/// Where names, units and rows stand.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct HeaderPlace {
    pub(super) names: usize,
    pub(super) units: Option<usize>,
    pub(super) first_row: usize,
}

/// The names behind a preamble: the line of words above the first rows of numbers with as many cells, where the line at the beginning
/// has no such rows. What may be read in two ways is refused with what to write.
pub(super) fn find(head: &TextHead) -> Result<Option<HeaderPlace>> {
    let separators = || marks::BYTES.into_iter().chain([BLANKS]);
    for first_row in head.rows(1) {
        for separator in separators() {
            let count = head.cells(first_row, separator).len();
            let is_row = |row: usize| {
                let cells = head.cells(row, separator);
                let numbers = cells.iter().filter(|cell| is_number(cell)).count();
                let is_setting = cells.first().is_some_and(|cell| is_key(cell));
                cells.len() == count && numbers * 2 > count && !is_setting
            };
            let rows = || head.rows(first_row).take(ROWS);
            if count < 2 || rows().count() < 2 || !rows().all(is_row) {
                continue;
            }
            // The lines of words directly above, with as many cells.
            let is_words = |row: &usize| {
                let cells = head.cells(*row, separator);
                // A separator may stand behind the last name.
                let names = cells.len() - usize::from(cells.len() > count && cells[count..] == [""]);
                names == count && !cells.iter().any(|cell| is_number(cell))
            };
            let above: Vec<usize> = (0..first_row).rev().take_while(is_words).collect();
            let words: Vec<usize> = above.into_iter().rev().collect();
            if words.is_empty() {
                continue;
            }
            return of_words(head, separator, &words, first_row).map(Some);
        }
    }
    Ok(None)
}

/// Whether a cell is the key of a setting, by the mark behind it.
pub(super) fn is_key(cell: &str) -> bool {
    cell.trim_end().ends_with(['=', ':'])
}

/// Whether the last lines are none of numbers, so that a preamble may go on behind them.
pub(super) fn goes_on(head: &TextHead) -> bool {
    let is_row = |row: usize| {
        marks::BYTES.into_iter().chain([BLANKS]).any(|separator| {
            let cells = head.cells(row, separator);
            2 * cells.iter().filter(|cell| is_number(cell)).count() > cells.len()
        })
    };
    !head.rows(head.len().saturating_sub(ROWS)).any(is_row)
}

/// Where units and rows stand below names, where lines of words stand between these and the numbers and the first of them holds units.
pub(super) fn below_names(head: &TextHead, names: usize, separator: u8, count: usize) -> Option<HeaderPlace> {
    let has_number = |row: &usize| head.cells(*row, separator).iter().any(|cell| is_number(cell));
    let first_row = head.rows(names + 1).take(BELOW_NAMES + 1).find(has_number)?;
    let units = head.rows(names + 1).next().filter(|row| *row < first_row)?;
    let fits = |row: usize| head.cells(row, separator).len() == count;
    let all = head.rows(names + 1).take_while(|row| *row <= first_row).all(fits);
    (all && has_units(head, units, separator)).then_some(HeaderPlace { names, units: Some(units), first_row })
}

/// What lines such as `SampleRate, 400,Hz`, `// Sample rate: 100.0Hz` or `tInc = 2e-06` state of a clock.
pub(super) fn stated_numbers<'a>(lines: impl Iterator<Item = &'a [u8]>) -> StatedNumbers {
    let mut stated = StatedNumbers::default();
    lines.for_each(|line| _ = learn(line, &mut stated));
    stated
}

/// Learns what a line of a key, a mark and a number with its unit states of a clock; whether it does.
pub(super) fn learn(line: &[u8], stated: &mut StatedNumbers) -> bool {
    let line = String::from_utf8_lossy(line.get(..line.len().min(LONGEST)).unwrap_or_default());
    let line = line.trim_matches(|c: char| matches!(c, '#' | '%' | '/') || c.is_whitespace());
    let is_mark = |c: char| matches!(c, ':' | '=' | ',' | ';' | '\t');
    let Some((key, value)) = line.split_once(is_mark) else { return false };
    let value = value.trim_start_matches(|c: char| is_mark(c) || c.is_whitespace() || c == '"');
    let Ok((number, digits)) = fast_float2::parse_partial::<f64, _>(value) else { return false };
    let behind = value.get(digits..).unwrap_or_default();
    let behind = behind.trim_start_matches(|c: char| is_mark(c) || c.is_whitespace());
    let unit: String = behind.chars().take_while(|c| c.is_alphabetic()).collect();
    // The unit stands behind the number, or behind the key in brackets.
    let key = key.replace(['(', '['], "_").replace([')', ']', '"'], "");
    if unit.is_empty() { stated.learn(&key, number) } else { stated.learn(&format!("{key}_{unit}"), number) }
}

/// Whether a cell of a line is a unit.
fn has_units(head: &TextHead, row: usize, separator: u8) -> bool {
    let known = |cell: &String| unit_cell(cell).is_some_and(|unit| !unit.is_empty());
    head.cells(row, separator).iter().any(known)
}

/// Which of some lines of words above rows are names and units.
fn of_words(head: &TextHead, separator: u8, words: &[usize], first_row: usize) -> Result<HeaderPlace> {
    let cells = |row: usize| head.cells(row, separator);
    let last = words.len() - 1;
    let place = |names: usize, units: Option<usize>| HeaderPlace { names, units, first_row };
    // Names with their units stand directly above the rows; of `deg/s` nobody knows, and units stand there as well.
    if cells(words[last]).iter().any(|cell| unit_cell(cell).is_none() && says_unit(cell)) || words.len() == 1
    {
        return Ok(place(words[last], None));
    }
    let below = words.iter().position(|row| has_units(head, *row, separator)).filter(|units| *units > 0);
    if let Some(units) = below.filter(|units| last - (units - 1) <= BELOW_NAMES) {
        return Ok(place(words[units - 1], Some(words[units])));
    }
    let [first, line] = [words[0], words[last]].map(|index| head.number(index));
    let found = format!(
        "lines {first} to {line} each hold as many words as the rows below hold cells, and any of them may be the names"
    );
    let expected = format!(
        "the settings to say which: `format = {{ kind = \"csv\", header_line = {line} }}` in the table that names the file, \
         or `--header-line {line}`"
    );
    Err(FormatError::not_recognised(found, expected))
}
