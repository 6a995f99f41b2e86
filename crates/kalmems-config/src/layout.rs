//! How the columns of a recording are to be read, as an experiment file or a program says it.

use crate::TemperatureCurve;
use crate::units::{Unit, Value};
use kalmems_formats::{Hints, Instant};

/// What an experiment file says about the columns of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordingLayout {
    /// Where the time comes from.
    pub clock: TimeSource,
    /// The column that tells several records in one file apart.
    pub segment_column: Option<String>,
    /// The columns to read, each of which must be there and have a unit. `None`: all but the time and the
    /// labels of the segments, whatever their names end with.
    pub columns: Option<Vec<String>>,
    /// What the settings say of them beyond their names.
    pub declared: Vec<DeclaredColumn>,
    /// How the file is written, where that cannot be told from it.
    pub hints: Hints,
    /// The rate at which the settings say that the rows of a column of times follow each other.
    pub nominal_rate_hz: Option<f64>,
    /// Where the times count from, where the file is put beside another one; else it is for its first time to say.
    pub origin: Option<Instant>,
    /// When a record is cut into stretches. `None`: never, so that its times have to increase.
    pub restarts: Option<Restarts>,
}

/// Where the times of the rows come from.
#[derive(Clone, Debug, PartialEq)]
pub enum TimeSource {
    /// A column of times.
    Column(String),
    /// A fixed rate, where there is no such column; each segment begins at the start.
    Rate {
        /// Rows per second.
        rate_hz: f64,
        /// The time of a segment's first row.
        start_s: f64,
    },
}

/// A column as the settings name it.
#[derive(Clone, Debug, PartialEq)]
pub struct DeclaredColumn {
    /// Its name, as the settings have it.
    pub column: String,
    /// The key of the settings that names it, such as `signal` or [`DeclaredColumn::CLOCK`]; for messages.
    pub key: String,
    /// Where its numbers are of no use without a unit: one that would fit, for messages.
    pub usual_unit: Option<&'static str>,
    /// What is said of its numbers, where that is more than the name.
    pub reading: Option<ColumnReading>,
}

/// What is said of a column's numbers: the value is `scale · number`, in the product of both units, plus `offset`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColumnReading {
    /// The unit of the numbers as it was written, and what it is; that of the column's name if it is not said.
    pub unit: Option<(String, Unit)>,
    /// What each number is multiplied by.
    pub scale: Option<Value>,
    /// What is added after that.
    pub offset: Option<Value>,
    /// The lowest and the highest value that the instrument shows: what is at them or beyond is no measured value.
    pub range: Option<[Value; 2]>,
    /// What the values are compensated for; in words why that is not known.
    pub compensation: Option<Result<Box<ColumnCompensation>, String>>,
}

/// What the values of a column are compensated for: (value − bias − Σ cross-axis sensitivity · other column) / scale factor.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnCompensation {
    /// The column with the temperature.
    pub temperature: DeclaredColumn,
    /// The bias over the temperature; 0 if left out.
    pub bias: Option<TemperatureCurve>,
    /// The scale factor over the temperature; 1 if left out.
    pub scale_factor: Option<TemperatureCurve>,
    /// Other columns with the sensitivity to them. These are without their own cross-axis sensitivities: what that leaves is of second order.
    pub cross_axis: Vec<(String, TemperatureCurve)>,
}

impl DeclaredColumn {
    /// The key of a column of times.
    pub const CLOCK: &str = "clock";

    /// Whether it is the column of the times.
    pub fn is_clock(&self) -> bool {
        self.key == Self::CLOCK
    }
}

/// When a record is cut, so that what is made of it starts anew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Restarts {
    /// The longest time between two rows in s that does not cut it.
    pub longest_gap_s: f64,
    /// Whether it is used however often it is cut, as of rows that arrive.
    pub at_any_rate: bool,
}

impl Restarts {
    /// Behind gaps that are longer than this in s, and where the clock goes back.
    pub const fn beyond(longest_gap_s: f64) -> Self {
        Self { longest_gap_s, at_any_rate: false }
    }

    /// Where the clock goes back alone.
    pub const WHERE_THE_CLOCK_GOES_BACK: Self = Self::beyond(f64::INFINITY);
}
