//! What a study is to run: its file and the experiment's, read, checked and numbered.

use super::StudyError;
use super::axis::{AxisValue, AxisValues, StudyAxis};
use super::calibration::{DrawnDeviation, Groups};
use super::description::{AppliesTo, StudyDescription};
use super::error::RunError;
use super::seed::{self, Draw};
use crate::config::{ConfigError, ConfigFault, Experiment, Key, Source, read_source};
use crate::config::{absent, put};
use crate::journal::digest_of;
use crate::results::Work;
use crate::rigs::Workbench;
use crate::sealed_line::hex;
use crate::simulate::{Simulation, described};
use sha2::{Digest, Sha256};
use std::path::Path;
use toml::Table;

/// Names that the results have already.
pub(super) const FIXED: [&str; 12] = [
    "point",
    "repeat",
    "seed",
    "error",
    "recording",
    "segment",
    "estimator",
    "estimator_name",
    "verdict",
    "grade",
    "mirrored",
    "failure",
];

/// Counts up where the same input gives other results, so that no journal is continued across it.
const FORMAT: u32 = 2;

/// A study, ready to run.
#[derive(Clone, Debug)]
pub struct StudyPlan {
    pub(super) workbench: Workbench,
    pub(super) source: Source,
    pub(super) description: StudyDescription,
    pub(super) axes: Vec<StudyAxis>,
    pub(super) experiment: Source,
    pub(super) document: Table,
    pub(super) truth: Vec<(Key, toml::Value)>,
    pub(super) simulated: bool,
    /// The filters in groups, where the truth is drawn from what they hold as uncertain.
    pub(super) calibration: Option<Groups>,
}

/// One run: a point of the grid, once.
#[derive(Clone, Debug)]
pub(super) struct StudyRun {
    pub(super) index: u64,
    /// The point of the grid; the key that varies last goes fastest, and the groups of filters of a calibration still faster.
    pub(super) point: u64,
    pub(super) repeat: u64,
    pub(super) seed: u64,
    /// One per axis.
    pub(super) settings: Vec<AxisValue>,
}

/// What a run starts from.
pub(super) enum RunStart {
    /// What is simulated, and what the filters are told.
    Simulated(Box<dyn Simulation>, Box<Experiment>),
    /// What the filters are told of a recording that is there.
    Recorded(Box<Experiment>),
}

impl StudyPlan {
    /// Reads a study file and the experiment file that it names.
    pub fn load(workbench: &Workbench, path: &Path) -> Result<Self, StudyError> {
        let source = Source::load(path)?;
        let experiment = Self::experiment_of(&source, path)?;
        Self::of(workbench, source, experiment, None)
    }

    /// The experiment file that a study file names.
    pub(super) fn experiment_of(source: &Source, path: &Path) -> Result<Source, StudyError> {
        let description: StudyDescription = read_source(source)?;
        let file = path.parent().unwrap_or(Path::new("")).join(&description.experiment);
        let experiment = Source::load(&file).map_err(|e| match e.fault {
            ConfigFault::NotFound => {
                let why = format!(
                    "there is no file `{}`; give its path from the folder of the study",
                    file.display()
                );
                source.error_at(Key::from("experiment"), ConfigFault::Value { why })
            }
            _ => e,
        })?;
        Ok(experiment)
    }

    /// The plan of a study that is no file, and of its experiment: both texts with where they stand, or would stand.
    pub fn of_texts(
        workbench: &Workbench,
        (study, study_path): (&str, &Path),
        (experiment, experiment_path): (&str, &Path),
    ) -> Result<Self, StudyError> {
        let (study, experiment) = (Source::of(study, study_path)?, Source::of(experiment, experiment_path)?);
        Self::of(workbench, study, experiment, None)
    }

    /// The plan of a study from both texts, as a journal has them, with the runs at each point of a calibration.
    pub(super) fn parse(
        workbench: &Workbench,
        (study, experiment): (&str, &str),
        calibration: Option<u64>,
    ) -> Result<Self, StudyError> {
        let source = Source::of(study, Path::new("study.toml"))?;
        let experiment = Source::of(experiment, Path::new("experiment.toml"))?;
        Self::of(workbench, source, experiment, calibration)
    }

    /// The plan of a study, or of a calibration with so many runs at each point.
    pub(super) fn of(
        workbench: &Workbench,
        source: Source,
        experiment: Source,
        calibration: Option<u64>,
    ) -> Result<Self, StudyError> {
        let mut description: StudyDescription = read_source(&source)?;
        description.repeats = calibration.unwrap_or(description.repeats);
        // The reader of experiments says better what is wrong with one.
        let simulated = workbench.parse(&experiment.text, &experiment.path)?.simulate.is_some();
        let document: Table = experiment.text.parse().map_err(|e: toml::de::Error| {
            let why = e.message().to_owned();
            experiment.error_at(Key::default(), ConfigFault::Syntax { column: 1, why })
        })?;
        let mut axes = Vec::new();
        for (i, vary) in description.vary.iter().enumerate() {
            axes.push(
                StudyAxis::of(vary, simulated)
                    .map_err(|(name, fault)| source.error_at(at(i, name), fault))?,
            );
        }
        let mut truth = Vec::new();
        flatten("", &description.truth, &mut |text, value| {
            let key = Key::parse(text).ok_or_else(|| {
                let why = format!(
                    "`{text}` is no key; expected names and indices, such as `recording[0].clock.rate`"
                );
                source.error_at(Key::from("truth").child(text), ConfigFault::Value { why })
            })?;
            truth.push((key, value.clone()));
            Ok(())
        })?;
        let workbench = workbench.clone();
        let mut plan = Self {
            workbench,
            source,
            description,
            axes,
            experiment,
            document,
            truth,
            simulated,
            calibration: None,
        };
        if calibration.is_some() {
            plan.calibration = Some(plan.groups()?);
        }
        plan.check_names()?;
        plan.check_keys()?;
        Ok(plan)
    }

    /// The study's name.
    pub fn name(&self) -> &str {
        self.description.name.as_str()
    }

    /// Points of the grid, each once for each group of filters of a calibration.
    pub fn points(&self) -> u64 {
        self.axes.iter().map(StudyAxis::points).fold(self.groups_at_a_point(), u64::saturating_mul)
    }

    /// Runs: each point of the grid once for each repeat.
    pub fn runs(&self) -> u64 {
        self.points().saturating_mul(self.description.repeats)
    }

    pub(super) fn refuse(&self, key: Key, fault: ConfigFault) -> ConfigError {
        self.source.error_at(key, fault)
    }

    /// A run by its index.
    pub(super) fn run(&self, index: u64) -> StudyRun {
        let seed = self.description.seed;
        let (point, repeat) = (index / self.description.repeats, index % self.description.repeats);
        let mut rest = point / self.groups_at_a_point();
        let mut settings: Vec<AxisValue> = Vec::with_capacity(self.axes.len());
        for (i, axis) in self.axes.iter().enumerate().rev() {
            settings.push(match &axis.values {
                AxisValues::Listed(listed) => {
                    let place = usize::try_from(rest % axis.points()).unwrap_or(0);
                    rest /= axis.points();
                    listed[place].clone()
                }
                AxisValues::Drawn(chance) => chance.setting(Draw::of(seed, index, i)),
            });
        }
        settings.reverse();
        StudyRun { index, point, repeat, seed: seed::noise(seed, index), settings }
    }

    /// What a run starts from, and what was drawn for it of what its filters hold as uncertain.
    pub(super) fn ready(&self, run: &StudyRun) -> Result<(RunStart, Vec<DrawnDeviation>), RunError> {
        let settings: Vec<Option<&AxisValue>> = run.settings.iter().map(Some).collect();
        match &self.calibration {
            None => Ok((self.ready_with(&settings, run.seed)?, Vec::new())),
            Some(groups) => self.ready_drawn(groups, run, &settings),
        }
    }

    /// What its results are of: studies of one name, since a journal does not know from which file it came.
    pub fn work(&self) -> Work {
        let inputs = [&self.source, &self.experiment].into_iter().flat_map(Source::files).collect();
        Work { inputs, ..Work::named(self.command(), self.name()) }
    }

    /// What all runs have in common must be right before any begins; a digest of the files that they read.
    pub(super) fn check(&self) -> Result<String, StudyError> {
        self.check_values()?;
        self.check_pictures()?;
        let base = vec![None; self.axes.len()];
        let ready = self.ready_with(&base, 0).map_err(|e| self.without_line(e))?;
        let mut hash = Sha256::new();
        match ready {
            RunStart::Simulated(simulation, _) => {
                for source in simulation.sources() {
                    hash.update(&source.sha256);
                }
            }
            RunStart::Recorded(told) => {
                let rig = self.workbench.rig(&told)?;
                for index in rig.wanted(&told)? {
                    let described = told.recording(index)?;
                    let reference = described.reference.as_ref().map(|reference| reference.file(described));
                    for file in [Some(described.file.as_path()), reference].into_iter().flatten() {
                        if let Some(arrays) = told.arrays().get(file) {
                            hash.update(&arrays.digest().sha256);
                        } else {
                            let path = told.resolve(file);
                            let digest = digest_of(&path, &|| false)
                                .map_err(|source| StudyError::Io { path, source })?;
                            hash.update(digest.unwrap_or_default());
                        }
                    }
                }
            }
        }
        Ok(hex(&hash.finalize()))
    }

    /// What tells one study from another: all that its figures follow from. The pictures, descriptions, comments and
    /// the order of keys do not count.
    pub(super) fn digest(&self, inputs: &str) -> String {
        let mut study: Table = self.source.text.parse().unwrap_or_default();
        for key in ["figure", "description", "experiment"] {
            study.remove(key);
        }
        let mut hash = Sha256::new();
        hash.update(FORMAT.to_le_bytes());
        if self.calibration.is_some() {
            hash.update("calibration");
            hash.update(self.description.repeats.to_le_bytes());
        }
        for text in [
            env!("CARGO_PKG_VERSION"),
            &toml::to_string(&study).unwrap_or_default(),
            &toml::to_string(&self.document).unwrap_or_default(),
            inputs,
        ] {
            hash.update((text.len() as u64).to_le_bytes());
            hash.update(text);
        }
        hex(&hash.finalize())
    }

    /// The axes of the grid: those whose values are listed.
    pub(super) fn grid(&self) -> impl Iterator<Item = (usize, &StudyAxis)> {
        self.axes.iter().enumerate().filter(|(_, axis)| matches!(axis.values, AxisValues::Listed(_)))
    }

    fn ready_with(&self, settings: &[Option<&AxisValue>], seed: u64) -> Result<RunStart, RunError> {
        let told = self.read(&self.patched(&[], settings, AppliesTo::Told, None)?)?;
        if !self.simulated {
            let rig = self.workbench.rig(&told)?;
            rig.wanted(&told)?;
            return Ok(RunStart::Recorded(Box::new(told)));
        }
        let truth = self.read(&self.patched(&self.truth, settings, AppliesTo::Truth, Some(seed))?)?;
        self.simulation(&truth, &told)
    }

    /// A run on a simulation of the truth, with filters that are told something.
    pub(super) fn simulation(&self, truth: &Experiment, told: &Experiment) -> Result<RunStart, RunError> {
        let simulation = self.workbench.rig(truth)?.simulate(truth)?;
        let told = described(told, &*simulation);
        self.workbench.rig(&told)?.wanted(&told)?;
        Ok(RunStart::Simulated(simulation, Box::new(told)))
    }

    /// The experiment file with what the study has in its place.
    pub(super) fn patched(
        &self,
        truth: &[(Key, toml::Value)],
        settings: &[Option<&AxisValue>],
        side: AppliesTo,
        seed: Option<u64>,
    ) -> Result<Table, ConfigError> {
        let mut document = self.document.clone();
        let mut patch = |key: &Key, value: &toml::Value| {
            put(&mut document, key, value.clone())
                .map_err(|fault| self.experiment.error_at(key.clone(), fault))
        };
        for (key, value) in truth {
            patch(key, value)?;
        }
        for (axis, setting) in self.axes.iter().zip(settings) {
            if let Some(setting) = setting
                && (axis.applies_to == AppliesTo::Both || axis.applies_to == side)
            {
                patch(&axis.key, &setting.toml)?;
            }
        }
        if let Some(seed) = seed {
            let seed = toml::Value::Integer(i64::try_from(seed).unwrap_or(i64::MAX));
            patch(&Key::from("simulate").child("seed"), &seed)?;
        }
        Ok(document)
    }

    /// The experiment of a document.
    pub(super) fn read(&self, document: &Table) -> Result<Experiment, ConfigError> {
        let text = toml::to_string(document).unwrap_or_default();
        self.workbench.parse(&text, &self.experiment.path)
    }

    /// A fault in a text that was put together has no line that anyone could look up.
    fn without_line(&self, error: RunError) -> StudyError {
        match error {
            RunError::Simulate(source) if !matches!(source, crate::simulate::SimulateError::Config(_)) => {
                StudyError::Simulate {
                    file: self.experiment.path.display().to_string(),
                    source: Box::new(source),
                }
            }
            error => {
                let (key, fault) = match error.config() {
                    Some(e) => (e.place.key.clone(), e.fault.clone()),
                    None => (Key::default(), ConfigFault::Value { why: error.to_string() }),
                };
                self.experiment.error(key, None, fault).into()
            }
        }
    }

    fn check_names(&self) -> Result<(), ConfigError> {
        let refuse = |key, why: String| Err(self.refuse(key, ConfigFault::Value { why }));
        if self.axes.is_empty() && self.calibration.is_none() {
            let remedy = "add a table headed `[[vary]]`, with double brackets".to_owned();
            return Err(self.refuse(Key::from("vary"), ConfigFault::MissingKey { remedy }));
        }
        if !self.truth.is_empty() && !self.simulated {
            let why =
                "the experiment has no `[simulate]`: the truth of its recordings is what it is".to_owned();
            return refuse(Key::from("truth"), why);
        }
        let drawn = self.axes.iter().any(|axis| matches!(axis.values, AxisValues::Drawn(_)));
        if self.description.repeats > 1 && !self.simulated && !drawn {
            let why =
                "the experiment has no `[simulate]` and nothing is drawn: all repeats would be the same"
                    .to_owned();
            return refuse(Key::from("repeats"), why);
        }
        if self.runs() > 100_000_000 {
            let why = format!("{} runs are too many; expected at most 1e8", self.runs());
            return refuse(Key::from("vary"), why);
        }
        for (i, axis) in self.axes.iter().enumerate() {
            let taken = FIXED.contains(&axis.name.as_str());
            if taken || self.axes.iter().take(i).any(|other| other.name == axis.name) {
                let name = &axis.name;
                let why =
                    format!("`{name}` is a column of the results already; give another one with `name`");
                return refuse(at(i, "name"), why);
            }
        }
        Ok(())
    }

    /// A picture is drawn against something that varies, and over something else that does.
    fn check_pictures(&self) -> Result<(), ConfigError> {
        for (i, picture) in self.description.figure.iter().enumerate() {
            for (word, name) in [("against", &picture.against), ("over", &picture.over)] {
                if let Some(name) = name
                    && !self.axes.iter().any(|axis| axis.name == *name)
                {
                    let known = self.axes.iter().map(|axis| axis.name.as_str());
                    let key = Key::from("figure").index(i).child(word);
                    return Err(self.refuse(key, ConfigFault::unknown_word(name, known)));
                }
            }
        }
        Ok(())
    }

    /// No key may be set twice on the same side.
    fn check_keys(&self) -> Result<(), ConfigError> {
        let touches = |axis: &StudyAxis, side| axis.applies_to == AppliesTo::Both || axis.applies_to == side;
        for (i, axis) in self.axes.iter().enumerate() {
            if touches(axis, AppliesTo::Truth) && self.truth.iter().any(|(key, _)| *key == axis.key) {
                let why =
                    "the key stands in `[truth]` already; write `applies_to = \"told\"`, or remove it there";
                return Err(self.refuse(at(i, "key"), ConfigFault::Value { why: why.to_owned() }));
            }
            let clash = self.axes.iter().take(i).any(|other| {
                let both = |side| touches(axis, side) && touches(other, side);
                other.key == axis.key && (both(AppliesTo::Truth) || both(AppliesTo::Told))
            });
            if clash {
                let why =
                    "the key is varied already; one of both may apply to `truth` and the other to `told`";
                return Err(self.refuse(at(i, "key"), ConfigFault::Value { why: why.to_owned() }));
            }
        }
        Ok(())
    }

    /// Whether the reader of experiments takes each key and value by itself.
    fn check_values(&self) -> Result<(), StudyError> {
        self.workbench.parse(&self.experiment.text, &self.experiment.path)?;
        for (key, value) in &self.truth {
            let place = Key::from("truth").child(&key.to_string());
            self.check_place(key, value, &place)?;
            let only = [(key.clone(), value.clone())];
            let tried = self.patched(&only, &[], AppliesTo::Truth, None).and_then(|truth| self.read(&truth));
            if let Err(e) = tried.map_err(RunError::from) {
                self.blame(key, &e, (place, None))?;
            }
        }
        for (i, axis) in self.axes.iter().enumerate() {
            let drawn;
            let (name, settings): (_, Vec<&AxisValue>) = match &axis.values {
                // What lies between the ends of a grid is of their kind.
                AxisValues::Listed(listed) if self.description.vary[i].grid.is_some() => {
                    ("grid", listed.first().into_iter().chain(listed.last()).collect())
                }
                AxisValues::Listed(listed) => ("values", listed.iter().collect()),
                AxisValues::Drawn(chance) => {
                    drawn = chance.middle();
                    (
                        if self.description.vary[i].normal.is_some() { "normal" } else { "uniform" },
                        vec![&drawn],
                    )
                }
            };
            for setting in settings {
                self.check_place(&axis.key, &setting.toml, &at(i, "key"))?;
                let mut alone = vec![None; self.axes.len()];
                alone[i] = Some(setting);
                if let Err(e) = self.ready_with(&alone, 0) {
                    self.blame(&axis.key, &e, (at(i, "key"), Some(at(i, name))))?;
                }
            }
        }
        Ok(())
    }

    /// Whether there is a place for the key.
    fn check_place(&self, key: &Key, value: &toml::Value, place: &Key) -> Result<(), ConfigError> {
        let put = put(&mut self.document.clone(), key, value.clone());
        put.map_err(|fault| self.refuse(place.clone(), fault))
    }

    /// Refuses a key or its value where that is at fault: at `places`, that of the key and that of the value. What a
    /// value does to others may be right together with other values, and is left to the run.
    fn blame(&self, key: &Key, error: &RunError, places: (Key, Option<Key>)) -> Result<(), ConfigError> {
        let Some(error) = error.config() else { return Ok(()) };
        let (place_of_key, place_of_value) = places;
        if let ConfigFault::UnknownKey { .. } = error.fault {
            return Err(self.refuse(place_of_key, error.fault.clone()));
        }
        if let Some((name, known)) = absent(&self.document, key)
            && !matches!(
                error.fault,
                ConfigFault::Value { .. } | ConfigFault::UnknownWord { .. } | ConfigFault::Type { .. }
            )
        {
            return Err(self.refuse(place_of_key, ConfigFault::unknown_key(name, known)));
        }
        let about_it = error.place.key == *key || !matches!(error.fault, ConfigFault::Value { .. });
        if about_it {
            return Err(self.refuse(place_of_value.unwrap_or(place_of_key), error.fault.clone()));
        }
        Ok(())
    }
}

/// The place of a `[[vary]]` table, or of a key in it.
fn at(index: usize, name: &str) -> Key {
    let key = Key::from("vary").index(index);
    if name.is_empty() { key } else { key.child(name) }
}

/// Keys may be written whole, in quotes, or as tables in tables.
fn flatten<'a>(
    above: &str,
    table: impl IntoIterator<Item = (&'a String, &'a toml::Value)>,
    each: &mut dyn FnMut(&str, &toml::Value) -> Result<(), ConfigError>,
) -> Result<(), ConfigError> {
    for (name, value) in table {
        let key = if above.is_empty() { name.clone() } else { format!("{above}.{name}") };
        match value {
            toml::Value::Table(inner) => flatten(&key, inner, each)?,
            value => each(&key, value)?,
        }
    }
    Ok(())
}
