//! How binary formats keep times.

use super::{Instant, TimeKind, TimeReader, TimeUnit};
use crate::element::{CellPlaces, Element};

/// The integer that is no time.
const NO_TIME: i128 = i64::MIN as i128;

/// How a column of times is kept in a binary format that says itself what they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TimeCode {
    pub(crate) form: TimeForm,
    /// What its numbers count.
    pub(crate) unit: TimeUnit,
    pub(crate) kind: TimeKind,
}

/// How a time is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TimeForm {
    /// A number.
    Counted(Element),
    /// An integer; the smallest one of 64 bits is no time (NumPy's NaT).
    Integer(Element),
    /// 2⁻⁶⁴ s and seconds since 1904, of 64 bits each.
    Labview { big_endian: bool },
}

impl TimeCode {
    /// The bytes of a time.
    pub(crate) const fn bytes(self) -> usize {
        match self.form {
            TimeForm::Counted(element) | TimeForm::Integer(element) => element.bytes,
            TimeForm::Labview { .. } => 16,
        }
    }

    /// Appends the times that stand in some cells.
    pub(crate) fn read(self, cells: CellPlaces<'_>, times: &mut TimeReader, out: &mut Vec<f64>) {
        match self.form {
            TimeForm::Counted(element) => element.times(cells, times, out),
            TimeForm::Integer(element) => {
                let time = |number: i128| if number == NO_TIME { f64::NAN } else { times.integer(number) };
                out.extend(cells.of(self.bytes()).map(|cell| element.integer(cell)).map(time));
            }
            TimeForm::Labview { big_endian } => {
                let mut time = |cell| labview(cell, big_endian).map_or(f64::NAN, |time| times.instant(time));
                out.extend(cells.of(self.bytes()).map(&mut time));
            }
        }
    }

    /// One time as a label: as a date, or as seconds.
    pub(crate) fn label(self, raw: &[u8]) -> String {
        let exact = match self.form {
            TimeForm::Labview { big_endian } => labview(raw, big_endian),
            TimeForm::Integer(element) => Some(element.integer(raw))
                .filter(|number| *number != NO_TIME)
                .and_then(|number| Instant::of_integer(number, self.unit)),
            TimeForm::Counted(_) => None,
        };
        if let Some(time) = exact {
            let date = Some(time).filter(|_| self.kind == TimeKind::Calendar).and_then(Instant::to_utc);
            return date.unwrap_or_else(|| time.to_string());
        }
        let mut number = Vec::with_capacity(1);
        let mut times = TimeReader::new(self.unit, Some(Instant::ZERO));
        self.read(CellPlaces::one(raw), &mut times, &mut number);
        crate::element::shortest(number.first().copied().unwrap_or(f64::NAN))
    }
}

/// A time of LabVIEW in 16 bytes.
pub(crate) fn labview(cell: &[u8], big_endian: bool) -> Option<Instant> {
    let (first, second) = (cell.first_chunk::<8>()?, cell.get(8..)?.first_chunk::<8>()?);
    // The more significant half comes first where bytes do.
    if big_endian {
        Instant::of_labview(i64::from_be_bytes(*first), u64::from_be_bytes(*second))
    } else {
        Instant::of_labview(i64::from_le_bytes(*second), u64::from_le_bytes(*first))
    }
}
