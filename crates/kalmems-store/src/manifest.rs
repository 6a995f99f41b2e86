//! The list of the files that a result owns.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Component, Path};

/// The name of the list, by which a folder is known to be a result.
pub const MANIFEST: &str = "manifest.toml";

/// The version of its form.
const FORM: u32 = 1;

/// More bytes than a list of files has.
const LIMIT: u64 = 16 << 20;

const HEADING: &str = "\
# The files that kalmems wrote here. These alone does it ever replace or remove, and only while they are as listed.
";

/// What a result is of, and which files are its own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Manifest {
    /// The version of the form, under the name of the list.
    #[serde(rename = "manifest")]
    form: u32,
    /// The version of the program.
    kalmems: String,
    /// The command that made it.
    pub(crate) command: String,
    /// The file that describes the work, seen from the result, or the name of the work.
    pub(crate) of: String,
    /// SHA-256 of each file, by its name as seen from the folder, with `/` between folders.
    pub(crate) files: BTreeMap<String, String>,
}

impl Manifest {
    pub(crate) fn new(command: &str, of: String, files: BTreeMap<String, String>) -> Self {
        Self {
            form: FORM,
            kalmems: env!("CARGO_PKG_VERSION").to_owned(),
            command: command.to_owned(),
            of,
            files,
        }
    }

    /// What it is of, for people.
    pub(crate) fn work(&self) -> String {
        work(&self.command, &self.of)
    }

    pub(crate) fn to_text(&self) -> Result<String, toml::ser::Error> {
        Ok(format!("{HEADING}\n{}", toml::to_string(self)?))
    }

    /// Reads the list of a folder; `None` where there is none. In an error is what is wrong with it.
    pub(crate) fn read(folder: &Path) -> Result<Option<Self>, String> {
        let path = folder.join(MANIFEST);
        match std::fs::symlink_metadata(&path) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(e.to_string()),
            Ok(there) if !there.is_file() => return Err("it is no regular file".to_owned()),
            Ok(there) if there.len() > LIMIT => return Err(format!("it has {} bytes", there.len())),
            Ok(_) => {}
        }
        let text = std::fs::read_to_string(&path).map_err(|e| e.to_string())?;
        Self::parse(&text).map(Some)
    }

    fn parse(text: &str) -> Result<Self, String> {
        // What is wrong with the text is of no use to anybody, and the text could be another file's.
        let manifest: Self = toml::from_str(text).map_err(|_| "it is damaged".to_owned())?;
        if manifest.form != FORM {
            return Err(format!("it has form {}, and this version knows {FORM}", manifest.form));
        }
        let odd = manifest.files.keys().find(|name| !is_within(name) || name.as_str() == MANIFEST);
        odd.map_or(Ok(()), |name| Err(format!("it lists `{name}`, which cannot be in the folder")))?;
        Ok(manifest)
    }

    /// Whether a folder, as seen from the result, is one that it has.
    pub(crate) fn has_folder(&self, folder: &str) -> bool {
        let within = format!("{folder}/");
        self.files.range(within.clone()..).next().is_some_and(|(name, _)| name.starts_with(&within))
    }
}

/// What a command makes of a file, for people.
pub(crate) fn work(command: &str, of: &str) -> String {
    format!("`{command}` of `{of}`")
}

/// Whether a name leads to a place within the folder that it is seen from.
fn is_within(name: &str) -> bool {
    !name.is_empty()
        && !name.contains('\\')
        && Path::new(name).components().all(|part| matches!(part, Component::Normal(_)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_that_leads_out_of_its_folder_is_refused() {
        let list = |name: &str| {
            let files = BTreeMap::from([(name.to_owned(), String::new())]);
            Manifest::parse(&Manifest::new("estimate", "a.toml".to_owned(), files).to_text().unwrap())
        };
        assert!(list("figures/motion.png").is_ok());
        for name in ["../thesis.tex", "/etc/passwd", "a/../../b", "", "manifest.toml", "a\\..\\b"] {
            assert!(list(name).is_err(), "{name}");
        }
    }
}
