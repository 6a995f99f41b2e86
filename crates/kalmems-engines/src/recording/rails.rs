//! The diagnosis of a column's values: constant, or saturated.
//!
//! A saturated signal repeats its highest or lowest value. So does the turning point of a sine that is rounded
//! coarsely, and so does a signal that has settled; neither must be taken for saturation. A run of `n` rows at an
//! extreme value, `n` at least [`SATURATION_RUN`], is looked at together with the `n` rows before and after it.
//!
//! - A smooth peak that stays for `n` rows within one step of rounding is a parabola there: `n` rows further out it
//!   has left its top by 3² − 1² = 8 steps, and a ninth by rounding. A clipped signal leaves it by more than
//!   [`SATURATION_STEPS`]. The step is the distance from the extreme value to the next one that the column ever
//!   takes, so a signal that switches between two levels never leaves by more than one.
//! - A clipped signal runs into its rail: within the nearest `n`/8 rows it leaves the value by an eighth of what it
//!   leaves it by within `n` rows if it is straight there, by a fourteenth if it is a clipped parabola. One that
//!   settles creeps: [`SATURATION_CREEP`] divides the two.
//!
//! A clipped sine with few samples in a cycle stays at its rail for fewer rows. The first argument holds down to [`SHORT_RUN`] rows, of which
//! a parabola leaves its top by 4² steps and two by rounding, but noise of about a step makes such runs as well, and in a recording whose values
//! are each written several times they are everywhere ([`HELD`]). So these count only where the level has [`SATURATION_SHARE`] times as many samples as
//! the values within three steps of it: a sine that is rounded is acos(1 − q/A)/π of the time on its highest step and as long on the
//! next three together, and noise is at its highest value less often than at those next to it.
//!
//! All of this is found in one pass. The runs at the present extreme are judged when the rows after them are there; a
//! new extreme drops them. What a run leaves its value by is compared with the step at the end, since the step can only
//! shrink. Where rows are let go of before the end, a run of [`LONG_RUN`] rows or more is judged by as many rows on
//! either side.

use super::FindingKind as Kind;
use super::dropped_bit::{DroppedBit, DroppedBitFinding};
use super::findings::{FindingPlace, Findings, short};
use super::segment::LineNumbers;
use super::stuck::{EqualRows, StuckValues};
use std::collections::BTreeMap;
use std::ops::Range;

/// A run this long is judged by as many rows before and after it, where the rows are not all kept.
pub const LONG_RUN: usize = 8192;

/// Runs that the step does not decide yet, sorted by what they leave their value by: where there are more, those that leave
/// it least are given up. A step that is not known after so many different ones is that of no converter.
const MOST_UNDECIDED: usize = 1 << 14;

/// The shortest run of rows at an extreme value that can be saturation.
pub const SATURATION_RUN: usize = 8;

/// The shortest run that can be saturation among many.
pub const SHORT_RUN: usize = 3;

/// Samples that a level must have where its runs have fewer than [`SATURATION_RUN`] rows.
const SHORT_SAMPLES: usize = 12;

/// By how many steps the signal must leave the extreme value next to such a run: those of a smooth peak of three rows, and its rounding.
const SHORT_STEPS: f64 = 18.0;

/// How many times as many samples it must have then as the values within three steps of it.
pub const SATURATION_SHARE: f64 = 3.0;

/// The share of rows that repeat the one before, away from the rails, from which on shorter runs say nothing.
const HELD: f64 = 0.25;

/// Values next to the level whose samples are counted: a converter has three within three steps.
const NEIGHBOURS: usize = 8;

/// By how many steps the signal must leave the extreme value next to the run: twice those of a smooth peak.
pub const SATURATION_STEPS: f64 = 16.0;

/// How many times as far the signal may be from the extreme value in all the rows next to the run as in the nearest
/// eighth of them.
pub const SATURATION_CREEP: f64 = 24.0;

/// The checks of one column, as its values come.
pub(super) struct Rails {
    /// Its position in the header.
    column: usize,
    sides: Option<[Rail; 2]>,
    /// The line of the first row.
    first_line: usize,
    numbers: usize,
    segment: SegmentExtremes,
    /// Segments whose values are all the same: position, line and value.
    constant: Vec<(usize, usize, f64)>,
    stuck: StuckValues,
    bits: DroppedBit,
    /// What is said of a dropped bit.
    dropped: Option<String>,
    news: RailNews,
}

/// What has become known of a column while its values come.
#[derive(Default)]
struct RailNews {
    /// Samples at a rail, and samples that stay, so far.
    saturated: usize,
    stuck: usize,
    /// What was told in this stretch already.
    told: [bool; 2],
    /// What was not told yet.
    waiting: Vec<(Kind, FindingPlace, usize, String)>,
}

impl RailNews {
    /// So many samples of this kind are found; `words` are asked for at the first in a stretch.
    fn found(&mut self, kind: Kind, place: FindingPlace, samples: usize, words: impl FnOnce() -> String) {
        let (count, told) = match kind {
            Kind::Stuck => (&mut self.stuck, &mut self.told[1]),
            _ => (&mut self.saturated, &mut self.told[0]),
        };
        *count += samples;
        if !std::mem::replace(told, true) {
            self.waiting.push((kind, place, samples, words()));
        }
    }
}

/// What is known of the present segment.
#[derive(Default)]
struct SegmentExtremes {
    index: usize,
    line: usize,
    rows: usize,
    extremes: Option<(f64, f64)>,
}

/// Where values stand.
pub(super) struct RailPart<'a> {
    /// The values of the segment up to now: all, or at least three times [`LONG_RUN`] of them and the fresh ones.
    pub(super) values: &'a [f64],
    /// How many of them, at the end, were not there before.
    pub(super) fresh: usize,
    /// The row of the recording after the last.
    pub(super) end: usize,
    /// The segment's position.
    pub(super) segment: usize,
}

impl RailPart<'_> {
    /// The values of some rows of the recording, as far as they are there.
    fn of(&self, rows: Range<usize>) -> &[f64] {
        let first = self.end - self.values.len();
        let (start, end) = (rows.start.max(first), rows.end.min(self.end));
        self.values.get(start - first..end.max(start) - first).unwrap_or_default()
    }
}

impl Rails {
    pub(super) fn new(column: usize) -> Self {
        Self {
            column,
            sides: None,
            first_line: 0,
            numbers: 0,
            segment: SegmentExtremes::default(),
            constant: Vec::new(),
            stuck: StuckValues::default(),
            bits: DroppedBit::default(),
            dropped: None,
            news: RailNews::default(),
        }
    }

    /// Takes the fresh values of a part.
    pub(super) fn take(&mut self, part: &RailPart, lines: &LineNumbers) {
        let begin = part.end - part.fresh;
        let fresh = part.of(begin..part.end);
        if begin == 0 {
            self.first_line = lines.of(0);
        }
        if self.segment.rows == 0 {
            self.segment =
                SegmentExtremes { index: part.segment, line: lines.of(begin), ..SegmentExtremes::default() };
        }
        self.segment.rows += fresh.len();
        for (row, value) in (begin..).zip(fresh) {
            self.stuck.take(*value, (row, part.segment), |row| lines.of(row));
            if let Some(dropped) = self.bits.take(*value) {
                self.hear_dropped(dropped);
            }
        }
        self.hear_stuck();
        let (mut low, mut high, mut numbers) = (f64::INFINITY, f64::NEG_INFINITY, 0);
        for value in fresh.iter().filter(|value| !value.is_nan()) {
            low = if *value < low { *value } else { low };
            high = if *value > high { *value } else { high };
            numbers += 1;
        }
        if numbers == 0 {
            self.meet(part, lines);
            return;
        }
        self.numbers = self.numbers.saturating_add(numbers);
        let (lowest, highest) = self.segment.extremes.unwrap_or((low, high));
        self.segment.extremes = Some((lowest.min(low), highest.max(high)));
        let [bottom, top] = self.sides.get_or_insert_with(|| [Rail::new(low), Rail::new(high)]);
        if low < bottom.level {
            *bottom = bottom.beyond(low);
        }
        if high > top.level {
            *top = top.beyond(high);
        }
        for rail in [bottom, top] {
            let before = rail.near.step;
            fresh.iter().filter(|value| !value.is_nan()).for_each(|value| rail.near.take(rail.level, *value));
            if rail.near.step < before {
                rail.decide();
            }
        }
        self.meet(part, lines);
    }

    fn meet(&mut self, part: &RailPart, lines: &LineNumbers) {
        for rail in self.sides.iter_mut().flatten() {
            rail.take(part, lines);
        }
        self.hear_rails();
    }

    /// Whether values are written several times, or change so slowly that neighbours are often the same.
    fn is_held(&self) -> bool {
        let at_rails = self.sides.iter().flatten().map(|rail| rail.near.own).sum::<usize>();
        let away = |rows: usize| rows.saturating_sub(at_rails) as f64;
        away(self.stuck.repeated()) > HELD * away(self.numbers)
    }

    /// Counts the runs at a rail that have become sure.
    fn hear_rails(&mut self) {
        let is_held = self.is_held();
        for (name, rail) in ["lowest", "highest"].into_iter().zip(self.sides.iter_mut().flatten()) {
            let Some((segment, tally)) = rail.news(is_held) else { continue };
            let place =
                FindingPlace { column: Some(self.column), segment: Some(segment), line: tally.first.1 };
            self.news.found(Kind::Saturation, place, tally.samples, || {
                format!("stays {}", at_rail(name, rail.level, &tally))
            });
        }
    }

    /// Counts the runs of equal values that have become known.
    fn hear_stuck(&mut self) {
        let levels = self.sides.as_ref().map_or([f64::NAN; 2], |[low, high]| [low.level, high.level]);
        while let Some(run) = self.stuck.next_between(levels) {
            let place =
                FindingPlace { column: Some(self.column), segment: Some(run.segment), line: run.line };
            self.news.found(Kind::Stuck, place, run.rows, || stays(&run));
        }
    }

    /// Keeps what the first rows show of a dropped bit: it is found once, and told while rows come and at the end.
    fn hear_dropped(&mut self, found: DroppedBitFinding) {
        let place = FindingPlace { column: Some(self.column), segment: None, line: self.first_line };
        let words = drops(found);
        self.news.waiting.push((Kind::DroppedBit, place, 1, words.clone()));
        self.dropped = Some(words);
    }

    /// The samples at a rail and those that stay, as far as they are known.
    pub(super) const fn counts(&self) -> [usize; 2] {
        [self.news.saturated, self.news.stuck]
    }

    /// Gives what has become known since this was last called, once of each kind in a stretch.
    pub(super) fn tell_news(&mut self, findings: &mut Findings) {
        for (kind, place, samples, words) in self.news.waiting.drain(..) {
            findings.add_many(kind, place, samples, || words);
        }
    }

    /// The rows before one are about to be let go of.
    pub(super) fn forget(&mut self, part: &RailPart) {
        for rail in self.sides.iter_mut().flatten() {
            rail.freeze(part);
        }
    }

    /// The end of a stretch of a segment, with its last part: what comes after it does not follow it.
    pub(super) fn end_stretch(&mut self, part: &RailPart) {
        self.stuck.interrupt();
        for rail in self.sides.iter_mut().flatten() {
            rail.end_segment(part);
        }
        self.hear_rails();
        self.news.told = [false; 2];
    }

    /// The end of a segment, after that of its last stretch.
    pub(super) fn end_record(&mut self) {
        let segment = std::mem::take(&mut self.segment);
        if segment.rows >= SATURATION_RUN
            && let Some((low, high)) = segment.extremes
            && low >= high
        {
            self.constant.push((segment.index, segment.line, low));
        }
    }

    /// The end of the recording.
    pub(super) fn finish(mut self, segments: usize, findings: &mut Findings) {
        if let Some(dropped) = self.bits.decide() {
            self.hear_dropped(dropped);
        }
        let is_held = self.is_held();
        let place = |segment, line| FindingPlace { column: Some(self.column), segment, line };
        let Some([low, high]) = self.sides else { return };
        if low.level.to_bits() == high.level.to_bits() {
            if self.numbers > 1 {
                findings.add(Kind::Constant, place(None, self.first_line), || {
                    format!("always {}", short(low.level))
                });
            }
            return;
        }
        if segments > 1 {
            for (segment, line, level) in self.constant {
                findings.add(Kind::Constant, place(Some(segment), line), || {
                    format!("always {} in this segment", short(level))
                });
            }
        }
        if let Some(dropped) = self.dropped {
            findings.add(Kind::DroppedBit, place(None, self.first_line), || dropped);
        }
        for run in self.stuck.finish([low.level, high.level]) {
            findings.add_many(Kind::Stuck, place(Some(run.segment), run.line), run.rows, || stays(&run));
        }
        let mut found: BTreeMap<usize, [RailTally; 2]> = BTreeMap::new();
        let levels = [high.level, low.level];
        for (side, rail) in [high, low].into_iter().enumerate() {
            for (segment, tally) in rail.tallies(is_held) {
                if let Some(own) = found.entry(segment).or_default().get_mut(side) {
                    *own = tally;
                }
            }
        }
        for (segment, tallies) in found {
            let samples = tallies.iter().map(|t| t.samples).sum();
            let first = tallies.iter().filter(|t| t.samples > 0).map(|t| t.first).min().unwrap_or_default();
            findings.add_many(Kind::Saturation, place(Some(segment), first.1), samples, || {
                let parts: Vec<String> = ["highest", "lowest"]
                    .iter()
                    .zip(levels)
                    .zip(&tallies)
                    .filter(|(_, tally)| tally.samples > 0)
                    .map(|((name, level), tally)| at_rail(name, level, tally))
                    .collect();
                format!("stays {}", parts.join(" and "))
            });
        }
    }
}

fn at_rail(name: &str, level: f64, tally: &RailTally) -> String {
    format!("at its {name} value {} in runs of up to {} rows", short(level), tally.longest)
}

fn drops(found: DroppedBitFinding) -> String {
    match found {
        DroppedBitFinding::Between { weight, step } => format!(
            "has no value in every second range of {}, in steps of {}: the bit of this weight is dropped",
            short(weight),
            short(step)
        ),
        DroppedBitFinding::Highest { jump, jumps } => format!(
            "jumps {jumps} times by its whole range of {} while the signal moves on: its highest bit is dropped, or it overflows",
            short(jump)
        ),
    }
}

fn stays(run: &EqualRows) -> String {
    format!("stays at {} for {} rows, between rows that differ", short(run.value), run.rows)
}

/// The values nearest to an extreme one.
struct NearValues {
    /// The distance to the nearest.
    step: f64,
    /// Samples at the extreme value itself, and at each of the nearest others.
    own: usize,
    nearest: Vec<(f64, usize)>,
}

impl NearValues {
    const NONE: Self = Self { step: f64::INFINITY, own: 0, nearest: Vec::new() };

    fn take(&mut self, level: f64, value: f64) {
        let distance = (value - level).abs();
        if distance == 0.0 {
            self.own += 1;
            return;
        }
        let is_full = self.nearest.len() == NEIGHBOURS;
        if is_full && self.nearest.last().is_some_and(|(last, _)| distance > (last - level).abs()) {
            return;
        }
        let place = self.nearest.partition_point(|(near, _)| (near - level).abs() < distance);
        if let Some((_, count)) = self.nearest.get_mut(place).filter(|(near, _)| *near == value) {
            *count += 1;
        } else {
            self.nearest.truncate(NEIGHBOURS - 1);
            self.nearest.insert(place, (value, 1));
        }
        self.step = self.step.min(distance);
    }

    /// Samples at values within three steps of the extreme one, but for those at itself.
    fn within_three_steps(&self, level: f64) -> usize {
        let near = |value: &f64| (value - level).abs() <= 3.5 * self.step;
        self.nearest.iter().filter(|(value, _)| near(value)).map(|(_, samples)| samples).sum()
    }
}

/// An extreme value, those next to it, and the runs at it.
struct Rail {
    level: f64,
    near: NearValues,
    /// The run that is going on.
    open: Option<RailRun>,
    /// Runs whose rows after them are not all there.
    waiting: Vec<RailRun>,
    /// What is sure of runs of [`SATURATION_RUN`] rows or more, by segment.
    sure: BTreeMap<usize, RailTally>,
    /// The same of shorter ones, which count where they are many.
    short: BTreeMap<usize, RailTally>,
    /// What of either has become sure since it was last asked, with its segment.
    fresh: [Option<(usize, RailTally)>; 2],
    /// What depends on the step, by what the runs leave their value by (the bits of a number that is not negative are in its
    /// order), by segment and by whether they are short.
    undecided: BTreeMap<(u64, usize, bool), RailTally>,
}

/// A run of rows at an extreme value.
#[derive(Clone)]
struct RailRun {
    start: usize,
    rows: usize,
    /// The line of its first row, once it counts.
    line: usize,
    /// What is before it, where its rows are let go of.
    before: Option<SignalSide>,
}

/// The signal on one side of a run.
#[derive(Clone, Copy)]
struct SignalSide {
    /// How far it leaves the level by where it runs into it; 0 where it creeps.
    departure: f64,
    /// Whether there are as many rows as the run has.
    complete: bool,
}

/// Runs together: where the first begins (row and line), how long the longest is and how many rows there are.
#[derive(Clone, Copy, Default)]
struct RailTally {
    first: (usize, usize),
    longest: usize,
    samples: usize,
}

impl RailTally {
    fn add(&mut self, other: Self) {
        self.first = if self.samples == 0 { other.first } else { self.first.min(other.first) };
        self.longest = self.longest.max(other.longest);
        self.samples += other.samples;
    }
}

impl Rail {
    const fn new(level: f64) -> Self {
        Self {
            level,
            near: NearValues::NONE,
            open: None,
            waiting: Vec::new(),
            sure: BTreeMap::new(),
            short: BTreeMap::new(),
            fresh: [None, None],
            undecided: BTreeMap::new(),
        }
    }

    /// A level beyond all values before.
    fn beyond(&self, level: f64) -> Self {
        let mut nearest = self.near.nearest.clone();
        nearest.insert(0, (self.level, self.near.own));
        nearest.truncate(NEIGHBOURS);
        let near = NearValues { step: (self.level - level).abs(), own: 0, nearest };
        Self { near, ..Self::new(level) }
    }

    fn take(&mut self, part: &RailPart, lines: &LineNumbers) {
        let begin = part.end - part.fresh;
        let mut row = begin;
        // Exactly equal is what is meant: a clipped signal repeats the value of its rail.
        while row < part.end {
            let rest = part.of(row..part.end);
            if self.open.is_none() {
                let Some(next) = rest.iter().position(|v| *v == self.level) else { break };
                row += next;
                self.open = Some(RailRun { start: row, rows: 0, line: 0, before: None });
            }
            let rest = part.of(row..part.end);
            let more = rest.iter().position(|v| *v != self.level).unwrap_or(rest.len());
            row += more;
            if let Some(run) = &mut self.open {
                if run.rows < SHORT_RUN && run.rows + more >= SHORT_RUN {
                    run.line = lines.of(run.start);
                }
                run.rows += more;
            }
            if row < part.end {
                self.close();
            }
        }
        self.judge(part, false);
    }

    fn close(&mut self) {
        self.waiting.extend(self.open.take().filter(|run| run.rows >= SHORT_RUN));
    }

    /// Judges the runs that have all their rows after them, at the end of a segment all.
    fn judge(&mut self, part: &RailPart, last: bool) {
        if self.waiting.is_empty() {
            return;
        }
        for run in std::mem::take(&mut self.waiting) {
            let end = run.start + run.rows;
            let rows = run.before.map_or(run.rows, |_| run.rows.min(LONG_RUN));
            if end + rows > part.end && !last {
                self.waiting.push(run);
                continue;
            }
            let before = run.before.unwrap_or_else(|| self.before(&run, part, run.rows));
            let after = part.of(end..end + rows);
            let after = self.side(after, after.split_at(nearest(after)).0, rows);
            // Into the level on both sides; where the record ends too early on both sides, on one of them.
            let departure = match (before.complete, after.complete) {
                (true, true) => before.departure.min(after.departure),
                (true, false) => before.departure,
                (false, true) => after.departure,
                (false, false) => before.departure.max(after.departure),
            };
            let tally = RailTally { first: (run.start, run.line), longest: run.rows, samples: run.rows };
            let is_short = run.rows < SATURATION_RUN;
            if departure > steps_of(is_short) * self.near.step {
                self.is_sure((part.segment, is_short), tally);
            } else if departure > 0.0 {
                self.undecided.entry((departure.to_bits(), part.segment, is_short)).or_default().add(tally);
            }
        }
        if self.undecided.len() > MOST_UNDECIDED {
            self.decide();
            while self.undecided.len() > MOST_UNDECIDED {
                self.undecided.pop_first();
            }
        }
    }

    /// What is before a run.
    fn before(&self, run: &RailRun, part: &RailPart, rows: usize) -> SignalSide {
        let before = part.of(run.start.saturating_sub(rows)..run.start);
        self.side(before, before.split_at(before.len() - nearest(before)).1, rows)
    }

    fn side(&self, side: &[f64], near: &[f64], rows: usize) -> SignalSide {
        let (far, near) = (self.departure(side), self.departure(near));
        SignalSide {
            departure: if far <= SATURATION_CREEP * near { far } else { 0.0 },
            complete: side.len() == rows,
        }
    }

    /// How far values are from the level at most, passing over NaN.
    fn departure(&self, values: &[f64]) -> f64 {
        values.iter().map(|v| (v - self.level).abs()).fold(0.0, f64::max)
    }

    /// Keeps what is known of long runs before their rows are let go of.
    fn freeze(&mut self, part: &RailPart) {
        let level = Self::new(self.level);
        for run in self.open.iter_mut().chain(&mut self.waiting) {
            if run.rows >= LONG_RUN && run.before.is_none() {
                run.before = Some(level.before(run, part, LONG_RUN));
            }
        }
    }

    fn end_segment(&mut self, part: &RailPart) {
        self.close();
        self.judge(part, true);
    }

    /// Moves what the step has decided.
    fn decide(&mut self) {
        let least = (SATURATION_STEPS * self.near.step).to_bits();
        for ((departure, segment, is_short), tally) in self.undecided.split_off(&(least + 1, 0, false)) {
            if f64::from_bits(departure) > steps_of(is_short) * self.near.step {
                self.is_sure((segment, is_short), tally);
            } else {
                self.undecided.insert((departure, segment, is_short), tally);
            }
        }
    }

    fn is_sure(&mut self, (segment, is_short): (usize, bool), tally: RailTally) {
        let own = if is_short { &mut self.short } else { &mut self.sure };
        own.entry(segment).or_default().add(tally);
        self.fresh[usize::from(is_short)].get_or_insert((segment, RailTally::default())).1.add(tally);
    }

    /// Whether the shorter runs count.
    fn has_many_short(&self, is_held: bool) -> bool {
        let samples = self.near.own;
        !is_held
            && samples >= SHORT_SAMPLES
            && samples as f64 > SATURATION_SHARE * self.near.within_three_steps(self.level) as f64
    }

    /// What has become sure since this was last called, with the segment where it begins.
    fn news(&mut self, is_held: bool) -> Option<(usize, RailTally)> {
        let long = self.fresh[0].take();
        let short = if self.has_many_short(is_held) { self.fresh[1].take() } else { None };
        let (segment, mut tally) = long.or(short)?;
        if long.is_some()
            && let Some((_, short)) = short
        {
            tally.add(short);
        }
        Some((segment, tally))
    }

    /// All runs that the step leaves, by segment.
    fn tallies(mut self, is_held: bool) -> BTreeMap<usize, RailTally> {
        self.decide();
        let counted =
            if self.has_many_short(is_held) { std::mem::take(&mut self.short) } else { BTreeMap::new() };
        for (segment, tally) in counted {
            self.sure.entry(segment).or_default().add(tally);
        }
        self.sure
    }
}

/// By how many steps a run must be left.
const fn steps_of(is_short: bool) -> f64 {
    if is_short { SHORT_STEPS } else { SATURATION_STEPS }
}

/// How many rows are next to a run.
fn nearest(side: &[f64]) -> usize {
    side.len().min(side.len() / 8 + 1)
}
