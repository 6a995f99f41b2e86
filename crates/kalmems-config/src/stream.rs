//! What an experiment file says about samples that arrive while they are estimated.

use super::filter::FilterName;
use super::kinds::{Angle, Frequency, Time};
use super::quantity::Quantity;
use super::regulated::TriggerDirection;
use super::sign::Positive;
use crate::inline_schema;
use schemars::{JsonSchema, json_schema};
use serde::{Deserialize, Serialize};
use std::num::NonZeroU32;

/// Samples that arrive while they are estimated, and what is wanted of the estimates.
///
/// The device and its filters are those of the experiment; clock and channels are those of its first recording that would
/// be estimated, whose file need not be there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StreamTable {
    /// Samples per second, about: how many belong to the settling time before the first estimate.
    pub rate: Quantity<Frequency, Positive>,
    /// How the samples come: exactly one table, `[stream.input.text]` or `[stream.input.frames]`.
    pub input: StreamFormat,
    /// For how many later samples one that is missing is waited for, so that late ones find their place; 32 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(max = 1_000_000))]
    pub wait: Option<u32>,
    /// One estimate is given of so many samples; each if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub every: Option<NonZeroU32>,
    /// How long to go on trying to connect again where a connection or a serial device breaks; the first break ends the
    /// stream if left out. What is missing then is a gap like any other. A file or standard input cannot
    /// be opened again.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"30 s")]
    pub reconnect: Option<Quantity<Time, Positive>>,
    /// How long a connection or a serial device may send nothing: after that it counts as broken, and `listen://` can serve another
    /// client; without end if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"60 s")]
    pub idle: Option<Quantity<Time, Positive>>,
    /// How often an event `health` is written, whether samples arrive or not; at least 0.1 s, never if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1 s")]
    pub heartbeat: Option<Quantity<Time, Positive>>,
    /// Over how long the mean NIS is watched; 100 samples if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alarm_over: Option<Quantity<Time, Positive>>,
    /// Whether amplitude and phase of the motion, each with its standard deviation, stand behind the states of an estimate; not
    /// if left out.
    #[serde(default, skip_serializing_if = "is_false")]
    pub phase: bool,
    /// Which zero phases are told before they happen; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trigger: Option<StreamTrigger>,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_false(value: &bool) -> bool {
    !value
}

/// Zero phases that are told before they happen, each once.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StreamTrigger {
    /// How long before at least, from the arrival of the sample behind the one that tells it on; up to some 4000 samples, be
    /// that many cycles of the motion.
    #[schemars(example = &"10 us")]
    pub ahead: Quantity<Time, Positive>,
    /// On which way of the motion through its middle; on both if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub direction: Option<TriggerDirection>,
    /// The amplitude of the motion from which zero phases are announced; if left out 1 mrad, or what is usual of the device.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1 mrad")]
    pub least_amplitude: Option<Quantity<Angle, Positive>>,
    /// The name of the filter that tells them; the first if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub filter: Option<FilterName>,
    /// Where they are told; among all that is written if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<TriggerChannel>,
}

/// Where zero phases are told that are to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TriggerChannel {
    /// Among the lines, as events.
    Lines,
    /// Among the frames, as frames of their own.
    Frames,
    /// Among both.
    Both,
}

impl TriggerChannel {
    /// Whether among the lines, and whether among the frames.
    pub const fn lines_and_frames(self) -> [bool; 2] {
        [matches!(self, Self::Lines | Self::Both), matches!(self, Self::Frames | Self::Both)]
    }
}

/// How samples come.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum StreamFormat {
    /// Lines of numbers separated by commas. Empty lines, comments that begin with `#` and a line of the columns' names are
    /// passed over.
    Text {
        /// The columns by their names with units, such as `["time_s", "drive_V", "cap_V"]`.
        #[schemars(example = text_columns())]
        columns: Vec<String>,
    },
    /// Frames of numbers in binary, little-endian, one after the other.
    Frames {
        /// The bytes that each frame begins with, in hexadecimal, such as `"a55a"`.
        sync: Sync,
        /// What follows them: types and names, such as `["u16 sequence", "f64 time_s", "f32 drive_V", "f32 cap_V"]`. By a
        /// field with the name `sequence`, which counts the frames, one that is lost is told from a pause.
        #[schemars(example = frame_fields())]
        fields: Vec<FrameField>,
        /// The checksum behind the fields, little-endian, of the bytes between `sync` and itself; a frame with another one is no sample and is
        /// counted. None if left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        crc: Option<FrameCheck>,
    },
}

/// What is written in the schema as an example.
const fn text_columns() -> [&'static str; 3] {
    ["time_s", "drive_V", "cap_V"]
}

const fn frame_fields() -> [&'static str; 4] {
    ["u16 sequence", "f64 time_s", "f32 drive_V", "f32 cap_V"]
}

impl StreamFormat {
    /// The names of the columns of numbers, in their order.
    pub fn columns(&self) -> Vec<String> {
        match self {
            Self::Text { columns } => columns.clone(),
            Self::Frames { fields, .. } => {
                fields.iter().filter(|f| !f.is_sequence()).map(|f| f.name.clone()).collect()
            }
        }
    }

    /// How many numbers the sequence of the frames has before it begins again, where they count.
    pub fn sequence_bits(&self) -> Option<u32> {
        let Self::Frames { fields, .. } = self else { return None };
        fields.iter().find(|field| field.is_sequence()).map(|field| field.kind.bits())
    }
}

/// The bytes that a frame begins with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Sync(Vec<u8>);

impl Sync {
    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }
}

impl TryFrom<String> for Sync {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let digits = text.as_bytes();
        let bytes = digits.chunks(2).map(|pair| {
            let pair = std::str::from_utf8(pair).ok().filter(|pair| pair.len() == 2)?;
            u8::from_str_radix(pair, 16).ok()
        });
        match bytes.collect::<Option<Vec<u8>>>() {
            Some(bytes) if (1..=16).contains(&bytes.len()) && !text.contains('+') => Ok(Self(bytes)),
            _ => Err(format!("`{text}` is not 1 to 16 bytes in hexadecimal; expected such as `a55a`")),
        }
    }
}

impl From<Sync> for String {
    fn from(sync: Sync) -> Self {
        const DIGITS: [char; 16] =
            ['0', '1', '2', '3', '4', '5', '6', '7', '8', '9', 'a', 'b', 'c', 'd', 'e', 'f'];
        let digits = |byte: &u8| [byte >> 4, byte & 15].map(|digit| DIGITS[usize::from(digit)]);
        sync.0.iter().flat_map(digits).collect()
    }
}

inline_schema!(
    Sync,
    "Sync",
    |_| json_schema!({ "type": "string", "pattern": "^([0-9a-fA-F]{2}){1,16}$", "examples": ["a55a"] })
);

/// A checksum of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FrameCheck {
    /// Two bytes: the polynomial 0x1021 from 0xffff on, as CRC-16/IBM-3740 (`CCITT-FALSE`); of `123456789` it is 0x29b1.
    Crc16,
    /// Four bytes, as in Ethernet and ZIP; of `123456789` it is 0xcbf43926.
    Crc32,
}

impl FrameCheck {
    /// How many bytes it takes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::Crc16 => 2,
            Self::Crc32 => 4,
        }
    }
}

/// A number in a frame.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct FrameField {
    /// How it is written.
    pub kind: FieldType,
    /// The name of its column, or `sequence`.
    pub name: String,
}

/// The name of the field that counts frames.
const SEQUENCE: &str = "sequence";

impl FrameField {
    /// Whether it counts the frames.
    pub fn is_sequence(&self) -> bool {
        self.name == SEQUENCE
    }
}

/// How a number is written in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldType {
    /// 8 bits with a sign.
    I8,
    /// 8 bits.
    U8,
    /// 16 bits with a sign.
    I16,
    /// 16 bits.
    U16,
    /// 32 bits with a sign.
    I32,
    /// 32 bits.
    U32,
    /// 64 bits with a sign.
    I64,
    /// 64 bits.
    U64,
    /// IEEE 754, single.
    F32,
    /// IEEE 754, double.
    F64,
}

impl FieldType {
    /// A whole number of this type, little-endian; `None` where the type is of other numbers or there are not enough bytes.
    pub fn integer(self, raw: &[u8]) -> Option<i128> {
        let bytes = raw.get(..self.bytes())?;
        let unsigned = bytes.iter().rev().fold(0_i128, |number, byte| number << 8 | i128::from(*byte));
        let size = 1_i128 << self.bits();
        match self {
            Self::F32 | Self::F64 => None,
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => Some(unsigned),
            Self::I8 | Self::I16 | Self::I32 | Self::I64 => {
                Some(if unsigned >= size / 2 { unsigned - size } else { unsigned })
            }
        }
    }

    /// A number of this type, little-endian; not a number where there are not enough bytes.
    pub fn number(self, raw: &[u8]) -> f64 {
        fn of<const N: usize>(raw: &[u8]) -> [u8; N] {
            raw.try_into().unwrap_or([0; N])
        }
        match self {
            Self::I8 => f64::from(i8::from_le_bytes(of(raw))),
            Self::U8 => f64::from(u8::from_le_bytes(of(raw))),
            Self::I16 => f64::from(i16::from_le_bytes(of(raw))),
            Self::U16 => f64::from(u16::from_le_bytes(of(raw))),
            Self::I32 => f64::from(i32::from_le_bytes(of(raw))),
            Self::U32 => f64::from(u32::from_le_bytes(of(raw))),
            Self::I64 => i64::from_le_bytes(of(raw)) as f64,
            Self::U64 => u64::from_le_bytes(of(raw)) as f64,
            Self::F32 => f64::from(f32::from_le_bytes(of(raw))),
            Self::F64 => f64::from_le_bytes(of(raw)),
        }
    }
}

/// All of them by their names.
const TYPES: [(&str, FieldType, usize); 10] = [
    ("i8", FieldType::I8, 1),
    ("u8", FieldType::U8, 1),
    ("i16", FieldType::I16, 2),
    ("u16", FieldType::U16, 2),
    ("i32", FieldType::I32, 4),
    ("u32", FieldType::U32, 4),
    ("i64", FieldType::I64, 8),
    ("u64", FieldType::U64, 8),
    ("f32", FieldType::F32, 4),
    ("f64", FieldType::F64, 8),
];

impl FieldType {
    /// How many bytes it takes.
    pub fn bytes(self) -> usize {
        TYPES.iter().find(|(_, kind, _)| *kind == self).map_or(0, |(_, _, bytes)| *bytes)
    }

    /// How many bits it takes.
    pub fn bits(self) -> u32 {
        u32::try_from(8 * self.bytes()).unwrap_or(u32::MAX)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        TYPES.iter().find(|(_, kind, _)| *kind == self).map_or("", |(name, ..)| name)
    }

    /// Whether it is a whole number that is never negative.
    fn counts(self) -> bool {
        matches!(self, Self::U8 | Self::U16 | Self::U32 | Self::U64)
    }
}

impl TryFrom<String> for FrameField {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let mut words = text.split_whitespace();
        let kind = words.next().and_then(|word| TYPES.iter().find(|(name, ..)| *name == word));
        let (Some((_, kind, _)), Some(name), None) = (kind, words.next(), words.next()) else {
            let names: Vec<&str> = TYPES.iter().map(|(name, ..)| *name).collect();
            return Err(format!(
                "`{text}` is not a type and a name; expected such as `f32 cap_V`, the type one of {}",
                names.join(", ")
            ));
        };
        let field = Self { kind: *kind, name: name.to_owned() };
        if field.is_sequence() && !kind.counts() {
            return Err(format!(
                "`{text}`: a sequence counts; expected `u8`, `u16`, `u32` or `u64` as its type"
            ));
        }
        Ok(field)
    }
}

impl From<FrameField> for String {
    fn from(field: FrameField) -> Self {
        format!("{} {}", field.kind.name(), field.name)
    }
}

inline_schema!(FrameField, "Field", |_| json_schema!({
    "type": "string",
    "pattern": r"^\s*([iu](8|16|32|64)|f(32|64))\s+\S+\s*$",
    "examples": ["f32 cap_V"],
}));
