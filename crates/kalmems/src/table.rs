//! Figures of many runs, or of many recordings, as one tidy table.

#[cfg(feature = "parquet-results")]
use crate::parquet::{Cells, ParquetColumn, ParquetColumnKind, ParquetFile};
use kalmems_figures::guarded;
use std::io::{self, Write};

/// One row for each run, segment and estimator; one for a run without figures.
#[derive(Clone, Debug)]
pub(crate) struct TidyTable {
    pub(crate) columns: Vec<String>,
    /// The names of columns that hold words even where they look like numbers.
    pub(crate) words: Vec<String>,
    pub(crate) rows: Vec<TidyRow>,
    /// How many columns come before the figures.
    pub(crate) before: usize,
}

/// A row of the table.
#[derive(Clone, Debug)]
pub(crate) struct TidyRow {
    /// The run, counted from 0.
    pub(crate) run: u64,
    /// One per column; empty where there is nothing.
    pub(crate) cells: Vec<String>,
}

impl TidyTable {
    /// The place of a column.
    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }

    /// The places of the columns of figures that are numbers.
    pub(crate) fn is_number(&self, column: usize) -> bool {
        let mut cells =
            self.rows.iter().map(|line| line.cells[column].as_str()).filter(|cell| !cell.is_empty());
        !self.words.contains(&self.columns[column]) && cells.all(|cell| number(cell).is_some())
    }

    /// As Parquet, in one group of rows: figures are doubles and words are text, and a cell without anything is null.
    #[cfg(feature = "parquet-results")]
    pub(crate) fn write_parquet(&self, w: &mut dyn Write) -> io::Result<()> {
        let numbers: Vec<bool> = (0..self.columns.len()).map(|column| self.is_number(column)).collect();
        let kind =
            |is_number: bool| if is_number { ParquetColumnKind::Numbers } else { ParquetColumnKind::Words };
        let named = self.columns.iter().cloned().zip(&numbers);
        let columns: Vec<ParquetColumn> =
            named.map(|(name, is_number)| ParquetColumn { name, kind: kind(*is_number) }).collect();
        let mut file = ParquetFile::begin(Vec::new(), &columns)?;
        file.rows(numbers.iter().enumerate().map(|(column, is_number)| {
            let cells = self.rows.iter().map(|line| line.cells[column].as_str());
            if *is_number {
                Cells::Numbers(cells.map(number).collect())
            } else {
                Cells::Words(cells.map(|cell| (!cell.is_empty()).then_some(cell)).collect())
            }
        }))?;
        w.write_all(&file.finish()?)
    }

    pub(crate) fn write_csv(&self, w: &mut dyn Write) -> io::Result<()> {
        let mut csv = csv::Writer::from_writer(w);
        csv.write_record(self.columns.iter().map(|name| guarded(name).into_owned()))?;
        for line in &self.rows {
            csv.write_record(line.cells.iter().map(|cell| guarded(cell).into_owned()))?;
        }
        csv.flush()
    }
}

/// A cell as a number. Words such as `infinity` are none.
pub(crate) fn number(cell: &str) -> Option<f64> {
    let begins = cell.starts_with(|c: char| c.is_ascii_digit() || c == '-');
    if begins { cell.parse().ok() } else { None }
}

/// The columns of all rows; one that a row has alone stands behind that which it stands behind there.
pub(crate) fn union<N: Into<String> + AsRef<str>>(rows: impl Iterator<Item = Vec<N>>) -> Vec<String> {
    let mut columns: Vec<String> = Vec::new();
    for row in rows {
        if row.iter().map(AsRef::as_ref).eq(columns.iter().map(String::as_str)) {
            continue;
        }
        let mut next = 0;
        for name in row {
            let there = columns.iter().position(|column| *column == *name.as_ref());
            next = there.unwrap_or_else(|| {
                columns.insert(next, name.into());
                next
            }) + 1;
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_keep_the_order_of_the_rows() {
        let rows = ["a d", "a b d", "a b c d e", "d"].map(|names| names.split_whitespace().collect());
        assert_eq!(union(rows.into_iter()), ["a", "b", "c", "d", "e"]);
    }

    #[test]
    fn heads_and_cells_that_a_spreadsheet_would_compute_are_text() {
        let columns = ["=1+1", "+a", "-b", "@c", "d=1", "-0.5"].map(str::to_owned).to_vec();
        let cells = ["=2", "-2", "", "e", "@f", "+1e3"].map(str::to_owned).to_vec();
        let table =
            TidyTable { columns, words: Vec::new(), rows: vec![TidyRow { run: 0, cells }], before: 0 };
        let mut csv = Vec::new();
        table.write_csv(&mut csv).unwrap();
        let expected = "'=1+1,'+a,'-b,'@c,d=1,-0.5\n'=2,-2,,e,'@f,+1e3\n";
        assert_eq!(String::from_utf8(csv).unwrap(), expected);
    }

    #[test]
    fn words_are_no_numbers() {
        assert_eq!(
            ["1e-5", "-0.5", "3", "inf", "NaN", "infinity", "", "1 V"].map(number),
            [Some(1e-5), Some(-0.5), Some(3.0), None, None, None, None, None]
        );
    }
}
