//! A table or a figure of a paper.

use super::check::{Check, ItemVerdict, decisive};
use kalmems_figures::{Figure, TextTable};
use serde::Serialize;

/// Where something stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct PaperPlace {
    /// The short name of the paper, as its [`Paper`](super::Paper) has it.
    pub paper: &'static str,
    /// Such as `TextTable III` or `Figure 5.9`.
    pub label: &'static str,
    /// The page, or what else finds it, as far as it is known; empty if it is not.
    pub page: &'static str,
}

impl PaperPlace {
    /// `S TextTable III (section IV-B)`.
    pub fn to_text(&self) -> String {
        let page = if self.page.is_empty() { String::new() } else { format!(" ({})", self.page) };
        format!("{} {}{page}", self.paper, self.label)
    }

    /// Whether this is what `asked` means: the label, or paper and label, whatever the case of the letters.
    pub(super) fn is_called(&self, asked: &str) -> bool {
        let whole = format!("{} {}", self.paper, self.label);
        asked.eq_ignore_ascii_case(self.label) || asked.eq_ignore_ascii_case(&whole)
    }
}

/// Whether an item is a table or a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ItemKind {
    /// Numbers in rows, or in the text.
    Table,
    /// A picture.
    Figure,
}

/// What the paper's values are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ValueOrigin {
    /// Measured on the authors' hardware.
    Measured,
    /// Calculated by the authors.
    Computed,
    /// Said in the text, drawn for illustration, or taken from a data sheet or the settings of an experiment.
    Stated,
}

impl ValueOrigin {
    /// What stands over the paper's values and over ours.
    pub(super) fn heads(self) -> [&'static str; 2] {
        match self {
            Self::Measured => ["paper (measured on the authors' hardware)", "ours (simulated)"],
            Self::Computed => ["paper (calculated by the authors)", "ours (computed)"],
            Self::Stated => ["paper (as it states it)", "ours (simulated)"],
        }
    }
}

/// What is known of an item before anything is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ItemHead {
    /// A short name for files, such as `table-iii`.
    pub key: &'static str,
    /// What it is about.
    pub title: &'static str,
    /// Table or figure.
    pub kind: ItemKind,
    /// Where the papers show it.
    pub places: &'static [PaperPlace],
    /// What the papers' values are.
    pub origin: ValueOrigin,
}

impl ItemHead {
    /// All places, separated by semicolons.
    pub fn source(&self) -> String {
        self.places.iter().map(PaperPlace::to_text).collect::<Vec<_>>().join("; ")
    }
}

/// A table or figure of a paper beside ours.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// What it is.
    pub head: &'static ItemHead,
    /// What the paper says against what was computed; the verdict follows from them.
    pub checks: Vec<Check>,
    /// What it means, and under which conditions ours was computed.
    pub remarks: Vec<String>,
    /// More tables: settings, values that the papers do not give.
    pub tables: Vec<TextTable>,
    /// Pictures, their names beginning with the head's key.
    pub figures: Vec<Figure>,
    /// Pictures of pixels for the page: a PNG file each, and what it shows.
    pub pictures: Vec<(Vec<u8>, String)>,
}

impl Item {
    /// An item with nothing in it yet.
    pub fn new(head: &'static ItemHead) -> Self {
        Self {
            head,
            checks: Vec::new(),
            remarks: Vec::new(),
            tables: Vec::new(),
            figures: Vec::new(),
            pictures: Vec::new(),
        }
    }

    /// Adds a check.
    #[must_use]
    pub fn check(mut self, check: Check) -> Self {
        self.checks.push(check);
        self
    }

    /// Adds a remark.
    #[must_use]
    pub fn remark(mut self, remark: impl Into<String>) -> Self {
        self.remarks.push(remark.into());
        self
    }

    /// Adds a table.
    #[must_use]
    pub fn table(mut self, table: TextTable) -> Self {
        self.tables.push(table);
        self
    }

    /// Adds a figure.
    #[must_use]
    pub fn figure(mut self, figure: Figure) -> Self {
        self.figures.push(figure);
        self
    }

    /// Adds a picture of pixels, a PNG file, with what it shows.
    #[must_use]
    pub fn picture(mut self, png: Vec<u8>, shows: impl Into<String>) -> Self {
        self.pictures.push((png, shows.into()));
        self
    }

    /// What came of it.
    pub fn verdict(&self) -> ItemVerdict {
        ItemVerdict::of(&self.checks)
    }

    /// The figure that says why: the check that is furthest off.
    pub fn why(&self) -> String {
        decisive(&self.checks).map_or_else(
            || "nothing was compared".to_owned(),
            |check| {
                let (subject, paper, ours) = (check.subject(), check.paper(), check.ours());
                match check {
                    Check::Value { .. } => {
                        format!("{subject}: {} (paper {paper}, ours {ours})", check.comparison())
                    }
                    Check::Claim { .. } => format!("{subject}: paper {paper}; ours {ours}"),
                }
            },
        )
    }
}
