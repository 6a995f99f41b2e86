//! How the files of applications are read.

use crate::config::{ConfigError, Source, read_source, schema_of};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use std::path::Path;

/// A file in which an operator writes what an application is to compute.
pub trait ApplicationFile: DeserializeOwned + JsonSchema {
    /// The title of its schema.
    const TITLE: &'static str;

    /// The same, which knows the text that it was read from.
    #[must_use]
    fn with_source(self, source: Source) -> Self;

    /// Refuses what no single key can be blamed for.
    ///
    /// # Errors
    /// What is wrong, with the key that is to be changed.
    fn check(&self) -> Result<(), ConfigError>;

    /// The JSON schema of such a file: for editors, and for checking one without this program.
    fn schema() -> serde_json::Value {
        schema_of::<Self>(Self::TITLE)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// What cannot be read, and what is wrong in it.
    fn load(path: &Path) -> Result<Self, ConfigError> {
        of_source(Source::load(path)?)
    }

    /// Reads the text of a file; `path` is where it stands, or would stand.
    ///
    /// # Errors
    /// What is wrong in it.
    fn parse(text: &str, path: &Path) -> Result<Self, ConfigError> {
        of_source(Source::of(text, path)?)
    }
}

fn of_source<F: ApplicationFile>(source: Source) -> Result<F, ConfigError> {
    let file = read_source::<F>(&source)?.with_source(source);
    file.check()?;
    Ok(file)
}
