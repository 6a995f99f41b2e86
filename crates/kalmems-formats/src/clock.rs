//! Clocks that a file states beside its samples, channel by channel: those that agree become the time of the table.

use crate::lanes::PaddedLane;
use crate::records::{CellKind, RecordField, RecordLane, StoredCell};
use crate::{Column, Instant, refuse_if};
use std::fmt::{self, Write as _};

/// How far a start may be from a whole number of samples, in samples.
pub(crate) const WHOLE: f64 = 0.01;
/// Rows of a text that are held until another waveform begins.
const MOST_ROWS_LATER: u64 = 1 << 16;
/// Begins of a clock that are named.
const NAMED: usize = 4;

/// How the samples of a channel follow each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SampleStep {
    /// So many seconds from one to the next.
    Interval(f64),
    /// So many in a second.
    Rate(f64),
}

impl SampleStep {
    /// Whether samples can follow each other so.
    pub(crate) fn is_sound(self) -> bool {
        self.interval_s() > 0.0 && self.interval_s().is_finite()
    }

    pub(crate) fn interval_s(self) -> f64 {
        match self {
            Self::Interval(interval_s) => interval_s,
            Self::Rate(rate_hz) => rate_hz.recip(),
        }
    }
}

impl fmt::Display for SampleStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Interval(interval_s) => write!(f, "k·{interval_s} s"),
            Self::Rate(rate_hz) => write!(f, "k/({rate_hz} Hz)"),
        }
    }
}

/// What a file states of the times of a channel's samples: `offset_s` and so many steps after an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ChannelClock {
    /// The instant, where one is stated.
    pub(crate) start: Option<Instant>,
    pub(crate) offset_s: f64,
    pub(crate) step: Option<SampleStep>,
}

/// A clock from a row of its channel on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ClockRun {
    pub(crate) row: u64,
    pub(crate) clock: ChannelClock,
}

/// Times from a row on: `start_s` and so many steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RegularTimes {
    pub(crate) row: u64,
    pub(crate) start_s: f64,
    pub(crate) step: SampleStep,
}

impl RegularTimes {
    /// The time of a row; of decimal digits, rounded once.
    pub(crate) fn at(&self, row: u64) -> f64 {
        match self.step {
            SampleStep::Rate(rate_hz) => self.start_s + (row - self.row) as f64 / rate_hz,
            SampleStep::Interval(interval_s) => {
                crate::decimal::affine(self.start_s, interval_s, row - self.row)
            }
        }
    }
}

/// The time of a row by runs of which the first begins with row 0.
pub(crate) fn time_at(runs: &[RegularTimes], row: u64) -> f64 {
    let run = runs.partition_point(|run| run.row <= row).checked_sub(1);
    run.and_then(|run| runs.get(run)).map_or(f64::NAN, |run| run.at(row))
}

/// How many rows are missing before each run but the first, as far as rows can be.
pub(crate) fn breaks(runs: &[RegularTimes]) -> impl Iterator<Item = (u64, u64)> {
    runs.windows(2).map(|pair| {
        let missing = (pair[1].start_s - pair[0].at(pair[1].row)) / pair[0].step.interval_s();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturating
        let missing = missing.round() as u64;
        (pair[1].row, missing)
    })
}

/// Channels that are put beside each other: columns with what the file states of their clocks, if they are samples.
pub(crate) struct ClockedChannels<'a> {
    pub(crate) fields: &'a mut Vec<RecordField>,
    pub(crate) lanes: &'a mut Vec<Box<dyn RecordLane>>,
    /// One for each field; nothing of those that are no samples.
    pub(crate) clocks: Vec<Vec<ClockRun>>,
    /// What states them, for people.
    pub(crate) stated_by: &'static str,
}

impl ClockedChannels<'_> {
    /// Puts the time that most channels agree on first. Channels whose start is a whole number of samples later begin as many rows
    /// later; those of another clock do not belong to the others. Says what it did.
    pub(crate) fn settle(self) -> String {
        let Self { fields, lanes, clocks, stated_by } = self;
        let name = |field: usize| fields.get(field).map_or("", |field| field.column.name.as_str());
        let channels: Vec<usize> = (0..clocks.len()).filter(|field| !clocks[*field].is_empty()).collect();
        let is_stated = |field: &usize| clocks[*field].iter().all(|run| run.clock.step.is_some());
        let (Some(stated), false) = (
            channels.iter().find(|field| is_stated(field)),
            fields.iter().any(|field| field.column.name == "time_s"),
        ) else {
            return String::new();
        };
        if let Some(other) = channels.iter().find(|field| !is_stated(field)) {
            let (states, lacks) = (name(*stated), name(*other));
            let why = format!("`{states}` states its interval and `{lacks}` does not");
            return format!("; no time is made, because {why} ({stated_by})");
        }
        let begin = clocks.iter().flatten().filter_map(|run| run.clock.start).min();
        let runs: Vec<Vec<RegularTimes>> = clocks.iter().map(|runs| regular(runs, begin)).collect();
        if let Some((field, run)) = channels.iter().find_map(|field| {
            let wrong = runs[*field].iter().find(|run| !run.step.is_sound() || !run.start_s.is_finite())?;
            Some((*field, wrong))
        }) {
            let (field, interval_s, start_s) = (name(field), run.step.interval_s(), run.start_s);
            let why = format!("`{field}` states samples every {interval_s} s from {start_s} s on");
            return format!("; no time is made, because {why} ({stated_by})");
        }
        // Of each class a channel, and the channels that agree with it, with the samples by which each begins later.
        let mut classes: Vec<(usize, Vec<(usize, i64)>)> = Vec::new();
        for field in channels {
            let class = classes.iter().enumerate().find_map(|(class, (of, _))| {
                Some((class, samples_later((&runs[*of], ""), &runs[field]).ok()?))
            });
            match class {
                Some((class, later)) => classes[class].1.push((field, later)),
                None => classes.push((field, vec![(field, 0)])),
            }
        }
        let most = classes.iter().map(|(_, members)| members.len()).max().unwrap_or(0);
        let Some(main) = classes.iter().position(|(_, members)| members.len() == most) else {
            return String::new();
        };
        let (of, members) = classes.swap_remove(main);
        let of_name = name(of).to_owned();
        for (class, (_, others)) in classes.iter().enumerate() {
            for (field, _) in others {
                let why = samples_later((&runs[of], &of_name), &runs[*field]).err().unwrap_or_default();
                fields[*field].column.group = class + 1;
                fields[*field].column.apart = Some(why);
            }
        }
        let earliest = members.iter().map(|(_, later)| *later).min().unwrap_or(0);
        let lead = |later: i64| later.abs_diff(earliest);
        if members.iter().any(|(_, later)| *later != earliest) {
            let rows =
                members.iter().map(|(field, later)| fields[*field].rows.saturating_add(lead(*later))).max();
            for (field, later) in &members {
                fields[*field].begin_later(lead(*later), rows.unwrap_or(0), lanes);
            }
        }
        let first = members.iter().find(|(_, later)| *later == earliest).map_or(of, |(field, _)| *field);
        let times = runs[first].clone();
        let words = words(&times, begin, stated_by);
        let rows = members.iter().map(|(field, _)| fields[*field].rows).max().unwrap_or(0);
        fields.insert(0, RecordField::new(Column::new("time_s"), CellKind::Clock(times), rows));
        words
    }
}

/// Runs as seconds after an instant; one that goes on from the one before is none of its own.
fn regular(runs: &[ClockRun], begin: Option<Instant>) -> Vec<RegularTimes> {
    let mut regular: Vec<RegularTimes> = Vec::new();
    for ClockRun { row, clock: ChannelClock { start, offset_s, step } } in runs {
        let Some(step) = *step else { continue };
        let since = start.zip(begin).map_or(0.0, |(start, begin)| start.since(begin));
        let next = RegularTimes { row: *row, start_s: since + offset_s, step };
        let goes_on = regular.last().is_some_and(|last| {
            last.step == step && (next.start_s - last.at(*row)).abs() <= WHOLE * step.interval_s()
        });
        if !goes_on {
            regular.push(next);
        }
    }
    regular
}

/// By how many samples a channel begins after another, which has a name; in words what keeps its rows from standing beside the
/// other's.
fn samples_later((of, name): (&[RegularTimes], &str), other: &[RegularTimes]) -> Result<i64, String> {
    let (Some(first), Some(second)) = (of.first(), other.first()) else { return Ok(0) };
    let interval_s = first.step.interval_s();
    if of == other {
        return Ok(0);
    }
    if (second.step.interval_s() / interval_s - 1.0).abs() > 1e-12 {
        let other_s = short(second.step.interval_s());
        return Err(format!(
            "a sample comes every {other_s} s, and every {} s of `{name}`",
            short(interval_s)
        ));
    }
    refuse_if(of.len() > 1 || other.len() > 1, || {
        format!("its clock begins anew at other rows or times than that of `{name}`")
    })?;
    let later_s = second.start_s - first.start_s;
    let (later, whole) = (later_s / interval_s, (later_s / interval_s).round());
    if (later - whole).abs() > WHOLE || whole.abs() > 1e15 {
        let (s, samples) = (short(later_s), short(later));
        return Err(format!("it starts {s} s after `{name}`: {samples} samples, no whole number"));
    }
    #[allow(clippy::cast_possible_truncation)] // within the bound
    let whole = whole as i64;
    Ok(whole)
}

/// Waveforms of one table: the time of the first row, and the rows by which each begins later; in words why they do not stand beside each
/// other. There is at least one.
pub(crate) fn rows_later(names: &[String], waveforms: &[RegularTimes]) -> Result<(f64, Vec<u64>), String> {
    let first = waveforms.first().ok_or("no waveform")?;
    let of = (std::slice::from_ref(first), names.first().map_or("", String::as_str));
    let mut later = Vec::new();
    for (name, waveform) in names.iter().zip(waveforms) {
        let samples = samples_later(of, std::slice::from_ref(waveform));
        later.push(samples.map_err(|why| format!("`{name}`: {why}"))?);
    }
    let earliest = later.iter().copied().min().unwrap_or(0);
    let start_s = waveforms.iter().map(|waveform| waveform.start_s).fold(f64::INFINITY, f64::min);
    let rows: Vec<u64> = later.into_iter().map(|samples| samples.abs_diff(earliest)).collect();
    if let Some(place) = rows.iter().position(|rows| *rows > MOST_ROWS_LATER) {
        let (name, rows) = (&names[place], rows[place]);
        return Err(format!("`{name}` begins {rows} samples later; at most {MOST_ROWS_LATER} are held"));
    }
    Ok((start_s, rows))
}

/// By how many rows a waveform begins after another that has a name, by the first times of both; in words why they do not stand beside each other.
pub(crate) fn rows_between((first, name): (&[f64], &str), own: &[f64]) -> Result<i64, String> {
    let (Some((start, rest)), Some(own_start)) = (first.split_first(), own.first()) else { return Ok(0) };
    let interval_s = rest.last().map_or(f64::NAN, |last| (last - start) / rest.len() as f64);
    let aligned =
        |(first, own): (&f64, &f64)| (own - first - (own_start - start)).abs() <= WHOLE * interval_s;
    refuse_if(first.len() != own.len() || !first.iter().zip(own).all(aligned), || {
        format!("its samples do not come as those of `{name}`")
    })?;
    let from = |start_s: f64| [RegularTimes { row: 0, start_s, step: SampleStep::Interval(interval_s) }];
    let rows = samples_later((&from(*start), name), &from(*own_start))?;
    refuse_if(rows.unsigned_abs() > MOST_ROWS_LATER, || {
        format!("it begins {rows} samples after `{name}`; at most {MOST_ROWS_LATER} are held")
    })?;
    Ok(rows)
}

/// A number of ten digits in a message.
fn short(number: f64) -> String {
    crate::element::shortest(format!("{number:.9e}").parse().unwrap_or(number))
}

/// What the times are, for people.
fn words(times: &[RegularTimes], begin: Option<Instant>, stated_by: &str) -> String {
    let mut words = String::from("; time_s =");
    for (place, RegularTimes { row, start_s, step }) in times.iter().take(NAMED).enumerate() {
        let joint = if place == 0 { "" } else { ";" };
        let from = if times.len() > 1 { format!(" from row {} on", row + 1) } else { String::new() };
        // Writing to a string cannot fail.
        let _ = write!(words, "{joint} {start_s} s + {step}{from}");
    }
    if times.len() > NAMED {
        let _ = write!(words, " and {} more", times.len() - NAMED);
    }
    words.push_str(if times.len() > 1 { " with k from 0 on in each" } else { " for row k from 0 on" });
    // Binary fractions of a second have digits that nobody wrote.
    if let Some(utc) = begin.map(Instant::to_nanosecond).and_then(Instant::to_utc) {
        let _ = write!(words, ", since {utc}");
    }
    let _ = write!(words, " ({stated_by}), which is not in the file");
    words
}

impl RecordField {
    /// Begins so many rows later, of so many in all: what is before and behind is missing.
    fn begin_later(&mut self, lead: u64, rows: u64, lanes: &mut [Box<dyn RecordLane>]) {
        let present = lead..lead + self.rows;
        if let CellKind::Stored { lane, cell: StoredCell::Number(_), .. } = self.cells
            && let Some(lane) = lanes.get_mut(lane)
        {
            let inner = std::mem::replace(lane, Box::new(PaddedLane::NONE));
            *lane = Box::new(PaddedLane::new(inner, present));
            self.rows = rows;
        }
    }
}
