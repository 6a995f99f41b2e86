//! Single files: pictures, and what a stream writes.

use crate::OutputError;
use crate::exchange::sync_folder;
use crate::sealed::checksum_of;
use crate::staging::{free, previous};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Writes a picture as SVG, whole or not at all. It ends with a comment that says that the program made it.
///
/// Only a picture that the program made and nobody changed since is replaced; another regular file is put aside as
/// `PATH.previous` with `force`. Anything else, such as a device, a pipe or a link, is refused.
pub fn write_picture(path: &Path, svg: &str, force: bool) -> Result<(), OutputError> {
    write_marked(path, svg, ".svg", "there and is no picture that kalmems made and nobody changed", force)
}

/// Writes a page as HTML by the rules of [`write_picture`].
pub fn write_page(path: &Path, html: &str, force: bool) -> Result<(), OutputError> {
    write_marked(path, html, ".html", "there and is no page that kalmems made and nobody changed", force)
}

/// The comment behind a text.
fn comment(text: &[u8]) -> String {
    format!("\n<!-- kalmems {} -->\n", checksum_of(text))
}

/// Whether a text says that the program made it, and is as it was then.
fn is_own(text: &[u8]) -> bool {
    let at = text.len().saturating_sub(comment(&[]).len());
    text.get(..at).is_some_and(|before| text.get(at..) == Some(comment(before).as_bytes()))
}

fn write_marked(
    path: &Path,
    text: &str,
    suffix: &str,
    what: &'static str,
    force: bool,
) -> Result<(), OutputError> {
    let error = |source| OutputError::Io { path: path.to_owned(), source };
    let replaces = match standing(path)? {
        Some(there) if fs::read(&there).is_ok_and(|there| is_own(&there)) => true,
        Some(_) => put_aside(path, force, what)?,
        None => false,
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Beside its place first, so that there is never half of it.
    let staged = tempfile::Builder::new().prefix(".kalmems-").suffix(suffix).tempfile_in(folder);
    let mut staged = staged.map_err(error)?;
    let marked = [text, &comment(text.as_bytes())].concat();
    staged.write_all(marked.as_bytes()).and_then(|()| staged.as_file().sync_all()).map_err(error)?;
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // A temporary file is its owner's alone, what is written for a reader is not.
        staged.as_file().set_permissions(fs::Permissions::from_mode(0o644)).map_err(error)?;
    }
    let placed = if replaces { staged.persist(path) } else { staged.persist_noclobber(path) };
    placed.map_err(|e| error(e.error))?;
    sync_folder(folder).map_err(error)
}

/// Begins a file that is written as samples come. What the program wrote there before, by `is_own` of its first bytes, is
/// kept as `PATH.previous`, and so is another regular file with `force`; anything else is refused.
pub fn create_file(path: &Path, is_own: impl Fn(&[u8]) -> bool, force: bool) -> Result<File, OutputError> {
    const BEGINNING: u64 = 4096;
    let error = |source| OutputError::Io { path: path.to_owned(), source };
    if let Some(there) = standing(path)? {
        let mut beginning = Vec::new();
        File::open(&there)
            .and_then(|file| file.take(BEGINNING).read_to_end(&mut beginning))
            .map_err(error)?;
        let own = beginning.is_empty() || is_own(&beginning);
        put_aside(path, own || force, "there and was not written by kalmems")?;
    }
    OpenOptions::new().write(true).create_new(true).open(path).map_err(error)
}

/// The regular file that stands at a path; `None` where nothing does.
fn standing(path: &Path) -> Result<Option<PathBuf>, OutputError> {
    let refuse = |what| {
        let remedy = "give the path of a regular file, or of none";
        Err(OutputError::File { path: path.to_owned(), what, remedy })
    };
    match fs::symlink_metadata(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(source) => Err(OutputError::Io { path: path.to_owned(), source }),
        Ok(there) if there.is_file() => Ok(Some(path.to_owned())),
        Ok(there) if there.is_symlink() => refuse("a link"),
        Ok(there) if there.is_dir() => refuse("a folder"),
        Ok(_) => refuse("a device, a pipe or a socket"),
    }
}

/// Puts a regular file aside, if that is wanted; it is not replaced then.
fn put_aside(path: &Path, wanted: bool, what: &'static str) -> Result<bool, OutputError> {
    if !wanted {
        let remedy = "give another path, or --force to keep the file next to it, as PATH.previous";
        return Err(OutputError::File { path: path.to_owned(), what, remedy });
    }
    keep_aside(path).map_err(|source| OutputError::Io { path: path.to_owned(), source })?;
    Ok(false)
}

/// Gives a file the name `PATH.previous`, or that with the next number, where it is not replaced; the name.
pub fn keep_aside(path: &Path) -> io::Result<PathBuf> {
    let kept = previous(path);
    let kept = if fs::symlink_metadata(&kept).is_ok() { free(&kept, "-") } else { kept };
    fs::rename(path, &kept)?;
    Ok(kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_nobody_changed_is_replaced_and_another_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.html");
        write_page(&path, "<p>one</p>", false).unwrap();
        write_page(&path, "<p>two</p>", false).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.starts_with("<p>two</p>\n<!-- kalmems "));
        fs::write(&path, text.replace("two", "six")).unwrap();
        assert!(write_page(&path, "<p>three</p>", false).is_err());
        write_page(&path, "<p>three</p>", true).unwrap();
        assert!(fs::read_to_string(folder.path().join("a.html.previous")).unwrap().contains("six"));
    }

    #[test]
    fn a_picture_stays_one_with_its_mark_and_replaces_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.svg");
        write_picture(&path, "<svg>1</svg>", false).unwrap();
        let marked = fs::read_to_string(&path).unwrap();
        assert!(marked.starts_with("<svg>1</svg>\n<!-- kalmems "));
        // One's own, untouched: replaced. Touched, or somebody's: refused, and kept with force.
        write_picture(&path, "<svg>2</svg>", false).unwrap();
        for theirs in [marked.trim_end(), "<svg>4</svg>", "thesis"] {
            fs::write(&path, theirs).unwrap();
            assert!(matches!(write_picture(&path, "<svg>5</svg>", false), Err(OutputError::File { .. })));
            assert_eq!(fs::read_to_string(&path).unwrap(), theirs);
        }
        write_picture(&path, "<svg>5</svg>", true).unwrap();
        assert_eq!(fs::read(folder.path().join("a.svg.previous")).unwrap(), b"thesis");
        fs::write(&path, "second thesis").unwrap();
        write_picture(&path, "<svg>6</svg>", true).unwrap();
        assert_eq!(fs::read(folder.path().join("a.svg.previous-2")).unwrap(), b"second thesis");
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_regular_file_is_refused_even_with_force() {
        let folder = tempfile::tempdir().unwrap();
        let (link, there) = (folder.path().join("link"), folder.path().join("there"));
        fs::write(&there, "").unwrap();
        std::os::unix::fs::symlink(&there, &link).unwrap();
        for path in [&link, Path::new("/dev/null"), folder.path()] {
            for force in [false, true] {
                assert!(matches!(write_picture(path, "<svg/>", force), Err(OutputError::File { .. })));
                assert!(matches!(create_file(path, |_| true, force), Err(OutputError::File { .. })));
            }
        }
        assert!(link.is_symlink());
    }

    #[test]
    fn what_a_stream_wrote_before_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lines");
        let own = |beginning: &[u8]| beginning.starts_with(b"# ours");
        create_file(&path, own, false).unwrap().write_all(b"# ours, first").unwrap();
        create_file(&path, own, false).unwrap().write_all(b"theirs").unwrap();
        assert_eq!(fs::read(folder.path().join("lines.previous")).unwrap(), b"# ours, first");
        assert!(create_file(&path, own, false).is_err());
        create_file(&path, own, true).unwrap();
        assert_eq!(fs::read(folder.path().join("lines.previous-2")).unwrap(), b"theirs");
    }
}
