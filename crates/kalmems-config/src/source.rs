//! The text of an experiment file and its lines.

use super::error::{ConfigPlace, LineAndColumn, shown};
use super::key::KeyStep;
use super::{ConfigError, ConfigFault, Key};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The largest file that is read, in bytes.
const LIMIT: usize = 1_000_000;

/// Where an experiment came from. It says nothing about the experiment: all are equal.
#[derive(Clone, Debug, Default)]
pub struct Source {
    /// Where it was read.
    pub path: PathBuf,
    /// What it says.
    pub text: String,
}

impl PartialEq for Source {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// How far from one file to the next a description is followed: a spectrum names an experiment, and that its recordings.
const DEEPEST_DESCRIPTION: u32 = 2;

impl Source {
    /// Reads a file that is not too large and is UTF-8.
    pub fn load(path: &Path) -> Result<Self, ConfigError> {
        let refuse = |fault| whole_file(path, fault);
        let cannot = |e: std::io::Error| {
            refuse(match e.kind() {
                ErrorKind::NotFound => ConfigFault::NotFound,
                ErrorKind::IsADirectory => ConfigFault::Folder,
                _ => ConfigFault::Read { why: e.to_string() },
            })
        };
        let file = File::open(path).map_err(cannot)?;
        if file.metadata().map_err(cannot)?.is_dir() {
            return Err(refuse(ConfigFault::Folder));
        }
        let mut bytes = Vec::new();
        // One byte more than allowed tells a file that is too large, however large it is.
        file.take(LIMIT as u64 + 1).read_to_end(&mut bytes).map_err(cannot)?;
        if bytes.len() > LIMIT {
            return Err(refuse(ConfigFault::TooLarge { limit: LIMIT }));
        }
        String::from_utf8(bytes).map(|text| Self { path: path.to_owned(), text }).map_err(|e| {
            let position = Some(position(e.as_bytes(), e.utf8_error().valid_up_to()));
            let place = ConfigPlace { file: path.to_owned(), position, key: Key::default() };
            ConfigError { place: Box::new(place), fault: ConfigFault::NotUtf8 }
        })
    }

    /// Takes text that is not too large.
    pub fn of(text: &str, path: &Path) -> Result<Self, ConfigError> {
        if text.len() > LIMIT {
            return Err(whole_file(path, ConfigFault::TooLarge { limit: LIMIT }));
        }
        Ok(Self { path: path.to_owned(), text: text.to_owned() })
    }

    /// The text as TOML, or where it is none.
    pub fn document(&self) -> Result<Spanned<DeTable<'_>>, ConfigError> {
        let (document, errors) = DeTable::parse_recoverable(&self.text);
        let end = self.text.len()..self.text.len();
        let spanned = errors.into_iter().map(|e| (e.span().unwrap_or(end.clone()), e));
        // The first in the file: what follows it may be its consequence.
        let Some((span, e)) = spanned.min_by_key(|(span, _)| span.start) else { return Ok(document) };
        let fault = if e.message().starts_with("duplicate key") {
            let key = self.text.get(span.clone()).unwrap_or_default();
            ConfigFault::DuplicateKey { key: shown(key) }
        } else {
            let column = position(self.text.as_bytes(), span.start).column;
            let why = e.message().trim().replace('\n', "; ");
            let path = self.path.display();
            let is_toml = self.path.extension().is_none_or(|extension| extension == "toml");
            let remedy = if is_toml {
                String::new()
            } else {
                format!(
                    "; if it is a recording, `kalmems new {path}` describes it and `kalmems inspect {path}` draws it"
                )
            };
            ConfigFault::Syntax { column, why: why + &remedy }
        };
        Err(self.error(Key::default(), Some(span.start), fault))
    }

    /// The file itself and the files that are there and that a string in it leads to, and so on from those of them that
    /// describe something themselves: whatever a run may read because of it.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = vec![self.path.clone()];
        self.add_files(&mut files, DEEPEST_DESCRIPTION);
        files
    }

    fn add_files(&self, files: &mut Vec<PathBuf>, deepest: u32) {
        let table: toml::Table = self.text.parse().unwrap_or_default();
        let mut values: Vec<toml::Value> = table.into_iter().map(|(_, value)| value).collect();
        let folder = self.path.parent().unwrap_or(Path::new(""));
        while let Some(value) = values.pop() {
            match value {
                toml::Value::Array(items) => values.extend(items),
                toml::Value::Table(table) => values.extend(table.into_iter().map(|(_, value)| value)),
                toml::Value::String(text) => {
                    let file = folder.join(text);
                    if files.contains(&file) || !file.is_file() {
                        continue;
                    }
                    let describes = deepest > 0 && file.extension().is_some_and(|ending| ending == "toml");
                    files.push(file.clone());
                    if let Some(source) = describes.then(|| Self::load(&file).ok()).flatten() {
                        source.add_files(files, deepest - 1);
                    }
                }
                _ => {}
            }
        }
    }

    /// Whether it has a table or a value of this name.
    pub fn has(&self, name: &str) -> bool {
        DeTable::parse(&self.text).is_ok_and(|document| document.get_ref().contains_key(name))
    }

    /// An error at a place in the text.
    pub fn error(&self, key: Key, byte: Option<usize>, fault: ConfigFault) -> ConfigError {
        let position = byte.map(|byte| position(self.text.as_bytes(), byte));
        ConfigError { place: Box::new(ConfigPlace { file: self.path.clone(), position, key }), fault }
    }

    /// An error at a key; where the key is not there, at the table in which it is missing.
    pub fn error_at(&self, key: Key, fault: ConfigFault) -> ConfigError {
        let document = DeTable::parse(&self.text).ok();
        let byte = document.and_then(|document| locate(document.get_ref(), &key));
        self.error(key, byte, fault)
    }
}

fn whole_file(path: &Path, fault: ConfigFault) -> ConfigError {
    let place = ConfigPlace { file: path.to_owned(), position: None, key: Key::default() };
    ConfigError { place: Box::new(place), fault }
}

/// The line and column of a byte.
fn position(text: &[u8], at: usize) -> LineAndColumn {
    let before = text.get(..at).unwrap_or(text);
    let line_start = before.iter().rposition(|b| *b == b'\n').map_or(0, |newline| newline + 1);
    let line = before.split(|b| *b == b'\n').count();
    let column = String::from_utf8_lossy(before.get(line_start..).unwrap_or_default()).chars().count() + 1;
    LineAndColumn { line, column }
}

/// The first byte of the deepest part of `key` that is there.
fn locate(document: &DeTable<'_>, key: &Key) -> Option<usize> {
    let mut byte = None;
    let mut inside: Option<&DeValue<'_>> = None;
    for step in key.steps() {
        let table = match inside {
            None => Some(document),
            Some(value) => value.as_table(),
        };
        let value = match step {
            KeyStep::Name(name) => {
                let Some((key, value)) = table.and_then(|t| t.get_key_value(name.as_str())) else { break };
                // A table is found by its header, a value by its key.
                byte = Some(if value.get_ref().is_table() { value.span().start } else { key.span().start });
                value
            }
            KeyStep::Index(index) => {
                let items = inside.and_then(DeValue::as_array);
                let Some(value) = items.and_then(|a| a.get(*index)) else { break };
                byte = Some(value.span().start);
                value
            }
        };
        inside = Some(value.get_ref());
    }
    byte
}
