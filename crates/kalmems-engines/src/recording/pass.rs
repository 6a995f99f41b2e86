//! One pass over the rows: numbers into columns, rows into segments, and what is wrong into findings.

use super::counter::CounterTimes;
use super::findings::{FindingPlace, Findings, short};
use super::label::SegmentLabel;
use super::plan::{ReadingPlan, TargetColumn};
use super::rails::{LONG_RUN, RailPart, Rails};
use super::repeats::Repeats;
use super::request::ReadRequest;
use super::restart::{RestartCounts, TOO_SLOW, UNSORTED, first_cut};
use super::scale::ColumnScale;
use super::segment::{LineNumbers, Segment, SegmentTimes, TimeBase};
use super::time::{TimeCheck, TimingTally};
use super::{
    Finding, FindingKind as Kind, RecordingSource, Restarts, SampledRecording, StretchPlace, TimeOrigin,
    TimeSource,
};
use kalmems_figures::number;
use kalmems_formats::{Block, CellFault, CellFinding, Instant, TimeReader, TimeUnit, may_be_grouped};
use std::collections::{BTreeMap, TryReserveError, VecDeque};
use std::ops::Range;

/// A segment: its first row, its times and, once it has ended, the row after its last and its times' verdict.
struct OpenSegment {
    /// Its record, by the place of its label.
    record: usize,
    stretch: StretchPlace,
    start: usize,
    /// How many intervals after the start of the clock it begins, where the file has no times.
    intervals: u64,
    check: TimeCheck,
    end: Option<(usize, (Option<f64>, bool))>,
}

impl OpenSegment {
    fn first_interval(&self) -> usize {
        usize::try_from(self.intervals).unwrap_or(usize::MAX / 2)
    }
}

pub(super) struct Pass {
    plan: ReadingPlan,
    clock: TimeSource,
    /// Rows of a segment over which its usual interval is found.
    head: usize,
    findings: Findings,
    lines: LineNumbers,
    /// When a record is cut into stretches, how often that was done, and where first by each reason.
    restarts: Option<Restarts>,
    cuts: RestartCounts,
    /// The segments from the one of this number on.
    drafts: VecDeque<OpenSegment>,
    first_draft: usize,
    labels: Vec<String>,
    /// The present label as it stands in the file, and the line where each label began.
    label: Vec<u8>,
    begun: BTreeMap<SegmentLabel, usize>,
    /// Rows that do not go on from those before them, and how many are missing between.
    breaks: VecDeque<(usize, u64)>,
    /// One for each target that is looked at.
    rails: Vec<Option<Rails>>,
    /// Columns that are one.
    repeats: Repeats,
    /// What became known last before the end, and how many samples were at a rail or stayed until then.
    last_news: Vec<Finding>,
    disturbed: [usize; 2],
    /// The interval of the nominal rate in s, where the settings say one of a column of times.
    nominal_s: Option<f64>,
    counter: CounterTimes,
    /// The times of the rows from `base` on, where they have any; the targets hold their values.
    times: Vec<f64>,
    base: usize,
    /// Where the times count from, and to how many s the file rounds them.
    origin: Instant,
    resolution_s: f64,
}

impl Pass {
    /// `head`: rows of a segment over which its usual interval is found.
    pub(super) fn new(plan: ReadingPlan, findings: Findings, request: &ReadRequest, head: usize) -> Self {
        // A start far from zero is an origin like a first time.
        let mut times = TimeReader::new(TimeUnit::SECOND, request.origin);
        let clock = match request.clock {
            TimeSource::Rate { rate_hz, start_s } => {
                TimeSource::Rate { rate_hz: *rate_hz, start_s: times.float(*start_s) }
            }
            TimeSource::Column(name) => TimeSource::Column(name.clone()),
        };
        let rails = |target: &TargetColumn| is_looked_at(&plan, target).then(|| Rails::new(target.index));
        let counter = CounterTimes::new(plan.clock_unit.unit);
        let looked_at: Vec<bool> = plan.targets.iter().map(|target| is_looked_at(&plan, target)).collect();
        Self {
            repeats: Repeats::new(&looked_at),
            last_news: Vec::new(),
            disturbed: [0; 2],
            rails: plan.targets.iter().map(rails).collect(),
            plan,
            clock,
            restarts: request.restarts,
            cuts: RestartCounts::default(),
            head,
            nominal_s: request.nominal_rate_hz.map(f64::recip),
            origin: times.origin().unwrap_or_default(),
            resolution_s: 0.0,
            findings,
            lines: LineNumbers::default(),
            drafts: VecDeque::new(),
            first_draft: 0,
            labels: Vec::new(),
            label: Vec::new(),
            begun: BTreeMap::new(),
            breaks: VecDeque::new(),
            counter,
            times: Vec::new(),
            base: 0,
        }
    }

    /// Makes room for the rows of a block, if there is any.
    pub(super) fn reserve(&mut self, rows: usize) -> Result<(), TryReserveError> {
        let columns = self.plan.targets.iter_mut().map(|target| &mut target.values);
        columns.chain(std::iter::once(&mut self.times)).try_for_each(|values| values.try_reserve(rows))
    }

    /// Takes the rows of a block.
    pub(super) fn take(&mut self, block: &Block) {
        let begin = self.lines.rows();
        self.lines.push_many(block.rows, &block.lines);
        if self.plan.clock.is_some() {
            (self.origin, self.resolution_s) = (block.origin, block.resolution_s);
        }
        self.append(block, begin);
        self.repeats.take(&self.plan.targets, block.rows, self.lines.of(begin));
        self.breaks.extend(block.breaks.iter().map(|(row, missing)| (begin + row, *missing)));
        let whole = [(0, Vec::new())];
        let runs = match block.labels.first() {
            Some(runs) if self.plan.segment_column.is_some() => runs.as_slice(),
            _ => &whole,
        };
        let mut faults = block.faults.iter().peekable();
        for (index, (start, label)) in runs.iter().enumerate() {
            let end = runs.get(index + 1).map_or(block.rows, |(next, _)| *next);
            if end == *start {
                continue;
            }
            self.enter_segment(label, begin + start, end - start);
            while let Some(fault) = faults.next_if(|fault| fault.row < end) {
                self.note(fault);
            }
            self.cut(begin + start..begin + end);
        }
        faults.for_each(|fault| self.note(fault));
    }

    /// Takes the numbers of a block, of which the first row is the row `begin`.
    fn append(&mut self, block: &Block, begin: usize) {
        let numbers = |slot: usize| block.numbers.get(slot).map_or(&[][..], Vec::as_slice);
        if let Some(clock) = &self.plan.clock {
            let first = self.times.len();
            self.times.extend_from_slice(numbers(clock.slot));
            let fresh = self.times.get_mut(first..).unwrap_or_default();
            for row in self.counter.unwrap(fresh, block.origin) {
                let place = FindingPlace {
                    column: Some(clock.index),
                    segment: self.labels.len().checked_sub(1),
                    line: self.lines.of(begin + row),
                };
                let period_s = self.counter.period_s();
                self.findings.add(Kind::CounterBeginsAgain, place, || {
                    format!("a counter of 32 bits begins again, every {} s", number(period_s))
                });
            }
        }
        for target in &mut self.plan.targets {
            let segment = self.labels.len().checked_sub(1);
            let place = |row: usize| FindingPlace {
                column: Some(target.index),
                segment,
                line: self.lines.of(begin + row),
            };
            let first = target.values.len();
            append(&mut target.values, numbers(target.slot), target.scale, |row, number| {
                self.findings.add(Kind::Infinite, place(row), || format!("`{number:e}` is not finite"));
            });
            if let Some([low, high]) = target.curve_range {
                let fresh = target.values.iter().skip(first).enumerate();
                for (row, value) in fresh.filter(|(_, value)| **value < low || **value > high) {
                    self.findings.add(Kind::BeyondCurve, place(row), || {
                        let [value, low, high] = [*value, low, high].map(short);
                        format!("{value} K is beyond the curves from {low} to {high} K")
                    });
                }
            }
            let Some((low, high)) = target.range else { continue };
            for (row, value) in target.values.iter_mut().skip(first).enumerate() {
                if *value <= low || *value >= high {
                    let words = || {
                        let [value, low, high] = [*value, low, high].map(short);
                        format!("{value} is at or beyond the stated range from {low} to {high}, in SI")
                    };
                    self.findings.add(Kind::Overload, place(row), words);
                    *value = f64::NAN;
                }
            }
        }
    }

    /// Counts what is wrong with a cell or a line.
    fn note(&mut self, fault: &CellFault) {
        let line = usize::try_from(fault.line).unwrap_or(usize::MAX);
        let count = |count: u64| usize::try_from(count).unwrap_or(usize::MAX);
        let place = FindingPlace { column: fault.column, segment: self.labels.len().checked_sub(1), line };
        let of_row = FindingPlace { column: None, segment: None, line };
        match &fault.fault {
            CellFinding::CellCount { found, expected, rows } => {
                self.findings.add_many(Kind::WrongColumnCount, of_row, count(*rows), || {
                    format!("{} where the header has {expected}", plural(*found, "cell"))
                });
            }
            CellFinding::BlankLines { count: lines } => {
                self.findings.add_many(Kind::BlankLine, of_row, count(*lines), || {
                    "nothing between the rows".to_owned()
                });
            }
            CellFinding::NoLineEnd => {
                self.findings.add(Kind::NoLineEnd, of_row, || "the last line has no line end".to_owned());
            }
            cell => {
                let quoted = |text: &str| {
                    if self.plan.shows_cells { format!("`{text}`") } else { "the cell".to_owned() }
                };
                if self.plan.clock.as_ref().is_some_and(|clock| Some(clock.index) == fault.column) {
                    self.findings.add(Kind::NoTime, place, || match cell {
                        CellFinding::Nan(text)
                        | CellFinding::Overload(text)
                        | CellFinding::Infinite(text)
                        | CellFinding::Text(text) => format!("{} is no time", quoted(text)),
                        _ => "the cell is empty".to_owned(),
                    });
                }
                if self.plan.targets.iter().any(|target| Some(target.index) == fault.column) {
                    let (kind, detail) = match cell {
                        CellFinding::Nan(text) => {
                            (Kind::Nan, format!("{} is no number by its own word", quoted(text)))
                        }
                        CellFinding::Overload(text) => (
                            Kind::Overload,
                            format!(
                                "{} is written where a value is beyond the range of the instrument",
                                quoted(text)
                            ),
                        ),
                        CellFinding::Infinite(text) => {
                            (Kind::Infinite, format!("{} is not finite", quoted(text)))
                        }
                        CellFinding::Text(text) if may_be_grouped(text) => (
                            Kind::NonNumeric,
                            format!(
                                "{} is one number with groups of three digits and another without, and nothing in its column tells \
                                 which: state the decimal mark, such as `decimal = \".\"` in `format`, or `--decimal .`",
                                quoted(text)
                            ),
                        ),
                        CellFinding::Text(text) => {
                            (Kind::NonNumeric, format!("{} is no number", quoted(text)))
                        }
                        _ => (Kind::Missing, "the cell is empty".to_owned()),
                    };
                    self.findings.add(kind, place, || detail);
                }
            }
        }
    }

    /// Begins a segment where the label of some rows is another one.
    fn enter_segment(&mut self, label: &[u8], row: usize, rows: usize) {
        let label = label.trim_ascii();
        let line = self.lines.of(row);
        let place = FindingPlace { column: self.plan.segment_column, segment: None, line };
        let unlabelled = self.plan.segment_column.is_some() && label.is_empty();
        if unlabelled {
            self.findings.add_many(Kind::NoLabel, place, rows, || "the cell is empty".to_owned());
        }
        // A row without label stays with those before it, as it must be somewhere; the recording is not used.
        if !self.drafts.is_empty() && (unlabelled || label == self.label) {
            return;
        }
        let key = SegmentLabel::of(label);
        let same = !self.drafts.is_empty() && key == SegmentLabel::of(&self.label);
        label.clone_into(&mut self.label);
        if same {
            return;
        }
        self.end_segment(row, true);
        let record = self.labels.len();
        let segment = Some(record);
        self.labels.push(String::from_utf8_lossy(label).into_owned());
        self.begin_segment(record, StretchPlace::FIRST, row, 0);
        if let Some(begun) = self.begun.get(&key) {
            self.findings.add(Kind::SegmentReturns, FindingPlace { segment, ..place }, || {
                format!("the segment of line {begun} comes again")
            });
        } else {
            self.begun.insert(key, line);
        }
    }

    fn begin_segment(&mut self, record: usize, stretch: StretchPlace, start: usize, intervals: u64) {
        let tally = match self.drafts.back_mut() {
            Some(before) if before.record == record => before.check.take_tally(),
            _ => TimingTally::default(),
        };
        let check = TimeCheck::new(self.head, self.nominal_s, tally);
        self.drafts.push_back(OpenSegment { record, stretch, start, intervals, check, end: None });
    }

    /// Checks some rows of the present record, and cuts it into stretches where its times ask for that.
    fn cut(&mut self, rows: Range<usize>) {
        let mut from = rows.start;
        while let Some((row, why)) = self.next_cut(from..rows.end) {
            self.diagnose(from..row);
            self.restart(row, why);
            from = row;
        }
        self.diagnose(from..rows.end);
    }

    /// The first of some rows before which the present record is cut, and why.
    fn next_cut(&self, rows: Range<usize>) -> Option<(usize, Kind)> {
        let (restarts, draft) = (self.restarts?, self.drafts.back()?);
        let broken =
            self.breaks.iter().map(|(row, _)| *row).find(|row| *row > draft.start && *row >= rows.start);
        let broken = broken.filter(|row| *row < rows.end);
        if self.plan.clock.is_none() {
            return broken.map(|row| (row, Kind::LongGap));
        }
        // From the row before the first on, where the stretch has it.
        let first = rows.start.saturating_sub(1).max(draft.start).max(self.base);
        let times = self.times.get(first - self.base..rows.end - self.base)?;
        let cut = first_cut(&restarts, times, 1).map(|(row, why)| (first + row, why));
        match broken {
            Some(row) if cut.is_none_or(|(cut, why)| row < cut || row == cut && why != Kind::ClockBack) => {
                Some((row, Kind::NewWaveform))
            }
            _ => cut,
        }
    }

    /// Begins a new stretch of the present record with a row.
    fn restart(&mut self, row: usize, why: Kind) {
        let Some(draft) = self.drafts.back() else { return };
        let (record, stretch) = (draft.record, draft.stretch);
        while self.breaks.front().is_some_and(|(broken, _)| *broken < row) {
            self.breaks.pop_front();
        }
        if let TimeSource::Rate { rate_hz, start_s } = self.clock {
            let missing = self.breaks.front().map_or(0, |(_, missing)| *missing);
            let rows = row.saturating_sub(draft.start) as u64;
            if rows == 0 {
                return;
            }
            let place = FindingPlace { column: None, segment: Some(record), line: self.lines.of(row) };
            let before_s = start_s + (draft.intervals + rows - 1) as f64 / rate_hz;
            let intervals = draft.intervals.saturating_add(rows).saturating_add(missing);
            self.findings.add(why, place, || {
                format!(
                    "the rows do not go on after {} s, where {missing} or more are missing",
                    number(before_s)
                )
            });
            self.end_segment(row, false);
            self.begin_segment(record, stretch.next(why, before_s), row, intervals);
            return;
        }
        let time = |row: usize| self.times.get(row.wrapping_sub(self.base)).copied().unwrap_or(f64::NAN);
        let (before_s, after_s) = (time(row.wrapping_sub(1)), time(row));
        let longest_s = self.restarts.map_or(f64::INFINITY, |restarts| restarts.longest_gap_s);
        let column = self.plan.clock.as_ref().map(|clock| clock.index);
        let place = FindingPlace { column, segment: Some(record), line: self.lines.of(row) };
        self.findings.add(why, place, || match why {
            Kind::LongGap => format!(
                "nothing for {} s after {} s, longer than the {} s that are predicted over",
                short(after_s - before_s),
                number(before_s),
                short(longest_s)
            ),
            Kind::NewWaveform => {
                format!("the file begins a new waveform, {} s after {} s", number(after_s), number(before_s))
            }
            _ => format!("{} s after {} s", number(after_s), number(before_s)),
        });
        self.cuts.add(why);
        self.refuse_many(row, false);
        if self.restarts.is_none() {
            return;
        }
        self.end_segment(row, false);
        self.begin_segment(record, stretch.next(why, before_s), row, 0);
    }

    /// Refuses a recording that is cut so often in so many rows that it is in no order, or that its policy does not fit it;
    /// no more is it cut then.
    fn refuse_many(&mut self, rows: usize, ended: bool) {
        let Some(Restarts { longest_gap_s, at_any_rate: false }) = self.restarts else { return };
        let Some(kind) = self.cuts.judge(rows, ended) else { return };
        self.restarts = None;
        let of = if kind == Kind::SparseTime { Kind::LongGap } else { Kind::ClockBack };
        self.findings.raise(of, kind, |detail| match kind {
            Kind::SparseTime => format!(
                "more than one row in {TOO_SLOW} comes later than {} s after the one before: {detail}",
                short(longest_gap_s)
            ),
            _ => format!("{detail}, and more than one row in {UNSORTED} goes back"),
        });
    }

    /// Checks the times and values of some rows, all of the present segment.
    fn diagnose(&mut self, rows: Range<usize>) {
        let Some(draft) = self.drafts.back_mut() else { return };
        let segment = draft.record;
        let column = self.plan.clock.as_ref().map(|clock| clock.index);
        if column.is_some() {
            let lines = &self.lines;
            let start = draft.start;
            let place = |i: usize| FindingPlace { column, segment: Some(segment), line: lines.of(start + i) };
            let times = self.times.get(start.max(self.base) - self.base..rows.end - self.base);
            draft.check.hear_resolution(self.resolution_s);
            draft.check.take(times.unwrap_or_default(), rows.len(), place, &mut self.findings);
        }
        for (target, rails) in self.plan.targets.iter().zip(&mut self.rails) {
            let Some(rails) = rails else { continue };
            let from = draft.start.max(self.base) - self.base;
            let values = target.values.get(from..rows.end - self.base).unwrap_or_default();
            rails.take(&RailPart { values, fresh: rows.len(), end: rows.end, segment }, &self.lines);
        }
    }

    /// Ends the present segment before a row, and its record with it or not.
    fn end_segment(&mut self, end: usize, record_ends: bool) {
        let Some(draft) = self.drafts.back_mut() else { return };
        let segment = draft.record;
        let from = draft.start.max(self.base) - self.base;
        let verdict = match self.clock {
            TimeSource::Rate { rate_hz, .. } => (Some(rate_hz.recip()), true),
            TimeSource::Column(_) => {
                let column = self.plan.clock.as_ref().map(|clock| clock.index);
                let (lines, start) = (&self.lines, draft.start);
                let place =
                    |i: usize| FindingPlace { column, segment: Some(segment), line: lines.of(start + i) };
                let times = self.times.get(from..end - self.base).unwrap_or_default();
                draft.check.finish(times, place, &mut self.findings)
            }
        };
        if record_ends {
            draft.check.take_tally().tell(&mut self.findings);
        }
        draft.end = Some((end, verdict));
        for (target, rails) in self.plan.targets.iter().zip(&mut self.rails) {
            let values = target.values.get(from..end - self.base).unwrap_or_default();
            if let Some(rails) = rails {
                let part = RailPart { values, fresh: 0, end, segment };
                rails.end_stretch(&part);
                if record_ends {
                    rails.end_record();
                }
            }
        }
    }

    /// The end of the rows.
    pub(super) fn end(&mut self) {
        if self.drafts.is_empty() {
            let place = FindingPlace { column: None, segment: None, line: self.plan.line };
            self.findings.add(Kind::HeaderOnly, place, || "there are names and no row of numbers".to_owned());
        }
        self.refuse_many(self.lines.rows(), true);
        self.end_segment(self.lines.rows(), true);
        // What follows asks the columns for all that they know, and they are none then.
        self.last_news = self.news();
        self.disturbed = self.disturbed();
        for rails in std::mem::take(&mut self.rails).into_iter().flatten() {
            rails.finish(self.labels.len(), &mut self.findings);
        }
        let repeats = std::mem::replace(&mut self.repeats, Repeats::new(&[]));
        repeats.finish(&self.plan.targets, &self.plan.names, &mut self.findings);
    }

    /// Gives what has become known of the columns' values since this was last called: each kind of a column once in a stretch.
    pub(super) fn news(&mut self) -> Vec<Finding> {
        let mut findings = Findings::default();
        self.rails.iter_mut().flatten().for_each(|rails| rails.tell_news(&mut findings));
        self.repeats.tell_news(&self.plan.targets, &self.plan.names, &mut findings);
        if !findings.is_empty() {
            self.last_news.extend(self.listed(&findings));
        }
        std::mem::take(&mut self.last_news)
    }

    /// The samples at a rail and those that stay, of all columns, as far as they are known.
    pub(super) fn disturbed(&self) -> [usize; 2] {
        self.rails.iter().flatten().fold(self.disturbed, |[saturated, stuck], rails| {
            let [own_saturated, own_stuck] = rails.counts();
            [saturated + own_saturated, stuck + own_stuck]
        })
    }

    /// Lets go of rows, so far as no check needs them any more; at least those from `row` on stay.
    pub(super) fn forget(&mut self, row: usize) {
        while self.drafts.len() > 1
            && self.drafts.front().and_then(|draft| draft.end).is_some_and(|(end, _)| end <= row)
        {
            self.drafts.pop_front();
            self.first_draft += 1;
        }
        let Some(draft) = self.drafts.back() else { return };
        let needed = if self.plan.clock.is_some() && draft.check.is_waiting() {
            draft.start
        } else {
            self.lines.rows().saturating_sub(3 * LONG_RUN)
        };
        let row = row.min(needed);
        // Moving what stays costs as much as letting go; it is worth it for as many rows.
        if row < self.base + (self.lines.rows() - self.base) / 2 {
            return;
        }
        let segment = draft.record;
        let (end, from) = (self.lines.rows(), draft.start.max(self.base) - self.base);
        for (target, rails) in self.plan.targets.iter().zip(&mut self.rails) {
            if let Some(rails) = rails {
                let values = target.values.get(from..).unwrap_or_default();
                rails.forget(&RailPart { values, fresh: 0, end, segment });
            }
        }
        for target in &mut self.plan.targets {
            target.values.drain(..row - self.base);
        }
        if self.plan.clock.is_some() {
            self.times.drain(..row - self.base);
        }
        self.lines.forget(row);
        self.base = row;
    }

    /// Where the times count from, as far as it is known.
    pub(super) fn origin(&self) -> Option<TimeOrigin> {
        TimeOrigin::of(self.origin, self.plan.clock_unit.calendar)
    }

    /// The number of rows so far.
    pub(super) const fn rows(&self) -> usize {
        self.lines.rows()
    }

    /// Whether something was found that makes the recording unusable.
    pub(super) fn is_fatal(&self) -> bool {
        self.findings.is_fatal()
    }

    fn draft(&self, index: usize) -> Option<&OpenSegment> {
        self.drafts.get(index.checked_sub(self.first_draft)?)
    }

    /// The rows of a segment; without the end while it goes on. `None` where there is no such segment yet.
    pub(super) fn segment(&self, index: usize) -> Option<(usize, Option<usize>)> {
        self.draft(index).map(|draft| (draft.start, draft.end.map(|(end, _)| end)))
    }

    /// The usual interval of a segment in s, once it is known.
    pub(super) fn interval_s(&self, index: usize) -> Option<f64> {
        let draft = self.draft(index)?;
        match self.clock {
            TimeSource::Rate { rate_hz, .. } => Some(rate_hz.recip()),
            TimeSource::Column(_) => draft.check.interval_s(),
        }
    }

    /// Rows of a segment as a recording of their own, whose vectors `spare` provides.
    pub(super) fn part(
        &self,
        segment: usize,
        rows: Range<usize>,
        source: &RecordingSource,
        spare: &mut Vec<Vec<f64>>,
    ) -> Option<SampledRecording> {
        let draft = self.draft(segment)?;
        let range = rows.start.checked_sub(self.base)?..rows.end.checked_sub(self.base)?;
        let mut copy = |values: &[f64]| {
            let mut copy = spare.pop().unwrap_or_default();
            copy.clear();
            copy.extend_from_slice(values.get(range.clone()).unwrap_or_default());
            copy
        };
        let time = match self.clock {
            TimeSource::Rate { rate_hz, start_s } => {
                rate_times(rate_hz, start_s, draft.first_interval() + rows.start - draft.start, rows.len())
            }
            TimeSource::Column(_) => {
                let times = copy(&self.times);
                let interval_s = draft.check.interval_s();
                let uniform = super::time::are_uniform(&times, interval_s);
                TimeBase { times: SegmentTimes::Column(times), interval_s, uniform }
            }
        };
        let values = self.plan.targets.iter().map(|target| copy(&target.values)).collect();
        Some(SampledRecording {
            source: source.clone(),
            columns: self.plan.columns(values),
            segments: vec![Segment {
                label: self.labels.get(draft.record).cloned().unwrap_or_default(),
                rows: 0..rows.len(),
                time,
                stretch: draft.stretch,
            }],
            diagnosis: Vec::new(),
            rows: rows.len(),
            origin: self.origin,
        })
    }

    /// All that was found, the fatal first.
    pub(super) fn findings(&self) -> Vec<Finding> {
        self.listed(&self.findings)
    }

    fn listed(&self, findings: &Findings) -> Vec<Finding> {
        let labels = if self.plan.shows_cells { self.labels.as_slice() } else { &[] };
        findings.list(&self.plan.names, labels)
    }

    /// The whole recording, of which no row was let go of.
    pub(super) fn finish(mut self, source: RecordingSource) -> SampledRecording {
        self.end();
        let (rows, diagnosis) = (self.rows(), self.findings());
        let mut segments = Vec::with_capacity(self.drafts.len());
        let mut times = self.times;
        for draft in self.drafts.into_iter().rev() {
            let (end, (interval_s, uniform)) = draft.end.unwrap_or((rows, (None, false)));
            let time = match self.clock {
                TimeSource::Rate { rate_hz, start_s } => {
                    rate_times(rate_hz, start_s, draft.first_interval(), end - draft.start)
                }
                TimeSource::Column(_) => {
                    let of = if draft.start == 0 {
                        std::mem::take(&mut times)
                    } else {
                        times.split_off(draft.start.min(times.len()))
                    };
                    TimeBase { times: SegmentTimes::Column(of), interval_s, uniform }
                }
            };
            let label = self.labels.get(draft.record).cloned().unwrap_or_default();
            segments.push(Segment { label, rows: draft.start..end, time, stretch: draft.stretch });
        }
        segments.reverse();
        let values = self.plan.targets.iter_mut().map(|target| std::mem::take(&mut target.values)).collect();
        SampledRecording {
            source,
            columns: self.plan.columns(values),
            diagnosis,
            segments,
            rows,
            origin: self.origin,
        }
    }
}

/// Whether a column is searched for what is wrong with it: the labels of segments are constant in each by their nature, and a temperature stays where
/// it was set.
fn is_looked_at(plan: &ReadingPlan, target: &TargetColumn) -> bool {
    plan.segment_column != Some(target.index) && !target.is_hidden
}

/// The times of a clock that the file does not hold, from a row of a segment on.
fn rate_times(rate_hz: f64, start_s: f64, first: usize, len: usize) -> TimeBase {
    TimeBase {
        times: SegmentTimes::Rate { rate_hz, start_s, first, len },
        interval_s: Some(rate_hz.recip()),
        uniform: true,
    }
}

/// Appends numbers in SI; one that is beyond f64 there becomes NaN, and its row and what it was are told.
fn append(values: &mut Vec<f64>, numbers: &[f64], scale: ColumnScale, mut beyond: impl FnMut(usize, f64)) {
    let (factor, offset) = match scale {
        ColumnScale::Decimal(_) => return values.extend_from_slice(numbers),
        // Nothing is added to it, not even to the sign of a zero.
        ColumnScale::Factor(factor) => (factor, -0.0),
        ColumnScale::Affine { factor, offset, .. } => (factor, offset),
    };
    values.extend(numbers.iter().enumerate().map(|(row, number)| {
        let si = number * factor + offset;
        if si.is_infinite() {
            beyond(row, *number);
            return f64::NAN;
        }
        si
    }));
}

pub(crate) fn plural(count: usize, noun: &str) -> String {
    if count == 1 { format!("1 {noun}") } else { format!("{count} {noun}s") }
}
