//! A reproduction as tables, for the page and for the terminal.

use super::{Item, ItemHead, Reproduction};
use kalmems_figures::{ColumnHead, TextTable};

/// Places in the papers that a row names; the section of an item names all of them.
const NAMED: usize = 3;

/// One row per item: what came of it, and, where there is room, the figure that says why.
pub fn summary_table(reproduction: &Reproduction, with_reasons: bool) -> TextTable {
    let reasons = with_reasons.then_some("the figure that says why");
    let columns = ["table or figure", "about", "verdict"].into_iter().chain(reasons);
    let mut table = TextTable::new("", columns.map(ColumnHead::text));
    for item in &reproduction.items {
        let labels = |head: &ItemHead| {
            let labels = head.places.iter().map(|place| format!("{} {}", place.paper, place.label));
            let named: Vec<String> = labels.take(NAMED).collect();
            match head.places.len() - named.len() {
                0 => named.join(", "),
                more => format!("{} and {more} more", named.join(", ")),
            }
        };
        let cells = [labels(item.head), item.head.title.to_owned(), item.verdict().words().to_owned()];
        table.push(cells.into_iter().chain(with_reasons.then(|| item.why())));
    }
    table
}

/// One row per check of an item: the paper beside ours.
pub fn checks_table(item: &Item) -> TextTable {
    let [paper, ours] = item.head.origin.heads();
    let columns = ["quantity", paper, ours, "comparison", "criterion"].map(ColumnHead::text);
    let mut table = TextTable::new("", columns);
    for check in &item.checks {
        table.push([check.subject(), check.paper(), check.ours(), check.comparison(), check.criterion()]);
    }
    table
}
