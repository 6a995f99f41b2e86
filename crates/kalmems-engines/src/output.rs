//! A folder of results that is there whole or not at all.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use tempfile::TempDir;

/// The file that every result has, and by which a folder is known to be one.
pub const RUN_FILE: &str = "run.toml";

/// When a run began, and how long it took: all that differs between two runs of the same input.
#[derive(Clone, Copy, Debug)]
pub struct RunInfo {
    /// When it began.
    pub started: SystemTime,
    /// How long it took until its results were written.
    pub took: Duration,
}

/// A result being written: beside its place, under another name, until it is complete.
#[derive(Debug)]
pub struct Output {
    staged: TempDir,
    target: PathBuf,
}

/// Why a result cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The system says no.
    #[error("cannot write {}: {source}", path.display())]
    Io {
        /// What was to be written.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// Something else is there.
    #[error(
        "{} is there and is not a result of kalmems (it has no {RUN_FILE}); give another folder with --out",
        path.display()
    )]
    Foreign {
        /// The folder.
        path: PathBuf,
    },
    /// A result of another input is there.
    #[error(
        "{} holds a result of another input ({was}, now {is}); give another folder with --out, or --force to replace it",
        path.display()
    )]
    OtherInput {
        /// The folder.
        path: PathBuf,
        /// What the result there was made from.
        was: String,
        /// What this one is made from.
        is: String,
    },
}

impl Output {
    /// Prepares a result at `target`, made from `input`: a name that tells inputs apart.
    ///
    /// A result of the same input is replaced when this one is complete; one of another input only with `force`;
    /// a folder that is no result never.
    pub fn prepare(target: &Path, input: &str, force: bool) -> Result<Self, OutputError> {
        let error = |source| OutputError::Io { path: target.to_owned(), source };
        if target.exists() {
            let empty = fs::read_dir(target).map_err(error)?.next().is_none();
            let run = fs::read_to_string(target.join(RUN_FILE)).ok();
            match run.as_deref().and_then(input_of) {
                None if empty => {}
                None => return Err(OutputError::Foreign { path: target.to_owned() }),
                Some(was) if was != input && !force => {
                    return Err(OutputError::OtherInput {
                        path: target.to_owned(),
                        was,
                        is: input.to_owned(),
                    });
                }
                Some(_) => {}
            }
        }
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        fs::create_dir_all(parent).map_err(error)?;
        let staged = tempfile::Builder::new().prefix(".kalmems-").tempdir_in(parent).map_err(error)?;
        Ok(Self { staged, target: target.to_owned() })
    }

    /// Writes one file of the result.
    pub fn write(
        &self,
        name: &str,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), OutputError> {
        let path = self.staged.path().join(name);
        let error = |source| OutputError::Io { path: self.target.join(name), source };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(error)?;
        }
        let mut file = io::BufWriter::new(fs::File::create(&path).map_err(error)?);
        content(&mut file).and_then(|()| file.flush()).map_err(error)
    }

    /// Begins one file of the result that is written bit by bit.
    pub fn create(&self, name: &str) -> Result<io::BufWriter<fs::File>, OutputError> {
        let path = self.staged.path().join(name);
        let file = fs::File::create(&path);
        let file = file.map_err(|source| OutputError::Io { path: self.target.join(name), source })?;
        Ok(io::BufWriter::with_capacity(1 << 18, file))
    }

    /// The error of a file of this name that cannot be written.
    pub fn error(&self, name: &str, source: io::Error) -> OutputError {
        OutputError::Io { path: self.target.join(name), source }
    }

    /// Puts the complete result in its place.
    pub fn commit(self) -> Result<(), OutputError> {
        let error = |source| OutputError::Io { path: self.target.clone(), source };
        // A folder made for one user alone would surprise the others whom the results are for.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            fs::set_permissions(self.staged.path(), fs::Permissions::from_mode(0o755)).map_err(error)?;
        }
        let old = self.staged.path().with_extension("old");
        let replaces = self.target.exists();
        if replaces {
            fs::rename(&self.target, &old).map_err(error)?;
        }
        if let Err(source) = fs::rename(self.staged.path(), &self.target) {
            if replaces {
                // The old result goes back to where it was; if even that fails it still exists under its other name.
                let _ = fs::rename(&old, &self.target);
            }
            return Err(error(source));
        }
        // Its folder is in place: nothing of the staging is left to remove but the name.
        let _ = self.staged.keep();
        if replaces { fs::remove_dir_all(&old).map_err(error) } else { Ok(()) }
    }
}

/// What a run file says that it was made from.
fn input_of(run: &str) -> Option<String> {
    let table: toml::Table = run.parse().ok()?;
    Some(table.get("input_id")?.as_str()?.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(target: &Path, input: &str, force: bool) -> Result<(), OutputError> {
        let output = Output::prepare(target, input, force)?;
        output.write(RUN_FILE, |w| writeln!(w, "input_id = \"{input}\""))?;
        output.write("figures/a.svg", |w| writeln!(w, "picture of {input}"))?;
        output.commit()
    }

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_result_is_whole_or_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("out/scan");
        let output = Output::prepare(&target, "a", false).unwrap();
        output.write(RUN_FILE, |w| writeln!(w, "input_id = \"a\"")).unwrap();
        assert!(!target.exists());
        drop(output);
        assert!(names(&folder.path().join("out")).is_empty());
        put(&target, "a", false).unwrap();
        assert_eq!(names(&target), ["figures", RUN_FILE]);
        assert_eq!(names(&folder.path().join("out")), ["scan"]);
    }

    #[test]
    fn the_same_input_is_replaced_and_another_only_by_force() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("scan");
        put(&target, "a", false).unwrap();
        fs::write(target.join("stale"), "").unwrap();
        put(&target, "a", false).unwrap();
        assert_eq!(names(&target), ["figures", RUN_FILE]);
        let error = put(&target, "b", false).unwrap_err();
        assert!(
            matches!(&error, OutputError::OtherInput { was, is, .. } if was == "a" && is == "b"),
            "{error}"
        );
        put(&target, "b", true).unwrap();
        assert_eq!(fs::read_to_string(target.join("figures/a.svg")).unwrap(), "picture of b\n");
        assert_eq!(names(folder.path()), ["scan"]);
    }

    #[test]
    fn what_is_no_result_is_never_touched() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("thesis.tex"), "years of work").unwrap();
        for force in [false, true] {
            assert!(matches!(put(folder.path(), "a", force), Err(OutputError::Foreign { .. })));
        }
        assert_eq!(names(folder.path()), ["thesis.tex"]);
    }
}
