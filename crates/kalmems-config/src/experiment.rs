//! The whole file.

use super::device::DeviceTable;
use super::inputs::InputSource;
use super::reader;
use super::schema::remedy;
use super::source::Source;
use super::uncertainty::{Correlations, UncertainNumber};
use super::values::{self, AnyValue, ExpectedEntry, Values};
use super::variation::Variations;
use super::{
    ArraysByFile, Channels, ConfigError, ConfigFault, DriveSource, Estimate, FilesBeside, Identify, Key,
    Name, Recording, Reference, Sign, Simulate, StreamTable,
};
use crate::layout::{DeclaredColumn, RecordingLayout};
use crate::units::Kind;
use kalmems_formats::{Arrays, Hints};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A device and its recordings, as one TOML file describes them.
///
/// Two experiments are equal if they say the same, whatever file they came from.
#[derive(Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("anyOf" = [{ "required": ["recording"] }, { "required": ["simulate"] }]))]
pub struct Experiment {
    /// A name; results go to a folder of this name unless another is given.
    pub name: Name,
    /// What the experiment is about, in free text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// The device: exactly one table, such as `[device.shared_scanner]`; see [`Experiment::device`].
    pub(super) device: DeviceTable,
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
    pub stream: Option<StreamTable>,
    #[serde(skip)]
    pub(super) source: Source,
    #[serde(skip)]
    arrays: ArraysByFile,
    #[serde(skip)]
    beside: FilesBeside,
    #[serde(skip)]
    pub(super) variations: Variations,
    /// What was uncertain of the device from which this one differs in one direction, and is exact here.
    #[serde(skip)]
    pub(super) was_uncertain: Vec<UncertainNumber>,
}

/// Not derived: that would be compiled, with all tables, in every crate that clones an experiment.
impl Clone for Experiment {
    fn clone(&self) -> Self {
        Self {
            name: self.name.clone(),
            description: self.description.clone(),
            device: self.device.clone(),
            recordings: self.recordings.clone(),
            estimate: self.estimate.clone(),
            identify: self.identify.clone(),
            simulate: self.simulate.clone(),
            stream: self.stream.clone(),
            source: self.source.clone(),
            arrays: self.arrays.clone(),
            beside: self.beside.clone(),
            variations: self.variations.clone(),
            was_uncertain: self.was_uncertain.clone(),
        }
    }
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
        experiment.device.correlation = Correlations::of(&source)?;
        let folder = source.path.parent().unwrap_or(Path::new(""));
        for recording in &mut experiment.recordings {
            recording.channels.load_compensations(folder);
            if let Some(reference) = &mut recording.reference {
                reference.channels.load_compensations(folder);
            }
        }
        experiment.source = source;
        experiment.check()?;
        Ok(experiment)
    }

    /// What no single key can be blamed for.
    fn check(&self) -> Result<(), ConfigError> {
        if self.recordings.is_empty() && self.simulate.is_none() {
            let why = "found no recording; expected at least one `[[recording]]`".to_owned();
            let empty = self.error("recording", ConfigFault::Value { why });
            if empty.place.position.is_some() {
                return Err(empty);
            }
            let remedy = {
                let key = Key::from("recording");
                remedy::<Self>(&key, &key)
            };
            return Err(self.error("recording", ConfigFault::MissingKey { remedy }));
        }
        self.check_names()?;
        self.check_columns()?;
        self.check_uncertainties()?;
        if let Some(estimate) = &self.estimate {
            estimate.check().map_err(|(key, fault)| self.error(key, fault))?;
        }
        if let Some(simulate) = &self.simulate {
            simulate.check().map_err(|(key, fault)| self.error(key, fault))?;
        }
        Ok(())
    }

    /// A column that is read in two ways.
    fn check_columns(&self) -> Result<(), ConfigError> {
        for (index, recording) in self.recordings.iter().enumerate() {
            let key = Key::from("recording").index(index);
            let reference = recording.reference.as_ref().map(|reference| reference.in_file(recording));
            let files = [(key.clone(), Some(recording.in_file())), (key.child("reference"), reference)];
            for (key, file) in files {
                let Some(Err((name, why))) = file.map(|file| file.check()) else { continue };
                let key = if name == DeclaredColumn::CLOCK { key } else { key.child("channels") };
                return Err(self.error(key.child(&name), ConfigFault::Value { why }));
            }
        }
        Ok(())
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
                return Err(self.error(key.child("name"), ConfigFault::MissingKey { remedy }));
            };
            if let Some(first) = seen.get(name) {
                let fault = ConfigFault::DuplicateName { name: name.to_string(), first: first.to_string() };
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

    /// The text of that file.
    pub fn text(&self) -> &str {
        &self.source.text
    }

    /// The same with arrays instead of some of the files of its recordings and of their references.
    #[must_use]
    pub fn with_arrays(mut self, arrays: &ArraysByFile) -> Self {
        for recording in &mut self.recordings {
            recording.arrays = arrays.get(&recording.file);
            if let Some(reference) = &mut recording.reference {
                reference.arrays = arrays.get(reference.own_file().unwrap_or(&recording.file));
            }
        }
        self.arrays = arrays.clone();
        self
    }

    /// The same that shares with others what is read of files beside its recordings.
    #[must_use]
    pub fn sharing(mut self, beside: &FilesBeside) -> Self {
        self.beside = beside.clone();
        self
    }

    /// What was read of files beside its recordings.
    pub const fn beside(&self) -> &FilesBeside {
        &self.beside
    }

    /// The arrays instead of files.
    pub const fn arrays(&self) -> &ArraysByFile {
        &self.arrays
    }

    /// Whether what a file holds that the experiment names can be read again: it is there and no pipe, or arrays stand in its place.
    pub fn can_be_read(&self, file: &Path) -> bool {
        self.arrays.get(file).is_some() || self.resolve(file).is_file()
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
            recording.channels.move_files(place);
            if let Some(reference) = &mut recording.reference {
                reference.move_file(place);
            }
        }
        match moved.simulate.as_mut().map(|simulate| &mut simulate.drive) {
            Some(DriveSource::Recorded(recorded)) => recorded.file = place(&recorded.file),
            Some(DriveSource::Inputs(inputs)) => {
                for source in inputs.values_mut() {
                    if let InputSource::Recorded(recorded) = source {
                        recorded.file = place(&recorded.file);
                    }
                }
            }
            _ => {}
        }
        moved.device.move_files(place);
        moved
    }

    /// The same experiment as a table, with every default written out where it has a value.
    ///
    /// Serialised here, so that no other crate compiles the serialisation of all its tables again.
    pub fn to_table(&self) -> Result<toml::Table, toml::ser::Error> {
        toml::Table::try_from(self)
    }

    /// The same experiment as TOML; see [`Self::to_table`].
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        // The writer of texts is another serializer, which would be compiled for each table as well.
        toml::to_string(&self.to_table()?)
    }

    /// An error at a key, with its line; for what only a rig can check.
    pub fn error(&self, key: impl Into<Key>, fault: ConfigFault) -> ConfigError {
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
        expected: [ExpectedEntry; N],
    ) -> Result<[f64; N], ConfigError> {
        let found = self.values_of(key, values, &expected)?;
        Ok(std::array::from_fn(|i| found.get(i).copied().unwrap_or(f64::NAN)))
    }

    /// The same of a table whose keys are known when the program runs.
    pub fn values_of(
        &self,
        key: impl Into<Key>,
        values: &Values,
        expected: &[ExpectedEntry],
    ) -> Result<Vec<f64>, ConfigError> {
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
        sign.check(value.value(), kind).map_err(|why| self.error(key, ConfigFault::Value { why }))
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
        let found = self.columns_of(key, channels, &meanings)?;
        Ok(std::array::from_fn(|i| found.get(i).copied().unwrap_or_default()))
    }

    /// The same by meanings that are known when the program runs.
    pub fn columns_of<'a>(
        &self,
        key: impl Into<Key>,
        channels: &'a Channels,
        meanings: &[&str],
    ) -> Result<Vec<&'a str>, ConfigError> {
        let key = key.into();
        if let Some((name, _)) = channels.iter().find(|(name, _)| !meanings.contains(name)) {
            return Err(self.error(key.child(name), ConfigFault::unknown_key(name, meanings.iter().copied())));
        }
        let column = |meaning: &&str| {
            channels.column(meaning).ok_or_else(|| {
                let remedy = format!("name the column, such as `{meaning} = \"{meaning}_V\"`");
                self.error(key.clone().child(meaning), ConfigFault::MissingKey { remedy })
            })
        };
        meanings.iter().map(column).collect()
    }

    /// The places of the recordings with one of these roles, which are those that a rig estimates; refused where there
    /// is none, and where `check` refuses the recording at a place, such as for its columns.
    pub fn to_estimate<T>(
        &self,
        roles: &[super::RecordingRole],
        check: impl Fn(usize) -> Result<T, ConfigError>,
    ) -> Result<Vec<usize>, ConfigError> {
        let places = (0..self.recordings.len()).filter(|i| roles.contains(&self.recordings[*i].role));
        let places: Vec<usize> = places.collect();
        if places.is_empty() {
            let names: Vec<String> = roles.iter().map(|role| format!("`{}`", role.key())).collect();
            let why = match names.split_last() {
                Some((last, first)) if !first.is_empty() => format!("{} or {last}", first.join(", ")),
                _ => names.concat(),
            };
            let simulated = if self.simulate.is_some() {
                "; the file has a table `[simulate]`: `kalmems simulate` with it makes a recording, and an experiment file that is estimated"
            } else {
                ""
            };
            let why = format!("no recording has the role {why}; those are estimated{simulated}");
            return Err(self.error("recording", ConfigFault::Value { why }));
        }
        for place in &places {
            check(*place)?;
        }
        Ok(places)
    }

    /// A recording by its place in the file, counted from 0.
    pub fn recording(&self, index: usize) -> Result<&Recording, ConfigError> {
        self.recordings.get(index).ok_or_else(|| {
            let why = format!("there is no recording {index}; there are {}", self.recordings.len());
            self.error("recording", ConfigFault::Value { why })
        })
    }
}

impl Recording {
    /// How to read these columns of its file.
    pub fn layout(&self, columns: &[&str]) -> RecordingLayout {
        of_arrays(self.in_file().layout(Some(columns)), self.arrays.as_ref())
    }

    /// How to read these columns of its reference's file.
    pub fn reference_layout(&self, reference: &Reference, columns: &[&str]) -> RecordingLayout {
        of_arrays(reference.in_file(self).layout(Some(columns)), reference.arrays.as_ref())
    }
}

/// The same where arrays stand instead of the file: how that is written does not matter then.
fn of_arrays(layout: RecordingLayout, arrays: Option<&Arrays>) -> RecordingLayout {
    match arrays {
        Some(arrays) => {
            RecordingLayout { hints: Hints { arrays: Some(arrays.clone()), ..Hints::default() }, ..layout }
        }
        None => layout,
    }
}
