//! The report page as data.

use crate::figure::Figure;
use crate::table::TextTable;

/// A report.
#[derive(Clone, Debug, PartialEq)]
pub struct Page {
    /// What is reported on.
    pub title: String,
    /// A line below it; empty for none.
    pub subtitle: String,
    /// From top to bottom.
    pub sections: Vec<PageSection>,
    /// Explanations of words in the sections, which stand at the end.
    pub explanations: Vec<Explanation>,
    /// The file beside the page that has each sample of its series, where there is one.
    pub samples: Option<SamplesLink>,
}

/// What tells a page the file of its samples, and that it is this one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SamplesLink {
    /// Its name, seen from the page.
    pub file: String,
    /// Its length.
    pub bytes: u64,
    /// The CRC-32 of its description, which has those of its blocks.
    pub crc32: u32,
}

/// The text that explains a word, a name or a command of a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Explanation {
    /// What is explained, as it stands in backticks in the page; there it becomes a link.
    pub code: String,
    /// The heading.
    pub title: String,
    /// The text, shown as it is.
    pub text: String,
}

/// What a section is for. Every page has its parts in this order, whatever the order in which they were added.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum PagePart {
    /// Whether the result is to be trusted, and why.
    Verdict,
    /// What was asked for.
    #[default]
    Answer,
    /// What the verdict rests on.
    Evidence,
    /// What was found of the device's parameters.
    Parameters,
    /// What the uncertainty is due to.
    Budget,
    /// Settings, inputs, and how to do it again.
    Made,
}

/// A part of a page with a heading.
#[derive(Clone, Debug, PartialEq)]
pub struct PageSection {
    /// The heading; empty for none.
    pub title: String,
    /// What it is for.
    pub part: PagePart,
    /// Figures over time are looked into together where this is the same.
    pub time_base: String,
    /// Whether it is folded away, with its heading, until a reader asks for it.
    pub is_folded: bool,
    /// The tab in which it stands; empty for none. All tabs of a page stand where the first of their sections does, one of them in sight.
    pub tab: String,
    /// From top to bottom.
    pub blocks: Vec<PageBlock>,
}

/// How serious a notice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum NoticeSeverity {
    /// A check passed.
    Ok,
    /// The reader should know.
    Note,
    /// The result is in doubt. A warning that does not belong to the verdict is named at the top of the page as well.
    Warning,
    /// The result is wrong, or there is none. A failure is named at the top of the page as a warning is.
    Failure,
}

/// A piece of a section. All text is plain text.
#[derive(Clone, Debug, PartialEq)]
pub enum PageBlock {
    /// Running text.
    Paragraph(String),
    /// A verdict that must not be missed.
    Notice {
        /// How serious it is.
        severity: NoticeSeverity,
        /// What it says.
        text: String,
    },
    /// What was found, as one box for all findings of the same severity.
    Findings {
        /// How serious they are.
        severity: NoticeSeverity,
        /// A sentence each.
        texts: Vec<String>,
    },
    /// Items of equal rank, one below the other.
    List(Vec<String>),
    /// Sentences that a reader may want to see, folded away.
    Folded {
        /// What the reader sees before they are unfolded.
        summary: String,
        /// The sentences, and how serious each is.
        notices: Vec<(NoticeSeverity, String)>,
    },
    /// Names and values.
    KeyValues(Vec<(String, String)>),
    /// A table.
    Table(TextTable),
    /// A numbered figure with its caption.
    Figure(Figure),
    /// A picture of pixels.
    Raster {
        /// A PNG file.
        png: Vec<u8>,
        /// What it shows, for those who do not see it.
        alt: String,
        /// The line below it.
        caption: String,
        /// A bar to measure it by: its share of the width, and what that is.
        bar: Option<(f64, String)>,
    },
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
        Self {
            title: title.into(),
            subtitle: subtitle.into(),
            sections: Vec::new(),
            explanations: Vec::new(),
            samples: None,
        }
    }

    /// Adds an explanation; it is on the page if a section names its code.
    #[must_use]
    pub fn explained(mut self, explanation: Explanation) -> Self {
        self.explanations.push(explanation);
        self
    }

    /// Adds a section.
    #[must_use]
    pub fn with(mut self, section: PageSection) -> Self {
        let is_verdict = section.part == PagePart::Verdict;
        self.sections.push(if is_verdict { section.with_a_box_for_each_severity() } else { section });
        self
    }

    /// Says which file beside the page has each sample of its series.
    #[must_use]
    pub fn beside(mut self, samples: Option<SamplesLink>) -> Self {
        self.samples = samples;
        self
    }
}

impl PageSection {
    /// A section without content yet.
    pub fn new(title: impl Into<String>) -> Self {
        let (part, time_base, blocks) = (PagePart::default(), String::new(), Vec::new());
        Self { title: title.into(), part, time_base, is_folded: false, tab: String::new(), blocks }
    }

    /// How a page was made: by which command, by which version, and the files beside it in words.
    pub fn made(command: &str, version: &str, beside: &str) -> Self {
        Self::new("How it was made").part(PagePart::Made).paragraph(format!(
            "`kalmems {command}`, kalmems {version}. The same input gives the same page to the last byte. {beside}"
        ))
    }

    /// Says what it is for.
    #[must_use]
    pub fn part(mut self, part: PagePart) -> Self {
        self.part = part;
        self
    }

    /// Says to which recording its times belong, where a page has several.
    #[must_use]
    pub fn of_time(mut self, base: impl Into<String>) -> Self {
        self.time_base = base.into();
        self
    }

    /// With one box for all notices of the same severity where the first notice is, the worst first and notes last.
    fn with_a_box_for_each_severity(mut self) -> Self {
        let is_notice =
            |block: &PageBlock| matches!(block, PageBlock::Notice { .. } | PageBlock::Findings { .. });
        let first = self.blocks.iter().position(is_notice);
        let (notices, mut blocks): (Vec<PageBlock>, Vec<PageBlock>) =
            self.blocks.into_iter().partition(is_notice);
        let mut boxes: Vec<(NoticeSeverity, Vec<String>)> = Vec::new();
        for notice in notices {
            let (severity, texts) = match notice {
                PageBlock::Notice { severity, text } => (severity, vec![text]),
                PageBlock::Findings { severity, texts } => (severity, texts),
                _ => continue,
            };
            match boxes.iter_mut().find(|(known, _)| *known == severity) {
                Some((_, own)) => own.extend(texts),
                None => boxes.push((severity, texts)),
            }
        }
        boxes.sort_by_key(|(severity, _)| match severity {
            NoticeSeverity::Failure => 0,
            NoticeSeverity::Warning => 1,
            NoticeSeverity::Ok => 2,
            NoticeSeverity::Note => 3,
        });
        let boxes = boxes.into_iter().map(|(severity, texts)| PageBlock::Findings { severity, texts });
        let first = first.unwrap_or(blocks.len());
        blocks.splice(first..first, boxes);
        self.blocks = blocks;
        self
    }

    /// Puts it into the tab of this name.
    #[must_use]
    pub fn in_tab(mut self, name: impl Into<String>) -> Self {
        self.tab = name.into();
        self
    }

    /// Folds it away if this is so.
    #[must_use]
    pub fn folded(mut self, is_folded: bool) -> Self {
        self.is_folded = is_folded;
        self
    }

    /// Adds any block.
    #[must_use]
    pub fn with(mut self, block: PageBlock) -> Self {
        self.blocks.push(block);
        self
    }

    /// Adds running text.
    #[must_use]
    pub fn paragraph(self, text: impl Into<String>) -> Self {
        self.with(PageBlock::Paragraph(text.into()))
    }

    /// Adds a verdict.
    #[must_use]
    pub fn notice(self, severity: NoticeSeverity, text: impl Into<String>) -> Self {
        self.with(PageBlock::Notice { severity, text: text.into() })
    }

    /// Adds a box with all findings of the same severity; none if there are none.
    #[must_use]
    pub fn findings(self, severity: NoticeSeverity, texts: Vec<String>) -> Self {
        if texts.is_empty() { self } else { self.with(PageBlock::Findings { severity, texts }) }
    }

    /// Adds items of equal rank.
    #[must_use]
    pub fn list(self, items: Vec<String>) -> Self {
        self.with(PageBlock::List(items))
    }

    /// Adds notes, folded away.
    #[must_use]
    pub fn notes(self, notes: Vec<String>) -> Self {
        let count = notes.len();
        let summary = if count == 1 { "1 note".to_owned() } else { format!("{count} notes") };
        self.folded_notices(summary, notes.into_iter().map(|note| (NoticeSeverity::Note, note)).collect())
    }

    /// Adds sentences that are folded away; nothing if there are none.
    #[must_use]
    pub fn folded_notices(self, summary: impl Into<String>, notices: Vec<(NoticeSeverity, String)>) -> Self {
        if notices.is_empty() {
            self
        } else {
            self.with(PageBlock::Folded { summary: summary.into(), notices })
        }
    }

    /// Adds names and values.
    #[must_use]
    pub fn key_values<K: Into<String>, V: Into<String>>(
        self,
        pairs: impl IntoIterator<Item = (K, V)>,
    ) -> Self {
        self.with(PageBlock::KeyValues(pairs.into_iter().map(|(k, v)| (k.into(), v.into())).collect()))
    }

    /// Adds a table.
    #[must_use]
    pub fn table(self, table: TextTable) -> Self {
        self.with(PageBlock::Table(table))
    }

    /// Adds a figure.
    #[must_use]
    pub fn figure(self, figure: Figure) -> Self {
        self.with(PageBlock::Figure(figure))
    }

    /// Adds a picture of pixels, a PNG file.
    #[must_use]
    pub fn raster(self, png: Vec<u8>, alt: impl Into<String>, caption: impl Into<String>) -> Self {
        self.with(PageBlock::Raster { png, alt: alt.into(), caption: caption.into(), bar: None })
    }

    /// Adds the same with a bar that is this share of its width, between 0 and 1, and stands for what the text says.
    #[must_use]
    pub fn raster_with_bar(
        self,
        png: Vec<u8>,
        alt: impl Into<String>,
        caption: impl Into<String>,
        (share, length): (f64, String),
    ) -> Self {
        let bar = Some((share, length));
        self.with(PageBlock::Raster { png, alt: alt.into(), caption: caption.into(), bar })
    }

    /// Adds text that is folded away.
    #[must_use]
    pub fn preformatted(self, summary: impl Into<String>, text: impl Into<String>) -> Self {
        self.with(PageBlock::Preformatted { summary: summary.into(), text: text.into() })
    }
}
