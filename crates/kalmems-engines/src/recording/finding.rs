//! What the diagnosis of a recording can find, and how it says so.

use serde::Serialize;
use std::fmt;

/// Whether a recording can be used in spite of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// It cannot.
    Fatal,
    /// It can; the finding is kept and counted.
    Note,
}

/// The kinds of finding. Nothing of it is ever repaired.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// No header and no row.
    Empty,
    /// The first line holds numbers, no names.
    NoHeader,
    /// The names are separated by something else than commas.
    Separator,
    /// A header and no row.
    HeaderOnly,
    /// A column that is needed is not there.
    NoSuchColumn,
    /// Several columns have one name.
    DuplicateColumn,
    /// The name of a needed column ends with no unit.
    UnknownUnit,
    /// The unit of the time column is no unit of time.
    TimeUnit,
    /// What the settings say of a column's numbers does not fit together.
    Contradiction,
    /// A row with more or fewer cells than the header.
    WrongColumnCount,
    /// A cell that holds something, and no number.
    NonNumeric,
    /// A row without a finite time.
    NoTime,
    /// A time that is the one before.
    RepeatedTime,
    /// Times before the ones before them, in so many places that the rows are in no order.
    DecreasingTime,
    /// Gaps that are too long to be predicted over, behind so many rows that the rest is too little.
    SparseTime,
    /// A row without a segment's label.
    NoLabel,
    /// A segment's label that was there already, with others between.
    SegmentReturns,
    /// The settings say what a column's numbers are.
    Stated,
    /// The settings say another unit than the file.
    OtherUnit,
    /// The name of a column ends with no unit, and it needs none.
    NoUnit,
    /// Lines without cells between the rows.
    BlankLine,
    /// The last line has no line end.
    NoLineEnd,
    /// An empty cell.
    Missing,
    /// A cell that says it is no number.
    Nan,
    /// A cell that is infinite or beyond the range of numbers.
    Infinite,
    /// A cell that says that the value was beyond the range of the instrument, or a value beyond the range that the settings state.
    Overload,
    /// Whole sampling intervals without rows.
    Gap,
    /// Times without rows that are too long to be predicted over: a new stretch begins.
    LongGap,
    /// Times before the ones before them: the clock begins again, and a new stretch with it.
    ClockBack,
    /// Rows with which the file begins a new waveform: a new stretch begins.
    NewWaveform,
    /// A counter of 32 bits begins again, and its times are taken as going on.
    CounterBeginsAgain,
    /// Rows of several sources take turns.
    MixedRows,
    /// Intervals that differ from the usual one: that of the nominal rate where the settings say one, their median otherwise.
    IrregularTime,
    /// Times that the file keeps in too few digits for their interval.
    RoundedTime,
    /// Times that follow each other at another rate than the settings say.
    OtherRate,
    /// Times that come in bursts, as those of a host do.
    BurstTime,
    /// A temperature beyond those at which the curves that compensate other columns were found.
    BeyondCurve,
    /// The signal stays at its highest or lowest value.
    Saturation,
    /// The signal stays at a value while its neighbours move.
    Stuck,
    /// A bit of the converter or of the transfer is the same in all values.
    DroppedBit,
    /// A column holds the values of another one.
    Repeats,
    /// The same value in every row.
    Constant,
}

/// What a recording is read for: what follows from a finding depends on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Purpose {
    /// An estimate or an identification, or an inspection before them.
    #[default]
    Estimate,
    /// A calibration.
    Calibration,
    /// An image or a spectrum.
    Evaluation,
}

impl FindingKind {
    /// Whether it is of the names and units of columns, and of no row.
    const fn is_of_the_columns(self) -> bool {
        matches!(
            self,
            Self::Empty
                | Self::NoHeader
                | Self::Separator
                | Self::HeaderOnly
                | Self::NoSuchColumn
                | Self::DuplicateColumn
                | Self::UnknownUnit
                | Self::TimeUnit
                | Self::Contradiction
                | Self::Stated
                | Self::OtherUnit
                | Self::NoUnit
                | Self::Constant
        )
    }

    /// Whether a recording with such a finding can be used.
    pub const fn severity(self) -> Severity {
        match self {
            Self::Empty
            | Self::NoHeader
            | Self::Separator
            | Self::HeaderOnly
            | Self::NoSuchColumn
            | Self::DuplicateColumn
            | Self::UnknownUnit
            | Self::TimeUnit
            | Self::Contradiction
            | Self::WrongColumnCount
            | Self::NonNumeric
            | Self::NoTime
            | Self::RepeatedTime
            | Self::DecreasingTime
            | Self::SparseTime
            | Self::NoLabel
            | Self::MixedRows
            | Self::SegmentReturns => Severity::Fatal,
            Self::Stated
            | Self::OtherUnit
            | Self::NoUnit
            | Self::BlankLine
            | Self::NoLineEnd
            | Self::Missing
            | Self::Nan
            | Self::Infinite
            | Self::Overload
            | Self::Gap
            | Self::LongGap
            | Self::ClockBack
            | Self::NewWaveform
            | Self::CounterBeginsAgain
            | Self::IrregularTime
            | Self::RoundedTime
            | Self::OtherRate
            | Self::BurstTime
            | Self::BeyondCurve
            | Self::Saturation
            | Self::Stuck
            | Self::DroppedBit
            | Self::Repeats
            | Self::Constant => Severity::Note,
        }
    }

    /// What is counted, for one and for several; empty where a count says nothing.
    const fn counted(self) -> (&'static str, &'static str) {
        match self {
            Self::WrongColumnCount | Self::NoTime | Self::NoLabel | Self::BeyondCurve => ("row", "rows"),
            Self::NonNumeric | Self::Missing | Self::Nan | Self::Infinite | Self::Overload => {
                ("cell", "cells")
            }
            Self::RepeatedTime | Self::DecreasingTime | Self::ClockBack | Self::CounterBeginsAgain => {
                ("time", "times")
            }
            Self::BlankLine => ("line", "lines"),
            Self::Gap | Self::LongGap | Self::SparseTime => ("gap", "gaps"),
            Self::IrregularTime => ("interval", "intervals"),
            Self::BurstTime => ("burst", "bursts"),
            Self::NewWaveform => ("waveform", "waveforms"),
            Self::Saturation | Self::Stuck => ("sample", "samples"),
            _ => ("", ""),
        }
    }

    /// What was expected, and what happens or what to do.
    const fn consequence(self, purpose: Purpose) -> &'static str {
        match (self, purpose) {
            (Self::Missing | Self::Nan | Self::Infinite | Self::Overload, Purpose::Calibration) => {
                "no value is made up: the calibration leaves the sample out"
            }
            (Self::Missing | Self::Nan | Self::Infinite | Self::Overload, Purpose::Evaluation) => {
                "no value is made up"
            }
            (Self::Gap, Purpose::Calibration) => {
                "nothing is put in: the calibration takes the samples at their times, and no difference across the gap"
            }
            (Self::Gap, Purpose::Evaluation) => "nothing is put in",
            (Self::IrregularTime, Purpose::Calibration | Purpose::Evaluation) => {
                "the times are kept as they stand"
            }
            _ => self.usual_consequence(),
        }
    }

    /// That where the purpose makes no difference.
    const fn usual_consequence(self) -> &'static str {
        match self {
            Self::Empty | Self::HeaderOnly => {
                "expected a line of names such as `time_s,cap_V` and rows of numbers below it"
            }
            Self::NoHeader => {
                "expected the names of the columns with their units: write such a `format` in the table that names the file, or put a \
                 line of names before the numbers"
            }
            Self::Separator => "expected commas between cells and a point in numbers",
            Self::NoSuchColumn => "name a column that the file has",
            Self::DuplicateColumn => "expected each name once: rename the others",
            Self::UnknownUnit => {
                "expected a name that ends with a unit, such as `cap_V`, or with `_1` where there is none"
            }
            Self::Contradiction => "correct `offset`, `scale`, `unit` or `compensation`",
            Self::Stated => "the settings say so",
            Self::OtherUnit => "the unit of the settings counts: correct whichever is wrong",
            Self::TimeUnit => "expected a unit of time, such as `time_s` or `time_us`",
            Self::WrongColumnCount => "expected as many cells as names in the header: complete the row",
            Self::NonNumeric => {
                "expected a number such as `-1.5e-3`: correct the cell, or leave it empty where nothing was \
                 measured"
            }
            Self::NoTime => "expected a finite time in every row: write it, or remove the row",
            Self::RepeatedTime => {
                "expected times that increase: where the times are written with too few digits, declare the rate instead of the \
                 column, such as `clock = { rate = \"1 kHz\" }`; where the rows of several records or sensors take turns, write each \
                 to a file of its own"
            }
            Self::MixedRows => "expected rows of one source: write those of each to a file of its own",
            Self::CounterBeginsAgain => "the times go on: the period of the counter is added from there on",
            Self::DecreasingTime => {
                "expected times that increase: sort the rows, or, where the file holds several records, name \
                 the column that tells them apart"
            }
            Self::NoLabel => "expected a label in every row, as the column tells the records apart",
            Self::SegmentReturns => {
                "expected the rows of a record in one piece: give each record a label of its own"
            }
            Self::NoUnit => "its numbers are kept as they stand",
            Self::BlankLine => "they are passed over",
            Self::NoLineEnd => {
                "it is read as it stands: if the file or the pipe was cut there, its last number is short of digits"
            }
            Self::Missing | Self::Nan | Self::Infinite | Self::Overload => {
                "no value is made up: an estimate there is a prediction without update"
            }
            Self::SparseTime => {
                "expected a recording with rows that follow each other: write a longer time as `longest` in \
                 `[recording.gaps]`, or sample faster"
            }
            Self::Gap => {
                "nothing is put in: an estimate predicts over the gap where it knows the drive, or begins anew if it is beyond \
                 `longest` in `[recording.gaps]`; `identify` takes records without a gap"
            }
            Self::LongGap => {
                "nothing is put in: a new stretch begins, and the estimate begins anew; `longest` in \
                 `[recording.gaps]` says what is predicted over"
            }
            Self::ClockBack | Self::NewWaveform => {
                "the times are kept as they stand: a new stretch begins, and the estimate begins anew"
            }
            Self::IrregularTime => "the times are kept as they stand: steps in time follow them",
            Self::RoundedTime => {
                "each is taken as its shortest decimal digits: write integers, such as of ns, or take off the start before \
                 writing, or leave the column out and declare the rate, such as `clock = { rate = \"1 MHz\" }`"
            }
            Self::OtherRate => {
                "the times are kept as they stand: correct `rate` of the `clock`, or the unit or `scale` of its `column`"
            }
            Self::BurstTime => {
                "the times are kept as they stand: if a host stamped the rows as they arrived, declare that rate as `rate` \
                 of the `clock`, instead of its `column`; if they were sampled in bursts, nothing is to be done"
            }
            Self::BeyondCurve => {
                "the curves keep their values at the ends: calibrate over this range of the temperature too"
            }
            Self::Saturation => {
                "the samples are kept as they stand: check the range of the instrument, if this is a \
                 measured signal"
            }
            Self::Stuck => {
                "the samples are kept as they stand: if the converter or the transfer hung there, leave these cells empty"
            }
            Self::DroppedBit => {
                "the samples are kept as they stand: check the converter, its cable and the number format of the file"
            }
            Self::Repeats => {
                "both are kept: if they are two channels, check the wiring and the names of the columns"
            }
            Self::Constant => "it is kept: check the connection, if this is a measured signal",
        }
    }
}

/// One finding: a kind, where it is first seen and how often.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What kind it is.
    pub kind: FindingKind,
    /// The column, where it concerns one.
    pub column: Option<String>,
    /// The segment, where it concerns one and the file has several.
    pub segment: Option<String>,
    /// Where it is first seen: the line in the file, counted from 1 as an editor does, or the sample of an array, counted from 0.
    pub first_row: usize,
    /// How often it is seen.
    pub count: usize,
    /// What was found, in words.
    pub detail: String,
    /// What the recording is read for.
    #[serde(skip)]
    pub purpose: Purpose,
    /// Whether it is of arrays, which have samples and no lines.
    #[serde(skip)]
    pub in_arrays: bool,
}

impl Finding {
    /// One about a column from a row on.
    pub(crate) fn of_column(
        kind: FindingKind,
        column: &str,
        first_row: usize,
        count: usize,
        detail: String,
    ) -> Self {
        let (column, segment, purpose) = (Some(column.to_owned()), None, Purpose::default());
        Self { kind, column, segment, first_row, count, detail, purpose, in_arrays: false }
    }

    /// Whether the recording can be used in spite of it.
    pub const fn severity(&self) -> Severity {
        self.kind.severity()
    }

    /// The same with what follows from it for another purpose.
    #[must_use]
    pub fn read_for(self, purpose: Purpose) -> Self {
        Self { purpose, ..self }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let place = match self.in_arrays {
            false => Some(format!("line {}", self.first_row)),
            true if self.kind.is_of_the_columns() => None,
            true => Some(format!("sample {}", self.first_row)),
        };
        let column = self.column.as_ref().map(|column| format!("column `{column}`"));
        let segment = self.segment.as_ref().map(|segment| format!("segment `{segment}`"));
        let places: Vec<String> = [place, column, segment].into_iter().flatten().collect();
        if !places.is_empty() {
            write!(f, "{}: ", places.join(", "))?;
        }
        write!(f, "{}", self.detail)?;
        let (one, several) = self.kind.counted();
        match self.count {
            _ if one.is_empty() => {}
            1 => write!(f, " (1 {one})")?,
            count => write!(f, " (the first of {count} {several})")?,
        }
        let is_given = self.in_arrays && self.kind == FindingKind::NoSuchColumn;
        let given = "give one of this name, or name one that there is";
        write!(f, "; {}", if is_given { given } else { self.kind.consequence(self.purpose) })
    }
}
