//! What a result is to be of.

use crate::OutputError;
use std::ffi::OsString;
use std::io;
use std::path::{Component, Path, PathBuf};

/// The work that a result is of.
#[derive(Clone, Debug)]
pub struct Work {
    /// The command, such as `estimate`.
    pub command: &'static str,
    /// What it works on.
    pub subject: Subject,
    /// The files that it reads.
    pub inputs: Vec<PathBuf>,
    /// Whether what another experiment left, and what was changed by hand, is put aside.
    pub force: bool,
}

/// What tells the work of one result from that of another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Subject {
    /// The file that describes it.
    File(PathBuf),
    /// A name, where no file describes it.
    Named(String),
}

impl Work {
    /// Work that a file describes; the files that it reads, with this one among them.
    pub fn of_file(command: &'static str, file: &Path, mut inputs: Vec<PathBuf>) -> Self {
        inputs.push(file.to_owned());
        Self { command, subject: Subject::File(file.to_owned()), inputs, force: false }
    }

    /// Work that has a name.
    pub fn named(command: &'static str, name: &str) -> Self {
        Self { command, subject: Subject::Named(name.to_owned()), inputs: Vec::new(), force: false }
    }

    /// Likewise, where what another experiment left is put aside.
    #[must_use]
    pub fn forced(self, force: bool) -> Self {
        Self { force, ..self }
    }

    /// Refuses a target in which a file lies that the run reads.
    pub(crate) fn refuse_inputs_within(&self, target: &Path, place: &Path) -> Result<(), OutputError> {
        // A file that is not there is told by whoever reads it.
        let within = |input: &&PathBuf| input.canonicalize().is_ok_and(|input| input.starts_with(place));
        match self.inputs.iter().find(within) {
            Some(input) => {
                Err(OutputError::Input { input: input.clone(), instead: target.join(self.command) })
            }
            None => Ok(()),
        }
    }
}

impl Subject {
    /// What the manifest of a result at this place calls it: the way to a file, so that a tree of folders can be moved.
    pub(crate) fn name_from(&self, place: &Path) -> String {
        match self {
            Self::File(file) => {
                way_from(place, file).unwrap_or_else(|| file.clone()).to_string_lossy().replace('\\', "/")
            }
            Self::Named(name) => name.clone(),
        }
    }
}

/// The way from a folder, which need not be there yet, to a file that is.
pub fn way_from(folder: &Path, file: &Path) -> Option<PathBuf> {
    let (folder, file) = (resolved(folder).ok()?, std::fs::canonicalize(file).ok()?);
    let steps = |path: &Path| path.components().map(|c| c.as_os_str().to_owned()).collect::<Vec<OsString>>();
    let (from, to) = (steps(&folder), steps(&file));
    let same = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = std::iter::repeat_n(Component::ParentDir.as_os_str().to_owned(), from.len() - same);
    Some(up.chain(to.into_iter().skip(same)).collect())
}

/// The target of a result with every link followed, so that a link to a folder stays one.
pub(crate) fn followed(target: &Path) -> Result<PathBuf, OutputError> {
    let error = |source| OutputError::Io { path: target.to_owned(), source };
    let place = resolved(target).map_err(error)?;
    if place.file_name().is_none() {
        return Err(OutputError::NoFolder { path: target.to_owned(), what: "the root of a file system" });
    }
    match std::fs::symlink_metadata(&place) {
        Ok(there) if there.is_symlink() => {
            Err(OutputError::NoFolder { path: target.to_owned(), what: "a link that leads nowhere" })
        }
        Ok(there) if !there.is_dir() => {
            Err(OutputError::NoFolder { path: target.to_owned(), what: "there and no folder" })
        }
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(error(e)),
        _ => Ok(place),
    }
}

/// An absolute path without links, as far as it is there.
fn resolved(path: &Path) -> io::Result<PathBuf> {
    let (mut rest, mut there) = (PathBuf::new(), std::path::absolute(path)?);
    loop {
        match there.canonicalize() {
            Ok(real) if rest.as_os_str().is_empty() => return Ok(real),
            Ok(real) => return Ok(real.join(rest)),
            Err(e) => {
                let (Some(name), Some(parent)) = (there.file_name(), there.parent()) else { return Err(e) };
                rest = if rest.as_os_str().is_empty() { name.into() } else { Path::new(name).join(rest) };
                there = parent.to_owned();
            }
        }
    }
}
