//! The whole file.

use super::format::FileFormat;
use super::reader;
use super::schema::remedy;
use super::source::Source;
use super::values::{self, AnyValue, Entry, Values};
use super::{
    Channels, Clock, ConfigError, Device, DriveSource, Estimate, Fault, Filter, Identify, Key, Method, Name,
    Quantity, Recording, Reference, Segments, Sign, Simulate, Stream,
};
use crate::recording::{self, Layout};
use crate::units::Kind;
use kalmems_formats::Hints;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A device and its recordings, as one TOML file describes them.
///
/// Two experiments are equal if they say the same, whatever file they came from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("anyOf" = [{ "required": ["recording"] }, { "required": ["simulate"] }]))]
pub struct Experiment {
    /// A name; results go to a folder of this name unless another is given.
    pub name: Name,
    /// What the experiment is about, in free text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// The device: exactly one table, such as `[device.shared_scanner]`.
    pub device: Device,
    /// The recordings, at least one; none are needed for a simulation alone.
    #[serde(rename = "recording", default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(min = 1))]
    pub recordings: Vec<Recording>,
    /// The estimate that is wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub estimate: Option<Estimate>,
    /// How the recordings for an identification were taken.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub identify: Option<Identify>,
    /// The simulation that is wanted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulate: Option<Simulate>,
    /// Samples that arrive while they are estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stream: Option<Stream>,
    #[serde(skip)]
    source: Source,
}

impl Experiment {
    /// Reads an experiment file.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        Self::from_source(Source::load(path)?)
    }

    /// Reads the text of an experiment file; `path` is where it stands, or would stand.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        Self::from_source(Source::of(text, path)?)
    }

    fn from_source(source: Source) -> Result<Self, ConfigError> {
        let mut experiment: Self = reader::read_source(&source)?;
        experiment.source = source;
        experiment.check()?;
        Ok(experiment)
    }

    /// What no single key can be blamed for.
    fn check(&self) -> Result<(), ConfigError> {
        self.device.check().map_err(|(key, why)| self.error(key, Fault::Value { why }))?;
        if self.recordings.is_empty() && self.simulate.is_none() {
            let why = "found no recording; expected at least one `[[recording]]`".to_owned();
            let empty = self.error("recording", Fault::Value { why });
            if empty.place.position.is_some() {
                return Err(empty);
            }
            let remedy = remedy::<Self>(&Key::from("recording"));
            return Err(self.error("recording", Fault::MissingKey { remedy }));
        }
        self.check_names()?;
        self.check_crossings()?;
        if let Some(estimate) = &self.estimate {
            estimate.check().map_err(|(key, fault)| self.error(key, fault))?;
            self.check_methods(estimate)?;
        }
        if let Some(simulate) = &self.simulate {
            simulate.check().map_err(|(key, fault)| self.error(key, fault))?;
            self.check_dither(simulate)?;
        }
        Ok(())
    }

    /// Keys of the estimate that are for a device with a threshold alone.
    fn check_crossings(&self) -> Result<(), ConfigError> {
        let Some(estimate) =
            self.estimate.as_ref().filter(|_| !matches!(self.device, Device::ThresholdScanner(_)))
        else {
            return Ok(());
        };
        let at = Key::from("estimate");
        let of_filter = |(index, filter): (usize, &Filter)| {
            let given = [
                ("variant", filter.variant.is_some()),
                ("signal_variance", filter.signal_variance.is_some()),
                ("threshold", filter.threshold.is_some()),
            ];
            let at = at.clone().child("filter").index(index);
            given.into_iter().find(|(_, given)| *given).map(|(name, _)| at.child(name))
        };
        let of_all = [("parts", estimate.parts.is_some()), ("crossings", estimate.crossings.is_some())];
        let of_all = of_all.into_iter().find(|(_, given)| *given).map(|(name, _)| at.clone().child(name));
        match of_all.or_else(|| estimate.filters.iter().enumerate().find_map(of_filter)) {
            Some(key) => {
                let why = "it is for a `[device.threshold_scanner]`; leave it out".to_owned();
                Err(self.error(key, Fault::Value { why }))
            }
            None => Ok(()),
        }
    }

    /// What is built for one device alone.
    fn check_methods(&self, estimate: &Estimate) -> Result<(), ConfigError> {
        let with_channels = estimate.filters.iter().position(|filter| !filter.channels.is_empty());
        if let Some(index) = with_channels.filter(|_| !matches!(self.device, Device::MicroStage(_))) {
            let key = Key::from("estimate").child("filter").index(index).child("channels");
            let why = "only the micro-stage has several signals; leave it out".to_owned();
            return Err(self.error(key, Fault::Value { why }));
        }
        if matches!(self.device, Device::Accelerometer(_)) {
            return Ok(());
        }
        for (index, filter) in estimate.filters.iter().enumerate() {
            let key = Key::from("estimate").child("filter").index(index);
            // Of a phasor a settled gain is a phase-locked loop.
            let is_lock =
                filter.method == Method::SteadyState && matches!(self.device, Device::PistonMirror(_));
            if filter.method.is_for_nearly_linear() && !is_lock {
                let word = filter.method.word();
                let why = format!("the method `{word}` is for the accelerometer alone; use `ekf`");
                return Err(self.error(key.child("method"), Fault::Value { why }));
            }
            if filter.noise_memory.is_some() {
                let why = "only the accelerometer's filters estimate the variance of a sample; leave it out";
                return Err(self.error(key.child("noise_memory"), Fault::Value { why: why.to_owned() }));
            }
            if filter.known_acceleration {
                let why = "only the accelerometer has an acceleration that could be known; leave it out";
                return Err(self.error(key.child("known_acceleration"), Fault::Value { why: why.to_owned() }));
            }
        }
        Ok(())
    }

    /// What can be added to a feedback is refused where there is none.
    fn check_dither(&self, simulate: &Simulate) -> Result<(), ConfigError> {
        let has_feedback = matches!(&self.device, Device::Accelerometer(device) if device.feedback.is_some());
        if has_feedback || simulate.dither.is_none() {
            return Ok(());
        }
        let why = "a dither is added to the feedback of an accelerometer, and there is none; leave it out, or write \
                   `[device.accelerometer.feedback]`";
        Err(self.error("simulate.dither", Fault::Value { why: why.to_owned() }))
    }

    fn check_names(&self) -> Result<(), ConfigError> {
        let mut seen: BTreeMap<&Name, Key> = BTreeMap::new();
        for (index, recording) in self.recordings.iter().enumerate() {
            let key = Key::from("recording").index(index);
            let Some(name) = &recording.name else {
                if self.recordings.len() == 1 {
                    continue;
                }
                let remedy =
                    "with several recordings each needs a name, such as `name = \"test-1\"`".to_owned();
                return Err(self.error(key.child("name"), Fault::MissingKey { remedy }));
            };
            if let Some(first) = seen.get(name) {
                let fault = Fault::DuplicateName { name: name.to_string(), first: first.to_string() };
                return Err(self.error(key.child("name"), fault));
            }
            seen.insert(name, key);
        }
        Ok(())
    }

    /// The file it came from.
    pub fn path(&self) -> &Path {
        &self.source.path
    }

    /// A file that the experiment names: relative to the folder of the experiment file.
    pub fn resolve(&self, file: &Path) -> PathBuf {
        self.source.path.parent().unwrap_or(Path::new("")).join(file)
    }

    /// The files that a run reads because of it, itself among them; see [`Source::files`].
    pub fn files(&self) -> Vec<PathBuf> {
        self.source.files()
    }

    /// The same experiment with every file that it names put elsewhere: for a copy in another folder.
    #[must_use]
    pub fn with_files(&self, place: &dyn Fn(&Path) -> PathBuf) -> Self {
        let mut moved = self.clone();
        for recording in &mut moved.recordings {
            recording.file = place(&recording.file);
            if let Some(reference) = &mut recording.reference {
                reference.move_file(place);
            }
        }
        if let Some(Simulate { drive: DriveSource::Recorded(recorded), .. }) = &mut moved.simulate {
            recorded.file = place(&recorded.file);
        }
        moved
    }

    /// The same experiment as TOML, with every default written out where it has a value.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }

    /// An error at a key, with its line; for what only a rig can check.
    pub fn error(&self, key: impl Into<Key>, fault: Fault) -> ConfigError {
        self.source.error_at(key.into(), fault)
    }

    /// The SI values of a table whose keys and kinds a rig knows, in the order of `expected`. All of them
    /// must be there, and no others.
    ///
    /// `key` says where the table stands, such as `simulate.start`.
    pub fn values<const N: usize>(
        &self,
        key: impl Into<Key>,
        values: &Values,
        expected: [Entry; N],
    ) -> Result<[f64; N], ConfigError> {
        values::read(values, expected)
            .map_err(|(name, fault)| self.error(key.into().child(name.last()), fault))
    }

    /// The SI value of a key whose kind a rig knows.
    pub fn value(
        &self,
        key: impl Into<Key>,
        value: &AnyValue,
        kind: &Kind,
        sign: Sign,
    ) -> Result<f64, ConfigError> {
        sign.check(value.value(), kind).map_err(|why| self.error(key, Fault::Value { why }))
    }

    /// The columns of a recording by the meanings that a rig knows, in the order of `meanings`. All of them
    /// must be there, and no others.
    ///
    /// `key` says where the channels stand, such as `recording[0].channels`.
    pub fn columns<'a, const N: usize>(
        &self,
        key: impl Into<Key>,
        channels: &'a Channels,
        meanings: [&str; N],
    ) -> Result<[&'a str; N], ConfigError> {
        let key = key.into();
        if let Some((name, _)) = channels.iter().find(|(name, _)| !meanings.contains(name)) {
            return Err(self.error(key.child(name), Fault::unknown_key(name, meanings)));
        }
        let mut columns = [""; N];
        for (slot, meaning) in columns.iter_mut().zip(meanings) {
            *slot = channels.column(meaning).ok_or_else(|| {
                let remedy = format!("name the column, such as `{meaning} = \"{meaning}_V\"`");
                self.error(key.clone().child(meaning), Fault::MissingKey { remedy })
            })?;
        }
        Ok(columns)
    }

    /// The places of the recordings with one of these roles, which are those that a rig estimates; refused where there
    /// is none.
    pub fn to_estimate(&self, roles: &[super::Role]) -> Result<Vec<usize>, ConfigError> {
        let places = (0..self.recordings.len()).filter(|i| roles.contains(&self.recordings[*i].role));
        let places: Vec<usize> = places.collect();
        if places.is_empty() {
            let names: Vec<String> = roles.iter().map(|role| format!("`{}`", role.key())).collect();
            let why = match names.split_last() {
                Some((last, first)) if !first.is_empty() => format!("{} or {last}", first.join(", ")),
                _ => names.concat(),
            };
            let why = format!("no recording has the role {why}; those are estimated");
            return Err(self.error("recording", Fault::Value { why }));
        }
        Ok(places)
    }

    /// A recording by its place in the file, counted from 0.
    pub fn recording(&self, index: usize) -> Result<&Recording, ConfigError> {
        self.recordings.get(index).ok_or_else(|| {
            let why = format!("there is no recording {index}; there are {}", self.recordings.len());
            self.error("recording", Fault::Value { why })
        })
    }
}

impl Recording {
    /// How to read these columns of its file.
    pub fn layout(&self, columns: &[&str]) -> Layout {
        let hints = self.format.as_ref().map(FileFormat::hints).unwrap_or_default();
        Layout { hints, ..layout(&self.clock, self.segments.as_ref(), columns) }
    }

    /// How to read these columns of its reference's file.
    pub fn reference_layout(&self, reference: &Reference, columns: &[&str]) -> Layout {
        let format = self.format.as_ref().filter(|_| reference.is_in_recording());
        let hints = format.map(FileFormat::hints).unwrap_or_default();
        Layout { hints, ..layout(reference.clock(self), reference.segments(self), columns) }
    }
}

/// How to read these columns of a file.
pub(super) fn layout(clock: &Clock, segments: Option<&Segments>, columns: &[&str]) -> Layout {
    Layout {
        clock: match clock {
            Clock::Column { column } => recording::Clock::Column(column.clone()),
            Clock::Rate { rate, start } => recording::Clock::Rate {
                rate_hz: rate.si(),
                start_s: start.as_ref().map_or(0.0, Quantity::si),
            },
        },
        segment_column: segments.map(|segments| segments.column.clone()),
        columns: Some(columns.iter().map(|&column| column.to_owned()).collect()),
        hints: Hints::default(),
        origin: None,
        restarts: None,
    }
}
