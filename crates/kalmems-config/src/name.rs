//! Names that may become the name of a folder.

use super::error::shown;
use crate::inline_schema;
use schemars::json_schema;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A name of lower-case letters, digits, `-` and `_`: safe as a folder's name on every system.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String")]
pub struct Name(String);

const LONGEST: usize = 64;

impl Name {
    /// The name.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || matches!(c, '-' | '_');
        if !name.is_empty() && name.len() <= LONGEST && name.chars().all(allowed) {
            return Ok(Self(name));
        }
        Err(format!(
            "`{}` cannot be the name of a folder; expected 1 to {LONGEST} of a-z, 0-9, `-` and `_`, such as \
             `shared-scanner`",
            shown(&name)
        ))
    }
}

inline_schema!(Name, "Name", |_| json_schema!({
    "type": "string",
    "pattern": format!("^[a-z0-9_-]{{1,{LONGEST}}}$"),
    "examples": ["shared-scanner"],
}));
