//! The rooms of this crate stand in an order: each uses those before it, and none behind it. What crosses this order the
//! other way is found here by the paths that the sources name.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// From what knows nothing of the others to what knows all of them; the README of this crate says what each is.
const ORDER: [&str; 15] = [
    "topics",
    "progress",
    "signal",
    "fit",
    "recording",
    "inspect",
    "simulate",
    "circuit",
    "outlook",
    "estimate",
    "evaluate",
    "identify",
    "export",
    "rig",
    "lib",
];

/// All source files below a path.
fn sources(path: &Path, found: &mut Vec<PathBuf>) {
    if path.is_dir() {
        for entry in fs::read_dir(path).unwrap() {
            sources(&entry.unwrap().path(), found);
        }
    } else if path.extension().is_some_and(|ending| ending == "rs") {
        found.push(path.to_owned());
    }
}

/// The room that a file below `src` belongs to: its folder there, or its own name.
fn room_of(file: &Path, src: &Path) -> String {
    let below = file.strip_prefix(src).unwrap().components().next().unwrap();
    below.as_os_str().to_str().unwrap().trim_end_matches(".rs").to_owned()
}

/// The rooms that a source names by `crate::ROOM`, alone or in braces, outside of its comments.
fn named_by(source: &str) -> BTreeSet<String> {
    let code: Vec<&str> = source.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let code = code.join("\n");
    let is_name = |c: char| c.is_ascii_lowercase() || c == '_';
    let mut rooms = BTreeSet::new();
    for (start, path) in code.match_indices("crate::") {
        // The end of another crate's name is none.
        if code[..start].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = &code[start + path.len()..];
        let list = rest.strip_prefix('{').map(|inner| inner.split('}').next().unwrap_or_default());
        let most = if list.is_some() { usize::MAX } else { 1 };
        for part in list.unwrap_or(rest).split(',').take(most) {
            let name: String = part.trim().chars().take_while(|c| is_name(*c)).collect();
            rooms.insert(name);
        }
    }
    rooms.remove("");
    rooms
}

#[test]
fn every_room_uses_those_before_it_alone() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let place = |room: &str| ORDER.iter().position(|known| *known == room);
    let mut files = Vec::new();
    sources(&src, &mut files);
    assert!(files.len() > 100, "{} files below {}", files.len(), src.display());
    let mut against = Vec::new();
    for file in &files {
        let room = room_of(file, &src);
        let here =
            place(&room).unwrap_or_else(|| panic!("`{room}` has no place in the order: {}", file.display()));
        for named in named_by(&fs::read_to_string(file).unwrap()) {
            if place(&named).is_some_and(|there| there > here) {
                against.push(format!("{}: {room} uses {named}", file.strip_prefix(&src).unwrap().display()));
            }
        }
    }
    assert!(against.is_empty(), "against the order of the rooms:\n{}", against.join("\n"));
}

#[test]
fn a_use_against_the_order_is_found_however_it_is_written() {
    let rooms = |source: &str| named_by(source).into_iter().collect::<Vec<_>>();
    assert_eq!(rooms("use crate::rig::Rig;"), ["rig"]);
    assert_eq!(rooms("use crate::{evaluate::Reference, units};"), ["evaluate", "units"]);
    assert_eq!(rooms("let x = crate::estimate::answers();"), ["estimate"]);
    assert_eq!(rooms("/// See [`crate::rig::Rig`].\n//! crate::rig\nuse kalmems_core::Filter;"), [""; 0]);
}
