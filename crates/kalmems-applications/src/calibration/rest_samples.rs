//! The samples of a channel at rest, taken part by part in bounded memory.

use super::rest_lines::RestLines;
use super::rest_spectrum::LONGEST;
use crate::signal::OctaveSums;

/// Pieces of a record at most, and samples of one at least.
const MOST_PIECES: usize = 128;
const SHORTEST_PIECE: usize = 4;
/// A piece with a gap as long as one of so many parts of it is no piece of one stretch.
const PART_OF_PIECE: usize = 10;

/// Number, mean, and sum of squares about the mean of some samples.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Moments {
    pub count: usize,
    pub mean: f64,
    pub squares: f64,
}

impl Moments {
    fn of(values: &[f64]) -> Self {
        let count = values.len();
        if count == 0 {
            return Self::default();
        }
        let mean = values.iter().sum::<f64>() / count as f64;
        Self { count, mean, squares: values.iter().map(|value| (value - mean).powi(2)).sum() }
    }

    /// Those of these and other samples together.
    pub fn and(self, other: Self) -> Self {
        let count = self.count + other.count;
        if count == 0 {
            return self;
        }
        let apart = other.mean - self.mean;
        let part = other.count as f64 / count as f64;
        Self {
            count,
            mean: self.mean + part * apart,
            squares: self.squares + other.squares + part * self.count as f64 * apart * apart,
        }
    }

    pub fn variance(&self) -> f64 {
        self.squares / (self.count.max(2) - 1) as f64
    }
}

/// Samples that follow one another, with the times in s of the first and the last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Piece {
    pub moments: Moments,
    pub time_s: [f64; 2],
    /// The most samples that are missing in one place, before the first one included.
    gap: usize,
}

impl Piece {
    fn and(self, next: Self) -> Self {
        if self.moments.count == 0 {
            return next;
        }
        Self {
            moments: self.moments.and(next.moments),
            time_s: [self.time_s[0], next.time_s[1]],
            gap: self.gap.max(next.gap),
        }
    }

    /// Whether each gap in it is shorter than a tenth of it.
    pub fn is_of_one_stretch(&self) -> bool {
        PART_OF_PIECE * self.gap <= self.moments.count
    }
}

/// What a channel at rest shows, of any number of samples in any number of records.
#[derive(Default)]
pub struct RestSamples {
    pub(super) sums: OctaveSums,
    /// Lines that were taken off before.
    pub(super) lines: RestLines,
    /// 128 pieces at most, all but the last of one length.
    pieces: Vec<Piece>,
    length: usize,
    /// The samples of each record.
    pub(super) records: Vec<Moments>,
    /// How many gaps are in the records.
    pub(super) gaps: usize,
    /// Samples that are missing since the last one; none before the first of a record.
    missing: Option<usize>,
    /// The present run of samples without a gap and the longest, as far as a spectrum takes it.
    run: Vec<f64>,
    longest: Vec<f64>,
}

impl RestSamples {
    /// The samples of one record at equal intervals; those that are not finite are missing.
    pub fn of(values: &[f64], interval_s: f64) -> Self {
        let mut samples = Self::default();
        samples.take(values, |row| row as f64 * interval_s);
        samples.end_record();
        samples
    }

    /// Takes the next samples, each with its time in s; those that are not finite are missing.
    pub fn take(&mut self, values: &[f64], time_s: impl Fn(usize) -> f64) {
        self.sums.push(values);
        let mut from = 0;
        while from < values.len() {
            let rest = &values[from..];
            let run = rest.iter().take_while(|value| value.is_finite()).count();
            if run == 0 {
                let missing = rest.iter().take_while(|value| !value.is_finite()).count();
                self.note_missing(missing);
                from += missing;
                continue;
            }
            self.take_run(&rest[..run], |row| time_s(from + row));
            from += run;
        }
    }

    /// So many samples are missing before the next one.
    pub fn skip(&mut self, samples: usize) {
        self.sums.skip(samples);
        self.note_missing(samples);
    }

    /// What comes next is another record.
    pub fn end_record(&mut self) {
        self.sums.end_stretch();
        self.lines.end_record();
        self.end_run();
        self.missing = None;
    }

    /// How many samples there are.
    pub fn count(&self) -> usize {
        self.records.iter().map(|record| record.count).sum()
    }

    /// The longest run of samples without a gap, as far as a spectrum takes it.
    pub(super) fn longest(&self) -> &[f64] {
        if self.run.len() > self.longest.len() { &self.run } else { &self.longest }
    }

    /// Lets go of that run.
    pub(super) fn forget_longest(&mut self) {
        (self.run, self.longest) = (Vec::new(), Vec::new());
    }

    /// All samples in their order, in pieces of which neighbours are put together until there are no more than these, and no piece but the
    /// last has fewer samples than these.
    pub(super) fn pieces(&self, most: usize, shortest: usize) -> Vec<Piece> {
        let mut pieces = self.pieces.clone();
        let mut length = self.length;
        while pieces.len() > most || (length < shortest && pieces.len() > 1) {
            pieces = in_pairs(&pieces);
            length *= 2;
        }
        pieces
    }

    /// The means of so many parts of about the same number of samples; none of fewer pieces.
    pub(super) fn means<const N: usize>(&self) -> Option<[Moments; N]> {
        let pieces = &self.pieces;
        (pieces.len() >= N).then(|| {
            std::array::from_fn(|part| {
                let of = part * pieces.len() / N..(part + 1) * pieces.len() / N;
                pieces[of].iter().fold(Moments::default(), |all, piece| all.and(piece.moments))
            })
        })
    }

    fn note_missing(&mut self, samples: usize) {
        if let Some(missing) = &mut self.missing {
            *missing += samples;
            self.end_run();
        }
    }

    fn end_run(&mut self) {
        if self.run.len() > self.longest.len() {
            std::mem::swap(&mut self.run, &mut self.longest);
        }
        self.run.clear();
    }

    fn take_run(&mut self, values: &[f64], time_s: impl Fn(usize) -> f64) {
        let mut gap = if let Some(gap) = self.missing.replace(0) {
            self.gaps += usize::from(gap > 0);
            gap
        } else {
            self.records.push(Moments::default());
            // A record does not go on where another ended.
            if self.records.len() > 1 { usize::MAX / PART_OF_PIECE } else { 0 }
        };
        if self.longest.len() < LONGEST {
            let room = LONGEST - self.run.len().min(LONGEST);
            self.run.extend_from_slice(&values[..values.len().min(room)]);
        }
        let mut from = 0;
        self.length = self.length.max(SHORTEST_PIECE);
        while from < values.len() {
            if self.pieces.last().is_none_or(|piece| piece.moments.count >= self.length) {
                if self.pieces.len() == MOST_PIECES {
                    self.pieces = in_pairs(&self.pieces);
                    self.length *= 2;
                }
                self.pieces.push(Piece::default());
            }
            let Some(piece) = self.pieces.last_mut() else { return };
            let to = values.len().min(from + self.length - piece.moments.count);
            let moments = Moments::of(&values[from..to]);
            if let Some(record) = self.records.last_mut() {
                *record = record.and(moments);
            }
            *piece = piece.and(Piece { moments, time_s: [time_s(from), time_s(to - 1)], gap });
            (from, gap) = (to, 0);
        }
    }
}

fn in_pairs(pieces: &[Piece]) -> Vec<Piece> {
    pieces.chunks(2).map(|pair| pair.iter().fold(Piece::default(), |all, piece| all.and(*piece))).collect()
}
