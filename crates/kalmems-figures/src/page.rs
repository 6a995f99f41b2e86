//! The report page: one HTML file that needs nothing else.

use crate::error::ReportError;
use crate::figure::Figure;
use crate::table::Table;
use minijinja::{Environment, Value, context};

const TEMPLATE: &str = include_str!("page.html");

/// A report.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// What is reported on.
    pub title: String,
    /// A line below it; empty for none.
    pub subtitle: String,
    /// From top to bottom.
    pub sections: Vec<Section>,
}

/// A part of a page with a heading.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// The heading; empty for none.
    pub title: String,
    /// From top to bottom.
    pub blocks: Vec<Block>,
}

/// How serious a notice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// A check passed.
    Ok,
    /// The reader should know.
    Note,
    /// The result is in doubt. Warnings are repeated at the top of the page.
    Warning,
    /// The result is wrong, or there is none. Repeated likewise.
    Failure,
}

/// A piece of a section. All text is plain text.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// Running text.
    Paragraph(String),
    /// A verdict that must not be missed.
    Notice {
        /// How serious it is.
        severity: Severity,
        /// What it says.
        text: String,
    },
    /// Names and values.
    KeyValues(Vec<(String, String)>),
    /// A table.
    Table(Table),
    /// A numbered figure with its caption.
    Figure(Figure),
    /// Text to be shown as it is, folded away until it is asked for.
    Preformatted {
        /// What the reader sees before it is unfolded.
        summary: String,
        /// The text.
        text: String,
    },
}

impl Page {
    /// A page without sections yet.
    pub fn new(title: impl Into<String>, subtitle: impl Into<String>) -> Self {
        Self { title: title.into(), subtitle: subtitle.into(), sections: Vec::new() }
    }

    /// Adds a section.
    #[must_use]
    pub fn with(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// The page as HTML. The same page gives the same bytes.
    pub fn to_html(&self) -> Result<String, ReportError> {
        let mut environment = Environment::new();
        // The ending tells that values are escaped.
        environment.add_template("page.html", TEMPLATE)?;
        let mut numbers = Numbers::default();
        let sections: Vec<Value> = self
            .sections
            .iter()
            .map(|section| {
                let blocks: Vec<Value> = section.blocks.iter().map(|b| numbers.block(b)).collect();
                context! { title => section.title.as_str(), blocks => blocks }
            })
            .collect();
        let page = context! {
            title => self.title.as_str(),
            subtitle => self.subtitle.as_str(),
            warnings => numbers.warnings,
            sections => sections,
        };
        Ok(environment.get_template("page.html")?.render(page)?)
    }
}

impl Section {
    /// A section without content yet.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), blocks: Vec::new() }
    }

    /// Adds any block.
    #[must_use]
    pub fn with(mut self, block: Block) -> Self {
        self.blocks.push(block);
        self
    }

    /// Adds running text.
    #[must_use]
    pub fn paragraph(self, text: impl Into<String>) -> Self {
        self.with(Block::Paragraph(text.into()))
    }

    /// Adds a verdict.
    #[must_use]
    pub fn notice(self, severity: Severity, text: impl Into<String>) -> Self {
        self.with(Block::Notice { severity, text: text.into() })
    }

    /// Adds names and values.
    #[must_use]
    pub fn key_values<K: Into<String>, V: Into<String>>(
        self,
        pairs: impl IntoIterator<Item = (K, V)>,
    ) -> Self {
        self.with(Block::KeyValues(pairs.into_iter().map(|(k, v)| (k.into(), v.into())).collect()))
    }

    /// Adds a table.
    #[must_use]
    pub fn table(self, table: Table) -> Self {
        self.with(Block::Table(table))
    }

    /// Adds a figure.
    #[must_use]
    pub fn figure(self, figure: Figure) -> Self {
        self.with(Block::Figure(figure))
    }

    /// Adds text that is folded away.
    #[must_use]
    pub fn preformatted(self, summary: impl Into<String>, text: impl Into<String>) -> Self {
        self.with(Block::Preformatted { summary: summary.into(), text: text.into() })
    }
}

/// The beginning of a notice, up to where it goes into particulars.
fn brief(text: &str) -> &str {
    let ends = ["; ", ". "].iter().filter_map(|end| text.find(end));
    ends.min().and_then(|end| text.get(..end)).unwrap_or(text)
}

/// Plain text as HTML, what stands in backticks as code.
fn with_code(text: &str) -> Value {
    let escaped = |part: &str| {
        part.replace('&', "&amp;")
            .replace('<', "&lt;")
            .replace('>', "&gt;")
            .replace('"', "&quot;")
            .replace('\'', "&#x27;")
    };
    let parts: Vec<&str> = text.split('`').collect();
    // One without a partner is no mark.
    if parts.len().is_multiple_of(2) {
        return Value::from_safe_string(escaped(text));
    }
    let html = parts.iter().enumerate().map(|(index, part)| {
        if index % 2 == 1 { format!("<code>{}</code>", escaped(part)) } else { escaped(part) }
    });
    Value::from_safe_string(html.collect())
}

/// What is numbered throughout a page.
#[derive(Default)]
struct Numbers {
    figures: usize,
    warnings: Vec<Value>,
}

impl Numbers {
    fn block(&mut self, block: &Block) -> Value {
        match block {
            Block::Paragraph(text) => context! { kind => "paragraph", text => with_code(text) },
            Block::Notice { severity, text } => self.notice(*severity, text),
            Block::KeyValues(pairs) => context! { kind => "key-values", pairs },
            Block::Table(table) => table_value(table),
            Block::Figure(figure) => {
                self.figures += 1;
                context! {
                    kind => "figure",
                    number => self.figures,
                    caption => figure.caption.as_str(),
                    svg => Value::from_safe_string(figure.to_svg()),
                }
            }
            Block::Preformatted { summary, text } => context! { kind => "preformatted", summary, text },
        }
    }

    fn notice(&mut self, severity: Severity, text: &str) -> Value {
        let (severity, word) = match severity {
            Severity::Ok => ("ok", "OK"),
            Severity::Note => ("note", "Note"),
            Severity::Warning => ("warning", "Warning"),
            Severity::Failure => ("failure", "Failure"),
        };
        let mut anchor = None;
        if matches!(severity, "warning" | "failure") {
            let name = format!("warning-{}", self.warnings.len() + 1);
            self.warnings
                .push(context! { anchor => name.as_str(), text => with_code(brief(text)), severity });
            anchor = Some(name);
        }
        context! { kind => "notice", severity, word, text => with_code(text), anchor }
    }
}

fn table_value(table: &Table) -> Value {
    let class = |column| if table.is_numeric(column) { "number" } else { "text" };
    let heads: Vec<Value> = (0..table.width())
        .map(|column| context! { text => table.head(column), class => class(column) })
        .collect();
    let rows: Vec<Vec<Value>> = table
        .rows
        .iter()
        .map(|row| {
            (0..table.width())
                .map(|column| {
                    let text = row.get(column).map_or("", String::as_str);
                    context! { text, class => class(column) }
                })
                .collect()
        })
        .collect();
    context! { kind => "table", caption => table.caption.as_str(), heads, rows }
}
