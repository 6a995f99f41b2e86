//! The store of results: folders that are whole or not there, and that never cost anybody a file.
//!
//! A result is a folder with a [manifest](MANIFEST) that lists the files which the program wrote, with their checksums.
//! These files alone are ever replaced or removed, and only while they are as they were written. Before a run begins,
//! [`Output::begin`] looks at what stands at its target and refuses
//!
//! - a folder with anything in it that the manifest does not list,
//! - a folder with a file that the run reads,
//! - a file of the manifest that was changed since, and the result of another experiment: both but with `force`,
//! - a target that another run is writing to.
//!
//! The new result is staged beside its target and put there by [`Output::commit`] in one step where the system has it. The
//! earlier result is removed if the new one says the same, and is kept as `TARGET.previous` otherwise. What a run that
//! was killed left behind is cleared by the next run beside it.
//!
//! A picture or another single file follows the same rules, see [`write_picture`].

mod error;
mod exchange;
mod manifest;
mod sealed;
mod single;
mod staging;
mod stored;
mod target_state;
mod work;

#[cfg(test)]
mod tests;

pub use error::OutputError;
pub use exchange::sync_folder;
pub use manifest::MANIFEST;
pub use sealed::ResultFile;
pub use single::{create_file, keep_aside, write_page, write_picture};
pub use stored::StoredResult;
pub use work::{Subject, Work, way_from};

use manifest::Manifest;
use sealed::Sealing;
use serde::Serialize;
use staging::{EarlierResultFate, Staging};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use target_state::{TargetState, look};

/// The record of the run that every result has; it alone differs between two runs of the same input, by its timing.
pub const RUN_FILE: &str = "run.toml";

/// When a run began, and how long it took: all that differs between two runs of the same input.
#[derive(Clone, Copy, Debug)]
pub struct RunInfo {
    /// When it began.
    pub started: SystemTime,
    /// How long it took until its results were written.
    pub took: Duration,
}

impl RunInfo {
    /// The same as the record of a run says it.
    pub fn timing(&self) -> RunTiming {
        RunTiming {
            started_unix_s: self.started.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs()),
            took_s: self.took.as_secs_f64(),
        }
    }
}

/// The times of a run in its record.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct RunTiming {
    /// When it began, in whole seconds since 1970.
    pub started_unix_s: u64,
    /// How long it took until its results were written, in s.
    pub took_s: f64,
}

/// The record of a run: what every command says, and what one says beside it.
#[derive(Serialize)]
struct RunRecord<'a, T> {
    version: &'static str,
    command: &'static str,
    input_id: &'a str,
    #[serde(flatten)]
    rest: T,
}

/// A result being written: beside its target, under another name, until it is complete.
#[derive(Debug)]
pub struct Output {
    target: PathBuf,
    /// The target with every link on the way to it followed.
    place: PathBuf,
    staging: Staging,
    command: &'static str,
    of: String,
    force: bool,
    /// The checksums of the files that are complete.
    sealed: RefCell<BTreeMap<String, String>>,
    standing: TargetState,
}

/// What became of the result that stood at the target before.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EarlierResult {
    /// Where the earlier result is kept, if it said anything else than the new one.
    pub earlier: Option<PathBuf>,
}

impl Output {
    /// Prepares a result at `target`, before the work that it is of begins. Nothing that stands there is touched.
    pub fn begin(target: &Path, work: &Work) -> Result<Self, OutputError> {
        let place = work::followed(target)?;
        work.refuse_inputs_within(target, &place)?;
        let of = work.subject.name_from(&place);
        let staging = Staging::begin(target, &place)?;
        let standing = look(target, &place, &TargetState::Nothing)?;
        if !work.force {
            refuse_replacing(target, &standing, (work.command, &of))?;
        }
        Ok(Self {
            target: target.to_owned(),
            place,
            staging,
            command: work.command,
            of,
            force: work.force,
            sealed: RefCell::default(),
            standing,
        })
    }

    /// The folder in which the result will be, as it was given.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Writes one file of the result.
    pub fn write(
        &self,
        name: &str,
        content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), OutputError> {
        let mut file = self.create(name)?;
        content(&mut file).map_err(|source| self.error(name, source))?;
        self.seal(file)
    }

    /// Writes the record of the run ([`RUN_FILE`]): what computed it, of which input, and behind that what else the command says of it.
    pub fn write_run<T: Serialize>(
        &self,
        input_id: &str,
        rest: impl FnOnce() -> io::Result<T>,
    ) -> Result<(), OutputError> {
        self.write(RUN_FILE, |w| {
            let (version, rest) = (env!("CARGO_PKG_VERSION"), rest()?);
            let record = RunRecord { version, command: self.command, input_id, rest };
            w.write_all(toml::to_string(&record).map_err(io::Error::other)?.as_bytes())
        })
    }

    /// Begins one file of the result that is written bit by bit; [`Output::seal`] completes it.
    pub fn create(&self, name: &str) -> Result<ResultFile, OutputError> {
        let sealing = self.staging.create(name).and_then(Sealing::new);
        let sealing = sealing.map_err(|source| self.error(name, source))?;
        Ok(ResultFile::new(name, sealing))
    }

    /// Completes a file: all of it is on the disk then.
    pub fn seal(&self, file: ResultFile) -> Result<(), OutputError> {
        let (name, sealing) = file.into_parts();
        let checksum = sealing.finish().map_err(|source| self.error(&name, source))?;
        let checksum = if name == RUN_FILE { self.staging.checksum(&name) } else { Ok(checksum) };
        let checksum = checksum.map_err(|source| self.error(&name, source))?;
        self.sealed.borrow_mut().insert(name, checksum);
        Ok(())
    }

    /// Makes a file that is complete already, and that nobody changes, one of the result: by a second name of it where the file system
    /// has that, else by a copy. It is refused where its SHA-256 is not the expected one.
    pub fn adopt(&self, name: &str, complete: &Path, sha256: &str) -> Result<(), OutputError> {
        let found = self.staging.adopt(name, complete).and_then(|()| self.staging.checksum(name));
        if found.map_err(|source| self.error(name, source))? != sha256 {
            let source = io::Error::other(format!("{} was changed while it was needed", complete.display()));
            return Err(self.error(name, source));
        }
        self.sealed.borrow_mut().insert(name.to_owned(), sha256.to_owned());
        Ok(())
    }

    /// A file with this SHA-256 of the result that stands at the target, which nobody changed since it was written.
    pub fn standing_file(&self, sha256: &str) -> Option<PathBuf> {
        let TargetState::Result { manifest, seen, .. } = &self.standing else { return None };
        let mut same =
            manifest.files.iter().filter(|(name, of)| of.as_str() == sha256 && seen.contains_key(*name));
        same.next().map(|(name, _)| self.place.join(name))
    }

    /// The error of a file of this name that cannot be written.
    pub fn error(&self, name: &str, source: io::Error) -> OutputError {
        OutputError::Io { path: self.target.join(name), source }
    }

    /// Puts the complete result in its place.
    ///
    /// Where the result that stands there says anything else, or was changed, it is kept beside it. Where something came to
    /// stand there since the run began, that is left alone, and the new result is put beside it.
    pub fn commit(self) -> Result<EarlierResult, OutputError> {
        let error = |source| OutputError::Io { path: self.target.clone(), source };
        let manifest = Manifest::new(self.command, self.of.clone(), self.sealed.borrow().clone());
        self.staging.write_manifest(&manifest).map_err(error)?;
        let standing = look(&self.target, &self.place, &self.standing).and_then(|standing| {
            if !self.force {
                refuse_replacing(&self.target, &standing, (self.command, &self.of))?;
            }
            Ok(standing)
        });
        let Ok(standing) = standing else {
            let result = self.staging.publish_beside(&self.place).map_err(error)?;
            return Err(OutputError::Taken { path: self.target.clone(), result });
        };
        let earlier = match &standing {
            TargetState::Nothing => None,
            TargetState::Result { manifest: earlier, changed, seen } => {
                let same = changed.is_empty() && manifest == *earlier;
                Some((if same { EarlierResultFate::Remove } else { EarlierResultFate::Keep }, seen))
            }
        };
        let earlier = self.staging.publish(&self.place, &manifest, earlier).map_err(error)?;
        Ok(EarlierResult { earlier })
    }
}

/// Refuses to replace what other work left, or what was changed since it was written.
fn refuse_replacing(
    target: &Path,
    standing: &TargetState,
    (command, of): (&str, &str),
) -> Result<(), OutputError> {
    let TargetState::Result { manifest, changed, .. } = standing else { return Ok(()) };
    let path = target.to_owned();
    if (manifest.command.as_str(), manifest.of.as_str()) != (command, of) {
        return Err(OutputError::OtherWork { path, was: manifest.work(), is: manifest::work(command, of) });
    }
    changed.first().map_or(Ok(()), |file| Err(OutputError::Changed { path, file: file.clone() }))
}
