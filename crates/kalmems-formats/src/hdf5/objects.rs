//! Objects by their paths, through links to other paths and into other files.

use super::file::Hdf5File;
use super::header::ObjectHeader;
use super::links::{GroupLink, LinkTarget, links};
use crate::source::SharedFile;
use crate::{FormatError, Result, limits};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Links that lead to links, as many as the HDF5 library follows.
const HOPS: usize = 16;
/// Files that links lead into.
const FILES: usize = 16;

/// An object: the file that it is in, and the place of its header.
#[derive(Clone)]
pub(super) struct Object {
    pub(super) file: Arc<Hdf5File>,
    pub(super) address: u64,
}

impl Object {
    pub(super) fn header(&self) -> Result<ObjectHeader> {
        ObjectHeader::read(&self.file, self.address)
    }

    /// Whether two are the same.
    pub(super) fn is(&self, other: &Self) -> bool {
        self.address == other.address && Arc::ptr_eq(&self.file, &other.file)
    }
}

/// What a link leads to, or why it leads nowhere, in words that follow a name.
pub(super) type LinkOutcome = Result<Object, String>;

/// The opened file, and those that links lead into.
pub(super) struct LinkedFiles {
    pub(super) own: Arc<Hdf5File>,
    /// The folder of the opened file, where it is one on a disk.
    folder: Option<PathBuf>,
    others: Vec<(PathBuf, Arc<Hdf5File>)>,
}

impl LinkedFiles {
    pub(super) fn new(source: Arc<SharedFile>) -> Result<Self> {
        let folder = source.folder().map(Path::to_owned);
        Ok(Self { own: Arc::new(Hdf5File::open(source, None)?), folder, others: Vec::new() })
    }

    pub(super) fn root(&self) -> Object {
        Object { address: self.own.root, file: Arc::clone(&self.own) }
    }

    /// The object at a path of the opened file.
    pub(super) fn at_path(&mut self, path: &str) -> Result<LinkOutcome> {
        let mut hops = HOPS;
        self.walk(self.root(), path, &mut hops)
    }

    /// What a link of a group leads to.
    pub(super) fn follow(&mut self, group: &Object, target: &LinkTarget) -> Result<LinkOutcome> {
        let mut hops = HOPS;
        self.hop(group, target, &mut hops)
    }

    fn hop(&mut self, group: &Object, target: &LinkTarget, hops: &mut usize) -> Result<LinkOutcome> {
        if let LinkTarget::Object(address) = target {
            return Ok(Ok(Object { file: Arc::clone(&group.file), address: *address }));
        }
        let Some(rest) = hops.checked_sub(1) else {
            return Ok(Err(format!("a link that leads to itself, or through more than {HOPS} others")));
        };
        *hops = rest;
        let (what, reached) = match target {
            LinkTarget::Path(path) => {
                let root = Object { address: group.file.root, file: Arc::clone(&group.file) };
                let start = if path.starts_with('/') { root } else { group.clone() };
                (format!("a link to `{}`", shortened(path)), self.walk(start, path, hops)?)
            }
            LinkTarget::Elsewhere { file, path } => {
                let reached = match self.other(file)? {
                    Ok(file) => self.walk(Object { address: file.root, file }, path, hops)?,
                    Err(why) => Err(why),
                };
                (format!("a link to `{}` in the file `{}`", shortened(path), shortened(file)), reached)
            }
            LinkTarget::Other | LinkTarget::Object(_) => {
                return Ok(Err("a link of a kind that only the program which made it follows".to_owned()));
            }
        };
        // Of links that lead to links the last says it.
        let is_last = |why: &String| why.starts_with("which") || why.starts_with("and");
        Ok(reached.map_err(|why| if is_last(&why) { format!("{what}, {why}") } else { why }))
    }

    fn walk(&mut self, start: Object, path: &str, hops: &mut usize) -> Result<LinkOutcome> {
        let mut object = start;
        for name in path.split('/').filter(|name| !name.is_empty() && *name != ".") {
            let found = links(&object.file, &object.header()?)?;
            let Some(GroupLink { target, .. }) = found.into_iter().find(|link| link.name == name) else {
                return Ok(Err("which is not in the file".to_owned()));
            };
            match self.hop(&object, &target, hops)? {
                Ok(next) => object = next,
                nowhere => return Ok(nowhere),
            }
        }
        Ok(Ok(object))
    }

    /// Opens a file that a link names, beside the file that was opened or by its whole path; or says why it cannot.
    fn other(&mut self, name: &str) -> Result<Result<Arc<Hdf5File>, String>> {
        let Some(folder) = &self.folder else {
            return Ok(Err("and this file is not on a disk".to_owned()));
        };
        let beside = || Some(folder.join(Path::new(name).file_name()?));
        let candidates = [Some(folder.join(name)), beside()];
        let Some(path) = candidates.into_iter().flatten().find(|path| path.is_file()) else {
            return Ok(Err("which is not next to this one: put it there".to_owned()));
        };
        if let Some((_, file)) = self.others.iter().find(|(known, _)| *known == path) {
            return Ok(Ok(Arc::clone(file)));
        }
        let what = "the number of files that links lead into";
        limits::at_most(super::FORMAT, what, self.others.len() as u64 + 1, FILES)?;
        let source = SharedFile::open(&path)?;
        match Hdf5File::open(Arc::new(source), Some(path.clone())) {
            Ok(file) => {
                let file = Arc::new(file);
                self.others.push((path, Arc::clone(&file)));
                Ok(Ok(file))
            }
            Err(FormatError::Io(error)) => Err(error.into()),
            // What is in it is not told: it may be anything.
            Err(_) => Ok(Err("which is no HDF5 file that can be read".to_owned())),
        }
    }
}

/// A path for messages.
fn shortened(path: &str) -> String {
    const SHOWN: usize = 80;
    let mut text: String = path.chars().take(SHOWN).collect();
    if path.chars().nth(SHOWN).is_some() {
        text.push('…');
    }
    text
}
