//! The squared differences of a rate's phase at octaves of averaging times, in bounded memory and with samples missing.

use super::allan::DifferenceSums;
use std::ops::Range;

/// Averaging times of so many samples at most have a difference from each sample on, which are all of a record of half a million.
const EACH: usize = 1 << 17;
/// Longer ones have a difference from so many places to an averaging time, which leaves 1/32768 of a difference's standard deviation unused.
const FINEST: usize = 1 << 15;
/// Phases that are taken in before their differences are formed.
const BLOCK: usize = 1 << 15;
/// Factors of two beyond [`EACH`], and the averaging times up to it.
const LEVELS: usize = 22;
/// Values that the kind of a noise is read off, where there are as many.
const NOISE_VALUES: usize = 128;
/// A gap of so many times all samples before it is in no mean: what comes after begins anew.
const LONGEST_GAP: usize = 10;
/// Lengths of stretches that are told apart.
const LENGTHS: usize = 64;

/// The sums that Allan's deviation and its relatives are made of, at 1, 2, 4, … samples, of equidistant samples that are given piece by piece.
///
/// The memory is bounded: 40 MB at any length. A sample that is missing takes its time all the same. A mean in which at most one sample in
/// ten is missing counts, as the mean of those that are there, and its square as much less as white noise makes it larger. Where half of the
/// differences at an averaging time or more have all their samples, these count alone. So a gap ends no averaging time: it takes the differences that reach
/// into it.
pub struct OctaveSums {
    levels: Vec<Level>,
    /// What is taken off each sample, so that the digits of the phase last; that of the stretch's first samples.
    offset: Option<f64>,
    phase: f64,
    /// Samples of the stretch, and how many of them are missing.
    taken: usize,
    gone: u32,
    longest: usize,
    /// The beginnings of the longest stretch, at all spacings.
    heads: Vec<Vec<f64>>,
}

/// The phase at every so many samples.
struct Level {
    spacing: usize,
    /// The longest averaging time in steps.
    longest: usize,
    /// The last phases, how many were dropped before them, and the samples that are missing until each.
    phase: Vec<f64>,
    missing: Vec<u32>,
    dropped: usize,
    /// The first ones, and how many of them come before the first missing sample.
    head: Vec<f64>,
    complete: usize,
    octaves: Vec<Octave>,
}

struct Octave {
    sums: DifferenceSums,
    /// The phase at which the next difference begins.
    next: usize,
}

/// The sums at one averaging time.
pub(super) struct OctaveView<'a> {
    pub factor: usize,
    pub sums: &'a DifferenceSums,
    /// The beginning of the longest stretch, and the averaging time in steps of it.
    pub beginning: (&'a [f64], usize),
    pub longest: usize,
}

impl Default for OctaveSums {
    fn default() -> Self {
        let level = |level: usize| {
            // The longer levels have the one averaging time that is too long for the level before.
            let (spacing, steps, longest) = match level {
                0 => (1, 0..=EACH.ilog2(), EACH),
                level => ((EACH / FINEST) << level, FINEST.ilog2()..=FINEST.ilog2(), FINEST),
            };
            let octave =
                |power: u32| Octave { sums: DifferenceSums::new(1_usize << power, spacing), next: 0 };
            Level {
                spacing,
                longest,
                phase: Vec::new(),
                missing: Vec::new(),
                dropped: 0,
                head: Vec::new(),
                complete: 0,
                octaves: steps.map(octave).collect(),
            }
        };
        Self {
            levels: (0..LEVELS).map(level).collect(),
            offset: None,
            phase: 0.0,
            taken: 0,
            gone: 0,
            longest: 0,
            heads: Vec::new(),
        }
    }
}

impl OctaveSums {
    /// Of stretches that have nothing to do with one another, such as records of several days; a sample that is not finite is missing.
    pub fn of(stretches: &[&[f64]]) -> Self {
        let mut sums = Self::default();
        for stretch in stretches {
            sums.push(stretch);
            sums.end_stretch();
        }
        sums
    }

    /// Takes the next samples of the rate; those that are not finite are missing.
    pub fn push(&mut self, rates: &[f64]) {
        for rates in rates.chunks(BLOCK) {
            let finite = || rates.iter().copied().filter(|rate| rate.is_finite());
            let count = finite().count();
            let mean = if count == 0 { 0.0 } else { finite().sum::<f64>() / count as f64 };
            let offset = *self.offset.get_or_insert(mean);
            self.begin();
            for rate in rates {
                if rate.is_finite() {
                    self.phase += rate - offset;
                } else {
                    self.gone = self.gone.wrapping_add(1);
                }
                self.step();
            }
            self.advance(false);
        }
    }

    /// So many samples are missing. A gap of more than ten times as many samples as came before ends the stretch.
    pub fn skip(&mut self, samples: usize) {
        if self.taken == 0 || samples > LONGEST_GAP * self.taken {
            return self.end_stretch();
        }
        let mut left = samples;
        while left > 0 {
            let some = left.min(BLOCK);
            for _ in 0..some {
                self.gone = self.gone.wrapping_add(1);
                self.step();
            }
            self.advance(false);
            left -= some;
        }
    }

    /// Ends a stretch: no difference reaches from what came to what comes.
    pub fn end_stretch(&mut self) {
        self.advance(true);
        if self.taken > self.longest {
            self.longest = self.taken;
            self.heads = self.levels.iter_mut().map(|level| std::mem::take(&mut level.head)).collect();
        }
        let is_long = self.taken > BLOCK;
        for level in &mut self.levels {
            if is_long {
                // Memory for what comes after a record; short stretches keep it for the next one.
                (level.phase, level.missing) = Default::default();
            }
            level.phase.clear();
            level.missing.clear();
            level.head.clear();
            (level.dropped, level.complete) = (0, 0);
            level.octaves.iter_mut().for_each(|octave| octave.next = 0);
        }
        (self.offset, self.phase, self.taken, self.gone) = (None, 0.0, 0, 0);
    }

    /// The stretches that have differences at an averaging time of so many samples, as lengths in samples with their number: of the
    /// samples from the first to the last of differences that follow one another without a gap. Of more than 64 lengths neighbours count as equal.
    pub fn stretches(&self, factor: usize) -> Vec<(usize, usize)> {
        let octave = self.octaves().find(|octave| octave.factor == factor);
        let mut found: Vec<(usize, usize)> =
            octave.map_or_else(Vec::new, |octave| octave.sums.stretches().collect());
        if found.len() > LENGTHS {
            let group = found.len().div_ceil(LENGTHS);
            let merged = found.chunks(group).map(|few| {
                let count: usize = few.iter().map(|(_, count)| count).sum();
                let all: usize = few.iter().map(|(length, count)| length * count).sum();
                (all / count, count)
            });
            found = merged.collect();
        }
        found
    }

    /// The averaging times that have a difference.
    pub(super) fn octaves(&self) -> impl Iterator<Item = OctaveView<'_>> {
        let all =
            self.levels.iter().flat_map(|level| level.octaves.iter().map(move |octave| (level, octave)));
        all.filter(|(_, octave)| octave.sums.has_terms()).map(|(level, octave)| {
            let step = octave.sums.step();
            let factor = step * level.spacing;
            // A beginning that has too few values at this averaging time goes on at a longer spacing.
            let beginning = self.heads.iter().zip(&self.levels).find_map(|(head, level)| {
                let steps = (factor / level.spacing).max(1);
                let suffices = head.len() < 2 * level.longest || head.len() / steps >= NOISE_VALUES;
                suffices.then_some((head.as_slice(), steps))
            });
            OctaveView {
                factor,
                sums: &octave.sums,
                beginning: beginning.unwrap_or((&[], 1)),
                longest: self.longest,
            }
        })
    }

    /// The phase at the beginning of a stretch.
    fn begin(&mut self) {
        if self.taken == 0 && self.levels.first().is_some_and(|level| level.phase.is_empty()) {
            let (phase, gone) = (self.phase, self.gone);
            self.levels.iter_mut().for_each(|level| level.take(phase, gone));
        }
    }

    /// Takes the phase behind one more sample.
    fn step(&mut self) {
        self.taken += 1;
        // A multiple of 2ⁿ is in the levels of spacings up to that.
        let levels = 1 + self.taken.trailing_zeros().saturating_sub((EACH / FINEST).ilog2()) as usize;
        let (phase, gone) = (self.phase, self.gone);
        self.levels.iter_mut().take(levels).for_each(|level| level.take(phase, gone));
    }

    fn advance(&mut self, ends: bool) {
        self.levels.iter_mut().for_each(|level| level.advance(ends));
    }
}

impl Level {
    fn take(&mut self, phase: f64, missing: u32) {
        if self.phase.len() == self.phase.capacity() {
            // Twice as much only up to a block, and by blocks from there on: the last doubling would leave a third of the memory unused.
            let more = self.phase.len().clamp(4, BLOCK);
            self.phase.reserve_exact(more);
            self.missing.reserve_exact(more);
        }
        self.phase.push(phase);
        self.missing.push(missing);
        if self.head.len() < 2 * self.longest {
            self.head.push(phase);
        }
        if missing == 0 {
            self.complete = self.dropped + self.phase.len();
        }
    }

    fn advance(&mut self, ends: bool) {
        if !ends && self.phase.len() < 3 * self.longest + BLOCK {
            return;
        }
        let all = self.dropped + self.phase.len();
        for octave in &mut self.octaves {
            let from: Range<usize> = octave.next - self.dropped..self.phase.len();
            let (Some(phase), Some(missing)) = (self.phase.get(from.clone()), self.missing.get(from)) else {
                continue;
            };
            octave.sums.advance(phase, missing, ends);
            octave.next = octave.next.max(all.saturating_sub(3 * octave.sums.step()));
            let ends_of = 2 * octave.sums.step();
            if ends && all > ends_of {
                let tail = &self.phase[self.phase.len().saturating_sub(ends_of)..];
                let gone = &self.missing[self.phase.len().saturating_sub(ends_of)..];
                let complete = self.complete >= ends_of && gone.first() == gone.last();
                octave.sums.mirror(complete.then_some((&self.head[..], tail)), all);
            }
        }
        let keep = self.phase.len().min(3 * self.longest);
        let dropped = self.phase.len() - keep;
        self.phase.drain(..dropped);
        self.missing.drain(..dropped);
        self.dropped += dropped;
    }
}
