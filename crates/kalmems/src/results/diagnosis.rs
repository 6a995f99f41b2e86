//! A diagnosis in words.

use super::summary::{shown, significant_value};
use crate::diagnose::{
    AnswerChange, CauseGain, CauseReport, Diagnosis, DiagnosisFinding, Edit, FoundNoise, Proposal, ScaleNote,
};
use crate::evaluate::CycleEvidence;
use crate::inspect::quantity;
use crate::topics::{explained, link};
use kalmems_figures::{
    Axis, ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, Panel, Series, SeriesRole,
    TextTable, significant,
};
use std::fmt::Write as _;

impl Diagnosis {
    /// What was found, what to write, and what the signal cannot tell, for a terminal.
    pub fn to_text(&self) -> String {
        let mut text = self.answer().map_or_else(String::new, |answer| answer + "\n\n");
        text += &match self.finding {
            DiagnosisFinding::NothingToChange => {
                "nothing to change: the innovations pass all tests, so that the recording does not contradict the experiment\n"
                    .to_owned()
            }
            DiagnosisFinding::Explained => self.explained(),
            DiagnosisFinding::NoneOfThese => self.unexplained(),
            DiagnosisFinding::Interrupted => self.so_far(),
            DiagnosisFinding::Steps => format!(
                "the filter's own steps lead it astray, so that its innovations say nothing of the numbers of the experiment: {}. Diagnose it again with that.\n",
                self.tests.join("; ")
            ),
        };
        if let Some(left_out) = self.left_out() {
            text += &format!("\n{left_out}\n");
        }
        for note in &self.notes {
            text += &format!("\nnote: {note}\n");
        }
        for unseen in &self.unseen {
            text += &format!("\nnote: {unseen}\n");
        }
        let Self { experiment, filter, rows, .. } = self;
        let long_s = significant(self.duration_s);
        text += &format!("\n{experiment}, filter `{filter}`: {rows} rows ({long_s} s) of its recordings\n");
        text
    }

    /// The answer in one sentence: the causes that explain the recording, the first line to write, and what that changes.
    pub fn answer(&self) -> Option<String> {
        let first = self.causes.first()?;
        let names: Vec<&str> = self.causes.iter().map(|cause| cause.name.as_str()).collect();
        let mut text = format!("cause: {}", names.join(", or "));
        if let Some(Edit { key, to, .. }) = first.edits.first() {
            text += &format!("; write `{key} = {to}`");
        }
        if let Some(answer) = &first.answer {
            text += &format!(", which {}", effect(answer, first.answer_name, first.answer_unit));
        }
        Some(text)
    }

    fn explained(&self) -> String {
        let of = match self.causes.len() {
            1 => "one explains the recording".to_owned(),
            several => format!("{several} explain the recording, which does not distinguish them"),
        };
        let mut text = format!("of {} causes that were tried {of}:\n", self.tried);
        for (place, cause) in self.causes.iter().enumerate() {
            text += &format!("\n{}. {}\n", place + 1, cause.to_text());
        }
        if self.causes.iter().any(|cause| cause.numbers > 1) {
            text += "\nNo single number explains the recording. If several numbers are wrong, many pairs may explain it as well as these: identify \
                     them together, with `kalmems identify`.\n";
        }
        if self.causes.iter().any(|cause| !cause.edits.is_empty()) && self.causes.len() > 1 {
            if self.is_ambiguous() {
                text += &format!(
                    "\n{} Measure one of these numbers; `--write` takes the one that `--cause` names.\n",
                    self.ambiguity()
                );
            } else {
                text += "\nWrite one of them, the one that is known worst, or measure it; `--write` takes the first.\n";
            }
        }
        match &self.proposal {
            Some(proposal) => text += &proposal.to_text(),
            None if self.causes.len() > 1 && self.left_out.is_empty() => {
                text += "\nNo other amplitude, frequency or duration of the drive was found that would distinguish them.\n";
            }
            None => {}
        }
        text
    }

    /// That the recording does not tell the causes apart, and how far their answers differ, as sentences.
    pub fn ambiguity(&self) -> String {
        let apart = self.answers_differ.map_or_else(String::new, |apart| {
            format!(
                " With one or another of them the answer differs by up to {} of the standard deviation that the filter claims.",
                significant(apart)
            )
        });
        format!("Which of them it is, the recording does not tell.{apart}")
    }

    /// What was not tried, as a sentence.
    fn left_out(&self) -> Option<String> {
        (!self.left_out.is_empty()).then(|| {
            let all = self.left_out.join("; ");
            format!("Left out, because the work is limited: {all}. `--thorough` tries them.")
        })
    }

    fn so_far(&self) -> String {
        let each = self.closest.iter().map(|cause| format!("\n- {}: {:.0}", cause.name, cause.gain));
        format!(
            "interrupted before a cause was found that explains the recording. By so much each of these raises the log-likelihood of the blocks that were not \
             fitted; none of them was examined further:\n{}\n",
            each.collect::<String>()
        )
    }

    fn unexplained(&self) -> String {
        let mut text = format!(
            "none of these: {} causes were tried, and with none of them the innovations pass all tests",
            self.tried
        );
        text += ". The innovations show:\n";
        for test in &self.tests {
            let _ = writeln!(text, "  {test}");
        }
        if !self.closest.is_empty() {
            text += "\nThese changes explain most of the deviations, and not all; the cause is likely an effect that the model does not have:\n";
        }
        for cause in &self.closest {
            text += &format!("\n- {}\n", cause.to_text());
        }
        text
    }
}

impl CauseReport {
    /// The entry of a filter with which it estimates the numbers itself.
    fn as_states(&self) -> Option<String> {
        let states = self.states.join(", ");
        (!states.is_empty()).then(|| format!("as a state of the filter: states = {{ {states} }}"))
    }

    fn to_text(&self) -> String {
        let mut text = format!(
            "{}: the log-likelihood of the blocks that were not fitted rises by {:.0}",
            self.name, self.gain
        );
        if !self.passes {
            text += "; the innovations then still fail a test";
        }
        if let Some(answer) = &self.answer {
            let _ = write!(text, "; it {}", effect(answer, self.answer_name, self.answer_unit));
        }
        for Edit { key, from, to, sd, across } in &self.edits {
            let was = from.as_ref().map_or_else(|| "new".to_owned(), |from| format!("was {from}"));
            let mut sd =
                sd.map_or_else(String::new, |sd| format!(", known to {} %", significant(100.0 * sd)));
            if let Some(across) = across {
                let part = significant(100.0 * across);
                sd += &format!(" if this is the cause; the causes differ by {part} % in it");
            }
            let _ = write!(text, "\n     {key} = {to}  # {was}{sd}");
        }
        if let Some(states) = self.as_states() {
            let _ = write!(text, "\n     or, where it is not known well or changes, {states}");
        }
        for said in [&self.remedy, &self.withheld].into_iter().flatten() {
            let _ = write!(text, "\n     {said}");
        }
        text
    }
}

impl Proposal {
    fn to_text(&self) -> String {
        let lines: Vec<String> = self.simulate.lines().map(|line| format!("     {line}")).collect();
        let lines = lines.join("\n");
        format!(
            "\nA recording with {} would distinguish them: the log-likelihood of the true cause would be larger by {:.0}. As a simulation:\n\n{lines}\n",
            self.what, self.ahead
        )
    }
}

impl std::fmt::Display for FoundNoise {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { key, written, interval: [low, high], of_neighbours, filter, rows, meaning } = self;
        let Some(meaning) = meaning else {
            let per_cent = |factor: f64| 100.0 * (factor - 1.0);
            write!(
                f,
                "`{key}` is `{written}` by the innovations of `{filter}`, {rows} samples; the 95 % interval is {:.2} to +{:.2} % about it",
                per_cent(*low),
                per_cent(*high)
            )?;
            if let Some(more) = of_neighbours.filter(|more| *more > MISSES) {
                write!(
                    f,
                    "; it is {more:.3} times the noise that the differences of neighbouring samples show, so that a part of the signal that \
                     the model does not have is counted as noise here"
                )?;
            }
            return Ok(());
        };
        if *low == 0.0 {
            return write!(
                f,
                "`{key}`: the innovations of `{filter}`, {rows} samples, do not show that it is more than 0; the upper end of the 95 % interval, \
                 `{written}`, is written, so that what the filters claim is not too small for any density that the recording allows; with \
                 it {meaning}"
            );
        }
        write!(
            f,
            "`{key}` is `{written}` by the innovations of `{filter}`, {rows} samples; the 95 % interval is {} to {} times that; with it {meaning}",
            significant(*low),
            significant(*high)
        )
    }
}

/// A noise that is so many times that of neighbouring samples is no noise of the readout alone.
const MISSES: f64 = 1.5;

impl std::fmt::Display for ScaleNote {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { parameter, with, hidden, by, change, answer, unit } = self;
        let (unit_of_answer, factor) = people_read(unit);
        let others = with.iter().map(|(name, times)| format!("`{name}` ({times:+.3} times as much)"));
        let others = others.collect::<Vec<_>>().join(", ");
        let with = if with.is_empty() { String::new() } else { format!(", together with {others}") };
        if *hidden < 1.0 {
            write!(
                f,
                "`{parameter}`{with} can be wrong by {} % before the innovations show it; ",
                significant(100.0 * hidden)
            )?;
        } else {
            write!(f, "the signal does not determine `{parameter}`{with}; ")?;
        }
        write!(
            f,
            "an error of {} % {}, where the filter claims {} {unit_of_answer}",
            significant(100.0 * by),
            effect(change, answer, unit),
            significant(change.claimed * factor)
        )
    }
}

/// What a change makes of an answer.
fn effect(change: &AnswerChange, answer: &str, unit: &'static str) -> String {
    let (unit, factor) = people_read(unit);
    let mut text = format!("changes the {answer} by {} {unit} rms", significant(change.rms * factor));
    if change.share > 0.5 {
        let mut parts = Vec::new();
        // What makes less than a tenth of the difference is none of its parts.
        if change.scale.abs() * change.of_rms > 0.1 * change.rms {
            let larger = if change.scale < 0.0 { "smaller" } else { "larger" };
            parts.push(format!("{} % {larger}", significant(100.0 * change.scale.abs())));
        }
        if change.offset.abs() > 0.1 * change.rms {
            let higher = if change.offset < 0.0 { "lower" } else { "higher" };
            parts.push(format!("{} {unit} {higher}", significant(change.offset.abs() * factor)));
        }
        if parts.is_empty() && change.early_s != 0.0 {
            let earlier = if change.early_s < 0.0 { "later" } else { "earlier" };
            parts.push(format!("{} {earlier}", quantity(significant_value(change.early_s.abs()), "s")));
        }
        if !parts.is_empty() {
            text += &format!(" ({})", parts.join(", "));
        }
    }
    text
}

/// The unit in which people read it, and how many of that one of its SI unit is.
fn people_read(unit: &'static str) -> (&'static str, f64) {
    if unit == "rad" { ("deg", 180.0 / std::f64::consts::PI) } else { shown(unit) }
}

/// Half the height of a bar, of rows that are 1 apart.
const HALF_BAR: f64 = 0.3;

/// The innovations over the cycle of the motion before and after the correction of the first cause; `None` if that was not tried.
fn over_the_cycle(found: &Diagnosis) -> Option<Figure> {
    let [before, after] = found.cycles.as_slice() else { return None };
    let cause = &found.causes.first()?.name;
    let caption = format!(
        "The mean of the normalised innovations over the cycle of the motion with the experiment as it is, and with {cause} as written above, and where \
         95 % of the means of a consistent filter lie."
    );
    let over = |cycle: &CycleEvidence| -> Vec<(f64, f64)> {
        cycle.parts.iter().map(|[phase, _, mean, _]| (*phase, *mean)).collect()
    };
    let bound = |[phase, count, ..]: &[f64; 4]| (*phase, -1.96 / count.sqrt(), 1.96 / count.sqrt());
    let bound: Vec<(f64, f64, f64)> = before.parts.iter().map(bound).collect();
    let panel = Panel::new(Axis::new("phase of the motion", "deg"), Axis::new("mean innovation", "1"))
        .with(Series::band("95 %", SeriesRole::Bound, bound))
        .with(Series::line("as it is", SeriesRole::Model, over(before)))
        .with(Series::line("corrected", SeriesRole::Estimate, over(after)));
    Some(Figure::new("cycle", "Innovations over the cycle, before and after", caption).with(panel))
}

/// Bars that are drawn at most.
const BARS: usize = 16;

/// How much likelier the recording is with each cause that was fitted.
fn gains(all: &[CauseGain], needed: f64) -> Figure {
    let causes = all.get(..BARS).unwrap_or(all);
    let mut caption = "The gain in log-likelihood of the blocks that were not fitted, for each cause that was fitted, and the gain that a cause \
                       needs so that it is no fluctuation. Causes of equal gain are not distinguished by the recording."
        .to_owned();
    if all.len() > causes.len() {
        caption += &format!(" {} further causes gain less than these.", all.len() - causes.len());
    }
    let limit = [(needed, 0.5), (needed, 0.5 - causes.len() as f64)];
    let largest = causes.iter().map(|cause| cause.gain).fold(needed, f64::max);
    let gain = Axis::new("gain", "ln p").between(0.0, 1.05 * largest);
    let mut panel = Panel::new(gain, Axis::of_names(causes.iter().map(|cause| cause.name.clone())));
    for (place, cause) in causes.iter().enumerate() {
        let (low, high) = (-(place as f64) - HALF_BAR, -(place as f64) + HALF_BAR);
        let label = if place == 0 { "gain" } else { "" };
        let bar = [(0.0, low, high), (cause.gain.max(0.0), low, high)];
        panel = panel.with(Series::band(label, SeriesRole::Estimate, bar));
    }
    let panel = panel.with(Series::line("needed", SeriesRole::Bound, limit));
    Figure::new("gains", "Gain of each cause", caption).with(panel)
}

/// Each cause with what to write, and what that does to the answer.
fn table_of_causes(causes: &[CauseReport]) -> TextTable {
    let columns = [
        ColumnHead::text("cause"),
        ColumnHead::number("gain", "ln p"),
        ColumnHead::text("what to write"),
        ColumnHead::text("effect on the answer"),
    ];
    let mut table = TextTable::new("", columns);
    for cause in causes {
        let edits = cause.edits.iter().map(|Edit { key, from, to, .. }| {
            let was = from.as_ref().map_or_else(|| "new".to_owned(), |from| format!("was {from}"));
            format!("`{key} = {to}` ({was})")
        });
        let states = cause.as_states().map(|states| format!("or {states}"));
        let write = edits
            .chain(states)
            .chain(cause.remedy.clone())
            .chain(cause.withheld.clone())
            .collect::<Vec<_>>()
            .join("; ");
        let answer = cause.answer.as_ref().map(|answer| effect(answer, cause.answer_name, cause.answer_unit));
        table.push([cause.name.clone(), format!("{:.0}", cause.gain), write, answer.unwrap_or_default()]);
    }
    table
}

/// The report of a diagnosis: the page's text, which needs nothing else.
#[cfg(feature = "report")]
pub fn diagnosis_page(found: &Diagnosis) -> Result<String, kalmems_figures::ReportError> {
    page(found).to_html()
}

fn page(found: &Diagnosis) -> Page {
    let (severity, text) = match found.finding {
        DiagnosisFinding::NothingToChange => (
            NoticeSeverity::Ok,
            "The innovations pass all tests: the recording does not contradict the experiment.".to_owned(),
        ),
        DiagnosisFinding::Explained => (
            NoticeSeverity::Warning,
            match found.causes.as_slice() {
                [one] => format!(
                    "One of the {} causes that were tried explains the recording: {}.",
                    found.tried, one.name
                ),
                several => format!(
                    "{} of the {} causes that were tried explain the recording, which does not distinguish them{}.",
                    several.len(),
                    found.tried,
                    link("recordings")
                ),
            },
        ),
        DiagnosisFinding::NoneOfThese => (
            NoticeSeverity::Failure,
            format!(
                "None of the {} causes that were tried explains the recording{}.",
                found.tried,
                link("overconfident")
            ),
        ),
        DiagnosisFinding::Interrupted => (
            NoticeSeverity::Warning,
            "The diagnosis was interrupted before a cause was found that explains the recording.".to_owned(),
        ),
        DiagnosisFinding::Steps => (
            NoticeSeverity::Warning,
            format!(
                "The filter's own steps lead it astray, and nothing follows for the numbers of the experiment: {}.",
                found.tests.join("; ")
            ),
        ),
    };
    let verdict = PageSection::new("Verdict").part(PagePart::Verdict);
    let verdict = found.answer().into_iter().fold(verdict, PageSection::paragraph).notice(severity, text);
    let (causes, title) = if found.causes.is_empty() {
        (&found.closest, "What explains most, and not all")
    } else {
        (&found.causes, "What explains the recording")
    };
    let table = table_of_causes(causes);
    let mut answer = PageSection::new(title);
    if !table.rows.is_empty() {
        answer = answer.figure(gains(&found.gains, found.needed)).table(table);
    }
    answer = over_the_cycle(found).into_iter().fold(answer, PageSection::figure);
    answer = found.left_out().into_iter().fold(answer, PageSection::paragraph);
    if let Some(Proposal { what, ahead, simulate }) = &found.proposal {
        let text = format!(
            "A recording with {what} would tell them apart: the true one would be ahead by {ahead:.0} in ln p."
        );
        answer = answer.paragraph(text).preformatted("That recording as a simulation", simulate.as_str());
    }
    let mut page = Page::new(
        format!("{}: what is wrong", found.experiment),
        format!(
            "by {} rows ({} s) of its recordings, filter `{}`",
            found.rows,
            significant(found.duration_s),
            found.filter
        ),
    )
    .with(verdict)
    .with(answer);
    if !found.tests.is_empty() {
        let section = PageSection::new("What the innovations show").part(PagePart::Evidence);
        page = page.with(section.folded(true).list(found.tests.clone()));
    }
    if !found.notes.is_empty() {
        let section = PageSection::new("What the signal does not determine").part(PagePart::Budget);
        page = page.with(section.list(found.notes.iter().map(ToString::to_string).collect()));
    }
    explained(page.with(PageSection::made("diagnose", env!("CARGO_PKG_VERSION"), "")))
}
