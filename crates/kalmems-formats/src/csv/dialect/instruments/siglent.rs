//! Siglent: lines of settings, then `Second,Volt,Volt`.

use super::{DialectSearch, TextBeginning, columns};

/// The channels stand in `Source,CH1,CH2` in newer ones, in `Vertical Scale,CH1: 0.05,CH2: 1.0` in older.
pub(super) fn find(text: &TextBeginning) -> DialectSearch {
    if text.cell(0) != "Record Length" || !text.cell(1).starts_with("Analog") {
        return None;
    }
    let header = text.head.find("Second", text.separator)?;
    let (units, _) = text.filled(header);
    let sources = text.values("Source").unwrap_or_else(|| {
        let scales = text.values("Vertical Scale").unwrap_or_default();
        scales.iter().filter_map(|scale| Some(scale.split_once(':')?.0.trim().to_owned())).collect()
    });
    let mut names = vec!["time".to_owned()];
    names.extend(sources.into_iter().filter(|name| !name.is_empty()));
    if names.len() != units.len() {
        names = (0..units.len())
            .map(|i| if i == 0 { "time".to_owned() } else { format!("column_{}", i + 1) })
            .collect();
    }
    let line = text.head.number(header);
    let columns = columns(&names, &units);
    Some(Ok(text.found(
        "a Siglent oscilloscope",
        header,
        header + 1,
        columns,
        format!("units in line {line}"),
    )))
}
