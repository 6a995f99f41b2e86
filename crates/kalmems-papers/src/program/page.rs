//! A reproduction as a page.

use super::{Effort, Item, ItemVerdict, Reproduction, checks_table, summary_table};
use kalmems_figures::{NoticeSeverity, Page, PagePart, PageSection, ReportError};

/// The page: what holds and what does not, then each item.
pub(super) fn page(reproduction: &Reproduction) -> Result<String, ReportError> {
    let program = reproduction.program;
    let papers = program.papers.iter().map(|paper| (paper.key, paper.citation));
    let severities = reproduction.items.iter().map(|item| severity(item.verdict()));
    let mut overview = PageSection::new("What holds and what does not")
        .part(PagePart::Verdict)
        .table(summary_table(reproduction, true).with_verdicts("verdict", severities))
        .paragraph(
            "Reproduced: every number agrees within the tolerance stated beside it and every statement holds by the rule stated \
             beside it. Same trend: numbers differ, but the order or direction that the paper reports is there. Circular: all \
             that agrees was put in, so that it shows that the computation is right and nothing of the paper. Does not \
             reproduce: a statement does not hold, or numbers differ and nothing else was stated. The papers' values are \
             constants with their source; all of ours were computed in this run. Where a statement is one about chance, its \
             test has a level of 5 %.",
        )
        .key_values(papers);
    for premise in program.premises {
        overview = overview.paragraph(*premise);
    }
    let mut page = Page::new(
        format!("{}: the papers next to ours", program.title),
        "What the papers print next to what is computed and simulated here",
    )
    .with(overview);
    for item in &reproduction.items {
        page = page.with(section(item));
    }
    page.with(made(reproduction)).to_html()
}

fn section(item: &Item) -> PageSection {
    let verdict = item.verdict();
    let severity = severity(verdict);
    let labels: Vec<String> = item.head.places.iter().map(|p| format!("{} {}", p.paper, p.label)).collect();
    let mut section = PageSection::new(format!("{}: {}", labels.join(", "), item.head.title))
        .notice(severity, format!("{}: {}", capital(verdict.words()), item.why()))
        .table(checks_table(item));
    for remark in &item.remarks {
        section = section.paragraph(remark.as_str());
    }
    for figure in &item.figures {
        section = section.figure(figure.clone());
    }
    for (png, shows) in &item.pictures {
        section = section.raster(png.clone(), shows.as_str(), shows.as_str());
    }
    for table in &item.tables {
        section = section.table(table.clone());
    }
    section.paragraph(format!("Source: {}.", item.head.source()))
}

/// What does not reproduce is a finding about a paper, and no fault of the run.
fn severity(verdict: ItemVerdict) -> NoticeSeverity {
    if verdict == ItemVerdict::Reproduced { NoticeSeverity::Ok } else { NoticeSeverity::Note }
}

fn made(reproduction: &Reproduction) -> PageSection {
    let settings = &reproduction.settings;
    let effort = match settings.effort {
        Effort::Quick => "quick: few seeds; --full computes more",
        Effort::Full => "full",
    };
    PageSection::new("How it was made").part(PagePart::Made).paragraph(format!(
        "kalmems {}, rig {}, {effort}, first seed {}. The same command gives the same page to the last byte, whatever \
         the number of threads; dates and durations are in run.toml.",
        env!("CARGO_PKG_VERSION"),
        reproduction.rig,
        settings.seed
    ))
}

fn capital(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
