//! An experiment of which recordings are given as arrays, instead of the files that it names.

use crate::config::{ArraysByFile, ConfigError, ConfigFault, ConfigPlace, Experiment, Key, Source};
use crate::diagnose::{DiagnoseError, FoundNoise, with_noise};
use crate::progress::Progress;
use crate::recording::Arrays;
use crate::rigs::Workbench;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// A recording as arrays, and what is said of them beside the experiment.
#[derive(Clone, Debug)]
pub struct ArrayRecording {
    /// Its columns, by the names that the experiment has for them.
    pub arrays: Arrays,
    /// Units of the numbers of columns, where that is not what their names end with.
    pub units: BTreeMap<String, String>,
    /// The column that tells records apart, where that is not for the experiment to say.
    pub segments: Option<String>,
    /// When the samples were taken, where the experiment does not say it.
    pub clock: Option<ArrayClock>,
}

/// When samples were taken.
#[derive(Clone, Debug, PartialEq)]
pub enum ArrayClock {
    /// As this column says.
    Column(String),
    /// At this rate in Hz.
    Rate(f64),
}

/// An experiment and the recordings that are given for it.
#[derive(Clone, Debug)]
pub struct ArrayExperiment {
    path: PathBuf,
    text: String,
    document: Table,
    /// Whether the document says something else than the text.
    is_changed: bool,
    arrays: BTreeMap<PathBuf, Arrays>,
    /// The recordings that were given, by their places in the experiment.
    recordings: Vec<usize>,
}

/// An experiment that is ready for work.
#[derive(Debug)]
pub struct PreparedExperiment {
    /// The devices, with the arrays instead of files for whatever is read because of the experiment.
    pub workbench: Workbench,
    /// The experiment.
    pub experiment: Experiment,
    /// The noises that it leaves to its recording.
    pub noise: Vec<FoundNoise>,
}

impl ArrayExperiment {
    /// Nothing yet, for the experiment of this text; `path` is where that stands, or would stand.
    pub fn new(text: &str, path: &Path) -> Result<Self, ConfigError> {
        let source = Source::of(text, path)?;
        source.document()?;
        Ok(Self {
            path: path.to_owned(),
            document: text.parse().unwrap_or_default(),
            text: source.text,
            is_changed: false,
            arrays: BTreeMap::new(),
            recordings: Vec::new(),
        })
    }

    /// Puts arrays instead of the file of a recording: that of this name or role, or, where nothing is said, the only one, else the only one
    /// of the role `test`.
    pub fn recording(&mut self, of: Option<&str>, given: &ArrayRecording) -> Result<(), ConfigError> {
        let place = self.place(of)?;
        self.check_columns(&Key::from("recording").index(place), given)?;
        let taken: Vec<PathBuf> = self.arrays.keys().cloned().collect();
        let recording = self.table(place)?;
        let file = put_file(recording, &format!("recording {place}"), &taken);
        keep_for_reference(recording, given);
        if let Some(segments) = &given.segments {
            recording.insert("segments".to_owned(), Value::Table(Table::from_iter([column(segments)])));
        }
        set_clock(recording, given);
        set_units(recording, given);
        if let Some(Value::Table(reference)) = recording.get_mut("reference")
            && !reference.contains_key("file")
        {
            set_units(reference, given);
        }
        self.note_change();
        self.arrays.insert(file.into(), given.arrays.clone());
        self.recordings.push(place);
        Ok(())
    }

    /// Refuses what is said of a column that is not given: it would mean nothing.
    fn check_columns(&self, key: &Key, given: &ArrayRecording) -> Result<(), ConfigError> {
        let units = given.units.keys().map(|column| ("units", column));
        let clock = match &given.clock {
            Some(ArrayClock::Column(column)) => Some(("clock", column)),
            _ => None,
        };
        let segments = given.segments.as_ref().map(|column| ("segments", column));
        for (of, column) in units.chain(clock).chain(segments) {
            if !given.arrays.names().any(|name| name == column) {
                let fault = ConfigFault::unknown_word(column, given.arrays.names());
                return Err(self.error(key.clone().child(of), fault));
            }
        }
        Ok(())
    }

    /// Puts another file instead of that of a recording, read as that is; which recording, as with [`recording`](Self::recording). A
    /// reference in a file of its own is replaced by `reference`, and left out where that is `None`. Other recordings with its role are left
    /// out: each is estimated by itself.
    pub fn file(
        &mut self,
        of: Option<&str>,
        file: &Path,
        reference: Option<&Path>,
    ) -> Result<(), ConfigError> {
        let place = self.alone(of)?;
        let key = Key::from("recording").index(place).child("file");
        let text = |file: &Path| {
            let absolute = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
            absolute.into_os_string().into_string().map_err(|found| {
                let why = format!("a path in Unicode is expected, and this is `{}`", found.display());
                self.error(key.clone(), ConfigFault::Value { why })
            })
        };
        let (file, reference) = (text(file)?, reference.map(text).transpose()?);
        let recording = self.table(place)?;
        recording.insert("file".to_owned(), Value::String(file));
        let own = |table: &Value| table.get("file").is_some();
        match (recording.get_mut("reference"), reference) {
            (Some(Value::Table(table)), Some(reference)) => {
                table.insert("file".to_owned(), Value::String(reference));
            }
            (Some(table), None) if own(table) => drop(recording.remove("reference")),
            _ => {}
        }
        self.note_change();
        self.recordings.push(place);
        Ok(())
    }

    /// Whether this recording has a reference in a file of its own.
    #[cfg(feature = "parquet-results")]
    pub(crate) fn has_reference_file(&mut self, of: Option<&str>) -> bool {
        let recording = self.alone(of).and_then(|place| self.table(place).cloned());
        recording.is_ok_and(|recording| {
            recording.get("reference").is_some_and(|reference| reference.get("file").is_some())
        })
    }

    /// The experiment without the files of a recording that is to be replaced, as text, and the other files that it names.
    #[cfg(feature = "parquet-results")]
    pub(crate) fn without_recording(
        &mut self,
        of: Option<&str>,
    ) -> Result<(String, Vec<PathBuf>), ConfigError> {
        let place = self.alone(of)?;
        let recording = self.table(place)?;
        recording.remove("file");
        if let Some(Value::Table(reference)) = recording.get_mut("reference") {
            reference.remove("file");
        }
        let mut files = Vec::new();
        for recording in self.document.get("recording").and_then(Value::as_array).into_iter().flatten() {
            for table in [Some(recording), recording.get("reference")].into_iter().flatten() {
                files.extend(table.get("file").and_then(Value::as_str).map(PathBuf::from));
            }
        }
        Ok((self.document.to_string(), files))
    }

    /// Leaves out the recordings that have the role of this one; its place then.
    pub(crate) fn alone(&mut self, of: Option<&str>) -> Result<usize, ConfigError> {
        let place = self.place(of)?;
        let Some(all) = self.document.get_mut("recording").and_then(Value::as_array_mut) else {
            return Ok(place);
        };
        let role = |recording: &Value| recording.get("role").and_then(Value::as_str).map(str::to_owned);
        let own = all.get(place).map(role);
        let (mut kept, mut here) = (Vec::new(), place);
        for (index, recording) in std::mem::take(all).into_iter().enumerate() {
            if index == place {
                here = kept.len();
            }
            if index == place || Some(role(&recording)) != own {
                kept.push(recording);
            }
        }
        *all = kept;
        Ok(here)
    }

    /// Puts arrays instead of the file of a recording's reference; which recording, as with [`recording`](Self::recording).
    pub fn reference(&mut self, of: Option<&str>, given: &ArrayRecording) -> Result<(), ConfigError> {
        let place = self.place(of)?;
        let taken: Vec<PathBuf> = self.arrays.keys().cloned().collect();
        let key = Key::from("recording").index(place).child("reference");
        self.check_columns(&key, given)?;
        let Some(Value::Table(reference)) = self.table(place)?.get_mut("reference") else {
            let remedy =
                "say what its columns are, such as `reference = { channels = { angle = \"angle_rad\" } }`";
            return Err(self.error(key, ConfigFault::MissingKey { remedy: remedy.to_owned() }));
        };
        let file = put_file(reference, &format!("reference {place}"), &taken);
        if let Some(segments) = &given.segments {
            reference.insert("segments".to_owned(), Value::Table(Table::from_iter([column(segments)])));
        }
        set_clock(reference, given);
        set_units(reference, given);
        self.note_change();
        self.arrays.insert(file.into(), given.arrays.clone());
        Ok(())
    }

    /// Reads the experiment with what was given, and finds the noises that it leaves to its recording.
    pub fn prepare(
        self,
        workbench: &Workbench,
        progress: &dyn Progress,
    ) -> Result<PreparedExperiment, DiagnoseError> {
        for (place, recording) in
            self.document.get("recording").and_then(Value::as_array).into_iter().flatten().enumerate()
        {
            let file = recording.get("file").and_then(Value::as_str).map(Path::new);
            if !self.recordings.contains(&place) && file.is_some_and(|file| self.arrays.contains_key(file)) {
                let why = "it is in the file of another recording, in whose place there are arrays; give arrays for this one as well";
                let key = Key::from("recording").index(place).child("file");
                return Err(self.error(key, ConfigFault::Value { why: why.to_owned() }).into());
            }
        }
        let workbench = workbench.clone().with_arrays(self.arrays.into_iter().collect::<ArraysByFile>());
        let text = if self.is_changed { self.document.to_string() } else { self.text };
        let without_line = |mut error: ConfigError| {
            // It would be a line of a text that nobody wrote.
            if self.is_changed {
                error.place.position = None;
            }
            error
        };
        let found = match Experiment::parse(&text, &self.path) {
            Ok(raw) => with_noise(&workbench, &raw, progress),
            // What is wrong is said by who reads all of it.
            Err(_) => {
                workbench.parse(&text, &self.path).map(|read| (read, Vec::new())).map_err(DiagnoseError::from)
            }
        };
        let (experiment, noise) = found.map_err(|error| match error {
            DiagnoseError::Config(error) => without_line(error).into(),
            other => other,
        })?;
        Ok(PreparedExperiment { workbench, experiment, noise })
    }

    /// Which recording is meant.
    fn place(&self, of: Option<&str>) -> Result<usize, ConfigError> {
        let all = self.document.get("recording").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
        let with = |key: &str, value: &str| {
            let mut places =
                (0..all.len()).filter(|place| all[*place].get(key).and_then(Value::as_str) == Some(value));
            (places.next(), places.next())
        };
        let found = match of {
            Some(of) => match (with("name", of), with("role", of)) {
                ((Some(place), _), _) | (_, (Some(place), None)) => Some(place),
                _ => None,
            },
            None if all.len() == 1 => Some(0),
            None => Some(with("role", "test")).and_then(|(first, second)| first.filter(|_| second.is_none())),
        };
        found.ok_or_else(|| {
            let texts = |recording: &Value, key: &str| {
                recording.get(key).and_then(Value::as_str).unwrap_or("").to_owned()
            };
            let each = all.iter().map(|one| match texts(one, "name").as_str() {
                "" => format!("one of the role `{}`", texts(one, "role")),
                name => format!("`{name}` of the role `{}`", texts(one, "role")),
            });
            let each: Vec<String> = each.collect();
            let there = if each.is_empty() { "none".to_owned() } else { each.join(", ") };
            let why = match of {
                Some(of) => format!("no single recording has the name or the role `{of}`; there are {there}"),
                None => format!("which recording is given is not clear; say it by name or role, of {there}"),
            };
            self.error(Key::from("recording"), ConfigFault::Value { why })
        })
    }

    fn table(&mut self, place: usize) -> Result<&mut Table, ConfigError> {
        let error = self.error(
            Key::from("recording").index(place),
            ConfigFault::Value { why: "a recording is a table".to_owned() },
        );
        let recordings = self.document.get_mut("recording").and_then(Value::as_array_mut);
        recordings.and_then(|all| all.get_mut(place)).and_then(Value::as_table_mut).ok_or(error)
    }

    fn note_change(&mut self) {
        self.is_changed = self.text.parse::<Table>().map_or(true, |told| told != self.document);
    }

    fn error(&self, key: Key, fault: ConfigFault) -> ConfigError {
        ConfigError { place: Box::new(ConfigPlace { file: self.path.clone(), position: None, key }), fault }
    }
}

/// The file of a table: that which it names, unless arrays are in its place already, or this one.
fn put_file(table: &mut Table, usual: &str, taken: &[PathBuf]) -> String {
    match table.get("file").and_then(Value::as_str) {
        Some(file) if taken.iter().all(|other| other != Path::new(file)) => file.to_owned(),
        _ => {
            table.insert("file".to_owned(), Value::String(usual.to_owned()));
            usual.to_owned()
        }
    }
}

/// What a reference in a file of its own takes over from the recording stays as it was for that file.
fn keep_for_reference(recording: &mut Table, given: &ArrayRecording) {
    let changed = [("clock", given.clock.is_some()), ("segments", given.segments.is_some())];
    let before: Vec<(&str, Option<Value>)> =
        changed.iter().filter(|(_, is)| *is).map(|(key, _)| (*key, recording.get(*key).cloned())).collect();
    if let Some(Value::Table(reference)) = recording.get_mut("reference")
        && reference.contains_key("file")
    {
        for (key, value) in before {
            if let Some(value) = value
                && !reference.contains_key(key)
            {
                reference.insert(key.to_owned(), value);
            }
        }
    }
}

fn column(name: &str) -> (String, Value) {
    ("column".to_owned(), Value::String(name.to_owned()))
}

fn set_clock(table: &mut Table, given: &ArrayRecording) {
    let clock = match &given.clock {
        Some(ArrayClock::Column(name)) => column(name),
        Some(ArrayClock::Rate(rate_hz)) => ("rate".to_owned(), Value::String(format!("{rate_hz:e} Hz"))),
        None => return,
    };
    table.insert("clock".to_owned(), Value::Table(Table::from_iter([clock])));
}

/// States the units of columns where the table names them.
fn set_units(table: &mut Table, given: &ArrayRecording) {
    if given.units.is_empty() {
        return;
    }
    let state = |said: &mut Value| {
        let name = said.as_str().or_else(|| said.get("column").and_then(Value::as_str)).map(str::to_owned);
        let Some((name, unit)) =
            name.and_then(|name| Some((given.units.get(&name)?, name))).map(|(u, n)| (n, u))
        else {
            return;
        };
        let unit = ("unit".to_owned(), Value::String(unit.clone()));
        match said {
            Value::Table(said) => {
                said.insert(unit.0, unit.1);
            }
            said => *said = Value::Table(Table::from_iter([column(&name), unit])),
        }
    };
    if let Some(Value::Table(channels)) = table.get_mut("channels") {
        channels.iter_mut().for_each(|(_, said)| state(said));
    }
    if let Some(clock) = table.get_mut("clock") {
        state(clock);
    }
}
