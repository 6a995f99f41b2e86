//! The only table of a file, wherever it is.

use super::datatype::DatatypeKind;
use super::header::MessageKind as Message;
use super::links::{LinkTarget, is_group, links};
use super::objects::Object;
use super::{FORMAT, FoundDataset, Hdf5TableParts, OBJECTS, unsupported};
use crate::table_parts::only;
use crate::{Hints, OmittedPart, Result, limits};
use std::collections::VecDeque;

/// Where tables are: the path, the object, and whether it is a group of columns and not a dataset that is a table by itself.
type TablePlaces = Vec<(String, (Object, bool))>;

impl Hdf5TableParts {
    /// Takes the only table that there is.
    pub(super) fn find(&mut self, hints: &Hints) -> Result<()> {
        let mut places = self.places()?;
        let mut others = Vec::new();
        if let Some(root) = places.iter().position(|(path, _)| path == "/") {
            places.swap(0, root);
            // Datasets beside the columns are columns or left out themselves.
            let is_other =
                |(path, (_, is_group)): &(String, (Object, bool))| *is_group || path[1..].contains('/');
            others.extend(places.drain(1..).filter(is_other).map(|(path, _)| {
                let why = format!("a table of its own: write `group = \"{path}\"`");
                OmittedPart::new(path, why)
            }));
        }
        let Some((path, (object, is_group))) = only(FORMAT, places)? else {
            let remedy = "write one dataset of one axis for each column";
            let left_out = limits::list(&self.table.left_out);
            let which = if left_out.is_empty() { left_out } else { format!(" ({left_out})") };
            return Err(unsupported(format!("a file without a column of numbers{which}"), remedy));
        };
        // What was looked at on the way does not belong to it.
        self.table.left_out = others;
        if is_group {
            return self.add_group(&object, &path);
        }
        let header = object.header()?;
        self.add_table(&FoundDataset::look(object, header, &path)?, hints)
    }

    /// The groups with columns, and the datasets that are tables by themselves. Each group is looked into once, by
    /// whatever ways it is reached: links to what is above are no deeper.
    fn places(&mut self) -> Result<TablePlaces> {
        let mut places = Vec::new();
        let mut seen: Vec<Object> = Vec::new();
        let mut groups = VecDeque::from([(self.files.root(), String::new())]);
        // Where links lead is looked at after what is in its place.
        let mut linked: Vec<(Object, LinkTarget, String)> = Vec::new();
        let mut budget = OBJECTS;
        loop {
            let Some((group, path)) = groups.pop_front() else {
                let Some((group, target, path)) = linked.pop() else { return Ok(places) };
                let Ok(object) = self.files.follow(&group, &target)? else { continue };
                if is_group(&object.header()?) {
                    groups.push_back((object, path));
                }
                continue;
            };
            // A long path is one of many groups in each other.
            if path.len() > limits::TEXT_BYTES || seen.iter().any(|known| known.is(&group)) {
                continue;
            }
            seen.push(group.clone());
            let (mut has_columns, mut tables) = (false, Vec::new());
            for link in links(&group.file, &group.header()?)? {
                spend(&mut budget)?;
                let place = format!("{path}/{}", link.name);
                let Ok(object) = self.files.follow(&group, &link.target)? else { continue };
                // What is damaged is said where its group is read.
                let Ok(header) = object.header() else { continue };
                if is_group(&header) {
                    // What MATLAB hides.
                    if link.name.starts_with('#') {
                    } else if matches!(link.target, LinkTarget::Object(_)) {
                        groups.push_back((object, place));
                    } else {
                        linked.push((group.clone(), link.target, place));
                    }
                    continue;
                }
                if !header.has(Message::Layout) {
                    continue;
                }
                let Ok(found) = FoundDataset::look(object.clone(), header, &place) else { continue };
                match (&found.kind, &found.space.shape[..]) {
                    _ if found.of_matlab().is_some() => {
                        self.table
                            .left_out
                            .extend(found.of_matlab().map(|what| OmittedPart::new(place, what)));
                    }
                    _ if found.is_class("char") || found.space.count() == 1 => {}
                    (DatatypeKind::Number(_), [_] | [1, _] | [_, 1]) => has_columns = true,
                    (DatatypeKind::Fields { .. }, [_]) | (DatatypeKind::Number(_), [_, _]) => {
                        tables.push((place, (object, false)));
                    }
                    _ => {}
                }
            }
            // Beside columns, other tables are columns too, or left out and said to be.
            if has_columns {
                let path = if path.is_empty() { "/".to_owned() } else { path };
                places.push((path, (group, true)));
            } else {
                places.append(&mut tables);
            }
        }
    }
}

fn spend(budget: &mut usize) -> Result<()> {
    *budget = budget.checked_sub(1).ok_or_else(|| {
        let what = format!("a file of more than {OBJECTS} objects");
        unsupported(what, "write the path of the table in `group`")
    })?;
    Ok(())
}
