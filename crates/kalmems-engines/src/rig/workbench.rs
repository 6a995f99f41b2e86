//! The rigs that a program works with.

use super::Rig;
use crate::config::{
    ArraysByFile, ConfigError, ConfigFault, ConfigPlace, DeviceKind, Experiment, FilesBeside, Key,
    experiment_schema,
};
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// The devices that a program knows: a rig for each. A device of one's own is a type that implements [`Rig`].
#[derive(Clone, Default)]
pub struct Workbench {
    rigs: Vec<Arc<dyn Rig>>,
    arrays: ArraysByFile,
    beside: FilesBeside,
}

impl Workbench {
    /// Without a rig yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The same with one more rig. Of several that read the same table the first that claims an experiment has it.
    #[must_use]
    pub fn with(mut self, rig: impl Rig + 'static) -> Self {
        self.rigs.push(Arc::new(rig));
        self
    }

    /// The same for experiments that it reads with arrays instead of files; see [`Experiment::with_arrays`].
    #[must_use]
    pub fn with_arrays(mut self, arrays: ArraysByFile) -> Self {
        self.arrays = arrays;
        self
    }

    /// Its rigs.
    pub fn rigs(&self) -> impl Iterator<Item = &dyn Rig> {
        self.rigs.iter().map(AsRef::as_ref)
    }

    /// The tables that its rigs read, each once.
    fn devices(&self) -> Vec<DeviceKind> {
        let mut kinds: Vec<DeviceKind> = Vec::new();
        for rig in self.rigs() {
            let kind = rig.device();
            if kinds.iter().all(|known| known.name != kind.name) {
                kinds.push(kind);
            }
        }
        kinds
    }

    /// Reads an experiment file, the device included: one that none of its rigs claims is refused.
    pub fn load(&self, path: &Path) -> Result<Experiment, ConfigError> {
        self.read(Experiment::load(path))
    }

    /// Reads an experiment file from its text; `path` is the place of the file, or the one it would have.
    pub fn parse(&self, text: &str, path: &Path) -> Result<Experiment, ConfigError> {
        self.read(Experiment::parse(text, path))
    }

    /// Reads an experiment that is there as a table already; `name` is what messages call it. What is wrong is told by its key alone: there
    /// is no text that would have lines.
    pub fn read_table(&self, table: &toml::Table, name: &Path) -> Result<Experiment, ConfigError> {
        let read = toml::to_string(table).map_err(|e| {
            let place = ConfigPlace { file: name.to_owned(), position: None, key: Key::default() };
            ConfigError { place: Box::new(place), fault: ConfigFault::Value { why: e.to_string() } }
        });
        read.and_then(|text| self.parse(&text, name)).map_err(|mut error| {
            error.place.position = None;
            error
        })
    }

    fn read(&self, read: Result<Experiment, ConfigError>) -> Result<Experiment, ConfigError> {
        let experiment = read.map_err(|error| self.with_devices(error))?;
        let experiment = experiment.with_arrays(&self.arrays).sharing(&self.beside);
        self.rig(&experiment)?;
        // Of what the rig has read, with the uncertainties that stand in tables of their own.
        experiment.directions()?;
        Ok(experiment)
    }

    /// Says which devices there are, where none or several are described.
    fn with_devices(&self, mut error: ConfigError) -> ConfigError {
        if error.place.key == Key::from("device") {
            let devices = self.devices();
            match &mut error.fault {
                ConfigFault::OneOf { known, .. } => {
                    *known = devices.iter().map(|device| device.name.to_owned()).collect();
                }
                ConfigFault::MissingKey { remedy } | ConfigFault::Type { remedy, .. } => {
                    let tables = devices.iter().map(|device| format!("`[device.{}]`", device.name));
                    let tables: Vec<String> = tables.collect();
                    *remedy = format!("add one of the tables {}", tables.join(", "));
                }
                _ => {}
            }
        }
        error
    }

    /// The rig for an experiment's device.
    pub fn rig(&self, experiment: &Experiment) -> Result<&dyn Rig, ConfigError> {
        let name = experiment.device_name();
        let mut claimants = self.rigs().filter(|rig| rig.device().name == name).peekable();
        if claimants.peek().is_none() {
            let devices = self.devices();
            let known = devices.iter().map(|device| device.name);
            return Err(
                experiment.error(Key::from("device").child(name), ConfigFault::unknown_key(name, known))
            );
        }
        for rig in claimants {
            if rig.claims(experiment)? {
                rig.uses(experiment).check(experiment)?;
                return Ok(rig);
            }
        }
        let why =
            "this device can be described, and none of the rigs that read its table is for it".to_owned();
        Err(experiment.error(Key::from("device").child(name), ConfigFault::Value { why }))
    }

    /// The JSON schema of an experiment file with one of these devices.
    pub fn schema(&self) -> serde_json::Value {
        experiment_schema(&self.devices())
    }
}

impl fmt::Debug for Workbench {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.rigs().map(Rig::name)).finish()
    }
}
