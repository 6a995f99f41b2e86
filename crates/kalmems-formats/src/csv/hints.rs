//! What an experiment file can say of a text.

/// How a text is to be read, where that cannot be told from it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CsvHints {
    /// What stands between the cells: `,`, `;`, `|`, a tab, or a blank for any number of blanks and tabs.
    pub separator: Option<char>,
    /// The decimal mark: `.` or `,`.
    pub decimal: Option<char>,
    /// The line of the names of the columns, counted from 1.
    pub header_line: Option<u64>,
    /// The line of the units, where they have one of their own.
    pub units_line: Option<u64>,
    /// The line of the first row, where it is not the one after the names and the units.
    pub first_row_line: Option<u64>,
}
