//! The report of an estimate as a page.

use super::figures::SegmentFigures;
use super::long_estimate::PICTURED;
use super::names::prefix;
use crate::config::{Experiment, ExtremeSign};
use crate::estimate::TrajectoryKind;
use crate::evaluate::{InnovationTest, MotionErrors, TestResult, ValueErrors};
use crate::results::summary::{segment_name, shown, summary_grades, without_repeats};
use crate::results::tracks::Tracks;
use crate::results::{
    EstimatorMetrics, Metrics, Notice, RecordingMetrics, SegmentMetrics, budget_table, is_unexplained,
    notices, notices_in_short, parameters_table, summary_table,
};
use crate::topics::explained;
use crate::workflow::{Outcome, SegmentOutcome};
use kalmems_figures::{ColumnHead, Figure, NoticeSeverity, Page, PagePart, PageSection, TextTable};

/// The page, and its figures once more by their name.
pub(in crate::results) fn page(outcome: &Outcome, metrics: &Metrics) -> (Page, Vec<Figure>) {
    let drawn = outcome.recordings.iter().zip(&metrics.recordings).map(|(recording, judged)| {
        let of = |(segment, judged): (&SegmentOutcome, &SegmentMetrics)| {
            let own = &segment.estimate.segment;
            if own.stretch.number > PICTURED {
                return SegmentFigures::default();
            }
            let prefix = prefix(outcome, recording, own);
            let tracks = Tracks::of(recording, segment, &prefix);
            SegmentFigures::of(recording, segment, &tracks, &prefix, judged.best_key())
        };
        recording.segments.iter().zip(&judged.segments).map(of).collect()
    });
    let drawn: Vec<Vec<SegmentFigures>> = drawn.collect();
    let page = page_with((&outcome.experiment, outcome.rig), metrics, &drawn);
    let pictured = drawn.iter().flatten().flat_map(SegmentFigures::pictured);
    (page, pictured.cloned().collect())
}

/// Segments up to which each has a tab; of more each has sections with its name.
const TABS: usize = 24;

/// The page with these figures, segment by segment of each recording.
pub(super) fn page_with(
    (experiment, rig): (&Experiment, &str),
    metrics: &Metrics,
    drawn: &[Vec<SegmentFigures>],
) -> Page {
    let subtitle = experiment.description.clone().unwrap_or_default();
    let mut page = Page::new(experiment.name.to_string(), subtitle).with(verdict(metrics));
    page = undetermined(metrics).into_iter().fold(page, Page::with);
    let none = SegmentFigures::default();
    let segments = metrics.recordings.iter().map(|recording| recording.segments.len()).sum::<usize>();
    let are_tabs = (2..=TABS).contains(&segments);
    let mut is_first = true;
    for (recording, drawn) in metrics.recordings.iter().zip(drawn) {
        for (index, segment) in recording.segments.iter().enumerate() {
            let name = segment_name(&recording.name, segment);
            let drawn = drawn.get(index).unwrap_or(&none);
            let title =
                |what: &str| if segments <= TABS { what.to_owned() } else { format!("{name}: {what}") };
            let section = |what: &str, part: PagePart, figures: &[Figure]| {
                // What is asked for first is the motion.
                let is_folded = part != PagePart::Answer || !(is_first || are_tabs);
                let section = PageSection::new(title(what)).part(part).of_time(&name).folded(is_folded);
                let section = if are_tabs { section.in_tab(&name) } else { section };
                figures.iter().cloned().fold(section, PageSection::figure)
            };
            for (what, part, figures) in [
                ("Motion", PagePart::Answer, &drawn.answer),
                ("Against the reference, and consistency", PagePart::Evidence, &drawn.judged),
            ] {
                if !figures.is_empty() {
                    page = page.with(section(what, part, figures));
                }
            }
            page = page
                .with(section("Innovations", PagePart::Evidence, &drawn.innovations).table(tests(segment)))
                .with(
                    section("Inputs", PagePart::Made, &[])
                        .key_values(facts(recording, segment))
                        .table(details(segment)),
                );
            if !drawn.parameters.is_empty() {
                page = page.with(section("Parameters over time", PagePart::Parameters, &drawn.parameters));
            }
            is_first = false;
        }
    }
    page = parameters_table(metrics).into_iter().fold(page, |page, table| {
        page.with(PageSection::new("Parameters").part(PagePart::Parameters).table(table))
    });
    let toml = experiment.to_toml().unwrap_or_else(|e| format!("cannot be written: {e}"));
    let page = (budget(metrics).into_iter().fold(page, Page::with))
        .with(
            PageSection::new("What the numbers mean")
                .part(PagePart::Made)
                .folded(true)
                .paragraph(meaning(experiment, metrics)),
        )
        .with(
            PageSection::new("How it was made")
                .part(PagePart::Made)
                .paragraph(format!(
                    "`kalmems estimate` with the experiment below, by kalmems {}, rig {rig}. The same experiment and recording give the same page to the last byte; dates and durations are in `run.toml`, all numbers in `metrics.json`.",
                    env!("CARGO_PKG_VERSION"),
                ))
                .preformatted("The experiment as it was understood", toml),
        );
    explained(page)
}

/// Whether the filters are to be trusted, and why: a box for each severity, with the worst that each filter shows, and all findings in a fold.
fn verdict(metrics: &Metrics) -> PageSection {
    let (notes, reasons): (Vec<Notice>, Vec<Notice>) = without_repeats(notices(metrics))
        .into_iter()
        .partition(|notice| notice.severity == NoticeSeverity::Note);
    let notes = notes.iter().filter(|note| !is_of_the_undetermined(note));
    let mut notes: Vec<String> = notes.map(Notice::sentence).collect();
    if is_unexplained(metrics) {
        notes.push("`kalmems diagnose` with the same experiment file looks for the cause".to_owned());
    }
    notes.push("What the verdicts mean: `kalmems help verdict`".to_owned());
    let mut section = PageSection::new("Verdict").part(PagePart::Verdict);
    for answer in &metrics.answer {
        section = section.paragraph(answer);
    }
    let short = notices_in_short(metrics);
    for severity in [NoticeSeverity::Failure, NoticeSeverity::Warning, NoticeSeverity::Ok] {
        let own = short.iter().filter(|notice| notice.severity == severity);
        section = section.findings(severity, own.map(Notice::sentence).collect());
    }
    let is_whole = reasons.iter().all(|reason| reason.severity == NoticeSeverity::Ok);
    let all =
        if reasons.len() == 1 { "The finding".to_owned() } else { format!("All {} findings", reasons.len()) };
    let all = (!is_whole).then_some((all + " in full", reasons));
    let table = summary_table(metrics, false).with_verdicts("verdict", summary_grades(metrics));
    let section = all.into_iter().fold(section.table(table), |section, (all, reasons)| {
        let each = reasons.iter().map(|notice| (notice.severity, notice.sentence()));
        section.folded_notices(all, each.collect())
    });
    section.notes(notes)
}

/// Whether a note says what no estimate from this recording determines.
fn is_of_the_undetermined(note: &Notice) -> bool {
    ["hidden", "sign"].contains(&note.topic)
}

/// What the recording does not determine, and what no test of it shows; `None` if nothing is known of that kind.
fn undetermined(metrics: &Metrics) -> Option<PageSection> {
    let notices = without_repeats(notices(metrics)).into_iter();
    let hidden = notices
        .filter(|notice| notice.severity == NoticeSeverity::Note && is_of_the_undetermined(notice))
        .map(|notice| notice.sentence());
    let unseen =
        metrics.unseen.iter().map(|unseen| format!("no test of the innovations sees this: {unseen}"));
    let items: Vec<String> = hidden.chain(unseen).collect();
    let section = PageSection::new("What this recording cannot tell").part(PagePart::Verdict);
    (!items.is_empty()).then(|| section.list(items))
}

/// Rows of the budgets up to which they are in sight.
const BUDGET_ROWS: usize = 12;

/// What the claimed uncertainty is due to; `None` if there is no budget.
fn budget(metrics: &Metrics) -> Option<PageSection> {
    let table = budget_table(metrics);
    let is_long = table.as_ref().is_some_and(|table| table.rows.len() > BUDGET_ROWS);
    let mut section = PageSection::new("Uncertainty").part(PagePart::Budget).folded(is_long);
    section = table.into_iter().fold(section, PageSection::table);
    if !metrics.held_as_exact.is_empty() {
        let text = "Held as exact, since the device's table states no uncertainty of them: ";
        section = section.paragraph(format!("{text}{}.", metrics.held_as_exact.join(", ")));
    }
    (!section.blocks.is_empty()).then_some(section)
}

/// What the numbers of the summary are.
fn meaning(experiment: &Experiment, metrics: &Metrics) -> String {
    if !metrics.values.is_empty() {
        return "Errors are estimate minus reference, after the settling time. With the right model the mean NIS lies in its interval in 95 of 100 \
             recordings. A filter passes if no test of its innovations, of its parameters and of its errors against the reference finds \
             what a filter with the true model shows in less than one of a million recordings."
            .to_owned();
    }
    let sign = match experiment.estimate.as_ref().and_then(|e| e.first_peak) {
        Some(peak) => {
            let word = if peak == ExtremeSign::Positive { "positive" } else { "negative" };
            let mirrored: Vec<&str> =
                metrics.estimators().filter(|e| e.mirrored).map(|e| e.name.as_str()).collect();
            let turned = if mirrored.is_empty() {
                String::new()
            } else {
                format!(" To agree with that, the answer was mirrored for: {}.", mirrored.join(", "))
            };
            let second = match experiment.estimate.as_ref().and_then(|e| e.first_peak_y) {
                Some(ExtremeSign::Positive) => {
                    ", that of the second axis after a peak of its own drive positive"
                }
                Some(ExtremeSign::Negative) => {
                    ", that of the second axis after a peak of its own drive negative"
                }
                None => "",
            };
            format!(
                "The experiment states it: the first turning point of the angle after the first drive peak after the \
                 settling time is {word}{second}.{turned}"
            )
        }
        None => "The experiment does not state it, so it is that of each filter's start and means nothing."
            .to_owned(),
    };
    format!(
        "Errors are root mean squares after the settling time, against the reference. The phase is the timing from \
         a drive peak to the angle peak after it, in degrees of the motion's cycle. The mean NIS of a filter that is \
         right lies in its interval 95 times in 100. A filter passes where no test of its innovations, of its parameters and \
         of its errors against the reference finds what a filter that is right shows less than once in a million times. The sign of the motion cannot be known from this signal, which \
         is even in the angle. {sign}"
    )
}

fn facts(recording: &RecordingMetrics, segment: &SegmentMetrics) -> Vec<(&'static str, String)> {
    let mut facts = vec![
        ("recording", recording.file.clone()),
        ("reference", recording.reference.clone().unwrap_or_else(|| "none".to_owned())),
        (
            "length",
            format!("{} ms, of which {} ms to settle", milli(segment.duration_s), milli(segment.skip_s)),
        ),
    ];
    if let Some(origin) = &recording.origin {
        facts.push(("times", origin.sentence()));
    }
    match &segment.drive {
        Some(drive) => facts.push((
            "drive",
            format!(
                "{:.3} V + {:.3} V sine at {:.3} Hz; the motion at {}",
                drive.offset_v,
                drive.amplitude_v,
                drive.frequency_hz,
                against_drive(segment.motion_hz, drive.frequency_hz)
            ),
        )),
        None if segment.estimators.iter().any(|e| e.values.contains_key("position")) => {
            facts.push(("motion", format!("at {:.6} Hz", segment.motion_hz)));
        }
        None if segment.estimators.iter().any(|e| !e.values.is_empty()) => {}
        None => facts.push(("drive", "no steady sine: phases are not compared with it".to_owned())),
    }
    for axis in &segment.other_axes {
        facts.push((
            axis.angle,
            match &axis.drive {
                Some(drive) => format!(
                    "moves at {:.3} Hz; its part of the drive is at {:.3} Hz",
                    axis.motion_hz, drive.frequency_hz
                ),
                None => format!("moves at {:.3} Hz", axis.motion_hz),
            },
        ));
    }
    facts
}

/// The frequency of a motion, in words where it is that of the drive or half of it.
fn against_drive(motion_hz: f64, drive_hz: f64) -> String {
    /// Both follow from one fit, or from two that agree this well.
    const SAME: f64 = 1e-6;
    match motion_hz / drive_hz {
        ratio if (ratio - 0.5).abs() < SAME => "half the frequency".to_owned(),
        ratio if (ratio - 1.0).abs() < SAME => "the same frequency".to_owned(),
        _ => format!("{motion_hz:.3} Hz"),
    }
}

fn milli(seconds: f64) -> String {
    let text = format!("{:.3}", seconds * 1e3);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// One figure of a filter, where it has it.
type Detail = fn(&EstimatorMetrics) -> Option<f64>;
/// One figure of the errors of what is no angle; not a number where they have none.
type ValueDetail = fn(&ValueErrors) -> f64;
/// One figure of an angle's errors, where they have it.
type AngleDetail = fn(&MotionErrors) -> Option<f64>;

/// How probable the finding of each test of the innovations is: a row per test, a column per filter.
fn tests(segment: &SegmentMetrics) -> TextTable {
    let tested: Vec<&EstimatorMetrics> = segment
        .estimators
        .iter()
        .filter(|e| !e.tests.is_empty() && e.kind != TrajectoryKind::Smoothed)
        .collect();
    let columns = std::iter::once(ColumnHead::text("test"))
        .chain(tested.iter().map(|e| ColumnHead::number(&e.name, "")));
    let caption = "Tests of the innovations: how probable what they find is for a consistent filter; one fails below 1e-6";
    let mut table = TextTable::new(caption, columns);
    let mut all: Vec<InnovationTest> = tested.iter().flat_map(|e| &e.tests).map(|found| found.test).collect();
    all.sort_unstable();
    all.dedup();
    for test in all {
        let of = |e: &&EstimatorMetrics| {
            let found = e.tests.iter().find(|found| found.test == test);
            let of_signal = |found: &TestResult| {
                let of = found.signal.as_ref().map_or_else(String::new, |of| format!(" of {of}"));
                probability(found.p_value) + &of
            };
            found.map_or_else(|| "–".to_owned(), of_signal)
        };
        table.push(std::iter::once(test.words().to_owned()).chain(tested.iter().map(of)));
    }
    table
}

/// The smallest probability that the tails of the tests' distributions give in double precision.
const SMALLEST_PROBABILITY: f64 = 1e-300;

/// A probability: two digits, with an exponent if zeros would be many.
fn probability(value: f64) -> String {
    match value {
        value if value < SMALLEST_PROBABILITY => format!("< {SMALLEST_PROBABILITY:e}"),
        value if value < 0.01 => format!("{value:.1e}"),
        value => format!("{value:.2}"),
    }
}

/// What the summary leaves out: a row per quantity that a filter has, a column per filter.
fn details(segment: &SegmentMetrics) -> TextTable {
    let names = segment.estimators.iter().map(|estimator| ColumnHead::number(&estimator.name, ""));
    let columns = [ColumnHead::text("quantity"), ColumnHead::text("unit")].into_iter().chain(names);
    let mut table = TextTable::new("More numbers", columns);
    let mut push = |name: String, unit: &str, digits: usize, values: Vec<Option<f64>>| {
        // Without a reference there are no errors.
        if values.iter().all(Option::is_none) {
            return;
        }
        let cells = values.into_iter().map(|v| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.digits$}")));
        table.push([name, unit.to_owned()].into_iter().chain(cells));
    };
    let of_angle: [(&str, &str, usize, AngleDetail); 8] = [
        ("largest angle error", "deg", 4, |e| Some(e.angle.largest_deg)),
        ("angle errors within ±3σ", "%", 2, |e| Some(100.0 * e.angle.within_three_sigma?)),
        ("cycle phase RMSE", "deg", 4, |e| e.cycle_phase_rmse_deg),
        ("mean phase shift, estimate", "deg", 3, |e| e.phase_shift_estimate_deg),
        ("mean phase shift, reference", "deg", 3, |e| e.phase_shift_reference_deg),
        ("mean amplitude, reference", "deg", 3, |e| e.amplitude_reference_deg),
        ("peaks compared", "", 0, |e| Some(e.peaks as f64)),
        ("peaks without a partner", "", 0, |e| Some(e.peaks_without_partner as f64)),
    ];
    let of_value: [(&str, &str, ValueDetail); 6] = [
        ("RMSE", "", |e| e.rmse),
        ("RMS of the reference over RMSE", "dB", |e| e.snr_db.unwrap_or(f64::NAN)),
        ("largest error", "", |e| e.largest),
        ("scale factor error", "ppm", |e| 1e6 * (e.scale_factor.unwrap_or(f64::NAN) - 1.0)),
        ("offset", "", |e| e.offset.unwrap_or(f64::NAN)),
        ("errors within ±3σ", "%", |e| 100.0 * e.within_three_sigma.unwrap_or(f64::NAN)),
    ];
    let mut known: Vec<(&str, &'static str)> = Vec::new();
    for (name, errors) in segment.estimators.iter().flat_map(|e| &e.values) {
        if !known.contains(&(name, errors.unit)) {
            known.push((name, errors.unit));
        }
    }
    for (name, si) in &known {
        let (unit, factor) = shown(si);
        for (figure, own_unit, of) in of_value {
            let (unit, factor) = if own_unit.is_empty() { (unit, factor) } else { (own_unit, 1.0) };
            let values = segment.estimators.iter().map(|e| Some(of(e.values.get(name)?) * factor));
            push(format!("{name}: {figure}"), unit, 4, values.map(|v| v.filter(|v| v.is_finite())).collect());
        }
    }
    let angles = segment.estimators.iter().filter_map(|e| e.errors.as_ref()).map(|e| e.each().count()).max();
    for index in 0..angles.unwrap_or(usize::from(known.is_empty())) {
        let errors: Vec<Option<&MotionErrors>> =
            segment.estimators.iter().map(|e| e.errors.as_ref()?.each().nth(index)).collect();
        let of = errors.iter().flatten().next().map(|e| e.of);
        for (name, unit, digits, figure) in of_angle {
            let name = match of {
                Some(of) if angles > Some(1) => format!("{of}: {name}"),
                _ => name.to_owned(),
            };
            push(name, unit, digits, errors.iter().map(|e| figure((*e)?)).collect());
        }
    }
    let of_filter: [(&str, &str, usize, Detail); 2] = [
        ("updates", "", 0, |e| Some(e.counts.updates as f64)),
        ("log-likelihood", "", 1, |e| Some(e.consistency.as_ref()?.log_likelihood)),
    ];
    for (name, unit, digits, figure) in of_filter {
        push(name.to_owned(), unit, digits, segment.estimators.iter().map(figure).collect());
    }
    table
}
