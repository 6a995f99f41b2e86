//! What can be wrong with an experiment file.

use super::Key;
use std::fmt;
use std::path::PathBuf;

/// Something is wrong with an experiment file: where, and what.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {fault}")]
pub struct ConfigError {
    /// Where.
    pub place: Box<ConfigPlace>,
    /// What was found, what was expected, and what to write.
    pub fault: ConfigFault,
}

/// A place in an experiment file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ConfigPlace {
    /// The experiment file, as the caller named it.
    pub file: PathBuf,
    /// Line and column, counted from 1; `None` where the whole file is meant.
    pub position: Option<LineAndColumn>,
    /// The key; empty where the whole file is meant.
    pub key: Key,
}

/// A line and a column (in characters), counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LineAndColumn {
    /// The line.
    pub line: usize,
    /// The column.
    pub column: usize,
}

impl fmt::Display for ConfigPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.file.display())?;
        if let Some(position) = self.position {
            write!(f, ":{}", position.line)?;
        }
        if self.key.steps().is_empty() { Ok(()) } else { write!(f, ": {}", self.key) }
    }
}

/// What is wrong.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigFault {
    /// There is no such file.
    #[error("there is no such file; name an experiment file, such as `experiment.toml`")]
    NotFound,
    /// A folder was named.
    #[error("this is a folder; name the experiment file in it, such as `experiment.toml`")]
    Folder,
    /// The file is there but cannot be read.
    #[error("cannot be read: {why}")]
    Read {
        /// What the operating system says.
        why: String,
    },
    /// The file is too large to be a description written by people.
    #[error("the file is larger than {limit} bytes; an experiment file only names the recordings")]
    TooLarge {
        /// The largest size that is read.
        limit: usize,
    },
    /// The file is not text.
    #[error("the file is not UTF-8 text; save it as UTF-8")]
    NotUtf8,
    /// The text is not TOML.
    #[error("not valid TOML at column {column}: {why}")]
    Syntax {
        /// The column, counted from 1.
        column: usize,
        /// What the parser says.
        why: String,
    },
    /// A key stands twice.
    #[error("the key `{key}` stands here a second time; remove one of them")]
    DuplicateKey {
        /// The key as found.
        key: String,
    },
    /// A key that means nothing here.
    #[error("unknown key `{found}`; {}known keys: {}", hint(suggestion.as_deref()), known.join(", "))]
    UnknownKey {
        /// The key as found.
        found: String,
        /// The nearest known key, where one is near.
        suggestion: Option<String>,
        /// All keys that may stand here.
        known: Vec<String>,
    },
    /// A word that means nothing here.
    #[error("unknown word `{found}`; {}known words: {}", hint(suggestion.as_deref()), known.join(", "))]
    UnknownWord {
        /// The word as found.
        found: String,
        /// The nearest known word, where one is near.
        suggestion: Option<String>,
        /// All words that may stand here.
        known: Vec<String>,
    },
    /// A key that must be there is not.
    #[error("the key is missing; {remedy}")]
    MissingKey {
        /// What to write.
        remedy: String,
    },
    /// A value of another type.
    #[error("found {found}; expected {expected}{}", after_semicolon(remedy))]
    Type {
        /// What was found, in words.
        found: String,
        /// What was expected, in words.
        expected: String,
        /// What to write; empty where that is said already.
        remedy: String,
    },
    /// Not exactly one of several tables.
    #[error("found {}; expected exactly one of: {}", listed(found), known.join(", "))]
    OneOf {
        /// The tables found.
        found: Vec<String>,
        /// The tables that may stand here.
        known: Vec<String>,
    },
    /// Two things of one kind with one name.
    #[error(
        "the name `{name}` is that of `{first}` already; give this one another, such as `name = \"{name}-2\"`"
    )]
    DuplicateName {
        /// The name.
        name: String,
        /// What has it already, such as `recording[0]` or `estimate.filter[0]`.
        first: String,
    },
    /// A value that cannot be: a wrong dimension, an unknown unit, out of range.
    #[error("{why}")]
    Value {
        /// What was found, what was expected, and a value that would be right.
        why: String,
    },
}

impl ConfigFault {
    /// A key that is not one of those known, with the nearest of them.
    pub fn unknown_key<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Self {
        let known: Vec<String> = known.into_iter().map(str::to_owned).collect();
        Self::UnknownKey { suggestion: nearest(found, &known), found: shown(found), known }
    }

    /// A word that is not one of those known, with the nearest of them.
    pub fn unknown_word<'a>(found: &str, known: impl IntoIterator<Item = &'a str>) -> Self {
        let known: Vec<String> = known.into_iter().map(str::to_owned).collect();
        Self::UnknownWord { suggestion: nearest(found, &known), found: shown(found), known }
    }
}

fn hint(suggestion: Option<&str>) -> String {
    suggestion.map_or_else(String::new, |s| format!("did you mean `{s}`? "))
}

fn after_semicolon(remedy: &str) -> String {
    if remedy.is_empty() { String::new() } else { format!("; {remedy}") }
}

fn listed(found: &[String]) -> String {
    match found {
        [] => "none".to_owned(),
        _ => format!("{} ({})", found.len(), found.join(", ")),
    }
}

/// The nearest of `known`, unless even that is another word altogether.
fn nearest(found: &str, known: &[String]) -> Option<String> {
    let lower = found.to_lowercase();
    known
        .iter()
        .map(|k| (strsim::damerau_levenshtein(&k.to_lowercase(), &lower), k))
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, k)| *distance <= 1 + k.chars().count() / 4)
        .map(|(_, k)| k.clone())
}

/// Text from the file, fit for one line of a message: escaped, and cut where it is long.
pub(super) fn shown(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut short = String::new();
    for c in text.chars().take(LONGEST) {
        if c.is_control() {
            short.extend(c.escape_default());
        } else {
            short.push(c);
        }
    }
    if text.chars().nth(LONGEST).is_some() {
        short.push('…');
    }
    short
}
