//! How binary formats keep times.

use super::{Instant, TimeKind, TimeReader, TimeUnit};
use crate::element::Element;

/// How a column of times is kept in a binary format that says itself what they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum TimeCode {
    /// Numbers of a unit.
    Counted { element: Element, unit: TimeUnit, kind: TimeKind },
    /// Integers of a unit, the smallest of which is no time (NumPy's NaT).
    #[cfg(feature = "npy")]
    Numpy { element: Element, unit: TimeUnit, kind: TimeKind },
    /// 2⁻⁶⁴ s and seconds since 1904, of 64 bits each.
    #[cfg(feature = "tdms")]
    Labview { big_endian: bool },
}

impl TimeCode {
    /// The bytes of a time.
    pub(crate) const fn bytes(self) -> usize {
        match self {
            Self::Counted { element, .. } => element.bytes,
            #[cfg(feature = "npy")]
            Self::Numpy { element, .. } => element.bytes,
            #[cfg(feature = "tdms")]
            Self::Labview { .. } => 16,
        }
    }

    /// What its numbers count.
    pub(crate) const fn unit(self) -> TimeUnit {
        match self {
            Self::Counted { unit, .. } => unit,
            #[cfg(feature = "npy")]
            Self::Numpy { unit, .. } => unit,
            #[cfg(feature = "tdms")]
            Self::Labview { .. } => TimeUnit::SECOND,
        }
    }

    /// What the times are.
    pub(crate) const fn kind(self) -> TimeKind {
        match self {
            Self::Counted { kind, .. } => kind,
            #[cfg(feature = "npy")]
            Self::Numpy { kind, .. } => kind,
            #[cfg(feature = "tdms")]
            Self::Labview { .. } => TimeKind::Calendar,
        }
    }

    /// Appends the times that stand in `raw` from `offset` on, `stride` bytes apart.
    pub(crate) fn read(
        self,
        raw: &[u8],
        offset: usize,
        stride: usize,
        rows: usize,
        times: &mut TimeReader,
        out: &mut Vec<f64>,
    ) {
        match self {
            Self::Counted { element, .. } => element.times(raw, offset, stride, rows, times, out),
            #[cfg(feature = "npy")]
            Self::Numpy { element, .. } => {
                let time = |cell: &[u8]| {
                    let number = element.integer(cell);
                    if number == i128::from(i64::MIN) { f64::NAN } else { times.integer(number) }
                };
                out.extend(cells(raw, offset, stride, element.bytes, rows).map(time));
            }
            #[cfg(feature = "tdms")]
            Self::Labview { big_endian } => out.extend(
                cells(raw, offset, stride, 16, rows)
                    .map(|cell| labview(cell, big_endian).map_or(f64::NAN, |time| times.instant(time))),
            ),
        }
    }

    /// One time as a label: as a date, or as seconds.
    pub(crate) fn label(self, raw: &[u8]) -> String {
        let exact = match self {
            #[cfg(feature = "tdms")]
            Self::Labview { big_endian } => labview(raw, big_endian),
            #[cfg(feature = "npy")]
            Self::Numpy { element, unit, .. } => Some(element.integer(raw))
                .filter(|number| *number != i128::from(i64::MIN))
                .and_then(|number| Instant::of_integer(number, unit)),
            Self::Counted { .. } => None,
        };
        if let Some(time) = exact {
            let date = Some(time).filter(|_| self.kind() == TimeKind::Calendar).and_then(Instant::to_utc);
            return date.unwrap_or_else(|| time.to_string());
        }
        let mut number = Vec::with_capacity(1);
        let mut times = TimeReader::new(self.unit(), Some(Instant::ZERO));
        self.read(raw, 0, self.bytes(), 1, &mut times, &mut number);
        crate::element::shortest(number.first().copied().unwrap_or(f64::NAN))
    }
}

#[cfg(any(feature = "npy", feature = "tdms"))]
fn cells(raw: &[u8], offset: usize, stride: usize, bytes: usize, rows: usize) -> impl Iterator<Item = &[u8]> {
    raw.chunks(stride.max(1)).filter_map(move |record| record.get(offset..offset + bytes)).take(rows)
}

/// A time of LabVIEW in 16 bytes.
#[cfg(feature = "tdms")]
pub(crate) fn labview(cell: &[u8], big_endian: bool) -> Option<Instant> {
    let (first, second) = (cell.first_chunk::<8>()?, cell.get(8..)?.first_chunk::<8>()?);
    // The more significant half comes first where bytes do.
    if big_endian {
        Instant::of_labview(i64::from_be_bytes(*first), u64::from_be_bytes(*second))
    } else {
        Instant::of_labview(i64::from_le_bytes(*second), u64::from_le_bytes(*first))
    }
}
