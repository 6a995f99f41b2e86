//! A table in the letters of a terminal, as wide as that.

use crate::table::TextTable;
use crate::text::printable;

/// Between two columns.
const GAP: usize = 2;
/// Columns that stay if others have no room.
const VERDICTS: [&str; 2] = ["verdict", "agrees"];
/// A column of words is not made narrower than this.
const NARROW: usize = 10;

pub(crate) fn written(table: &TextTable, limit: usize) -> String {
    let mut columns: Vec<PrintedColumn> =
        (0..table.width()).map(|column| PrintedColumn::of(table, column)).collect();
    let mut left_out = Vec::new();
    if width(&columns) > limit {
        columns.iter_mut().for_each(PrintedColumn::wrap_head);
    }
    for label in &table.expendable {
        if width(&columns) <= limit {
            break;
        }
        let place = columns.iter().position(|column| column.label == *label);
        left_out.extend(place.map(|place| columns.remove(place).whole_head));
    }
    // As many as have room with cells of words as narrow as they may be; the last ones go first.
    while columns.len() > 2 && narrowest(&columns) > limit {
        let place = columns.iter().rposition(|column| !column.is_verdict).unwrap_or(columns.len() - 1);
        left_out.push(columns.remove(place).whole_head);
    }
    while width(&columns) > limit {
        let words = columns.iter_mut().filter(|column| !column.is_numeric && column.width > NARROW);
        let Some(widest) = words.max_by_key(|column| column.width) else { break };
        widest.width -= 1;
    }
    let mut out = String::new();
    if !table.caption.is_empty() {
        out.push_str(&plain(&table.caption));
        out.push('\n');
    }
    if !columns.is_empty() {
        out.push_str(&line(&columns, |column| column.head.clone()));
        let rule: Vec<String> = columns.iter().map(|column| "─".repeat(column.width)).collect();
        out.push_str(&format!("{}\n", rule.join("  ")));
    }
    for row in 0..table.rows.len() {
        out.push_str(&line(&columns, |column| column.cell(row)));
    }
    if !left_out.is_empty() {
        out.push_str(&format!(
            "(without the columns {}, for which the terminal is too narrow)\n",
            left_out.join(", ")
        ));
    }
    out
}

/// A column as it is printed.
struct PrintedColumn {
    label: String,
    whole_head: String,
    /// Line by line.
    head: Vec<String>,
    cells: Vec<String>,
    is_numeric: bool,
    is_verdict: bool,
    width: usize,
}

impl PrintedColumn {
    fn of(table: &TextTable, column: usize) -> Self {
        let whole_head = plain(&table.head(column));
        let cell = |row: &Vec<String>| row.get(column).map_or_else(String::new, |text| plain(text));
        let cells: Vec<String> = table.rows.iter().map(cell).collect();
        let width = cells.iter().chain([&whole_head]).map(|text| length(text)).max().unwrap_or(0);
        let label = table.columns.get(column).map_or_else(String::new, |head| head.label.clone());
        let is_numeric = table.is_numeric(column);
        let is_verdict = VERDICTS.contains(&label.as_str());
        Self { label, head: vec![whole_head.clone()], whole_head, cells, is_numeric, is_verdict, width }
    }

    /// Over several lines, as wide as its longest word or its widest cell.
    fn wrap_head(&mut self) {
        let word = self.whole_head.split(' ').map(length).max().unwrap_or(0);
        self.width = self.cells.iter().map(|text| length(text)).chain([word]).max().unwrap_or(0);
        self.head = wrapped(&self.whole_head, self.width);
    }

    /// A cell line by line.
    fn cell(&self, row: usize) -> Vec<String> {
        self.cells.get(row).map_or_else(Vec::new, |text| wrapped(text, self.width))
    }
}

fn width(columns: &[PrintedColumn]) -> usize {
    columns.iter().map(|column| column.width).sum::<usize>() + GAP * columns.len().saturating_sub(1)
}

/// The width with each column of words as narrow as it may be.
fn narrowest(columns: &[PrintedColumn]) -> usize {
    let of = |column: &PrintedColumn| if column.is_numeric { column.width } else { column.width.min(NARROW) };
    columns.iter().map(of).sum::<usize>() + GAP * columns.len().saturating_sub(1)
}

/// Cells next to one another, over as many lines as the longest has.
fn line(columns: &[PrintedColumn], of: impl Fn(&PrintedColumn) -> Vec<String>) -> String {
    let cells: Vec<(&PrintedColumn, Vec<String>)> =
        columns.iter().map(|column| (column, of(column))).collect();
    let lines = cells.iter().map(|(_, lines)| lines.len()).max().unwrap_or(0).max(1);
    let of_line = |place: usize| {
        let padded = cells.iter().map(|(column, lines)| {
            let text = lines.get(place).map_or("", String::as_str);
            let room = " ".repeat(column.width.saturating_sub(length(text)));
            if column.is_numeric { room + text } else { text.to_owned() + &room }
        });
        format!("{}\n", padded.collect::<Vec<_>>().join("  ").trim_end())
    };
    (0..lines).map(of_line).collect()
}

/// Lines of at most so many characters, divided at spaces; a longer word is divided.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    if length(text) <= width {
        return vec![text.to_owned()];
    }
    let mut lines: Vec<String> = Vec::new();
    let mut last = String::new();
    for word in text.split(' ') {
        let mut word: Vec<char> = word.chars().collect();
        if !last.is_empty() && length(&last) + 1 + word.len() > width {
            lines.push(std::mem::take(&mut last));
        }
        while word.len() > width.max(1) {
            let rest = word.split_off(width.max(1));
            lines.push(word.into_iter().collect());
            word = rest;
        }
        if !last.is_empty() {
            last.push(' ');
        }
        last.extend(word);
    }
    lines.push(last);
    lines
}

/// One line, without anything that a terminal would obey.
fn plain(text: &str) -> String {
    text.chars().map(|c| if c == '\n' || c == '\t' { ' ' } else { printable(c) }).collect()
}

fn length(text: &str) -> usize {
    text.chars().count()
}

#[cfg(test)]
mod tests {
    use crate::{ColumnHead, TextTable};

    #[test]
    fn a_table_is_as_wide_as_its_terminal() {
        let table = TextTable::new(
            "",
            [
                ColumnHead::text("estimator"),
                ColumnHead::number("angle RMSE", "deg"),
                ColumnHead::number("phase RMSE", "deg"),
                ColumnHead::text("verdict"),
            ],
        )
        .with_expendable(&["phase RMSE"])
        .row(["EKF, stiffness as a state", "0.0181", "0.12", "passes with remarks"]);
        insta::assert_snapshot!(table.to_text_within(72), @r"
        estimator                   angle  phase  verdict
                                     RMSE   RMSE
                                    (deg)  (deg)
        ─────────────────────────  ──────  ─────  ───────────────────
        EKF, stiffness as a state  0.0181   0.12  passes with remarks
        ");
        let narrow = table.to_text_within(60);
        assert!(
            narrow
                .ends_with("(without the columns phase RMSE (deg), for which the terminal is too narrow)\n"),
            "{narrow}"
        );
        assert!(narrow.contains("EKF, stiffness as a state  0.0181  passes with remarks"), "{narrow}");
        let narrower = table.to_text_within(40);
        assert!(
            narrower.contains("\nEKF, stiffness ") && !narrower.contains("passes with remarks"),
            "{narrower}"
        );
        for limit in 40..100 {
            assert!(
                table
                    .to_text_within(limit)
                    .lines()
                    .filter(|line| !line.starts_with('('))
                    .all(|line| line.chars().count() <= limit)
            );
        }
        assert_eq!(table.to_text_within(200), table.to_text());
    }

    #[test]
    fn without_a_stated_order_the_last_columns_go_first_and_the_verdict_stays() {
        let heads = ["a", "b", "c", "d", "e"].map(|head| ColumnHead::number(head, ""));
        let table = TextTable::new("", heads.into_iter().chain([ColumnHead::text("verdict")]));
        let table =
            table.row(["1234567890", "1234567890", "1234567890", "1234567890", "1234567890", "doubtful"]);
        let narrow = table.to_text_within(40);
        assert!(narrow.starts_with("         a           b  verdict\n"), "{narrow}");
        assert!(
            narrow.ends_with("(without the columns e, d, c, for which the terminal is too narrow)\n"),
            "{narrow}"
        );
    }
}
