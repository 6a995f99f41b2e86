//! What is kept of a segment for plots.

use super::{Envelope, EnvelopePoint, envelope};
use crate::recording::Stretch;

/// Points that are kept of a long segment, at least half as many.
const POINTS: usize = 8192;

/// A segment as far as it is kept: whole where it is one stretch; where it is longer, its lowest and highest values over short
/// pieces, and its last rows.
#[derive(Clone, Debug)]
pub(super) struct ReducedSegment {
    rows: usize,
    /// The times and the values of each channel: of all rows, or of the last from `first` on.
    first: usize,
    times: Vec<f64>,
    values: Vec<Vec<f64>>,
    /// Pieces of so many rows; none where the segment is whole.
    piece: usize,
    pieces: Vec<SegmentPiece>,
    missing: Vec<usize>,
}

/// A piece: when it begins, and the lowest and highest value of each channel, infinite the other way round where it has none.
#[derive(Clone, Debug)]
struct SegmentPiece {
    start_s: f64,
    extremes: Vec<(f64, f64)>,
}

impl ReducedSegment {
    /// One that begins with a stretch.
    pub(super) fn begin(stretch: &Stretch) -> Self {
        let columns = stretch.recording.columns();
        let mut kept = Self {
            rows: 0,
            first: 0,
            times: Vec::new(),
            values: vec![Vec::new(); columns.len()],
            piece: 1,
            pieces: Vec::new(),
            missing: vec![0; columns.len()],
        };
        kept.add(stretch, usize::MAX);
        kept
    }

    /// Adds a stretch and keeps the last `tail` rows.
    pub(super) fn add(&mut self, stretch: &Stretch, tail: usize) {
        let fresh = stretch.fresh.clone();
        let columns = stretch.recording.columns();
        let Some(segment) = stretch.recording.segments().first() else { return };
        let times: Vec<f64> = fresh.clone().map(|i| segment.time.at(i)).collect();
        let parts: Vec<&[f64]> =
            columns.iter().map(|c| c.values.get(fresh.clone()).unwrap_or_default()).collect();
        if !(stretch.begins && stretch.ends) {
            self.add_pieces(&times, &parts);
        }
        for ((values, part), missing) in self.values.iter_mut().zip(&parts).zip(&mut self.missing) {
            *missing += part.iter().filter(|v| v.is_nan()).count();
            values.extend_from_slice(part);
            let gone = values.len().saturating_sub(tail);
            values.drain(..gone);
        }
        self.times.extend(times);
        let gone = self.times.len().saturating_sub(tail);
        self.times.drain(..gone);
        self.rows += fresh.len();
        self.first = self.rows - self.times.len();
    }

    fn add_pieces(&mut self, times: &[f64], parts: &[&[f64]]) {
        for (i, time) in times.iter().enumerate() {
            if (self.rows + i).is_multiple_of(self.piece) {
                if self.pieces.len() == POINTS {
                    self.halve();
                }
                if (self.rows + i).is_multiple_of(self.piece) {
                    let extremes = vec![(f64::INFINITY, f64::NEG_INFINITY); parts.len()];
                    self.pieces.push(SegmentPiece { start_s: *time, extremes });
                }
            }
            let Some(piece) = self.pieces.last_mut() else { continue };
            for ((low, high), part) in piece.extremes.iter_mut().zip(parts) {
                // NaN is passed over.
                *low = part.get(i).map_or(*low, |value| low.min(*value));
                *high = part.get(i).map_or(*high, |value| high.max(*value));
            }
        }
    }

    /// Puts each two pieces together.
    fn halve(&mut self) {
        self.piece *= 2;
        let mut pieces = std::mem::take(&mut self.pieces).into_iter();
        while let Some(mut piece) = pieces.next() {
            if let Some(other) = pieces.next() {
                for (own, other) in piece.extremes.iter_mut().zip(other.extremes) {
                    *own = (own.0.min(other.0), own.1.max(other.1));
                }
            }
            self.pieces.push(piece);
        }
    }

    /// The number of its rows.
    pub(super) const fn rows(&self) -> usize {
        self.rows
    }

    /// How many of its last rows are kept.
    pub(super) const fn tail(&self) -> usize {
        self.rows - self.first
    }

    /// The time of a row: of the piece that it is in, where it is not kept itself.
    pub(super) fn time(&self, row: usize) -> f64 {
        match row.checked_sub(self.first) {
            Some(kept) => self.times.get(kept).copied().unwrap_or(f64::NAN),
            None => self.pieces.get(row / self.piece).map_or(f64::NAN, |piece| piece.start_s),
        }
    }

    /// The envelope of a channel over some rows, in at most so many points: of kept rows, or of all.
    pub(super) fn envelope(&self, channel: usize, rows: std::ops::Range<usize>, points: usize) -> Envelope {
        if let Some(start) = rows.start.checked_sub(self.first) {
            let values = self.values.get(channel).map_or(&[][..], Vec::as_slice);
            return envelope(values.get(start..start + rows.len()).unwrap_or_default(), points);
        }
        let points = points.min(self.pieces.len());
        let mut result =
            Envelope { points: Vec::new(), missing: self.missing.get(channel).copied().unwrap_or(0) };
        let mut last = None;
        for (index, piece) in self.pieces.iter().enumerate() {
            let Some((minimum, maximum)) = piece.extremes.get(channel).copied() else { continue };
            if minimum > maximum {
                continue;
            }
            let point = index * points / self.pieces.len();
            match result.points.last_mut().filter(|_| last == Some(point)) {
                Some(own) => {
                    own.minimum = own.minimum.min(minimum);
                    own.maximum = own.maximum.max(maximum);
                }
                None => {
                    result.points.push(EnvelopePoint { first: point * self.rows / points, minimum, maximum });
                }
            }
            last = Some(point);
        }
        result
    }
}
