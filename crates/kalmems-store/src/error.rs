//! Why a result cannot be written.

use std::io;
use std::path::PathBuf;

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
    /// The target is no folder.
    #[error("{} is {what}, and a result is a folder; give another one with --out", path.display())]
    NoFolder {
        /// The target.
        path: PathBuf,
        /// What stands there.
        what: &'static str,
    },
    /// The target holds something, and no manifest says whose it is.
    #[error(
        "{} holds `{file}` and is not a result of kalmems (it has no {}); nothing was changed: give another folder \
         with --out, or an empty one",
        path.display(),
        crate::MANIFEST
    )]
    Foreign {
        /// The folder.
        path: PathBuf,
        /// The first thing in it.
        file: String,
    },
    /// A result of a version that kept no list of its files.
    #[error(
        "{} holds a result of an earlier version of kalmems, which did not list its files (it has no {}), so that they \
         cannot be distinguished from yours; nothing was changed: move or remove the folder, or give another one with --out",
        path.display(),
        crate::MANIFEST
    )]
    Unlisted {
        /// The folder.
        path: PathBuf,
    },
    /// A manifest that cannot be read.
    #[error(
        "{} cannot be read as the list of a result's files: {why}; nothing was changed: move or remove the folder, or \
         give another one with --out",
        path.display()
    )]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// Something in a result's folder is not the result's.
    #[error(
        "{} holds `{file}`, which kalmems did not write; nothing was changed: move it out of there, or give another \
         folder with --out",
        path.display()
    )]
    Stranger {
        /// The folder.
        path: PathBuf,
        /// What is in it, seen from it.
        file: String,
    },
    /// A file that the run reads is in the folder that it would replace.
    #[error(
        "{} is read by this run and lies in the folder for its result; nothing was changed: give another folder, such as \
         --out {}",
        input.display(),
        instead.display()
    )]
    Input {
        /// The file that is read.
        input: PathBuf,
        /// A folder that would do.
        instead: PathBuf,
    },
    /// A file of the result was changed since it was written.
    #[error(
        "{} was changed since kalmems wrote it; nothing was replaced: give another folder with --out, or --force to keep \
         the folder as it is beside the new result, as `{}`",
        path.join(file).display(),
        crate::staging::previous(path).display()
    )]
    Changed {
        /// The folder.
        path: PathBuf,
        /// The file, seen from it.
        file: String,
    },
    /// The result of other work is there.
    #[error(
        "{} holds the result of {was}, and this is {is}; nothing was replaced: give another folder with --out, or \
         --force to keep what is there as `{}`",
        path.display(),
        crate::staging::previous(path).display()
    )]
    OtherWork {
        /// The folder.
        path: PathBuf,
        /// What the result there is of.
        was: String,
        /// What this one is of.
        is: String,
    },
    /// Another run is at work there.
    #[error(
        "another run is writing to {}; nothing was changed: wait for it, or give another folder with --out",
        path.display()
    )]
    Busy {
        /// The folder.
        path: PathBuf,
    },
    /// While the run was at work, something else came to stand at its target.
    #[error(
        "{} was changed by something else while this run was at work, and was left alone; the result is in {}",
        path.display(),
        result.display()
    )]
    Taken {
        /// The folder.
        path: PathBuf,
        /// Where the result is.
        result: PathBuf,
    },
    /// A single file is to be written where something stands that may not be replaced.
    #[error("{} is {what}; nothing was changed: {remedy}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What stands there.
        what: &'static str,
        /// What to do.
        remedy: &'static str,
    },
}
