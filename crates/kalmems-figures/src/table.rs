//! Tables, for the page and for the terminal.

use crate::page::NoticeSeverity;
use crate::significant::with_short_numbers;
use crate::text::with_unit;

/// The head of a column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnHead {
    /// What stands in it.
    pub label: String,
    /// Its unit, such as `deg`; empty for none.
    pub unit: String,
    /// Whether it holds numbers, which are aligned on the right.
    pub numeric: bool,
}

impl ColumnHead {
    /// A column of words.
    pub fn text(label: impl Into<String>) -> Self {
        Self { label: label.into(), unit: String::new(), numeric: false }
    }

    /// A column of numbers.
    pub fn number(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), unit: unit.into(), numeric: true }
    }

    /// Label and unit as printed: `rms error (deg)`.
    pub fn head(&self) -> String {
        with_unit(&self.label, &self.unit)
    }
}

/// Columns and rows of text; numbers are formatted by whoever knows their precision.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TextTable {
    /// A line above it; empty for none.
    pub caption: String,
    /// From left to right.
    pub columns: Vec<ColumnHead>,
    /// From top to bottom. A cell that is missing is empty; one beyond the columns stands there all the same.
    pub rows: Vec<Vec<String>>,
    /// The column of verdicts, and how serious that of each row is.
    verdicts: Option<(usize, Vec<NoticeSeverity>)>,
    /// What each row is called where a page leads to it.
    anchors: Vec<String>,
    /// The labels of columns that a narrow terminal does without, the first ones first.
    pub(crate) expendable: Vec<String>,
}

impl TextTable {
    /// A table without rows yet.
    pub fn new(caption: impl Into<String>, columns: impl IntoIterator<Item = ColumnHead>) -> Self {
        Self {
            caption: caption.into(),
            columns: columns.into_iter().collect(),
            rows: Vec::new(),
            verdicts: None,
            anchors: Vec::new(),
            expendable: Vec::new(),
        }
    }

    /// On a page, names each row so that figures can lead to it (see [`SeriesLink`](crate::SeriesLink)).
    #[must_use]
    pub fn with_anchors(mut self, anchors: Vec<String>) -> Self {
        self.anchors = anchors;
        self
    }

    /// The name of a row.
    pub(crate) fn anchor(&self, row: usize) -> Option<&str> {
        self.anchors.get(row).map(String::as_str)
    }

    /// On a page, the column of this name stands second, where no width hides it, and its cells show how serious each is. Without
    /// such a column nothing changes.
    #[must_use]
    pub fn with_verdicts(
        mut self,
        label: &str,
        severities: impl IntoIterator<Item = NoticeSeverity>,
    ) -> Self {
        let column = self.columns.iter().position(|column| column.label == label);
        self.verdicts = column.map(|column| (column, severities.into_iter().collect()));
        self
    }

    /// The columns as a page has them.
    pub(crate) fn order(&self) -> impl Iterator<Item = usize> + '_ {
        let verdict = self.verdicts.as_ref().map(|(column, _)| *column);
        let others = (0..self.width()).filter(move |column| Some(*column) != verdict);
        let first = others.clone().take(1);
        first.chain(verdict).chain(others.skip(1))
    }

    /// How serious a cell is, if it is a verdict and not empty.
    pub(crate) fn grade(&self, row: usize, column: usize) -> Option<NoticeSeverity> {
        let (verdict, severities) = self.verdicts.as_ref()?;
        let is_said = self.rows.get(row)?.get(column).is_some_and(|cell| !cell.is_empty());
        (*verdict == column && is_said).then(|| severities.get(row).copied())?
    }

    /// Adds a row. Numbers of too many digits to count get an exponent.
    pub fn push<C: Into<String>>(&mut self, cells: impl IntoIterator<Item = C>) {
        let cell = |(column, cell): (usize, C)| {
            let cell: String = cell.into();
            if self.is_numeric(column) { with_short_numbers(&cell) } else { cell }
        };
        let row = cells.into_iter().enumerate().map(cell).collect();
        self.rows.push(row);
    }

    /// Adds a row.
    #[must_use]
    pub fn row<C: Into<String>>(mut self, cells: impl IntoIterator<Item = C>) -> Self {
        self.push(cells);
        self
    }

    /// How many columns there are, counting the longest row.
    pub(crate) fn width(&self) -> usize {
        self.rows.iter().map(Vec::len).chain([self.columns.len()]).max().unwrap_or(0)
    }

    pub(crate) fn is_numeric(&self, column: usize) -> bool {
        self.columns.get(column).is_some_and(|c| c.numeric)
    }

    pub(crate) fn head(&self, column: usize) -> String {
        self.columns.get(column).map(ColumnHead::head).unwrap_or_default()
    }

    /// Columns that are left out first where the width does not suffice for all, in this order.
    #[must_use]
    pub fn with_expendable(mut self, labels: &[&str]) -> Self {
        self.expendable = labels.iter().map(|label| (*label).to_owned()).collect();
        self
    }

    /// Aligned with spaces, with a rule below the head, and a line break at the end.
    pub fn to_text(&self) -> String {
        self.to_text_within(usize::MAX)
    }

    /// The same in lines of at most so many characters, if two columns have room in them. Heads are wrapped first; then columns are left out, as
    /// [`with_expendable`](Self::with_expendable) has them and then the last ones, and named below; then the cells of words are wrapped.
    pub fn to_text_within(&self, columns: usize) -> String {
        crate::text_table::written(self, columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let table = TextTable::new(
            "Errors against the reference",
            [
                ColumnHead::text("filter"),
                ColumnHead::number("rms error", "deg"),
                ColumnHead::number("χ²", ""),
            ],
        )
        .row(["extended", "0.0123", "1.02"])
        .row(["steady state", "12.1"])
        .row(["µ\u{1b}[2J", "−0.5", "1", "beyond"]);
        insta::assert_snapshot!(table.to_text(), @r"
        Errors against the reference
        filter        rms error (deg)    χ²
        ────────────  ───────────────  ────  ──────
        extended               0.0123  1.02
        steady state             12.1
        µ�[2J                    −0.5     1  beyond
        ");
    }

    #[test]
    fn an_empty_table_is_its_caption() {
        assert_eq!(TextTable::new("nothing", []).to_text(), "nothing\n");
        assert_eq!(TextTable::default().to_text(), "");
        assert_eq!(TextTable::new("", [ColumnHead::text("a")]).to_text(), "a\n─\n");
    }
}
