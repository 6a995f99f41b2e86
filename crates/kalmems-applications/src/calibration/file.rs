//! The calibration file of a gyroscope: its records, the motions that they are compared with, and a record at rest.

use super::inputs::OF_REPRODUCIBILITY;
use super::rest::InertialSensor;
use super::unit_record::RecordOfUnit;
use crate::ApplicationFile;
use crate::config::FileColumns;
use crate::config::FileFormat;
use crate::config::Quantity;
use crate::config::Source;
use crate::config::Vibrometer;
use crate::config::kinds::{Acceleration, Angle, AngularRate, Frequency, Ratio, Temperature, Time};
use crate::config::{Channels, Clock, ColumnChoice, ConfigError, ConfigFault, Key, Name, Segments};
use crate::config::{NotNegative, Positive};
use crate::metrology::{StandardUncertainty, StatedCorrelations};
use crate::recording::RecordingLayout;
use crate::units::kind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What stands for a record's name in the name of a file.
const RECORD: &str = "{record}";

/// What a gyroscope is calibrated with, as one TOML file says.
///
/// Two are equal if they say the same, whatever file they came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("anyOf" = [{ "required": ["condition"] }, { "required": ["rest"] }, { "required": ["positions"] }, { "required": ["rates"] }, { "required": ["turns"] }, { "required": ["sine"] }, { "required": ["temperature"] }]))]
#[schemars(transform = with_earlier_name)]
pub struct GyroscopeCalibration {
    /// A name; results go to a folder of this name unless another is given.
    pub name: Name,
    /// What the calibration is about, in free text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// The unit: gyroscopes, accelerometers or both. The table may also be called `[gyroscope]`.
    #[serde(rename = "sensor", alias = "gyroscope")]
    pub gyroscope: InertialUnit,
    /// The records under vibration, at one temperature or several.
    #[serde(rename = "condition", default, skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<Condition>,
    /// A record without motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rest: Option<RestRecord>,
    /// A record of several positions with motions between them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub positions: Option<PositionsRecord>,
    /// The same at further temperatures: each record of positions states its `temperature` then.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further_positions: Vec<PositionsRecord>,
    /// The curves through the results of the records of positions at several temperatures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub positions_over_temperature: Option<CurveChoice>,
    /// Records on a rate table that turns at one rate after the other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rates: Vec<RatesRecord>,
    /// The curves through the results of `rates` at several temperatures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rates_over_temperature: Option<CurveChoice>,
    /// Records of turns by a known angle, between which the unit rests.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub turns: Vec<TurnsRecord>,
    /// Records under sines of one frequency after the other, with a reference in the same file.
    #[serde(rename = "sine", default, skip_serializing_if = "Vec::is_empty")]
    pub sines: Vec<SineRecord>,
    /// A record at rest during a cycle of temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<TemperatureRecord>,
    /// What a certificate states and no record tells.
    #[serde(default, skip_serializing_if = "CertificateDetails::is_empty")]
    pub certificate: CertificateDetails,
    /// Propagates the distributions of all inputs by trials, beside the uncertainties (JCGM 101), and says whether both agree.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub monte_carlo: Option<MonteCarlo>,
    #[serde(skip)]
    source: Source,
}

/// What an operator states on a certificate. What is left out is listed there as not stated.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CertificateDetails {
    /// The certificate's number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub number: Option<String>,
    /// What was calibrated: maker, type, serial number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub item: Option<String>,
    /// For whom.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub customer: Option<String>,
    /// Who calibrated it, and where: name and address.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub laboratory: Option<String>,
    /// Who answers for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<String>,
    /// When the laboratory received it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"2026-11-20")]
    pub received: Option<String>,
    /// When it was calibrated.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"2026-11-25")]
    pub date: Option<String>,
    /// When the certificate was issued.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"2026-11-26")]
    pub issued: Option<String>,
    /// The results before any adjustment: these ones, or the certificate that has them.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"these results")]
    pub as_found: Option<String>,
    /// The results after the adjustment: these ones, or the certificate that has them; or that the item was not adjusted.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(example = &"not adjusted")]
    pub as_left: Option<String>,
    /// Conditions that no record tells: pressure, humidity, supply, settling time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conditions: Option<String>,
    /// To which standards the references are traceable, and by which certificates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traceability: Option<String>,
    /// A coverage factor that is wanted instead of that for 95 %, such as 2; the coverage probability then follows from it and the degrees of freedom.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 3))]
    pub coverage_factor: Option<u8>,
}

impl CertificateDetails {
    fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Each key with what is stated.
    pub fn entries(&self) -> [(&'static str, Option<&str>); 12] {
        [
            ("number", self.number.as_deref()),
            ("item", self.item.as_deref()),
            ("customer", self.customer.as_deref()),
            ("laboratory", self.laboratory.as_deref()),
            ("operator", self.operator.as_deref()),
            ("received", self.received.as_deref()),
            ("date", self.date.as_deref()),
            ("issued", self.issued.as_deref()),
            ("as_found", self.as_found.as_deref()),
            ("as_left", self.as_left.as_deref()),
            ("conditions", self.conditions.as_deref()),
            ("traceability", self.traceability.as_deref()),
        ]
    }
}

/// How many trials a Monte Carlo method may take.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MonteCarlo {
    /// Trials at most: it ends before where the ends of all intervals are accurate to a fifth of their tolerance.
    #[serde(default = "MonteCarlo::usual_trials")]
    #[schemars(range(min = 20_000, max = 10_000_000))]
    pub trials: usize,
    /// Which random numbers: the same seed gives the same trials.
    #[serde(default)]
    pub seed: u64,
}

impl MonteCarlo {
    const fn usual_trials() -> usize {
        200_000
    }
}

/// The gyroscope, and the accelerometers in its case if there are any.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InertialUnit {
    /// Its nominal sample rate. Its clock is its own: what it really is, the calibration finds.
    pub rate: Quantity<Frequency, Positive>,
    /// How far its clock may be off, relative to that. Records under vibration need it; of a record at rest a column of times is held
    /// against it where it is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock_tolerance: Option<Quantity<Ratio, NotNegative>>,
    /// Its columns by axis, such as `{ y = "gyro_rad_per_s" }`; the axes are those of the references. A unit of accelerometers alone has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<Channels>,
    /// The columns of the accelerometers by axis, in the same file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accelerometers: Option<Channels>,
    /// The largest rate that it can show; what is as large is clipped. Otherwise clipping is seen where a value repeats.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub full_scale: Option<Quantity<AngularRate, Positive>>,
}

/// Records at one temperature, and the references for them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// A name, unique in the file, such as `room`.
    pub name: Name,
    /// The temperature of the unit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Quantity<Temperature, Positive>>,
    /// The file of the gyroscope. With `{record}` in its name, a file for each of `records`.
    #[schemars(example = &"gyro.csv")]
    pub file: PathBuf,
    /// How the file is written, if it does not show that itself: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// Where one file holds several records: the column that tells them apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// The records that are used; all if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub records: Option<Vec<String>>,
    /// What the records are compared with: a vibrometer, an estimated motion.
    #[serde(rename = "reference")]
    #[schemars(length(min = 1))]
    pub references: Vec<MotionReference>,
}

/// A motion that is known: angular rates, angles, or the voltage of a vibrometer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MotionReference {
    /// A name, unique in the condition, such as `vibrometer` or `stage`.
    pub name: Name,
    /// Its file. With `{record}` in its name, a file for each record, such as `out/stage/{record}_trajectory_ekf.csv`.
    #[schemars(example = &"bias_on.csv")]
    pub file: PathBuf,
    /// How the file is written, if it does not show that itself: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// Where one file holds several records: the column that tells them apart, with the names that the gyroscope's have.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// When its samples were taken.
    pub clock: Clock,
    /// Its columns by axis: angular rates, angles, or volts of the `vibrometer`. An axis that is left out is taken to be
    /// at rest.
    pub channels: Channels,
    /// For columns in volts: how they become angular rates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vibrometer: Option<Vibrometer>,
    /// What it is, for a certificate: maker, type, serial number.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub instrument: Option<String>,
    /// By which certificate it is traceable, and to what.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traceability: Option<String>,
    /// Relative standard uncertainties that the records cannot tell. What is left out is not in the interval, and said.
    #[serde(default)]
    pub uncertainty: StatedUncertainty,
}

/// Standard uncertainties of a reference, from elsewhere: a certificate, a data sheet, a study. They are relative to the rate, but for that
/// of the alignment; each is a value alone or a table with its distribution, degrees of freedom and source.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StatedUncertainty {
    /// The vibrometer's gain; of an estimated motion, that of the vibrometer it was identified with.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vibrometer: Option<StandardUncertainty<Ratio>>,
    /// The lever arm that makes a rate of the vibrometer's velocity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lever_arm: Option<StandardUncertainty<Ratio>>,
    /// The clock of the reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<StandardUncertainty<Ratio>>,
    /// What is left of the drive in the sensors' signals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feedthrough: Option<StandardUncertainty<Ratio>>,
    /// The model behind an estimated motion: gap, gain, capacitance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<StandardUncertainty<Ratio>>,
    /// The temperature between calibration and use.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<StandardUncertainty<Ratio>>,
    /// Motion about axes that the reference does not show, times the unit's cross-axis sensitivity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub off_axis: Option<StandardUncertainty<Ratio>>,
    /// What the scale factor changes from record to record and from mounting to mounting, if that is known from elsewhere. It replaces what the
    /// records themselves scatter; of a single record nothing else tells it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reproducibility: Option<StandardUncertainty<Ratio>>,
    /// By what angle each of the reference's axes may be off the axis that it is called, in either direction square to it. Cross-axis terms
    /// depend on it in full and have no expanded uncertainty without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alignment: Option<StandardUncertainty<Angle>>,
    /// How these errors hang together, each pair once, such as `lever_arm = { vibrometer = 0.4 }`; the alignment is apart.
    #[serde(default, skip_serializing_if = "StatedCorrelations::is_empty")]
    pub correlation: StatedCorrelations,
}

/// A record without motion, or several of one unit in one state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RestRecord {
    /// Its file. With `{record}` in its name, a file for each of `records`.
    #[schemars(example = &"rest.csv")]
    pub file: PathBuf,
    /// How the file is written, if it does not show that itself: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// Where the file holds several records: the column that tells them apart. None of them is joined to the next.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// The records that are used; all of the file if left out. Their squared differences are added up, and so are the degrees of freedom; the bias is the
    /// mean of their means.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub records: Option<Vec<String>>,
    /// When its samples were taken; by the gyroscope's nominal rate if left out. A column of times has to show that rate within
    /// its `clock_tolerance`, if that is stated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// Its columns by axis. If these and those of the accelerometers are left out, they are those of the gyroscope.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<Channels>,
    /// The columns of the accelerometers by axis, whose noise is wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accelerometers: Option<Channels>,
    /// The latitude, positive in the north. With three accelerometers in the record, the vertical part of the Earth's rotation is then subtracted from the
    /// biases, and the horizontal one allowed for; otherwise their intervals allow for all of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latitude: Option<Quantity<Angle>>,
    /// Fits each line that stands out of the spectrum by a sine, in parts of at most 65536 samples, and subtracts it. What stands out then still
    /// forbids a certificate.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub subtract_lines: bool,
    /// Writes the noise densities as `imu.yaml` under the names of Kalibr and of drivers of ROS.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub noise_yaml: bool,
}

/// A record in which the unit rests in many positions one after the other, turned by hand between them. The columns are those of the unit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PositionsRecord {
    /// The file, relative to the calibration file.
    #[schemars(example = &"positions.csv")]
    pub file: PathBuf,
    /// How the file is written, if it does not show that itself: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// Where the file holds several records: the column that tells them apart. No motion is taken from one to the next.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// When its samples were taken; by the nominal rate if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// The magnitude of gravity at the place, such as `"9.81235 m/s^2"`: the reference of the accelerometers' scale factors.
    pub gravity: Quantity<Acceleration, Positive>,
    /// How well it is known. It is not in the interval if left out, and the certificate says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity_uncertainty: Option<StandardUncertainty<Acceleration>>,
    /// The latitude, positive in the north: the vertical part of the Earth's rotation is then taken off the gyroscopes' sensitivity to the
    /// specific force, from which it cannot be told otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latitude: Option<Quantity<Angle>>,
    /// How long a position lasts at least; `"1 s"` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shortest: Option<Quantity<Time, Positive>>,
    /// The direction of the specific force (upwards) along the axes of the unit in each position, of any length, as a fixture sets it. The attitudes
    /// determine the terms of second and third order of the accelerometers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub attitudes: Vec<[f64; 3]>,
    /// The temperature of the unit. Records at several temperatures give scale factors, angles and biases over the temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Quantity<Temperature, Positive>>,
    /// How the temperature was reached, `up` or `down`: curves are then apart, and their difference is the hysteresis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_direction: Option<TemperatureDirection>,
}

/// A record on a rate table that turns about one axis of the unit at one constant rate after the other. The columns are those of the unit's gyroscopes
/// and, in the same file, the rate of the table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RatesRecord {
    /// A name, unique among these records, such as `z_room`.
    pub name: Name,
    /// The file, relative to the calibration file.
    #[schemars(example = &"rates.csv")]
    pub file: PathBuf,
    /// How the file is written, if it does not show that itself: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// Where the file holds several records: the column that tells them apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// When its samples were taken; by the nominal rate if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// The axis of the unit that lies along that of the table: `x`, `y` or `z`. The other gyroscopes show their cross-axis sensitivity.
    pub axis: TableAxis,
    /// The column with the rate of the table, as its encoder or its controller gives it.
    #[schemars(example = &"table_dps")]
    pub table: ColumnChoice,
    /// The relative standard uncertainty of that rate. It is not in the interval if left out, and the certificate says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub table_uncertainty: Option<StandardUncertainty<Ratio>>,
    /// By what angle the unit's axis may be off that of the table: in full in the cross-axis sensitivities, in second order in the scale factor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alignment: Option<StandardUncertainty<Angle>>,
    /// Of a table with a vertical axis: where the unit's axis points, `up` or `down`. The rate of the table counts about the vertical, so that downwards the
    /// unit turns the other way round. Records of both mountings give the gyroscopes' sensitivity to the specific force.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mounting: Option<Mounting>,
    /// The latitude, positive in the north, of a table with a vertical axis, with the unit's axis upwards if no `mounting` is stated: the vertical part of the
    /// Earth's rotation is then added to the rate of the table. Otherwise the bias has it, and its interval allows for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub latitude: Option<Quantity<Angle>>,
    /// The temperature of the unit. Records of one axis at several temperatures give scale factor, bias and cross-axis sensitivity over the temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<Quantity<Temperature, Positive>>,
    /// How the temperature was reached, `up` or `down`: curves are then apart, and their difference is the hysteresis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_direction: Option<TemperatureDirection>,
    /// How long the table turns at one rate at least; `"1 s"` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shortest: Option<Quantity<Time, Positive>>,
    /// What is left out at the beginning of each rate, while a slow gyroscope still follows the one before.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub settling: Option<Quantity<Time, Positive>>,
}

/// A record in which the unit is turned about one of its axes by a known angle or multiples of it, to either side, and rests before and after each turn:
/// by hand against a stop, or on a table without a measured rate. The columns are those of the unit's gyroscopes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TurnsRecord {
    /// A name, unique among these records, such as `z_by_hand`.
    pub name: Name,
    /// The file, relative to the calibration file.
    #[schemars(example = &"turns.csv")]
    pub file: PathBuf,
    /// How the file is written, if it does not show that itself: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// Where the file holds several records: the column that tells them apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// When its samples were taken; by the nominal rate if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// The axis about which it is turned: `x`, `y` or `z`. The other gyroscopes show their cross-axis sensitivity.
    pub axis: TableAxis,
    /// The angle, such as `"360 deg"`; a turn may be a multiple of it.
    pub angle: Quantity<Angle, Positive>,
    /// How well that angle is known, in what is common to all turns: what differs from turn to turn is in their scatter. It is not in the interval if
    /// left out, and the certificate says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angle_uncertainty: Option<StandardUncertainty<Angle>>,
    /// By what angle the unit's axis may be off that of the turns: in full in the cross-axis sensitivities, in second order in the scale factor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alignment: Option<StandardUncertainty<Angle>>,
    /// How long a rest lasts at least; `"1 s"` if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shortest: Option<Quantity<Time, Positive>>,
}

/// A record under sines of one frequency after the other, of one sensor of the unit and, in the same rows, a reference along it: an acceleration, or an
/// angular rate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SineRecord {
    /// A name, unique among these records, such as `x_shaker`.
    pub name: Name,
    /// The file, relative to the calibration file.
    #[schemars(example = &"shaker.csv")]
    pub file: PathBuf,
    /// How the file is written, if it does not show that itself: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// The column that tells the frequencies apart, each of which is a record; of one frequency it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// When its samples were taken; by the nominal rate if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// `accelerometer` or `gyroscope`.
    pub sensor: InertialSensor,
    /// The axis of the unit that lies along that of the reference: `x`, `y` or `z`.
    pub axis: TableAxis,
    /// The column of the reference.
    #[schemars(example = &"reference_m_per_s2")]
    pub reference: ColumnChoice,
    /// The relative standard uncertainty of the reference's sensitivity. It is not in the interval if left out, and the certificate says so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference_uncertainty: Option<StandardUncertainty<Ratio>>,
    /// How well the time is known between a sample of the reference and that of the unit in the same row, its phase included. It is not in the
    /// interval of the phase if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delay_uncertainty: Option<StandardUncertainty<Time>>,
    /// What the scale factor changes from one mounting to the next, relative to it, where a frequency has a single record.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reproducibility: Option<StandardUncertainty<Ratio>>,
    /// Each record is a sweep over the frequencies, or noise, and begins and ends at rest: the response is then that in bands of a sixth of an octave.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub sweep: bool,
}

/// A record at rest while the temperature rises and falls. The columns are those of the unit and, in the same file, the temperature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TemperatureRecord {
    /// The file, relative to the calibration file.
    #[schemars(example = &"cycle.csv")]
    pub file: PathBuf,
    /// How the file is written, if it does not show that itself: `{ kind = "csv", separator = ";", decimal = "," }`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<FileFormat>,
    /// Where the file holds several records: the column that tells them apart.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segments: Option<Segments>,
    /// When its samples were taken; by the nominal rate if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clock: Option<Clock>,
    /// Its columns by axis. If these and those of the accelerometers are left out, they are those of the gyroscope.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<Channels>,
    /// The columns of the accelerometers by axis.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accelerometers: Option<Channels>,
    /// The column with the temperature of the unit.
    #[schemars(example = &"temperature_K")]
    pub temperature: ColumnChoice,
    /// The order of the polynomials, 1 to 4; 2 if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 4))]
    pub order: Option<u8>,
    /// Natural cubic splines instead, with so many knots at equal distances over the range of the temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 3, max = 8))]
    pub knots: Option<u8>,
    /// The temperature from which the polynomials count, and at which the hysteresis is stated; the middle of the record's range if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<Quantity<Temperature, Positive>>,
}

/// What is stated of curves over the temperature.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CurveChoice {
    /// The order of the polynomials, 1 to 4; 1 if left out, and 2 from five records on.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 4))]
    pub order: Option<u8>,
    /// Natural cubic splines instead, with so many knots at equal distances over the range of the temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 3, max = 8))]
    pub knots: Option<u8>,
    /// The temperature from which the polynomials count; the middle of the range if left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reference: Option<Quantity<Temperature, Positive>>,
}

impl TemperatureRecord {
    /// What it states of its curves.
    pub fn curve(&self) -> CurveChoice {
        CurveChoice { order: self.order, knots: self.knots, reference: self.reference.clone() }
    }
}

impl CurveChoice {
    /// The key that is wrong, and why.
    fn check(&self) -> Result<(), (&'static str, String)> {
        match (self.order, self.knots) {
            (Some(_), Some(_)) => {
                Err(("knots", "found `order` and `knots`; expected one of them".to_owned()))
            }
            (Some(order), None) if !(1..=4).contains(&order) => {
                Err(("order", format!("an order of {order}; expected 1 to 4")))
            }
            (None, Some(knots)) if !(3..=8).contains(&knots) => {
                Err(("knots", format!("{knots} knots; expected 3 to 8")))
            }
            _ => Ok(()),
        }
    }
}

/// Where an axis of the unit points on a table with a vertical axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Mounting {
    /// Upwards.
    Up,
    /// Downwards.
    Down,
}

/// A direction of the temperature.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TemperatureDirection {
    /// It rises.
    Up,
    /// It falls.
    Down,
}

impl TemperatureDirection {
    /// As names of numbers have it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Up => "up",
            Self::Down => "down",
        }
    }
}

/// An axis of the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TableAxis {
    /// The first one.
    X,
    /// The second one.
    Y,
    /// The third one.
    Z,
}

impl TableAxis {
    /// 0 for x.
    pub const fn index(self) -> usize {
        match self {
            Self::X => 0,
            Self::Y => 1,
            Self::Z => 2,
        }
    }
}

/// Said of a file for each record where no record is named.
const NAMES_WANTED: &str =
    "a file for each record needs their names, such as `records = [\"test1\", \"test2\"]`";

/// The table of the unit, and what it was called first.
const UNIT: &str = "sensor";
const EARLIER_UNIT: &str = "gyroscope";

/// A file may have the table of the unit under either name.
fn with_earlier_name(schema: &mut schemars::Schema) {
    let either = [UNIT, EARLIER_UNIT].map(|name| serde_json::json!({ "required": [name] }));
    schema.insert("oneOf".to_owned(), either.to_vec().into());
    if let Some(required) = schema.get_mut("required").and_then(serde_json::Value::as_array_mut) {
        required.retain(|name| name != UNIT);
    }
    if let Some(properties) = schema.get_mut("properties").and_then(serde_json::Value::as_object_mut)
        && let Some(unit) = properties.get(UNIT).cloned()
    {
        properties.insert(EARLIER_UNIT.to_owned(), unit);
    }
}

/// The axes that a channel can be of.
const AXES: [&str; 3] = ["x", "y", "z"];

impl ApplicationFile for GyroscopeCalibration {
    const TITLE: &'static str = "A kalmems calibration of a gyroscope";

    fn with_source(mut self, source: Source) -> Self {
        let folder = source.path.parent().unwrap_or(Path::new(""));
        let unit = &mut self.gyroscope;
        let of_rest = self.rest.iter_mut().flat_map(|rest| [&mut rest.channels, &mut rest.accelerometers]);
        let of_cycle =
            self.temperature.iter_mut().flat_map(|cycle| [&mut cycle.channels, &mut cycle.accelerometers]);
        let of_unit =
            [&mut unit.channels, &mut unit.accelerometers].into_iter().chain(of_rest).chain(of_cycle);
        let references = self.conditions.iter_mut().flat_map(|condition| &mut condition.references);
        let of_references = references.map(|reference| &mut reference.channels);
        for channels in of_unit.flatten().chain(of_references) {
            channels.load_compensations(folder);
        }
        Self { source, ..self }
    }

    fn check(&self) -> Result<(), ConfigError> {
        let refuse = |key: Key, why: String| Err(self.error(key, ConfigFault::Value { why }));
        let unit = self.unit_key();
        match (&self.gyroscope.channels, self.conditions.is_empty()) {
            (Some(channels), _) => self.check_axes(&unit.clone().child("channels"), channels)?,
            (None, true) if self.gyroscope.accelerometers.is_some() => {}
            (None, _) => {
                let why = "found no columns; expected those of the gyroscopes by axis, such as `channels = { z = \"gyro_z_rad_per_s\" }`; only a \
                           unit of accelerometers that is not shaken has none";
                return refuse(unit.child("channels"), why.to_owned());
            }
        }
        if let Some(channels) = &self.gyroscope.accelerometers {
            self.check_axes(&unit.clone().child("accelerometers"), channels)?;
        }
        if !self.conditions.is_empty() && self.gyroscope.clock_tolerance.is_none() {
            let why = "records under vibration need how far the gyroscope's clock may be off; expected such as `clock_tolerance = \"1 %\"`";
            return refuse(unit.child("clock_tolerance"), why.to_owned());
        }
        if let Some(factor) = self.certificate.coverage_factor.filter(|factor| !(1..=3).contains(factor)) {
            let why = format!("a coverage factor of {factor}; expected 1 to 3");
            return refuse(Key::from("certificate").child("coverage_factor"), why);
        }
        if self.conditions.is_empty()
            && self.rest.is_none()
            && self.positions.is_none()
            && self.rates.is_empty()
            && self.turns.is_empty()
            && self.sines.is_empty()
            && self.temperature.is_none()
        {
            let why = "found no record; expected `[[condition]]` of records under vibration, `[rest]`, `[positions]`, `[[rates]]`, `[[turns]]`, \
                       `[[sine]]` or `[temperature]`";
            return refuse(Key::default(), why.to_owned());
        }
        let both = FileColumns { columns: self.gyroscope.columns(), ..FileColumns::default() };
        self.check_columns(&unit, &both)?;
        let at_rest = self.rest.iter().map(|rest| ("rest", &rest.channels, &rest.accelerometers));
        let in_cycle =
            self.temperature.iter().map(|cycle| ("temperature", &cycle.channels, &cycle.accelerometers));
        for (table, channels, accelerometers) in at_rest.chain(in_cycle) {
            for (name, channels) in [("channels", channels), ("accelerometers", accelerometers)] {
                if let Some(channels) = channels {
                    self.check_axes(&Key::from(table).child(name), channels)?;
                }
            }
        }
        self.check_unit_records()?;
        if let Some(MonteCarlo { trials, .. }) = self.monte_carlo
            && !(20_000..=10_000_000).contains(&trials)
        {
            let why = format!("`{trials}` trials; expected 20000 to 10000000");
            return refuse(Key::from("monte_carlo").child("trials"), why);
        }
        let mut conditions = BTreeMap::new();
        for (index, condition) in self.conditions.iter().enumerate() {
            let key = Key::from("condition").index(index);
            self.require_unique(&mut conditions, &key, &condition.name)?;
            if is_per_record(&condition.file) && condition.records.is_none() {
                return refuse(key.child("records"), NAMES_WANTED.to_owned());
            }
            if condition.references.is_empty() {
                let why = "found no reference; expected at least one `[[condition.reference]]`";
                return refuse(key.child("reference"), why.to_owned());
            }
            let mut names = BTreeMap::new();
            for (number, reference) in condition.references.iter().enumerate() {
                let key = key.clone().child("reference").index(number);
                self.check_axes(&key.clone().child("channels"), &reference.channels)?;
                self.check_columns(&key, &reference.in_file())?;
                if let Err(why) = reference.uncertainty.check() {
                    return refuse(key.child("uncertainty").child("correlation"), why);
                }
                self.require_unique(&mut names, &key, &reference.name)?;
            }
        }
        Ok(())
    }
}

impl GyroscopeCalibration {
    /// Checks the records of a unit that no reference shakes: at rest, in positions, over the temperature and on a rate table.
    fn check_unit_records(&self) -> Result<(), ConfigError> {
        let refuse = |key: Key, why: String| Err(self.error(key, ConfigFault::Value { why }));
        if let Some(rest) = &self.rest {
            let key = Key::from("rest");
            if is_per_record(&rest.file) && rest.records.is_none() {
                return refuse(key.child("records"), NAMES_WANTED.to_owned());
            }
            self.check_record(&key, &rest.of_unit(&self.gyroscope))?;
        }
        let further = self.further_positions.iter().enumerate();
        let further = further.map(|(index, record)| (Key::from("further_positions").index(index), record));
        let first = self.positions.iter().map(|record| (Key::from("positions"), record));
        for (key, positions) in first.chain(further) {
            if !self.further_positions.is_empty()
                && (positions.temperature.is_none() || self.positions.is_none())
            {
                let why = "found several records of positions; expected `[positions]` and each of `[[further_positions]]` with its `temperature`";
                return refuse(key.child("temperature"), why.to_owned());
            }
            let complete = |channels: &Channels| AXES.iter().all(|axis| channels.column(axis).is_some());
            if !self.gyroscope.accelerometers.as_ref().is_some_and(complete) {
                let why = "positions calibrate three accelerometers; expected their columns such as `accelerometers = { x = \"acc_x_gn\", y = \
                           \"acc_y_gn\", z = \"acc_z_gn\" }`";
                return refuse(self.unit_key().child("accelerometers"), why.to_owned());
            }
            if self.gyroscope.channels.as_ref().is_some_and(|channels| !complete(channels)) {
                let why = "positions calibrate three gyroscopes or none; expected the columns of `x`, `y` and `z`, or no `channels`";
                return refuse(self.unit_key().child("channels"), why.to_owned());
            }
            self.check_record(&key, &positions.of_unit(&self.gyroscope))?;
        }
        let of_cycle = self.temperature.iter().map(|record| ("temperature", record.curve()));
        let of_several = [
            ("rates_over_temperature", &self.rates_over_temperature),
            ("positions_over_temperature", &self.positions_over_temperature),
        ];
        let of_several = of_several.into_iter().filter_map(|(table, choice)| Some((table, choice.clone()?)));
        for (table, choice) in of_cycle.chain(of_several) {
            if let Err((key, why)) = choice.check() {
                return refuse(Key::from(table).child(key), why);
            }
        }
        if let Some(record) = &self.temperature {
            let key = Key::from("temperature");
            self.check_record(&key, &record.of_unit(&self.gyroscope))?;
        }
        let unit = &self.gyroscope;
        let sines = self.sines.iter().map(|record| ("sine", &record.name, record.of_unit(unit), record.axis));
        let rates =
            self.rates.iter().map(|record| ("rates", &record.name, record.of_unit(unit), record.axis));
        let turns =
            self.turns.iter().map(|record| ("turns", &record.name, record.of_unit(unit), record.axis));
        let about_an_axis = sines.enumerate().chain(rates.enumerate()).chain(turns.enumerate());
        let mut names: BTreeMap<&str, BTreeMap<&Name, Key>> = BTreeMap::new();
        for (index, (table, name, record, axis)) in about_an_axis {
            let key = Key::from(table).index(index);
            self.require_unique(names.entry(table).or_default(), &key, name)?;
            let axis = AXES[axis.index()];
            let channels = record.channels.or(record.accelerometers);
            if channels.is_none_or(|channels| channels.column(axis).is_none()) {
                let why = format!(
                    "the unit has no such sensor of the axis {axis}; expected its column at `channels.{axis}` or `accelerometers.{axis}`"
                );
                return refuse(key.child("axis"), why);
            }
            self.check_record(&key, &record)?;
        }
        Ok(())
    }

    /// The records of positions in the order of the file.
    pub(super) fn all_positions(&self) -> impl Iterator<Item = &PositionsRecord> {
        self.positions.iter().chain(&self.further_positions)
    }

    /// The key of the unit's table, as the file calls it.
    fn unit_key(&self) -> Key {
        Key::from(if self.source.has(EARLIER_UNIT) { EARLIER_UNIT } else { UNIT })
    }

    /// Refuses a column that is read in two ways.
    fn check_columns(&self, key: &Key, file: &FileColumns) -> Result<(), ConfigError> {
        file.check().map_err(|(_, why)| self.error(key.clone(), ConfigFault::Value { why }))
    }

    /// Refuses a name at this key that stands at an earlier one already.
    fn require_unique<'a>(
        &self,
        names: &mut BTreeMap<&'a Name, Key>,
        key: &Key,
        name: &'a Name,
    ) -> Result<(), ConfigError> {
        let Some(first) = names.insert(name, key.clone()) else { return Ok(()) };
        let fault = ConfigFault::DuplicateName { name: name.to_string(), first: first.to_string() };
        Err(self.error(key.clone().child("name"), fault))
    }

    fn check_record(&self, key: &Key, record: &RecordOfUnit) -> Result<(), ConfigError> {
        let clock = record.clock.cloned().unwrap_or_else(|| self.gyroscope.clock());
        self.check_columns(key, &record.in_file(&clock))
    }

    fn check_axes(&self, key: &Key, channels: &Channels) -> Result<(), ConfigError> {
        match channels.iter().find(|(axis, _)| !AXES.contains(axis)) {
            Some((axis, _)) => {
                let why = format!("`{axis}` is no axis; expected `x`, `y` or `z`");
                Err(self.error(key.clone().child(axis), ConfigFault::Value { why }))
            }
            None => Ok(()),
        }
    }

    /// A file that it names: relative to the folder of the calibration file, with a record's name in its place.
    pub fn resolve(&self, file: &Path, record: &str) -> PathBuf {
        let named = PathBuf::from(file.to_string_lossy().replace(RECORD, record));
        self.source.path.parent().unwrap_or(Path::new("")).join(named)
    }

    /// The files that a run reads because of it, itself among them; see [`Source::files`].
    pub fn files(&self) -> Vec<PathBuf> {
        let named = self.conditions.iter().flat_map(|condition| {
            let files = condition.references.iter().map(|reference| &reference.file);
            let records = condition.records.iter().flatten().map(String::as_str);
            let of_record =
                move |record| std::iter::once(&condition.file).chain(files.clone()).map(move |f| (f, record));
            records.flat_map(of_record)
        });
        let named = named.map(|(file, record)| self.resolve(file, record));
        self.source.files().into_iter().chain(named).collect()
    }

    /// An error at a key, with its line.
    pub fn error(&self, key: impl Into<Key>, fault: ConfigFault) -> ConfigError {
        self.source.error_at(key.into(), fault)
    }
}

/// Whether a file's name has a record's name in it.
pub(super) fn is_per_record(file: &Path) -> bool {
    file.to_string_lossy().contains(RECORD)
}

impl InertialUnit {
    /// The columns of a file of it.
    fn columns(&self) -> Vec<(&str, &ColumnChoice, Option<&'static str>)> {
        [&self.channels, &self.accelerometers].into_iter().flatten().flat_map(Channels::in_file).collect()
    }

    /// The columns of gyroscopes and accelerometers in a record at rest: as stated, or those of the gyroscopes; a unit without any has accelerometers.
    fn columns_at_rest<'a>(&'a self, stated: [Option<&'a Channels>; 2]) -> [Option<&'a Channels>; 2] {
        match (stated, &self.channels) {
            ([None, None], Some(channels)) => [Some(channels), None],
            ([None, None], None) => [None, self.accelerometers.as_ref()],
            _ => stated,
        }
    }

    /// Its clock, by its nominal rate.
    pub fn clock(&self) -> Clock {
        Clock::Rate { rate: self.rate.clone(), start: None }
    }
}

impl Condition {
    /// How to read a file of the gyroscope.
    pub fn layout(&self, unit: &InertialUnit) -> RecordingLayout {
        let clock = unit.clock();
        FileColumns::new(self.format.as_ref(), &clock, unit.columns())
            .divided_by(self.segments.as_ref())
            .layout(None)
    }
}

impl MotionReference {
    /// How to read a file of it.
    pub fn layout(&self) -> RecordingLayout {
        self.in_file().layout(None)
    }

    fn in_file(&self) -> FileColumns<'_> {
        FileColumns::new(self.format.as_ref(), &self.clock, self.channels.in_file())
            .divided_by(self.segments.as_ref())
    }
}

/// The file of a record with how it is written, before its columns.
macro_rules! record_of {
    ($record:expr) => {
        RecordOfUnit {
            file: &$record.file,
            format: $record.format.as_ref(),
            segments: $record.segments.as_ref(),
            clock: $record.clock.as_ref(),
            channels: None,
            accelerometers: None,
            further: None,
        }
    };
}

impl RestRecord {
    /// The record with its columns.
    pub fn of_unit<'a>(&'a self, unit: &'a InertialUnit) -> RecordOfUnit<'a> {
        let [channels, accelerometers] =
            unit.columns_at_rest([self.channels.as_ref(), self.accelerometers.as_ref()]);
        RecordOfUnit { channels, accelerometers, ..record_of!(self) }
    }
}

impl PositionsRecord {
    /// The record with its columns.
    pub fn of_unit<'a>(&'a self, unit: &'a InertialUnit) -> RecordOfUnit<'a> {
        let (channels, accelerometers) = (unit.channels.as_ref(), unit.accelerometers.as_ref());
        RecordOfUnit { channels, accelerometers, ..record_of!(self) }
    }
}

impl RatesRecord {
    /// The record with its columns.
    pub fn of_unit<'a>(&'a self, unit: &'a InertialUnit) -> RecordOfUnit<'a> {
        let further = Some(("table", &self.table, &kind::ANGULAR_RATE));
        RecordOfUnit { channels: unit.channels.as_ref(), further, ..record_of!(self) }
    }
}

impl TurnsRecord {
    /// The record with its columns.
    pub fn of_unit<'a>(&'a self, unit: &'a InertialUnit) -> RecordOfUnit<'a> {
        RecordOfUnit { channels: unit.channels.as_ref(), ..record_of!(self) }
    }
}

impl SineRecord {
    /// The record with its columns.
    pub fn of_unit<'a>(&'a self, unit: &'a InertialUnit) -> RecordOfUnit<'a> {
        let (channels, accelerometers, kind) = match self.sensor {
            InertialSensor::Gyroscope => (unit.channels.as_ref(), None, &kind::ANGULAR_RATE),
            InertialSensor::Accelerometer => (None, unit.accelerometers.as_ref(), &kind::ACCELERATION),
        };
        let further = Some(("reference", &self.reference, kind));
        RecordOfUnit { channels, accelerometers, further, ..record_of!(self) }
    }
}

impl TemperatureRecord {
    /// The record with its columns.
    pub fn of_unit<'a>(&'a self, unit: &'a InertialUnit) -> RecordOfUnit<'a> {
        let [channels, accelerometers] =
            unit.columns_at_rest([self.channels.as_ref(), self.accelerometers.as_ref()]);
        let further = Some(("temperature", &self.temperature, &kind::TEMPERATURE));
        RecordOfUnit { channels, accelerometers, further, ..record_of!(self) }
    }
}

impl StatedUncertainty {
    /// The keys of the relative ones, what each stands for in a budget, and what is stated of it.
    pub fn contributions(&self) -> [(&'static str, &'static str, Option<&StandardUncertainty<Ratio>>); 8] {
        [
            ("vibrometer", "vibrometer", self.vibrometer.as_ref()),
            ("lever_arm", "lever arm", self.lever_arm.as_ref()),
            ("clock", "clock", self.clock.as_ref()),
            ("feedthrough", "feedthrough", self.feedthrough.as_ref()),
            ("model", "model", self.model.as_ref()),
            ("temperature", "temperature", self.temperature.as_ref()),
            ("off_axis", "off-axis motion", self.off_axis.as_ref()),
            ("reproducibility", OF_REPRODUCIBILITY, self.reproducibility.as_ref()),
        ]
    }

    /// Why its correlations are none that errors can have.
    fn check(&self) -> Result<(), String> {
        let stated = self.contributions().into_iter().filter(|(.., stated)| stated.is_some());
        let names: Vec<&str> = stated.map(|(key, ..)| key).collect();
        self.correlation.check(&names)
    }
}
