//! What a reader may ask about a result: explanations of verdicts and warnings, which `kalmems help TOPIC` prints and which reports have at
//! their end.

use kalmems_figures::{Explanation, Page, cut_to, first_clause};

/// An explanation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Topic {
    /// By which it is asked for: `kalmems help NAME`.
    pub name: &'static str,
    /// A line for a list of topics.
    pub what: &'static str,
    /// The chapter of the book that says most of it.
    pub chapter: &'static str,
    /// The text; its first line is a title.
    pub text: &'static str,
}

impl Topic {
    /// The first line of the text.
    pub fn title(&self) -> &'static str {
        self.text.lines().next().unwrap_or_default()
    }

    /// The command that prints it.
    pub fn command(&self) -> String {
        format!("kalmems help {}", self.name)
    }
}

/// All topics with their texts.
macro_rules! topics {
    ($($name:literal, $chapter:literal, $what:literal;)*) => {
        /// All topics, those for beginners first.
        pub const TOPICS: &[Topic] = &[$(Topic {
            name: $name,
            what: $what,
            chapter: $chapter,
            text: include_str!(concat!($name, ".txt")),
        }),*];
    };
}

topics! {
    "start", "first_recording.md", "from a recording to an answer in four commands";
    "verdict", "verdict.md", "what the verdict on a filter means";
    "overconfident", "verdict.md", "what to do about `doubtful` and `failed`";
    "lock", "verdict.md", "what to do about `no estimate`";
    "loss", "signals.md", "a signal that is lost and found again";
    "step", "steps.md", "what the integration step and the sampling rate cost";
    "hidden", "verdict.md", "which errors of the device the signal does not show";
    "uncertainty", "uncertainty.md", "uncertain parameters of the device, and what they contribute";
    "outliers", "signals.md", "samples that a filter rejects";
    "sign", "verdict.md", "the sign of the motion, and the reference";
    "recordings", "recordings.md", "which recording determines what";
    "findings", "formats.md", "what is found in a recording: gaps, clipping, clocks";
    "identified", "recordings.md", "numbers that `kalmems identify` determines, and those it does not";
    "units", "formats.md", "how values, uncertainties and columns state their units";
    "noise", "signals.md", "noise of the signal, and process noise";
    "applications", "spectrum.md", "warnings of spectra, images and calibrations";
    "files", "results.md", "which files a command reads and writes";
    "json", "json.md", "what `--json` prints";
}

/// A page with the topics that its sentences name, as [`link`] does.
pub fn explained(page: Page) -> Page {
    TOPICS.iter().fold(page, |page, topic| {
        page.explained(Explanation {
            code: topic.command(),
            title: topic.title().to_owned(),
            text: topic.text.to_owned(),
        })
    })
}

/// What a sentence ends with that a topic explains: the command that prints it, in brackets. Empty where there is no such topic.
pub fn link(name: &str) -> String {
    topic(name).map_or_else(String::new, |topic| format!(" (`{}`)", topic.command()))
}

/// Characters of a warning on a terminal.
pub const SHORT: usize = 140;

/// A warning as a line of a terminal: its first clause, and the command that says what to do, in at most [`SHORT`] characters.
pub fn warning_line(text: &str, name: &str) -> String {
    let (mark, link) = ("WARNING: ", link(name));
    let room = SHORT.saturating_sub(mark.len() + link.chars().count());
    format!("{mark}{}{link}", cut_to(first_clause(text), room))
}

/// The topic of this name.
pub fn topic(name: &str) -> Option<&'static Topic> {
    TOPICS.iter().find(|topic| topic.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_warning_is_a_line_with_the_command_that_says_what_to_do() {
        let line = warning_line("the record is short; a longer one is better", "recordings");
        assert_eq!(line, "WARNING: the record is short (`kalmems help recordings`)");
        let long = warning_line(&"word ".repeat(50), "recordings");
        assert!(
            long.chars().count() <= SHORT && long.ends_with("word … (`kalmems help recordings`)"),
            "{long}"
        );
    }

    #[test]
    fn every_topic_has_a_title_short_lines_and_a_chapter_that_is_there() {
        let book = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../book/src");
        for one in TOPICS {
            assert_eq!(topic(one.name), Some(one));
            assert!(!one.title().is_empty() && !one.what.is_empty(), "{}", one.name);
            assert!(book.join(one.chapter).is_file(), "{}: {}", one.name, one.chapter);
            let last = one.text.lines().next_back().unwrap_or_default();
            assert!(last.starts_with("Book: ") && last.contains(one.chapter), "{}: {last}", one.name);
            assert!(one.text.lines().all(|line| line.chars().count() <= 140), "{}", one.name);
        }
    }
}
