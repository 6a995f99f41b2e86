//! What an experiment file says about the simulation that is wanted.

use super::Clock;
use super::column::FileColumns;
use super::format::FileFormat;
use super::inputs::{InputSources, SimulatedChannel};
use super::kinds::{Acceleration, Angle, Frequency, Length, Ratio, Time, Voltage, VoltageVariance};
use super::quantity::Quantity;
use super::reader::read_below;
use super::regulated::{RegulatedDrive, TemperatureRamp};
use super::sign::{NotNegative, Positive, SignOf};
use super::source::Source;
use super::values::Values;
use super::{ColumnChoice, ConfigError, ConfigFault, Key};
use crate::layout::RecordingLayout;
use schemars::JsonSchema;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A recording that is computed instead of taken. Which states there are, the rig knows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Simulate {
    /// How long the recording is.
    #[schemars(example = &"24 ms")]
    pub duration: Quantity<Time, Positive>,
    /// How often a sample is taken.
    #[schemars(example = &"1 MHz")]
    pub sampling_rate: Quantity<Frequency, Positive>,
    /// How many steps per second the motion is integrated in: a whole multiple of `sampling_rate`.
    #[schemars(example = &"10 MHz")]
    pub integration_rate: Quantity<Frequency, Positive>,
    /// The first value of each state of the device, by its name; `kalmems help device NAME` lists them.
    pub start: Values,
    /// Whether the readout's noise is added; true if left out.
    #[serde(default = "yes")]
    pub noise: bool,
    /// Which noise, a whole number of 0 or more; 0 if left out.
    #[serde(default, deserialize_with = "seed")]
    #[schemars(extend("minimum" = 0))]
    pub seed: u64,
    /// A converter that rounds the signal; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub adc: Option<Adc>,
    /// How the measurements of a device that equations describe are recorded, by their names; each row, and as they are, if left out.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub channels: BTreeMap<String, SimulatedChannel>,
    /// What is added to the feedback of an accelerometer, so that its parameters can be identified; nothing if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub dither: Option<Dither>,
    /// What a micro-stage is recorded under; ideal if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stage: Option<StageConditions>,
    /// A temperature that changes while a regulated drive runs; it does not if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<TemperatureRamp>,
    /// The drive: exactly one table, such as `[simulate.drive.sine]`.
    pub drive: DriveSource,
}

/// What a micro-stage is recorded under.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StageConditions {
    /// The variance of one sample's noise before the oscilloscope averages; if left out, what is recorded has the noise
    /// of the electrode's table.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1.6e-8 V^2")]
    pub single_shot_noise: Option<Quantity<VoltageVariance, Positive>>,
    /// Over how many periods the oscilloscope averages, 1 to 65536; 1 if left out. It goes with `single_shot_noise`.
    #[serde(default, skip_serializing_if = "Option::is_none", deserialize_with = "averages")]
    #[schemars(range(min = 1, max = 65536), example = &1024)]
    pub averages: Option<u32>,
    /// The amplitude of the tilt about the other axis, relative to that of the driven one; none if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.3 %")]
    pub off_axis_ratio: Option<Quantity<Ratio, NotNegative>>,
    /// Its phase against that of the driven one; 0 rad if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.7 rad")]
    pub off_axis_phase: Option<Quantity<Angle>>,
    /// By how much every gap grows over the recording as the temperature changes; not at all if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"20 nm")]
    pub gap_drift: Option<Quantity<Length>>,
    /// By how much every gain grows, relative to it; not at all if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.1 %")]
    pub gain_drift: Option<Quantity<Ratio>>,
}

/// A converter from volts to steps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Adc {
    /// How many bits it has, 1 to 32: it knows `2^bits` levels.
    #[serde(deserialize_with = "bits")]
    #[schemars(range(min = 1, max = 32))]
    pub bits: u32,
    /// The lowest level. What lies below is clipped to it.
    pub low: Quantity<Voltage>,
    /// The highest level. What lies above is clipped to it.
    pub high: Quantity<Voltage>,
}

/// Sines of equal amplitude on top of a feedback voltage: their frequencies are in geometric progression, their phases
/// chance by the seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Dither {
    /// The root mean square of their sum.
    #[schemars(example = &"4 mV")]
    pub rms: Quantity<Voltage, Positive>,
    /// The lowest frequency.
    #[schemars(example = &"200 Hz")]
    pub from: Quantity<Frequency, Positive>,
    /// The highest frequency, below half the sampling rate.
    #[schemars(example = &"40 kHz")]
    pub to: Quantity<Frequency, Positive>,
    /// How many, 2 to 1000.
    #[serde(deserialize_with = "tones")]
    #[schemars(range(min = 2, max = 1000))]
    pub tones: u32,
}

/// What drives the device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(clippy::large_enum_variant)] // there are a few of them in a description, and none in a loop
pub enum DriveSource {
    /// A constant voltage, as during a free decay.
    Constant(ConstantDrive),
    /// `offset + amplitude sin(2 pi frequency t + phase)`.
    Sine(SineDrive),
    /// A square wave.
    Square(SquareDriveSource),
    /// A sine whose frequency changes linearly over the duration.
    Sweep(SweepDrive),
    /// An offset and several sines: one for each axis that depends on the electrode.
    Tones(TonesDrive),
    /// A column of a file.
    Recorded(RecordedDrive),
    /// A sine whose frequency and amplitude a regulator sets, so that amplitude and phase of the motion are held.
    Regulated(Box<RegulatedDrive>),
    /// A sine that is switched to the bias of a ring-down; the recording begins there.
    RingDown(RingDownDrive),
    /// A raised cosine that catches the motion by a sweep before the recording begins, and may be cut off in it.
    Capture(CaptureDrive),
    /// An acceleration, which an accelerometer is to measure.
    Acceleration(AccelerationDrive),
    /// None: the motion is what `start` says, with constant rates.
    Prescribed(PrescribedMotion),
    /// Each input of a device that equations describe by itself, such as `[simulate.drive.inputs.force.sine]`.
    Inputs(InputSources),
}

/// What a prescribed motion has beside its start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PrescribedMotion {
    /// The amplitude of the second harmonic; none where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"10 nm")]
    pub second_harmonic: Option<Quantity<Length, NotNegative>>,
    /// Its phase at twice the motion's phase 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"0.3 rad")]
    pub second_harmonic_phase: Option<Quantity<Angle>>,
}

/// A constant voltage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstantDrive {
    /// The voltage.
    pub voltage: Quantity<Voltage>,
}

/// A sine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SineDrive {
    /// The mean.
    pub offset: Quantity<Voltage>,
    /// The amplitude.
    pub amplitude: Quantity<Voltage, NotNegative>,
    /// The frequency.
    #[schemars(example = &"31.35 kHz")]
    pub frequency: Quantity<Frequency, Positive>,
    /// The phase of the sine at 0 s; 0 rad if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<Quantity<Angle>>,
}

/// A square wave: each period begins with the high level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SquareDriveSource {
    /// The low level.
    pub low: Quantity<Voltage>,
    /// The high level.
    pub high: Quantity<Voltage>,
    /// The frequency.
    #[schemars(example = &"31.35 kHz")]
    pub frequency: Quantity<Frequency, Positive>,
    /// The part of a period that is high, below 1.
    #[schemars(example = &"50 %")]
    pub duty_cycle: Quantity<Ratio, Positive>,
}

/// A sine whose frequency changes linearly over the duration, up or down.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepDrive {
    /// The mean.
    pub offset: Quantity<Voltage>,
    /// The amplitude.
    pub amplitude: Quantity<Voltage, NotNegative>,
    /// The frequency at the start.
    #[schemars(example = &"31.6 kHz")]
    pub from: Quantity<Frequency, Positive>,
    /// The frequency at the end.
    #[schemars(example = &"31.1 kHz")]
    pub to: Quantity<Frequency, Positive>,
}

/// The sum of an offset and of one sine per `[[simulate.drive.tones.tone]]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TonesDrive {
    /// The mean.
    pub offset: Quantity<Voltage>,
    /// The sines.
    pub tone: Vec<DriveTone>,
}

/// One sine of several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DriveTone {
    /// The amplitude.
    pub amplitude: Quantity<Voltage, NotNegative>,
    /// The frequency.
    #[schemars(example = &"13.1 kHz")]
    pub frequency: Quantity<Frequency, Positive>,
    /// The phase of the sine at 0 s; 0 rad if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub phase: Option<Quantity<Angle>>,
}

/// A drive that was recorded; it must reach from 0 s to the end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordedDrive {
    /// The file, relative to the folder of the experiment file.
    #[schemars(example = &"drive.csv")]
    pub file: PathBuf,
    /// How the file is written, where that cannot be told from it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// When its samples were taken.
    pub clock: Clock,
    /// The column.
    #[schemars(example = &"drive_V")]
    pub column: ColumnChoice,
}

impl RecordedDrive {
    /// How to read its file, where a column that states no unit would usually be in this one.
    pub fn layout(&self, usual_unit: &'static str) -> RecordingLayout {
        let columns = vec![("column", &self.column, Some(usual_unit))];
        FileColumns::new(self.format.as_ref(), &self.clock, columns).layout(None)
    }
}

/// A sine that drives the device before the recording and a bias that is on during it.
///
/// Bias and feedback resistance are those of `[identify.ring_down]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RingDownDrive {
    /// The mean of the sine.
    pub offset: Quantity<Voltage>,
    /// The amplitude.
    pub amplitude: Quantity<Voltage, NotNegative>,
    /// The frequency.
    #[schemars(example = &"31.25 kHz")]
    pub frequency: Quantity<Frequency, Positive>,
    /// How long the sine drives the device before it is switched off and the recording begins.
    #[schemars(example = &"20 ms")]
    pub lasting: Quantity<Time, NotNegative>,
    /// The standard deviation of the noise of the transimpedance stage's output, per sample.
    #[schemars(example = &"1 mV")]
    pub signal_noise: Quantity<Voltage, NotNegative>,
    /// The standard deviation of the noise of the optical reference, per sample.
    #[schemars(example = &"0.5 mrad")]
    pub angle_noise: Quantity<Angle, NotNegative>,
}

/// `voltage (1 - cos(2 pi f t))/2`, swept from one frequency to another, then held there: the recording begins after that.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CaptureDrive {
    /// The highest voltage; the lowest is 0.
    #[schemars(example = &"60 V")]
    pub voltage: Quantity<Voltage, Positive>,
    /// The frequency at which the sweep begins.
    #[schemars(example = &"1600 Hz")]
    pub from: Quantity<Frequency, Positive>,
    /// The frequency at which it ends.
    #[schemars(example = &"1260 Hz")]
    pub to: Quantity<Frequency, Positive>,
    /// How long the sweep takes.
    #[schemars(example = &"1 s")]
    pub sweep: Quantity<Time, Positive>,
    /// How long the last frequency is held before the recording begins.
    #[schemars(example = &"0.2 s")]
    pub hold: Quantity<Time, NotNegative>,
    /// How the power is cut off; never, if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cut_off: Option<PowerCut>,
}

/// Times without power.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerCut {
    /// When the first begins; with the recording if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub at: Option<Quantity<Time, NotNegative>>,
    /// How long each of them is; until the end if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"4 ms")]
    pub lasting: Option<Quantity<Time, Positive>>,
    /// From the beginning of one to that of the next; there is one alone if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"20 ms")]
    pub every: Option<Quantity<Time, Positive>>,
    /// The time constant with which the voltage goes and comes back.
    #[schemars(example = &"20 us")]
    pub transient: Quantity<Time, Positive>,
}

/// How many time constants of its transient a time with or without power lasts at least: what is left then is lost in
/// the rounding of a converter.
const SETTLED: f64 = 20.0;

impl PowerCut {
    /// What is wrong with one of its keys.
    pub fn check(&self) -> Result<(), (&'static str, String)> {
        let transient = self.transient.si();
        let Some(lasting) = &self.lasting else {
            return match &self.every {
                Some(_) => {
                    Err(("every", "power that stays off is cut off once; write `lasting` too".to_owned()))
                }
                None => Ok(()),
            };
        };
        let too_short = |text: &str| {
            let needed = SETTLED * transient;
            format!(
                "`{text}` leaves less than {SETTLED} times `transient`, {needed:e} s, for the voltage to settle"
            )
        };
        if lasting.si() < SETTLED * transient {
            return Err(("lasting", too_short(lasting.text())));
        }
        match &self.every {
            Some(every) if every.si() - lasting.si() < SETTLED * transient => {
                Err(("every", too_short(every.text())))
            }
            _ => Ok(()),
        }
    }
}

/// An acceleration: a sine from 0 s on, or, without amplitude and frequency, chance as the device's table
/// `acceleration` describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AccelerationDrive {
    /// The amplitude of the sine.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"1 gn")]
    pub amplitude: Option<Quantity<Acceleration, NotNegative>>,
    /// The frequency of the sine.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"10 Hz")]
    pub frequency: Option<Quantity<Frequency, Positive>>,
    /// Whether the carrier is simulated as the sine that it is, and not by its mean square; false if left out.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub full_carrier: bool,
}

/// Samples that a simulation may have: a file of 100 GB.
const MOST_SAMPLES: f64 = 1e9;

impl Simulate {
    /// The table `[simulate]` of a text with nothing else in it; the path is what errors name.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        read_below(&Source::of(text, path)?, &Key::from("simulate"))
    }

    /// Integration steps per sample.
    pub fn steps_per_sample(&self) -> u64 {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked
        let steps = (self.integration_rate.si() / self.sampling_rate.si()).round() as u64;
        steps
    }

    /// Samples, with those at 0 s and at the end.
    pub fn samples(&self) -> u64 {
        // A sample that rounding puts behind the end is in.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked
        let intervals = (self.duration.si() * self.sampling_rate.si() + 1e-6).floor() as u64;
        intervals + 1
    }

    /// Refuses a square wave that changes more often than it is integrated: each of its changes begins a step.
    pub fn resolves_square(&self, frequency: &Quantity<Frequency, Positive>) -> Result<(), String> {
        if 2.0 * frequency.si() <= self.integration_rate.si() {
            return Ok(());
        }
        let rate = self.integration_rate.text();
        Err(format!(
            "`{}` is above half of `integration_rate`, `{rate}`; write a higher rate",
            frequency.text()
        ))
    }

    /// Refuses a time before the recording that takes more steps than a recording may.
    pub fn may_precede<S: SignOf>(&self, time: &Quantity<Time, S>) -> Result<(), String> {
        let samples = time.si().abs() * self.sampling_rate.si();
        if samples < MOST_SAMPLES {
            return Ok(());
        }
        let (time, rate) = (time.text(), self.sampling_rate.text());
        Err(format!(
            "`{time}` at `{rate}` is {samples:.3e} samples before the recording; expected up to {MOST_SAMPLES:.0e}"
        ))
    }

    /// What no single value can be blamed for: the key, and what is wrong.
    pub(super) fn check(&self) -> Result<(), (Key, ConfigFault)> {
        let at = |name: &str, why: String| {
            let key = name.split('.').fold(Key::from("simulate"), Key::child);
            Err((key, ConfigFault::Value { why }))
        };
        let samples = self.duration.si() * self.sampling_rate.si();
        if !(1.0 - 1e-6..MOST_SAMPLES).contains(&samples) {
            let why = format!(
                "`{}` at `{}` is {samples:.3e} samples; expected 1 to {MOST_SAMPLES:.0e}",
                self.duration.text(),
                self.sampling_rate.text()
            );
            return at("duration", why);
        }
        let steps = self.integration_rate.si() / self.sampling_rate.si();
        if !(steps > 0.5 && steps < 1e6 && (steps - steps.round()).abs() < 1e-6 * steps) {
            let why = format!(
                "`{}` is {} times `sampling_rate`; expected a whole multiple, such as 10 times `{}`",
                self.integration_rate.text(),
                kalmems_figures::number(steps),
                self.sampling_rate.text()
            );
            return at("integration_rate", why);
        }
        if let Some(adc) = &self.adc
            && adc.low.si() >= adc.high.si()
        {
            let why = format!("`{}` is not above `low`, `{}`", adc.high.text(), adc.low.text());
            return at("adc.high", why);
        }
        if let Some(StageConditions { averages: Some(_), single_shot_noise: None, .. }) = &self.stage {
            let why =
                "averaging needs the noise that is averaged; write `single_shot_noise = \"1.6e-8 V^2\"` too";
            return at("stage.averages", why.to_owned());
        }
        if let Some(dither) = &self.dither {
            let (from, to) = (&dither.from, &dither.to);
            if to.si() >= 0.5 * self.sampling_rate.si() {
                let why = format!("`{}` is not below half of `sampling_rate`", to.text());
                return at("dither.to", why);
            }
            if from.si() >= to.si() {
                let why = format!("`{}` is not below `to`, `{}`", from.text(), to.text());
                return at("dither.from", why);
            }
        }
        if let Some(ramp) = &self.temperature {
            if !matches!(self.drive, DriveSource::Regulated(_)) {
                let why = "a temperature changes under a regulated drive alone; write `[simulate.drive.regulated]`, \
                           with `hold_from` to see the same motion without regulation";
                return at("temperature", why.to_owned());
            }
            if ramp.from.si() >= ramp.to.si() {
                let why = format!("`{}` is not after `from`, `{}`", ramp.to.text(), ramp.from.text());
                return at("temperature.to", why);
            }
        }
        if let DriveSource::Regulated(regulated) = &self.drive
            && let Err((name, why)) = regulated.check(self.sampling_rate.si())
        {
            return at(&format!("drive.regulated.{name}"), why);
        }
        if let DriveSource::Square(square) = &self.drive {
            if square.duty_cycle.si() >= 1.0 {
                let why =
                    format!("`{}` is not below 1; expected a part, such as `50 %`", square.duty_cycle.text());
                return at("drive.square.duty_cycle", why);
            }
            if let Err(why) = self.resolves_square(&square.frequency) {
                return at("drive.square.frequency", why);
            }
        }
        if let DriveSource::RingDown(before) = &self.drive
            && let Err(why) = self.may_precede(&before.lasting)
        {
            return at("drive.ring_down.lasting", why);
        }
        if let DriveSource::Capture(CaptureDrive { cut_off: Some(cut_off), .. }) = &self.drive
            && let Err((name, why)) = cut_off.check()
        {
            return at(&format!("drive.capture.cut_off.{name}"), why);
        }
        Ok(())
    }
}

fn yes() -> bool {
    true
}

fn seed<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    let number = i64::deserialize(deserializer)?;
    u64::try_from(number).map_err(|_| D::Error::custom(format!("`{number}` is below 0; write `0` or more")))
}

pub(super) fn bits<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    let number = i64::deserialize(deserializer)?;
    u32::try_from(number)
        .ok()
        .filter(|bits| (1..=32).contains(bits))
        .ok_or_else(|| D::Error::custom(format!("`{number}` is not 1 to 32; write the bits, such as `12`")))
}

fn averages<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<u32>, D::Error> {
    let number = i64::deserialize(deserializer)?;
    let count = u32::try_from(number).ok().filter(|count| (1..=65_536).contains(count));
    count.map(Some).ok_or_else(|| {
        D::Error::custom(format!("`{number}` is not 1 to 65536; write the number of periods, such as `1024`"))
    })
}

fn tones<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    let number = i64::deserialize(deserializer)?;
    u32::try_from(number)
        .ok()
        .filter(|tones| (2..=1000).contains(tones))
        .ok_or_else(|| D::Error::custom(format!("`{number}` is not 2 to 1000; write how many, such as `16`")))
}
