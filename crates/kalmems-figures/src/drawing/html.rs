//! The report page as HTML: one file that needs nothing else.

use crate::drawing::error::ReportError;
use crate::drawing::layout::extent;
use crate::drawing::live::LiveFigures;
use crate::drawing::notes::quantity;
use crate::figure::{Figure, Panel, Series};
use crate::page::{Explanation, NoticeSeverity, Page, PageBlock, PagePart, PageSection};
use crate::table::{ColumnHead, TextTable};
use crate::text::first_clause;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use minijinja::{Environment, Value, context};

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
/// The library that draws axes and follows the mouse, and what of a page it needs.
const PLOTS: [&str; 3] = [
    include_str!("../../assets/uplot.min.js"),
    include_str!("../../assets/uplot.min.css"),
    include_str!("../../assets/uplot-LICENSE.txt"),
];
const SCRIPT: &str = include_str!("page.js");
/// A table of so many columns becomes cards where the page is narrow.
const CARDS: usize = 4;

impl Page {
    /// Whether it has groups of samples where a file beside it would have each: of series that name their place in one.
    pub fn leaves_out_samples(&self) -> bool {
        let mut live = LiveFigures::default();
        for section in &self.sections {
            for block in &section.blocks {
                if let PageBlock::Figure(figure) = block {
                    live.take(0, &section.time_base, figure);
                }
            }
        }
        live.leaves_out_samples()
    }

    /// The sections in the order of their parts; those in tabs all where the first of them is, tab by tab.
    fn in_order(&self) -> Vec<&PageSection> {
        let mut order: Vec<&PageSection> = self.sections.iter().collect();
        order.sort_by_key(|section| section.part);
        let first = order.iter().position(|section| !section.tab.is_empty());
        let (mut order, mut in_tabs): (Vec<_>, Vec<_>) =
            order.into_iter().partition(|section| section.tab.is_empty());
        let mut names: Vec<&str> = Vec::new();
        for section in &in_tabs {
            if !names.contains(&section.tab.as_str()) {
                names.push(&section.tab);
            }
        }
        in_tabs.sort_by_key(|section| names.iter().position(|name| *name == section.tab));
        let first = first.unwrap_or(order.len());
        order.splice(first..first, in_tabs);
        order
    }

    /// The page as HTML, its sections in the order of [`PagePart`]. The same page gives the same bytes.
    ///
    /// Figures are still pictures, which a script replaces by plots that can be looked into: all samples where they are few, else
    /// the extremes of groups of them.
    pub fn to_html(&self) -> Result<String, ReportError> {
        let mut environment = Environment::new();
        // The ending tells that values are escaped.
        environment.add_template("page.html", TEMPLATE)?;
        let order = self.in_order();
        let tab_at = |place: Option<usize>| {
            let section = place.and_then(|place| order.get(place));
            section.map_or("", |section| section.tab.as_str())
        };
        let mut numbers = PageNumbering::default();
        let sections: Vec<Value> = (order.iter().enumerate())
            .map(|(index, section)| {
                let blocks: Vec<Value> =
                    (0..section.blocks.len()).map(|place| numbers.block(section, place)).collect();
                let anchor = format!("section-{}", index + 1);
                let (title, tab) = (section.title.as_str(), section.tab.as_str());
                let [before, after] = [tab_at(index.checked_sub(1)), tab_at(Some(index + 1))];
                let (begins_tab, ends_tab) = (before != tab, after != tab);
                let (begins_tabs, ends_tabs) = (before.is_empty(), after.is_empty());
                let is_folded = section.is_folded;
                context! { title, anchor, is_folded, blocks, tab, begins_tab, ends_tab, begins_tabs, ends_tabs }
            })
            .collect();
        let named: Vec<&Explanation> = self
            .explanations
            .iter()
            .filter(|one| self.sections.iter().any(|section| section.names(&one.code)))
            .collect();
        let explanations: Vec<Value> = (named.iter().enumerate())
            .map(|(index, one)| {
                // The heading says what the first line of the text says.
                let text = one.text.strip_prefix(one.title.as_str()).unwrap_or(&one.text).trim_matches('\n');
                context! { anchor => explanation_anchor(index), title => one.title.as_str(), text }
            })
            .collect();
        let data = numbers.live.into_json(self.samples.as_ref());
        let page = context! {
            title => self.title.as_str(),
            subtitle => with_code(&self.subtitle),
            warnings => numbers.warnings,
            sections => sections,
            explanations => explanations,
            style => Value::from_safe_string(STYLE.to_owned()),
            plots => PLOTS.map(|text| Value::from_safe_string(text.to_owned())).to_vec(),
            scripts => page_scripts().map(Value::from_safe_string).to_vec(),
            data => data.map(Value::from_safe_string),
        };
        let html = environment.get_template("page.html")?.render(page)?;
        Ok(named.iter().enumerate().fold(html, |html, (index, one)| {
            let code = format!("<code>{}</code>", escaped(&one.code));
            html.replace(&code, &format!("<a href=\"#{}\">{code}</a>", explanation_anchor(index)))
        }))
    }
}

/// The text of the scripts that a page runs, all that stands between the tags.
pub fn page_scripts() -> [String; 2] {
    let [plots, _, licence] = PLOTS;
    let plots = format!("/* The plots are drawn with uPlot, whose licence is:\n{licence}\n*/\n{plots}");
    [plots.as_str(), SCRIPT].map(|script| format!("//<![CDATA[\n{script}\n//]]>"))
}

fn explanation_anchor(index: usize) -> String {
    format!("explanation-{}", index + 1)
}

impl NoticeSeverity {
    fn class(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Failure => "failure",
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Ok => "OK",
            Self::Note => "Note",
            Self::Warning => "Warning",
            Self::Failure => "Failure",
        }
    }
}

impl PageSection {
    /// Whether its sentences name this in backticks.
    fn names(&self, code: &str) -> bool {
        let code = format!("`{code}`");
        self.blocks.iter().any(|block| match block {
            PageBlock::Paragraph(text) | PageBlock::Notice { text, .. } => text.contains(&code),
            PageBlock::Findings { texts, .. } | PageBlock::List(texts) => {
                texts.iter().any(|text| text.contains(&code))
            }
            PageBlock::Folded { notices, .. } => notices.iter().any(|(_, text)| text.contains(&code)),
            PageBlock::KeyValues(pairs) => pairs.iter().any(|(_, value)| value.contains(&code)),
            _ => false,
        })
    }
}

/// Plain text as HTML, in which none of its letters is a mark.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#x27;")
}

/// Plain text as HTML, what stands in backticks as code. No line ends between ± and its number.
fn with_code(text: &str) -> Value {
    let text = text.replace("± ", "±\u{a0}");
    let parts: Vec<&str> = text.split('`').collect();
    // One without a partner is no mark.
    if parts.len().is_multiple_of(2) {
        return Value::from_safe_string(escaped(&text));
    }
    let html = parts.iter().enumerate().map(|(index, part)| {
        if index % 2 == 1 { format!("<code>{}</code>", escaped(part)) } else { escaped(part) }
    });
    Value::from_safe_string(html.collect())
}

/// What is numbered throughout a page.
#[derive(Default)]
struct PageNumbering {
    figures: usize,
    anchors: usize,
    warnings: Vec<Value>,
    live: LiveFigures,
}

impl PageNumbering {
    fn block(&mut self, section: &PageSection, place: usize) -> Value {
        let Some(block) = section.blocks.get(place) else { return Value::UNDEFINED };
        match block {
            PageBlock::Paragraph(text) => context! { kind => "paragraph", text => with_code(text) },
            PageBlock::Notice { severity, text } => self.notice(section.part, *severity, text),
            PageBlock::Findings { severity, texts } => {
                let texts: Vec<Value> = texts.iter().map(|text| with_code(text)).collect();
                context! { kind => "findings", severity => severity.class(), word => severity.word(), texts }
            }
            PageBlock::List(items) => {
                let items: Vec<Value> = items.iter().map(|item| with_code(item)).collect();
                context! { kind => "list", items }
            }
            PageBlock::Folded { summary, notices } => {
                let notices: Vec<Value> = (notices.iter())
                    .map(
                        |(severity, text)| context! { severity => severity.class(), text => with_code(text) },
                    )
                    .collect();
                context! { kind => "folded", summary, notices }
            }
            PageBlock::KeyValues(pairs) => {
                let pairs: Vec<[Value; 2]> =
                    pairs.iter().map(|(name, value)| [with_code(name), with_code(value)]).collect();
                context! { kind => "key-values", pairs }
            }
            PageBlock::Table(table) => table_value(table),
            PageBlock::Figure(figure) => {
                self.figures += 1;
                let is_live = self.live.take(self.figures, &section.time_base, figure);
                context! {
                    kind => "figure",
                    number => self.figures,
                    title => figure.title.as_str(),
                    caption => with_code(&figure.caption),
                    svg => Value::from_safe_string(figure.to_page_svg()),
                    numbers => is_live.then(|| table_value(&numbers_of(figure))),
                }
            }
            PageBlock::Raster { png, alt, caption, bar } => context! {
                kind => "raster",
                // Those that follow each other stand next to one another.
                begins => !is_raster(section.blocks.get(place.wrapping_sub(1))),
                ends => !is_raster(section.blocks.get(place + 1)),
                // Letters, digits, `+`, `/` and `=`.
                data => Value::from_safe_string(STANDARD.encode(png)),
                alt,
                caption => with_code(caption),
                bar => bar.as_ref().map(|(share, length)| (format!("{:.3}", 100.0 * share), length)),
            },
            PageBlock::Preformatted { summary, text } => context! { kind => "preformatted", summary, text },
        }
    }

    fn notice(&mut self, part: PagePart, severity: NoticeSeverity, text: &str) -> Value {
        let word = severity.word();
        let mut anchor = None;
        // The verdict stands at the top itself.
        if severity >= NoticeSeverity::Warning && part != PagePart::Verdict {
            self.anchors += 1;
            let name = format!("warning-{}", self.anchors);
            let severity = severity.class();
            self.warnings
                .push(context! { anchor => name.as_str(), text => with_code(first_clause(text)), severity });
            anchor = Some(name);
        }
        context! { kind => "notice", severity => severity.class(), word, text => with_code(text), anchor }
    }
}

fn is_raster(block: Option<&PageBlock>) -> bool {
    matches!(block, Some(PageBlock::Raster { .. }))
}

/// What the series of a figure come to, in words and numbers.
fn numbers_of(figure: &Figure) -> TextTable {
    let columns = [
        ColumnHead::text("panel"),
        ColumnHead::text("series"),
        ColumnHead::number("samples", ""),
        ColumnHead::text("from"),
        ColumnHead::text("to"),
        ColumnHead::text("lowest"),
        ColumnHead::text("highest"),
    ];
    let mut table = TextTable::new("What the series of this figure come to", columns);
    for panel in &figure.panels {
        for series in panel.series.iter().filter(|series| series.record().is_some()) {
            table.push(numbers_of_series(panel, series));
        }
    }
    table
}

fn numbers_of_series(panel: &Panel, series: &Series) -> [String; 7] {
    let (x_unit, y_unit) = (panel.x.unit.as_str(), panel.y.unit.as_str());
    let ends = extent(series, panel).fold(None, |ends: Option<[f64; 4]>, [x, low, high]| {
        let [from, to, lowest, highest] = ends.unwrap_or([x, x, low, high]);
        Some([from.min(x), to.max(x), lowest.min(low), highest.max(high)])
    });
    let text =
        |place: usize, unit: &str| ends.map_or_else(|| "–".to_owned(), |ends| quantity(ends[place], unit));
    [
        panel.y.label.clone(),
        series.label().to_owned(),
        series.source_samples().to_string(),
        text(0, x_unit),
        text(1, x_unit),
        text(2, y_unit),
        text(3, y_unit),
    ]
}

fn table_value(table: &TextTable) -> Value {
    let class = |column| if table.is_numeric(column) { "number" } else { "text" };
    let order: Vec<usize> = table.order().collect();
    let heads: Vec<Value> = (order.iter())
        .map(|column| context! { text => with_code(&table.head(*column)), class => class(*column) })
        .collect();
    let rows: Vec<Value> = (table.rows.iter().enumerate())
        .map(|(index, row)| {
            let cells: Vec<Value> = (order.iter())
                .map(|column| {
                    let cell = row.get(*column).map_or("", String::as_str);
                    let text = with_code(cell);
                    let grade = table.grade(index, *column).map(NoticeSeverity::class);
                    context! { text, class => class(*column), head => table.head(*column), grade }
                })
                .collect();
            context! { cells, anchor => table.anchor(index) }
        })
        .collect();
    let is_cards = table.width() >= CARDS;
    // Rows that are led to can be many.
    let is_bounded = table.anchor(0).is_some();
    context! { kind => "table", caption => with_code(&table.caption), has_caption => !table.caption.is_empty(), heads, rows, is_cards, is_bounded }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn html(page: &Page) -> String {
        let html = page.to_html().unwrap();
        html.split_once("<main>").and_then(|(_, rest)| rest.split_once("</main>")).unwrap().0.to_owned()
    }

    #[test]
    fn no_line_ends_between_a_sign_and_its_number() {
        let section = PageSection::new("").paragraph("8.9 ± 0.1 deg").key_values([("x", "1 ± 2")]);
        let html = html(&Page::new("", "").with(section));
        assert!(html.contains("8.9 ±\u{a0}0.1 deg") && html.contains("1 ±\u{a0}2"), "{html}");
    }

    #[test]
    fn a_verdict_has_a_box_for_each_severity() {
        let verdict = PageSection::new("Verdict").part(PagePart::Verdict).paragraph("answer");
        let verdict = [NoticeSeverity::Ok, NoticeSeverity::Warning, NoticeSeverity::Ok]
            .into_iter()
            .enumerate()
            .fold(verdict, |verdict, (place, severity)| verdict.notice(severity, format!("finding {place}")));
        let html = html(&Page::new("", "").with(verdict.paragraph("after")));
        let places = ["answer", "finding 1", "finding 0", "finding 2", "after"].map(|text| html.find(text));
        assert!(places.is_sorted() && places[0].is_some(), "{places:?}");
        assert_eq!(html.matches("class=\"notice").count(), 2);
    }

    #[test]
    fn tabs_stand_together_each_with_all_of_its_sections() {
        let section = |title: &str, part: PagePart, tab: &str| PageSection::new(title).part(part).in_tab(tab);
        let page = Page::new("", "")
            .with(section("A1", PagePart::Answer, "a"))
            .with(section("A2", PagePart::Evidence, "a"))
            .with(section("B1", PagePart::Answer, "b"))
            .with(section("B2", PagePart::Evidence, "b"))
            .with(section("before", PagePart::Verdict, ""))
            .with(section("after", PagePart::Made, ""));
        let html = html(&page);
        let places =
            ["before", "A1", "A2", "B1", "B2", "after"].map(|title| html.find(&format!("<h2>{title}</h2>")));
        assert!(places.is_sorted() && places[0].is_some(), "{places:?}");
        assert_eq!(html.matches("type=\"radio\"").count(), 2);
        assert_eq!(html.matches("checked=\"checked\"").count(), 1);
        assert_eq!(html.matches("<div").count(), html.matches("</div>").count());
    }
}
