//! A reproduction as a page.

use super::{Effort, Item, Reproduction, Verdict, checks_table, summary_table};
use kalmems_figures::{Page, ReportError, Section, Severity};

/// The page: what holds and what does not, then each item.
pub(super) fn page(reproduction: &Reproduction) -> Result<String, ReportError> {
    let program = reproduction.program;
    let papers = program.papers.iter().map(|paper| (paper.key, paper.citation));
    let mut overview = Section::new("What holds and what does not")
        .table(summary_table(reproduction, true))
        .paragraph(
            "Reproduced: every number agrees within the tolerance stated and every statement holds. Same trend: \
             numbers differ, but the order or direction that the paper reports is there. Does not reproduce: a \
             statement does not hold, or numbers differ and nothing else was stated. The papers' values are \
             constants with their source; all of ours were computed in this run.",
        )
        .key_values(papers);
    for premise in program.premises {
        overview = overview.paragraph(*premise);
    }
    let mut page = Page::new(
        format!("{}: the papers beside ours", program.title),
        "Measured on the authors' hardware, simulated here",
    )
    .with(overview);
    for item in &reproduction.items {
        page = page.with(section(item));
    }
    page.with(made(reproduction)).to_html()
}

fn section(item: &Item) -> Section {
    let (severity, verdict) = match item.verdict() {
        verdict @ Verdict::Reproduced => (Severity::Ok, verdict),
        verdict => (Severity::Note, verdict),
    };
    let labels: Vec<String> = item.head.places.iter().map(|p| format!("{} {}", p.paper, p.label)).collect();
    let mut section = Section::new(format!("{}: {}", labels.join(", "), item.head.title))
        .notice(severity, format!("{}: {}", capital(verdict.words()), item.why()))
        .table(checks_table(item));
    for remark in &item.remarks {
        section = section.paragraph(remark.as_str());
    }
    for figure in &item.figures {
        section = section.figure(figure.clone());
    }
    for table in &item.tables {
        section = section.table(table.clone());
    }
    section.paragraph(format!("Source: {}.", item.head.source()))
}

fn made(reproduction: &Reproduction) -> Section {
    let settings = &reproduction.settings;
    let effort = match settings.effort {
        Effort::Quick => "quick: few seeds; --full computes more",
        Effort::Full => "full",
    };
    Section::new("How it was made").paragraph(format!(
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
