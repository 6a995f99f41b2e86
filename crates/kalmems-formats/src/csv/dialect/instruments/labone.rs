//! Zurich Instruments' LabOne: `chunk;timestamp;x;y;…` or `timestamp;value`, with times in ticks of the device's clock.

use super::{DialectSearch, TextBeginning, columns};
use crate::FormatError;

/// What a file of samples does not say is the unit of its values, and how long a tick of its times is.
pub(super) fn find(text: &TextBeginning) -> DialectSearch {
    let chunks = text.cell(0) == "chunk";
    if text.cell(usize::from(chunks)) != "timestamp" || !chunks && text.separator != b';' {
        return None;
    }
    if text.cells.iter().any(|name| name == "fieldname") {
        return Some(Err(FormatError::Unsupported {
            format: "CSV",
            what: "a LabOne file with a line for each field, such as sweeps are saved in,".to_owned(),
            remedy: "save samples (`chunk;timestamp;x;y;…`), or as HDF5".to_owned(),
        }));
    }
    let (names, _) = text.filled(0);
    let units: Vec<String> =
        names.iter().map(|name| if name == "freq" { "Hz" } else { "" }.to_owned()).collect();
    let units_of = "no units, times in ticks of the device's clock";
    let mut found = text.found("LabOne (Zurich Instruments)", 0, 1, columns(&names, &units), units_of);
    found.cells = names.len();
    Some(Ok(found))
}
