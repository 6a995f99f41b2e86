//! The experiment file: a device and its recordings, described once, in TOML.
//!
//! Every value is text with a unit, checked for its dimension and its sign. An unknown key or word is refused
//! with the nearest known one. A message names the file, the line, the key, what was found, what was
//! expected, and what to write:
//!
//! ```
//! use kalmems_config::Experiment;
//! let error = Experiment::parse("nmae = \"scan\"", "experiment.toml".as_ref()).unwrap_err();
//! assert_eq!(
//!     error.to_string(),
//!     "experiment.toml:1: nmae: unknown key `nmae`; did you mean `name`? \
//!      known keys: name, description, device, recording, estimate, identify, simulate, stream"
//! );
//! ```

mod arrays;
mod beside;
mod clock;
mod column;
mod compensation;
mod device;
mod error;
mod estimate;
mod event;
mod experiment;
mod filter;
mod format;
mod gaps;
mod hybrid;
mod identify;
mod inputs;
mod key;
pub mod kinds;
pub mod layout;
mod name;
mod outliers;
mod patch;
mod process_noise;
mod quantity;
mod reader;
mod readout;
mod recording;
mod regulated;
mod schema;
mod sign;
mod simulate;
mod source;
mod stream;
mod uncertainty;
mod uses;
mod values;
mod variation;
mod vibrometer;

pub use arrays::ArraysByFile;
pub use beside::{FilesBeside, ReadFile};
pub use clock::{Clock, TimeColumn};
pub use column::{ColumnChoice, FileColumns};
pub use compensation::{Compensation, CurvePiece, TemperatureCurve};
pub use device::{DeviceDescription, DeviceKind, OtherTerms, read_device};
pub use error::{ConfigError, ConfigFault, ConfigPlace, LineAndColumn};
pub use estimate::{Crossings, Estimate, ExtremeSign};
pub use event::{Edge, EventSource, EventUse};
pub use experiment::Experiment;
pub use filter::{FilterName, FilterStart, FilterTable, Method, TrackedNumber, TrackedState};
pub use format::{DecimalMark, FileFormat, FileKind, Separator};
pub use gaps::{CYCLES, Gaps, LongestGap, MOST_CYCLES};
pub use hybrid::{CrossingApplication, CrossingTiming, CrossingUse, Variant};
pub use identify::{CapacitanceTable, FeedthroughBy, Identify, TrustedNumber};
pub use inputs::{
    ChannelAdc, ConstantInput, InputSource, InputSources, InputStep, InputTone, RingDownInput,
    SimulatedChannel, SineInput, SquareInput, StepsInput, SweepInput, TonesInput,
};
pub use key::Key;
pub use key::KeyStep;
pub use name::Name;
pub use outliers::{OutlierGate, Update};
pub use patch::{absent, get, put};
pub use process_noise::ProcessNoiseTable;
pub use quantity::{FROM_RECORDING, Quantity, noise_schema, with_sd, written};
pub use reader::read_source;
pub use readout::{ColouredNoise, InterferenceLine, MOST_LINES, ReadoutStates};
pub use recording::{Channels, Recording, RecordingRole, Reference, Segments};
pub use regulated::{RegulatedDrive, TemperatureRamp, TriggerDirection, TriggerOutput};
pub use schema::{experiment_schema, schema_of};
pub use sign::{Any, NotNegative, NotZero, Positive, Sign, SignOf};
pub use simulate::{
    AccelerationDrive, Adc, CaptureDrive, ConstantDrive, Dither, DriveSource, DriveTone, PowerCut,
    PrescribedMotion, RecordedDrive, RingDownDrive, Simulate, SineDrive, SquareDriveSource, StageConditions,
    SweepDrive, TonesDrive,
};
pub use source::Source;
pub use stream::{
    FieldType, FrameCheck, FrameField, StreamFormat, StreamTable, StreamTrigger, Sync, TriggerChannel,
};
pub use uncertainty::{CORRELATION, Correlations, Direction, UncertainNumber, cholesky, exactly};
pub use uses::DeviceUses;
pub use values::{AnyValue, ExpectedEntry, Values};
pub use variation::VariedExperiment;
pub use vibrometer::Vibrometer;

pub use kalmems_units as units;
