//! What an experiment file says of the inputs of a simulated device that has several, or one that is no voltage, and of the channels
//! that it is measured by.

use super::kinds::{Angle, Frequency, Ratio, Time};
use super::quantity::Quantity;
use super::sign::{NotNegative, Positive};
use super::simulate::{PowerCut, RecordedDrive, bits};
use super::values::AnyValue;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What drives each input of a device, by the input's name. Values are in units that fit the input's own.
pub type InputSources = BTreeMap<String, InputSource>;

/// What drives one input: the word `none`, or exactly one table, such as `[simulate.drive.inputs.force.sine]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InputSource {
    /// Nothing: it is zero throughout.
    None,
    /// The same value at all times.
    Constant(ConstantInput),
    /// `offset + amplitude sin(2 pi frequency t + phase)`.
    Sine(SineInput),
    /// A square wave.
    Square(SquareInput),
    /// A sine whose frequency changes linearly.
    Sweep(SweepInput),
    /// An offset and several sines.
    Tones(TonesInput),
    /// A value that jumps at times that are stated.
    Steps(StepsInput),
    /// A sine that has driven the device until the recording begins, and is switched off there.
    RingDown(RingDownInput),
    /// A column of a file.
    Recorded(RecordedDrive),
    /// What a measurement of the device says, held from sample to sample: a loop. The law of its controller stands in the equations.
    Feedback(FeedbackInput),
}

/// The same value at all times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstantInput {
    /// The value.
    pub value: AnyValue,
}

/// A sine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SineInput {
    /// The mean; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<AnyValue>,
    /// The amplitude.
    pub amplitude: AnyValue,
    /// The frequency.
    #[schemars(example = &"10 kHz")]
    pub frequency: Quantity<Frequency, Positive>,
    /// The phase of the sine at 0 s; 0 rad if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<Quantity<Angle>>,
    /// When it is off; never if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut_off: Option<PowerCut>,
}

/// A square wave: each period begins with the high level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SquareInput {
    /// The low level.
    pub low: AnyValue,
    /// The high level.
    pub high: AnyValue,
    /// The frequency.
    #[schemars(example = &"10 kHz")]
    pub frequency: Quantity<Frequency, Positive>,
    /// The part of a period that is high, below 1.
    #[schemars(example = &"50 %")]
    pub duty_cycle: Quantity<Ratio, Positive>,
}

/// A sine whose frequency changes linearly, up or down, and is held before and behind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepInput {
    /// The mean; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<AnyValue>,
    /// The amplitude.
    pub amplitude: AnyValue,
    /// The frequency at the beginning.
    #[schemars(example = &"9.8 kHz")]
    pub from: Quantity<Frequency, Positive>,
    /// The frequency at the end.
    #[schemars(example = &"10.2 kHz")]
    pub to: Quantity<Frequency, Positive>,
    /// When it begins; 0 s if left out. Where that is before 0 s the device moves from then on, and the recording begins at 0 s.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"-1 s")]
    pub begins: Option<Quantity<Time>>,
    /// How long it takes; until the end of the recording if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1 s")]
    pub lasting: Option<Quantity<Time, Positive>>,
    /// When it is off; never if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut_off: Option<PowerCut>,
}

/// The sum of an offset and of several sines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TonesInput {
    /// The mean; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<AnyValue>,
    /// The sines.
    pub tone: Vec<InputTone>,
}

/// One sine of several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputTone {
    /// The amplitude.
    pub amplitude: AnyValue,
    /// The frequency.
    #[schemars(example = &"13.1 kHz")]
    pub frequency: Quantity<Frequency, Positive>,
    /// The phase of the sine at 0 s; 0 rad if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<Quantity<Angle>>,
}

/// A value that jumps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StepsInput {
    /// The value before the first jump; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub first: Option<AnyValue>,
    /// The jumps, in their order.
    pub step: Vec<InputStep>,
}

/// A jump.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputStep {
    /// When it jumps.
    #[schemars(example = &"5 ms")]
    pub at: Quantity<Time, NotNegative>,
    /// The value from then on.
    pub value: AnyValue,
}

/// A sine that drives the device before the recording and is switched off where that begins.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RingDownInput {
    /// The mean of the sine; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<AnyValue>,
    /// The amplitude.
    pub amplitude: AnyValue,
    /// The frequency.
    #[schemars(example = &"10 kHz")]
    pub frequency: Quantity<Frequency, Positive>,
    /// How long the sine drives the device before it is switched off and the recording begins.
    #[schemars(example = &"20 ms")]
    pub lasting: Quantity<Time, NotNegative>,
    /// The value during the recording; 0 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub then: Option<AnyValue>,
}

/// A loop that is closed at each sample.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FeedbackInput {
    /// The measurement that is fed back, with its noise and as its converter has it; in the unit of the input. The input has this
    /// value from that sample on until the next one, and is 0 before the first.
    pub of: String,
    /// What is applied in place of the value, with the sign of it: a loop of one bit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub one_bit: Option<AnyValue>,
}

/// How one measurement of a device is recorded.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SimulatedChannel {
    /// How often it is sampled: the sampling rate of the recording divided by a whole number. Rows between have no sample of it. Each
    /// row if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"100 kHz")]
    pub sampling_rate: Option<Quantity<Frequency, Positive>>,
    /// Its first row, from 0 on; 0 if left out.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub first_row: u32,
    /// A converter that rounds it; that of `[simulate.adc]` if left out, where it is measured in V.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adc: Option<ChannelAdc>,
}

/// A converter from a measurement in its own unit to steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChannelAdc {
    /// How many bits it has, 1 to 32: it knows `2^bits` levels.
    #[serde(deserialize_with = "bits")]
    #[schemars(range(min = 1, max = 32))]
    pub bits: u32,
    /// The lowest level. What lies below is clipped to it.
    pub low: AnyValue,
    /// The highest level. What lies above is clipped to it.
    pub high: AnyValue,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // as serde calls it
fn is_zero(number: &u32) -> bool {
    *number == 0
}
