//! Cells of tables that a spreadsheet may open.

use std::borrow::Cow;

/// A cell as a spreadsheet shows it: text that would be a formula there, such as the name of a recording that somebody else chose, begins with an
/// apostrophe.
pub fn guarded(cell: &str) -> Cow<'_, str> {
    let is_formula = cell.starts_with(['=', '+', '-', '@', '\t', '\r']) && cell.parse::<f64>().is_err();
    if is_formula { Cow::Owned(format!("'{cell}")) } else { Cow::Borrowed(cell) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_that_a_spreadsheet_would_compute_is_text() {
        for (cell, shown) in [
            ("=HYPERLINK(\"http://a\")", "'=HYPERLINK(\"http://a\")"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("+1+cmd|' /C calc'!A0", "'+1+cmd|' /C calc'!A0"),
            ("-scan", "'-scan"),
            ("-0.5", "-0.5"),
            ("-inf", "-inf"),
            ("+1e3", "+1e3"),
            ("monday=1", "monday=1"),
        ] {
            assert_eq!(guarded(cell), shown);
        }
    }
}
