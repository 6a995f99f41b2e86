//! What an experiment file says about its recordings.

use super::column::{FileColumns, usual_unit};
use super::format::FileFormat;
use super::kinds::Time;
use super::quantity::Quantity;
use super::sign::NotNegative;
use super::{Clock, ColumnChoice, Gaps, Name, Values};
use kalmems_formats::Arrays;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// One recording: a file, what it was taken for, and what its columns mean.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    /// A name, unique in the experiment; may be left out where there is only one recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<Name>,
    /// What it was taken for.
    #[schemars(example = &"test")]
    pub role: RecordingRole,
    /// The file with the samples, relative to the folder of the experiment file.
    #[schemars(example = &"recording.csv")]
    pub file: PathBuf,
    /// How the file is written, where that cannot be told from it: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// Where one file holds several records: the column that tells them apart. Time may restart with each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// When the samples were taken.
    pub clock: Clock,
    /// What is done where samples are missing in time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gaps: Option<Gaps>,
    /// The columns by their meaning, such as `{ drive = "drive_V", signal = "cap_V" }`; in place of a name a table, such as
    /// `{ column = "Ucap", unit = "V" }`, says what the column's numbers are.
    pub channels: Channels,
    /// An independent measurement of the motion. Only the evaluation of an estimate, or an identification,
    /// reads it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<Reference>,
    /// What stands in the place of the file; see [`ArraysByFile`](super::ArraysByFile).
    #[serde(skip)]
    pub(super) arrays: Option<Arrays>,
}

impl Recording {
    /// A file with these columns, of which nothing else is said.
    pub const fn of(
        role: RecordingRole,
        file: PathBuf,
        clock: Clock,
        channels: Channels,
        reference: Option<Reference>,
    ) -> Self {
        Self {
            name: None,
            role,
            file,
            format: None,
            segments: None,
            clock,
            gaps: None,
            channels,
            reference,
            arrays: None,
        }
    }

    /// Its file with its columns.
    pub(super) fn in_file(&self) -> FileColumns<'_> {
        FileColumns::new(self.format.as_ref(), &self.clock, self.channels.in_file())
            .divided_by(self.segments.as_ref())
    }
}

/// What a recording was taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RecordingRole {
    /// An estimate is wanted, and judged where there is a reference.
    Test,
    /// Parameters are identified from it.
    Training,
    /// Motion of constant amplitude.
    SteadyState,
    /// Free decay after the drive was cut off.
    RingDown,
    /// The drive's frequency passes the resonance.
    Sweep,
    /// Driven, with the bias of the sensing electrodes on.
    BiasOn,
    /// Driven, with that bias off: what is left is feedthrough.
    BiasOff,
    /// No drive: what is left is noise.
    ZeroDrive,
    /// The output of a gyroscope on the device.
    Gyro,
}

impl RecordingRole {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Test,
        Self::Training,
        Self::SteadyState,
        Self::RingDown,
        Self::Sweep,
        Self::BiasOn,
        Self::BiasOff,
        Self::ZeroDrive,
        Self::Gyro,
    ];

    /// As a file has it.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Test => "test",
            Self::Training => "training",
            Self::SteadyState => "steady_state",
            Self::RingDown => "ring_down",
            Self::Sweep => "sweep",
            Self::BiasOn => "bias_on",
            Self::BiasOff => "bias_off",
            Self::ZeroDrive => "zero_drive",
            Self::Gyro => "gyro",
        }
    }
}

/// How several records in one file are told apart.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Segments {
    /// The column whose value, text or number, changes from one record to the next.
    pub column: String,
}

/// Columns by their meaning. The rig knows the meanings; there is at least one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "BTreeMap<String, ColumnChoice>")]
pub struct Channels(BTreeMap<String, ColumnChoice>);

impl Channels {
    /// The column with this meaning.
    pub fn column(&self, meaning: &str) -> Option<&str> {
        self.0.get(meaning).map(ColumnChoice::name)
    }

    /// Meanings and columns, sorted by meaning.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.choices().map(|(meaning, column)| (meaning, column.name()))
    }

    /// The same with what is said of the columns.
    pub fn choices(&self) -> impl Iterator<Item = (&str, &ColumnChoice)> {
        self.0.iter().map(|(meaning, column)| (meaning.as_str(), column))
    }

    /// Reads the curves that its columns are compensated with; `folder` is that of the file that names them.
    pub fn load_compensations(&mut self, folder: &Path) {
        self.0.values_mut().for_each(|column| column.load_compensation(folder));
    }

    pub(super) fn move_files(&mut self, place: &dyn Fn(&Path) -> PathBuf) {
        self.0.values_mut().for_each(|column| column.move_file(place));
    }

    /// The columns of a file, all of which need a unit.
    pub fn in_file(&self) -> Vec<(&str, &ColumnChoice, Option<&'static str>)> {
        self.choices().map(|(meaning, column)| (meaning, column, Some(usual_unit(meaning)))).collect()
    }
}

impl TryFrom<BTreeMap<String, ColumnChoice>> for Channels {
    type Error = &'static str;

    fn try_from(columns: BTreeMap<String, ColumnChoice>) -> Result<Self, Self::Error> {
        if columns.is_empty() {
            Err(
                "found no channel; expected at least one meaning with its column, such as `signal = \"cap_V\"`",
            )
        } else {
            Ok(Self(columns))
        }
    }
}

impl JsonSchema for Channels {
    fn schema_name() -> Cow<'static, str> {
        "Channels".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut schema = <BTreeMap<String, ColumnChoice>>::json_schema(generator);
        schema.insert("minProperties".to_owned(), 1.into());
        let mapped = json!({ "drive": { "column": "Vdrive", "unit": "V" }, "signal": "cap_V" });
        schema.insert("examples".to_owned(), json!([{ "drive": "drive_V", "signal": "cap_V" }, mapped]));
        schema
    }
}

/// An independent measurement of the motion. What is left out is as in the recording.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Its file, relative to the folder of the experiment file; the recording's file if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<PathBuf>,
    /// How its file is written, where that cannot be told from it; as in the recording where it is the same file.
    #[serde(skip_serializing_if = "Option::is_none")]
    format: Option<FileFormat>,
    /// The column that tells records apart; as in the recording if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    segments: Option<Segments>,
    /// When its samples were taken; as in the recording if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    clock: Option<Clock>,
    /// The columns by their meaning, such as `{ angle = "angle_rad" }`.
    pub channels: Channels,
    /// How much later than the motion the instrument shows it; 0 s if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    delay: Option<Quantity<Time>>,
    /// The standard deviation of that; exact if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    delay_sd: Option<Quantity<Time, NotNegative>>,
    /// The standard deviation of its own errors, by channel, such as `{ angle = "1 mrad" }`; exact if left out.
    #[serde(default, skip_serializing_if = "Values::is_empty")]
    pub sd: Values,
    /// What stands in the place of the file.
    #[serde(skip)]
    pub(super) arrays: Option<Arrays>,
}

impl Reference {
    /// Whether it is in the recording's own file.
    pub const fn is_in_recording(&self) -> bool {
        self.file.is_none()
    }

    /// A file of its own with these columns, sampled as the recording.
    pub fn of(file: PathBuf, channels: Channels) -> Self {
        Self {
            file: Some(file),
            format: None,
            segments: None,
            clock: None,
            channels,
            delay: None,
            delay_sd: None,
            sd: Values::default(),
            arrays: None,
        }
    }

    /// Puts its file, where it has one of its own, elsewhere.
    pub(super) fn move_file(&mut self, place: &dyn Fn(&Path) -> PathBuf) {
        self.file = self.file.as_deref().map(place);
        self.channels.move_files(place);
    }

    /// Its file, where it is not the recording's.
    pub fn own_file(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    /// Its file, relative to the folder of the experiment file.
    pub fn file<'a>(&'a self, recording: &'a Recording) -> &'a Path {
        self.file.as_deref().unwrap_or(&recording.file)
    }

    /// How its file is written, where that cannot be told from it.
    pub fn format<'a>(&'a self, recording: &'a Recording) -> Option<&'a FileFormat> {
        let of_recording = recording.format.as_ref().filter(|_| self.is_in_recording());
        self.format.as_ref().or(of_recording)
    }

    /// Its file with its columns.
    pub(super) fn in_file<'a>(&'a self, recording: &'a Recording) -> FileColumns<'a> {
        FileColumns {
            format: self.format(recording),
            clock: Some(self.clock(recording)),
            segments: self.segments(recording),
            columns: self.channels.in_file(),
        }
    }

    /// The column that tells records apart.
    pub fn segments<'a>(&'a self, recording: &'a Recording) -> Option<&'a Segments> {
        self.segments.as_ref().or(recording.segments.as_ref())
    }

    /// When its samples were taken.
    pub fn clock<'a>(&'a self, recording: &'a Recording) -> &'a Clock {
        self.clock.as_ref().unwrap_or(&recording.clock)
    }

    /// How much later than the motion the instrument shows it, in s.
    pub fn delay_s(&self) -> f64 {
        self.delay.as_ref().map_or(0.0, Quantity::si)
    }

    /// The standard deviation of that, in s.
    pub fn delay_sd_s(&self) -> f64 {
        self.delay_sd.as_ref().map_or(0.0, Quantity::si)
    }

    /// States how much later it is.
    pub fn set_delay(&mut self, delay: Quantity<Time>) {
        self.delay = Some(delay);
    }
}
