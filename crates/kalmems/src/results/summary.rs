//! The figures as a table, and the sentences that must not be missed.

use super::verdict::angles_of;
use super::{EstimatorMetrics, FilterSelection, Metrics, RecordingMetrics, SegmentMetrics, Verdict};
use crate::estimate::{
    LockEvent, NisConsistency, ParameterCorrelation, SignalConsistency, SkippedStretch, TrajectoryKind,
};
use crate::evaluate::{
    Claim, DeviceUncertainty, ErrorDecomposition, Grade, MotionErrors, ParameterAnswer, PartErrors,
    StepErrors, TestResult, nis,
};
use crate::inspect::{fitting_unit, quantity};
use crate::topics::{SHORT, link, topic};
use kalmems_figures::{ColumnHead, NoticeSeverity, TextTable, cut_to, first_clause, significant};
use kalmems_models::constants::STANDARD_GRAVITY;
use std::fmt;

/// A sentence about a result, and how serious it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// How serious it is.
    pub severity: NoticeSeverity,
    /// The recording, or the segment of it, that it is about; empty if it is about all.
    pub place: String,
    /// The filter that it is about; empty if it is about none.
    pub filter: String,
    /// The sentence.
    pub text: String,
    /// The topic of `kalmems help` that explains it; empty for none.
    pub topic: &'static str,
    /// How large what it says is, to find the worst of several; 0 where it is no number.
    pub(super) size: f64,
    /// What it says in a few words; empty if its first clause does.
    pub(super) brief: String,
    /// What follows it in brackets: the number of further findings, and the command that explains it.
    tail: String,
}

/// Characters of names of filters; of longer ones the first is named and the others are counted.
const NAMES: usize = 40;

impl Notice {
    /// A sentence about a whole result.
    pub fn new(severity: NoticeSeverity, text: impl Into<String>) -> Self {
        let [place, filter, brief, tail] = [const { String::new() }; 4];
        Self { severity, place, filter, text: text.into(), topic: "", size: 0.0, brief, tail }
    }

    /// With the topic that explains it.
    #[must_use]
    pub fn explained_by(self, topic: &'static str) -> Self {
        Self { topic, ..self }
    }

    /// With the recording or segment that it is about.
    #[must_use]
    pub fn at(self, place: impl Into<String>) -> Self {
        Self { place: place.into(), ..self }
    }

    /// The sentence with what it is about and with the command that explains it.
    pub fn sentence(&self) -> String {
        let about = [&self.place, &self.filter].into_iter().filter(|about| !about.is_empty());
        let about: String = about.flat_map(|about| [about.as_str(), ": "]).collect();
        format!("{about}{}{}{}", self.text, self.tail, link(self.topic))
    }

    /// In a few words, with the number of further findings and with the command that says what to do.
    fn in_short(self, others: usize) -> Self {
        let more = (others > 0).then(|| format!("{others} more"));
        let command = topic(self.topic).map(|topic| format!("`{}`", topic.command()));
        let tail = more.into_iter().chain(command).collect::<Vec<String>>().join("; ");
        let tail = if tail.is_empty() { tail } else { format!(" ({tail})") };
        let text = if self.brief.is_empty() { first_clause(&self.text) } else { &self.brief }.to_owned();
        Self { text, tail, topic: "", ..self }
    }

    /// Cuts what does not fit a line of [`SHORT`] characters.
    fn cut(&mut self) {
        let mut names = self.filter.split("; ");
        if let (Some(first), others) = (names.next(), names.count())
            && others > 0
            && self.filter.chars().count() > NAMES
        {
            self.filter = format!("{first} and {others} more filters");
        }
        let length = |text: &str| text.chars().count();
        let room = SHORT.saturating_sub(length(&self.to_string()) - length(&self.text));
        self.text = cut_to(&self.text, room);
    }
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mark = match self.severity {
            NoticeSeverity::Ok => "ok",
            NoticeSeverity::Note => "note",
            NoticeSeverity::Warning => "WARNING",
            NoticeSeverity::Failure => "FAILURE",
        };
        write!(f, "{mark}: {}", self.sentence())
    }
}

/// The table that a run prints: one row per filter. Without durations it is the same for the same input.
pub fn summary_table(metrics: &Metrics, with_durations: bool) -> TextTable {
    let several = metrics.recordings.iter().map(|r| r.segments.len()).sum::<usize>() > 1;
    let mut columns = Vec::new();
    if several {
        columns.push(ColumnHead::text("segment"));
    }
    columns.push(ColumnHead::text("estimator"));
    let value = value_column(metrics);
    // Without a reference there are no errors.
    let is_compared = metrics.estimators().any(|e| e.errors.is_some() || !e.values.is_empty());
    let compared = match &value {
        _ if !is_compared => ComparedQuantity::Nothing,
        Some(value) => ComparedQuantity::Value(value),
        None => ComparedQuantity::Angles,
    };
    match compared {
        ComparedQuantity::Nothing => {}
        ComparedQuantity::Value(value) => {
            let unit = &value.unit;
            columns.extend([
                ColumnHead::number(format!("{} RMSE", value.name), unit),
                if value.is_rate() {
                    ColumnHead::number("scale factor", "")
                } else {
                    ColumnHead::number("mean error", unit)
                },
                ColumnHead::number(if value.is_rate() { "bias" } else { "largest error" }, unit),
                ColumnHead::number("within ±3σ", "%"),
            ]);
        }
        ComparedQuantity::Angles => columns.extend([
            ColumnHead::number("angle RMSE", "deg"),
            ColumnHead::number("of p-p", "%"),
            ColumnHead::number("phase RMSE", "deg"),
            ColumnHead::number("amplitude RMSE", "deg"),
        ]),
    }
    columns.extend([
        ColumnHead::number("mean NIS", ""),
        ColumnHead::text("95 % expected"),
        ColumnHead::text("verdict"),
    ]);
    if with_durations {
        columns.push(ColumnHead { numeric: true, ..ColumnHead::text("per step") });
    }
    let expendable = ["per step", "amplitude RMSE", "of p-p", "within ±3σ", "phase RMSE", "95 % expected"];
    let mut table = TextTable::new("", columns).with_expendable(&expendable);
    for recording in &metrics.recordings {
        for segment in &recording.segments {
            for estimator in &segment.estimators {
                let name = several.then(|| segment_name(&recording.name, segment));
                let duration = with_durations.then(|| per_step(estimator.seconds_per_step));
                let own = row(estimator, compared);
                table.push(name.clone().into_iter().chain(own).chain(duration));
                for part in estimator.errors.iter().flat_map(|e| &e.parts) {
                    let duration = with_durations.then(String::new);
                    table.push(name.clone().into_iter().chain(row_of_part(part)).chain(duration));
                }
                for errors in estimator.errors.iter().flat_map(|e| &e.other_angles) {
                    let duration = with_durations.then(String::new);
                    table.push(name.clone().into_iter().chain(row_of_axis(errors)).chain(duration));
                }
                for signal in &estimator.by_signal {
                    let duration = with_durations.then(String::new);
                    let own = row_of_signal(signal, compared);
                    table.push(name.clone().into_iter().chain(own).chain(duration));
                }
            }
        }
    }
    table
}

/// How serious the verdict of each row of the summary is.
pub(super) fn summary_grades(metrics: &Metrics) -> Vec<NoticeSeverity> {
    let of = |estimator: &EstimatorMetrics| {
        let severity = match estimator.grade {
            Some(grade) => severity_of(grade),
            None if estimator.verdict.is_of_an_estimate() => NoticeSeverity::Note,
            None => NoticeSeverity::Failure,
        };
        let errors = estimator.errors.iter();
        // The rows of its parts, of its other angles and of its signals follow.
        let more = errors.map(|errors| errors.parts.len() + errors.other_angles.len()).sum::<usize>();
        std::iter::repeat_n(severity, 1 + more + estimator.by_signal.len())
    };
    metrics.estimators().flat_map(of).collect()
}

/// With a unit; nothing for what takes no steps.
fn per_step(seconds: f64) -> String {
    if seconds.is_finite() { quantity(significant_value(seconds), "s") } else { "–".to_owned() }
}

pub(super) fn segment_name(recording: &str, segment: &SegmentMetrics) -> String {
    let mut name = recording.to_owned();
    if !segment.label.is_empty() {
        name += &format!(", {}", segment.label);
    }
    if let Some(stretch) = segment.stretch {
        name += &format!(", stretch {}", stretch.number);
    }
    name
}

/// A quantity that is no angle, of which the table has figures.
struct SummaryValueColumn {
    name: &'static str,
    /// Its SI unit as column names have it.
    si: &'static str,
    /// The unit of the figures.
    unit: String,
    /// How many of that one of the SI unit is.
    factor: f64,
}

impl SummaryValueColumn {
    /// Whether it is an angular rate, which is judged by its scale factor and bias.
    fn is_rate(&self) -> bool {
        self.si == "rad_per_s"
    }
}

/// Figures between these read well in the unit that people use.
const READABLE: std::ops::Range<f64> = 0.01..1000.0;

/// What the device is for, where that is no angle; what comes next, where that is not compared. What the others are,
/// the page and `metrics.json` tell.
fn value_column(metrics: &Metrics) -> Option<SummaryValueColumn> {
    let first = metrics.values.first()?;
    let compared = |name: &str| metrics.estimators().find_map(|e| e.values.get(name));
    let found = metrics.values.iter().find_map(|v| compared(v.name).map(|errors| (v.name, errors.unit)));
    let (name, si) = found.unwrap_or((first.name, "1"));
    let (unit, factor) = shown(si);
    let sizes = metrics.estimators().filter_map(|e| e.values.get(name)).map(|errors| errors.rmse);
    let ends =
        sizes.filter(|size| size.is_finite() && *size > 0.0).fold(None, |ends: Option<[f64; 2]>, size| {
            let [low, high] = ends.unwrap_or([size, size]);
            Some([low.min(size), high.max(size)])
        });
    // In the middle of the largest and the smallest, as ratios.
    let middle = ends.map_or(0.0, |[low, high]| low.sqrt() * high.sqrt());
    let reads_well = middle == 0.0 || READABLE.contains(&(middle * factor));
    let (unit, factor) = if reads_well || si == "m_per_s2" {
        (unit.to_owned(), factor)
    } else {
        fitting_unit(middle, &unit_of(si))
    };
    Some(SummaryValueColumn { name, si, unit, factor })
}

/// The unit of a column's name as people write it: `rad/s` of `rad_per_s`.
fn unit_of(si: &str) -> String {
    si.replace("_per_", "/").replace('_', " ")
}

/// The unit in which people read a quantity of this SI unit, and how many of it one of that is.
pub(super) fn shown(si: &'static str) -> (&'static str, f64) {
    match si {
        "F" => ("fF", 1e15),
        "m_per_s2" => ("mg", 1e3 / STANDARD_GRAVITY),
        "m" => ("nm", 1e9),
        "m_per_s" => ("µm/s", 1e6),
        "rad_per_s" => ("rad/s", 1.0),
        other => (other, 1.0),
    }
}

/// What a summary compares with references.
#[derive(Clone, Copy)]
enum ComparedQuantity<'a> {
    Nothing,
    Angles,
    Value(&'a SummaryValueColumn),
}

/// The row of an estimator.
fn row(estimator: &EstimatorMetrics, compared: ComparedQuantity) -> Vec<String> {
    let consistency = estimator.consistency.as_ref();
    let errors = estimator.errors.as_ref();
    let name = match errors {
        Some(errors) if !errors.other_angles.is_empty() => format!("{}, {}", estimator.name, errors.of),
        _ => estimator.name.clone(),
    };
    let mut cells = vec![name];
    match compared {
        ComparedQuantity::Nothing => {}
        ComparedQuantity::Value(value) => cells.extend(value_figures(estimator, value)),
        ComparedQuantity::Angles => cells.extend(figures(errors)),
    }
    cells.extend([
        consistency.map_or_else(|| "–".to_owned(), |c| nis(c.mean_nis)),
        consistency.map_or_else(|| "–".to_owned(), |c| format!("{:.3} … {:.3}", c.lower, c.upper)),
        estimator.verdict_words(),
    ]);
    cells
}

/// Another axis of the estimator above: what belongs to the estimator as a whole is not said again.
fn row_of_axis(errors: &MotionErrors) -> Vec<String> {
    let mut cells = vec![format!("  {}", errors.of)];
    cells.extend(figures(Some(errors)));
    cells.extend([const { String::new() }; 3]);
    cells
}

/// One of the signals of the estimator above: its mean NIS, which is part of the one above.
fn row_of_signal(signal: &SignalConsistency, compared: ComparedQuantity) -> Vec<String> {
    let SignalConsistency { signal, mean_nis, lower, upper, .. } = signal;
    let mut cells = vec![format!("  signal {signal}")];
    if !matches!(compared, ComparedQuantity::Nothing) {
        cells.extend([const { String::new() }; 4]);
    }
    cells.extend([nis(*mean_nis), format!("{lower:.3} … {upper:.3}"), String::new()]);
    cells
}

/// A part of the recording.
fn row_of_part(part: &PartErrors) -> Vec<String> {
    let mut cells =
        vec![format!("  {} to {} ms", significant(part.from_s * 1e3), significant(part.to_s * 1e3))];
    cells.push(significant(part.rmse_deg));
    cells.extend([const { String::new() }; 6]);
    cells
}

fn figures(errors: Option<&MotionErrors>) -> [String; 4] {
    let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), significant);
    [
        number(errors.map(|e| e.angle.rmse_deg)),
        number(errors.map(|e| e.angle.rmse_percent_of_peak_to_peak)),
        number(errors.and_then(|e| e.peak_phase_rmse_deg)),
        number(errors.and_then(|e| e.amplitude_rmse_deg)),
    ]
}

fn value_figures(estimator: &EstimatorMetrics, value: &SummaryValueColumn) -> [String; 4] {
    let errors = estimator.values.get(value.name);
    let factor = value.factor;
    let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), significant);
    let [second, third] = if value.is_rate() {
        let scale = errors.and_then(|e| e.scale_factor);
        let scale = scale.map_or_else(|| "–".to_owned(), |scale| format!("{scale:.6}"));
        [scale, number(errors.and_then(|e| e.offset).map(|offset| offset * factor))]
    } else {
        [number(errors.map(|e| e.bias * factor)), number(errors.map(|e| e.largest * factor))]
    };
    [
        number(errors.map(|e| e.rmse * factor)),
        second,
        third,
        number(errors.and_then(|e| Some(100.0 * e.within_three_sigma?))),
    ]
}

/// Parameters that the signal cannot tell, of which so many are told: those that change the answer most.
const SCALE_NOTES: usize = 4;

/// The correlation of two parameters from which on a recording does not tell them apart.
const INSEPARABLE: f64 = 0.99;

/// What a reader must know before trusting a figure, the worst first.
pub fn notices(metrics: &Metrics) -> Vec<Notice> {
    let mut notices = Vec::new();
    let note = |text: String| Notice::new(NoticeSeverity::Note, text);
    for recording in &metrics.recordings {
        let file = &recording.file;
        notices.extend(recording.origin.iter().map(|origin| note(origin.sentence()).at(file)));
        let found = recording.diagnosis.iter().map(|finding| note(finding.message.clone()).at(file));
        notices.extend(found.map(|found| found.explained_by("findings")));
        let reference = recording.reference.as_deref();
        let of = reference.unwrap_or("the reference");
        let found = recording.reference_diagnosis.iter().map(|finding| note(finding.message.clone()).at(of));
        notices.extend(found.map(|found| found.explained_by("findings")));
        for left_out in &recording.stretches.first_left_out {
            let SkippedStretch { stretch, samples, start_s, why, .. } = left_out;
            let from = quantity(*start_s, "s");
            let text =
                format!("stretch {stretch}: {samples} samples from {from} on are not estimated: {why}");
            notices.push(note(text).explained_by("findings"));
        }
        let named = recording.stretches.first_left_out.len();
        if let Some(more) = recording.stretches.left_out.checked_sub(named).filter(|more| *more > 0) {
            let text = format!("samples of {more} more stretches, or of their beginnings, are not estimated");
            notices.push(note(text).at(file));
        }
        for segment in &recording.segments {
            let place = segment_name(&recording.name, segment);
            if let Some(reference) = reference
                && segment.estimators.iter().all(|e| e.errors.is_none() && e.values.is_empty())
            {
                let text = format!(
                    "the reference {reference} has no sample of this segment to compare with after the settling time"
                );
                notices.push(note(text).at(&place));
            }
            notices
                .extend(segment.likeliest.iter().map(|likeliest| note(of_the_choice(likeliest)).at(&place)));
            notices.extend(of_the_signs(segment).map(|text| note(text).at(&place).explained_by("sign")));
            notices.extend(segment.remarks.iter().map(|remark| note(remark.clone()).at(&place)));
            for estimator in &segment.estimators {
                let own = sentences(estimator, segment.sign_is_hidden).into_iter();
                notices.extend(own.map(|notice| Notice {
                    place: place.clone(),
                    filter: estimator.name.clone(),
                    ..notice
                }));
            }
        }
    }
    let fault = metrics.input_fault.iter();
    notices.extend(
        fault.map(|fault| Notice::new(NoticeSeverity::Failure, fault.to_string()).explained_by("lock")),
    );
    notices.extend(
        metrics.noise_from_recording.iter().map(|noise| note(noise.to_string()).explained_by("noise")),
    );
    let hidden = metrics.scale_notes.iter().take(SCALE_NOTES).map(|hidden| note(hidden.to_string()));
    notices.extend(hidden.map(|hidden| hidden.explained_by("hidden")));
    if let Some(more) = metrics.scale_notes.len().checked_sub(SCALE_NOTES).filter(|more| *more > 0) {
        let text = format!("`metrics.json` lists {more} more numbers that the signal does not determine");
        notices.push(note(text).explained_by("hidden"));
    }
    for estimator in metrics.estimators() {
        let firm = |of: &&ParameterCorrelation| of.correlation.abs() > INSEPARABLE;
        for ParameterCorrelation { names: [first, second], correlation } in
            estimator.parameter_correlations.iter().filter(firm)
        {
            let text = format!(
                "`{first}` and `{second}` have a correlation of {correlation:.4}: the recording determines a combination of both, and \
                 neither separately"
            );
            notices.push(Notice { filter: estimator.name.clone(), ..note(text).explained_by("hidden") });
        }
    }
    notices.sort_by_key(|notice| std::cmp::Reverse(order(notice.severity)));
    notices
}

/// What is said of signs that the signals do not tell.
fn of_the_signs(segment: &SegmentMetrics) -> Option<String> {
    let arbitrary = segment.arbitrary.sentence()?;
    let has_signs_alone = segment.arbitrary.half_turns.is_empty() && segment.arbitrary.turns.is_empty();
    let branch = if has_signs_alone { "sign" } else { "branch" };
    let stated = if segment.sign_is_hidden {
        "`first_peak` in `[estimate]` states it".to_owned()
    } else {
        format!("a start whose {branch} is known states it")
    };
    let compared = segment.estimators.iter().any(|one| one.errors.is_some() || !one.values.is_empty());
    let by_reference = if compared {
        format!("; the errors are those of the {branch} that is nearer to the reference")
    } else {
        String::new()
    };
    Some(format!("{arbitrary}; {stated}{by_reference}"))
}

/// The place of a notice among others: the worst has the largest.
fn order(severity: NoticeSeverity) -> u8 {
    match severity {
        NoticeSeverity::Failure => 3,
        NoticeSeverity::Warning => 2,
        NoticeSeverity::Note => 1,
        NoticeSeverity::Ok => 0,
    }
}

/// Whether a filter fails a test of its innovations, so that `kalmems diagnose` may find the cause.
pub fn is_unexplained(metrics: &Metrics) -> bool {
    metrics.estimators().any(|estimator| !estimator.passes() && estimator.failing().next().is_some())
}

/// The same for a terminal: of each filter the worst finding about its verdict in at most 140 characters, with the number of further ones; what
/// is the same of several filters once; each explanation of a note named once.
pub fn notices_in_short(metrics: &Metrics) -> Vec<Notice> {
    let is_alone = metrics.recordings.iter().map(|recording| recording.segments.len()).sum::<usize>() == 1;
    let mut short = without_repeats(worst_of_each_filter(notices(metrics)));
    let mut explained = Vec::new();
    for notice in &mut short {
        if is_alone && !notice.filter.is_empty() {
            notice.place.clear();
        }
        if order(notice.severity) >= order(NoticeSeverity::Warning) {
            notice.cut();
        }
        if explained.contains(&notice.topic) {
            notice.topic = "";
        } else {
            explained.push(notice.topic);
        }
    }
    short
}

/// One sentence for all filters of which the same is said of the same segment.
pub fn without_repeats(notices: Vec<Notice>) -> Vec<Notice> {
    let mut once: Vec<Notice> = Vec::new();
    for notice in notices {
        let same = once.iter_mut().find(|known| {
            !notice.filter.is_empty()
                && (known.severity, &known.place, &known.text, &known.tail)
                    == (notice.severity, &notice.place, &notice.text, &notice.tail)
        });
        match same {
            Some(known) => known.filter += &format!("; {}", notice.filter),
            None => once.push(notice),
        }
    }
    once
}

/// Of what speaks against each filter the worst in short, with the number of further findings.
fn worst_of_each_filter(notices: Vec<Notice>) -> Vec<Notice> {
    let mut short: Vec<(Notice, usize)> = Vec::new();
    for notice in notices {
        let is_against =
            order(notice.severity) >= order(NoticeSeverity::Warning) && !notice.filter.is_empty();
        let known = short.iter_mut().find(|(known, _)| {
            is_against && (known.severity, &known.filter) == (notice.severity, &notice.filter)
        });
        match known {
            Some((worst, others)) => {
                *others += 1;
                if notice.size > worst.size {
                    *worst = notice;
                }
            }
            None => short.push((notice, 0)),
        }
    }
    let of = |(worst, others): (Notice, usize)| {
        let is_short = order(worst.severity) >= order(NoticeSeverity::Warning);
        if is_short { worst.in_short(others) } else { worst }
    };
    short.into_iter().map(of).collect()
}

/// When the signal was lost and found again, of a filter that has found it each time.
fn of_losses(estimator: &EstimatorMetrics) -> String {
    let events = &estimator.lock.events;
    let is_loss = |event: &&LockEvent| matches!(event, LockEvent::Lost { .. } | LockEvent::Stopped { .. });
    let losses = events.iter().filter(is_loss).count();
    let first = events.iter().take(2).map(ToString::to_string).collect::<Vec<_>>().join("; it ");
    let more = match losses - losses.min(1) {
        0 => String::new(),
        1 => "; once more later".to_owned(),
        more => format!("; {more} more times later"),
    };
    format!(
        "{first}{more}; the {} samples until it had settled again are no estimate and are left out of the errors and of the tests",
        estimator.counts.lost
    )
}

fn sentences(estimator: &EstimatorMetrics, sign_is_hidden: bool) -> Vec<Notice> {
    let mut said = Vec::new();
    if let Some(failure) = &estimator.failure {
        said.push(Notice::new(NoticeSeverity::Failure, failure.clone()).explained_by("lock"));
    }
    if estimator.verdict.is_of_an_estimate() && !estimator.lock.events.is_empty() {
        said.push(Notice::new(NoticeSeverity::Warning, of_losses(estimator)).explained_by("loss"));
    } else if let Some(first) = estimator.lock.events.first() {
        let more = match estimator.lock.events.len() - 1 {
            0 => String::new(),
            more => format!(", and {more} more times"),
        };
        said.push(if estimator.verdict == Verdict::Astray {
            let text = format!("does not follow the signal, as no measurement corrects it: {first}{more}");
            Notice::new(NoticeSeverity::Note, text)
        } else {
            let text = format!("{first}{more}; this is no estimate of the motion");
            Notice::new(NoticeSeverity::Failure, text).explained_by("lock")
        });
    }
    if let Some(lag) = estimator.errors.as_ref().and_then(|errors| errors.reference_lag) {
        let text = format!(
            "the reference shows the motion {} later than the experiment states; with that its error would be {} deg: correct \
             `delay` in `[recording.reference]`",
            quantity(significant_value(lag.lag_s), "s"),
            significant(lag.rmse_deg)
        );
        said.push(Notice::new(NoticeSeverity::Warning, text).explained_by("sign"));
    }
    if estimator.verdict == Verdict::WrongSign {
        let angles = angles_of(estimator.verdict, &estimator.lock, estimator.errors.as_ref());
        let of = if angles.is_empty() { String::new() } else { format!(" in {}", angles.join(" and ")) };
        let mend = match (sign_is_hidden, of.is_empty()) {
            (true, true) => {
                "the signal does not show the sign of the motion, so correct `estimate.first_peak`"
            }
            (true, false) => {
                "the signal does not show the sign of the motion, so correct `estimate.first_peak` of that axis"
            }
            (false, _) => {
                "the signal of this device shows the sign, so that the signal or the reference is recorded with the opposite one: \
                 `scale = -1` of its channel turns it"
            }
        };
        let text = format!("the estimate has the opposite sign of the reference{of}; {mend}");
        said.push(Notice::new(NoticeSeverity::Failure, text).explained_by("sign"));
    }
    said.extend(of_the_grade(estimator));
    let learnt = of_what_could_be_learnt(estimator);
    said.extend(learnt.map(|text| Notice::new(NoticeSeverity::Note, text).explained_by("uncertainty")));
    if estimator.rejections.count > 0 {
        let text = estimator.rejections.sentence();
        said.push(Notice::new(NoticeSeverity::Note, text).explained_by("outliers"));
    }
    let counts = &estimator.counts;
    let counted = [
        (counts.without_signal, "samples without a signal, predicted and not corrected", "findings"),
        (counts.bridged, "samples that the recording leaves out, predicted over", "findings"),
        (
            counts.drive_from_sine,
            "samples without a drive, for which the sine that the rest of it follows was used",
            "findings",
        ),
        (
            counts.drive_bends,
            "samples at which the drive bends too sharply for its feedthrough to be known, which did not correct the filter",
            "",
        ),
        (
            counts.for_start,
            "samples of the beginning from which the start was found, and which were not used again",
            "",
        ),
        (
            counts.restarted,
            "new starts from the signal while the filter settled, as a sample had disturbed it and it lost the signal",
            "outliers",
        ),
        (
            counts.crossings_refused,
            "crossings that the gate rejected, which did not correct the filter",
            "outliers",
        ),
    ];
    for (count, what, topic) in counted {
        if count > 0 {
            said.push(Notice::new(NoticeSeverity::Note, format!("{what}: {count}")).explained_by(topic));
        }
    }
    said
}

/// A value with three digits, for a sentence.
pub(super) fn significant_value(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Which uncertain number of the device, if any, dominates what a filter claims although the recording tells it far better than what is stated.
fn of_what_could_be_learnt(estimator: &EstimatorMetrics) -> Option<String> {
    let budget = estimator.uncertainty_budget.first()?;
    let number =
        budget.device.first().filter(|number| number.sd > budget.noise && number.is_told_better())?;
    let [_, sd] = number.told?;
    Some(format!(
        "the uncertainty of `{}` causes most of the claimed standard deviation, and this recording determines that number to {} of its stated \
         uncertainty: estimate it as a state of the filter (`states`), or identify it with `kalmems identify`",
        number.name,
        significant(sd)
    ))
}

/// Which of several filters to take.
fn of_the_choice(likeliest: &FilterSelection) -> String {
    let FilterSelection { name, log_likelihood, .. } = likeliest;
    match likeliest.ahead {
        None => format!("`{name}` is the only one of these filters that passes"),
        Some(ahead) if likeliest.is_tied() => format!(
            "of the filters that pass, `{name}` and the next one predict the signal equally well: their log-likelihoods are \
             {log_likelihood:.1} and {:.1}",
            log_likelihood - ahead
        ),
        Some(ahead) => format!(
            "of the filters that pass, `{name}` predicts the signal best: its log-likelihood is {log_likelihood:.1}, {ahead:.1} above \
             that of the next one"
        ),
    }
}

/// What became of the parameters that are states; `None` where none is.
pub fn parameters_table(metrics: &Metrics) -> Option<TextTable> {
    let words =
        ["estimator", "parameter", "known before", "at the end", "sd at the end"].map(ColumnHead::text);
    let change = ColumnHead::number("change in sd before", "");
    let mut table = TextTable::new("Parameters as states", words.into_iter().chain([change]));
    for recording in &metrics.recordings {
        for segment in &recording.segments {
            for estimator in segment.estimators.iter().filter(|e| e.kind != TrajectoryKind::Smoothed) {
                for parameter in &estimator.parameters {
                    let ParameterAnswer { name, unit, start_sd, end, end_sd, .. } = parameter;
                    let number = |value: f64| match *unit {
                        "1" => format!("{} %", significant(100.0 * value)),
                        unit => quantity(significant_value(value), &unit_of(unit)),
                    };
                    let numbers =
                        [number(*start_sd), number(*end), number(*end_sd), significant(end / start_sd)];
                    table.push([estimator.name.clone(), (*name).to_owned()].into_iter().chain(numbers));
                }
            }
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

/// The share of a claimed variance from which on what causes it has a row of its own.
const LISTED: f64 = 1e-3;

/// What the claims of what the device is for are due to; `None` where nothing of the device is stated as uncertain.
pub fn budget_table(metrics: &Metrics) -> Option<TextTable> {
    let segments = || {
        let named = |recording: &'_ RecordingMetrics, segment: &'_ SegmentMetrics| {
            segment_name(&recording.name, segment)
        };
        metrics
            .recordings
            .iter()
            .flat_map(move |one| one.segments.iter().map(move |own| (named(one, own), own)))
    };
    let has_several = segments().nth(1).is_some();
    let words = ["estimator", "claimed of", "due to"].map(ColumnHead::text);
    let numbers = [
        ColumnHead::text("sd"),
        ColumnHead::number("of the variance", "%"),
        ColumnHead::text("the recording tells it to"),
    ];
    let segment = has_several.then(|| ColumnHead::text("segment"));
    let mut table = TextTable::new(
        "What the claimed uncertainty is due to",
        segment.into_iter().chain(words).chain(numbers),
    )
    .with_expendable(&["the recording tells it to", "claimed of"]);
    let estimators =
        segments().flat_map(|(name, own)| own.estimators.iter().map(move |one| (name.clone(), one)));
    for (segment, estimator) in estimators {
        let of_interest = metrics.values.first().map(|value| value.name);
        let budgets = &estimator.uncertainty_budget;
        let named = budgets.iter().find(|budget| Some(budget.state) == of_interest);
        let Some(budget) = named.or(budgets.first()) else { continue };
        let (unit, factor) =
            if budget.unit == "rad" { ("deg", 1f64.to_degrees()) } else { shown(budget.unit) };
        let told = |number: &DeviceUncertainty| {
            number.told.map_or_else(|| "–".to_owned(), |[mean, sd]| format!("{mean:+.2} ± {sd:.2} stated sd"))
        };
        let own = ("noise and start".to_owned(), budget.noise, "–".to_owned());
        // What this filter does not use has no part of it.
        let used = budget.device.iter().filter(|number| number.sd > 0.0);
        let is_listed = |number: &&DeviceUncertainty| (number.sd / budget.sd).powi(2) >= LISTED;
        let (listed, others): (Vec<_>, Vec<_>) = used.partition(is_listed);
        let device = listed.into_iter().map(|number| (format!("`{}`", number.name), number.sd, told(number)));
        let smaller = others.iter().map(|number| number.sd * number.sd).sum::<f64>().sqrt();
        let smaller = (!others.is_empty())
            .then(|| (format!("{} smaller parts together", others.len()), smaller, "–".to_owned()));
        for (place, (due, sd, told)) in std::iter::once(own).chain(device).chain(smaller).enumerate() {
            let first = |text: &str| if place == 0 { text.to_owned() } else { String::new() };
            let own = [
                first(&estimator.name),
                first(budget.state),
                due,
                format!("{} {unit}", significant(sd * factor)),
                significant(100.0 * (sd / budget.sd).powi(2)),
                told,
            ];
            table.push(has_several.then(|| first(&segment)).into_iter().chain(own));
        }
    }
    (!table.rows.is_empty()).then_some(table)
}

/// How serious a grade is.
pub(crate) fn severity_of(grade: Grade) -> NoticeSeverity {
    match grade {
        Grade::Passes => NoticeSeverity::Ok,
        Grade::PassesWithRemarks => NoticeSeverity::Note,
        Grade::Doubtful => NoticeSeverity::Warning,
        Grade::Failed | Grade::NoEstimate => NoticeSeverity::Failure,
    }
}

/// What its grade is for: what a reference shows, what its parameters and its innovations tell.
fn of_the_grade(estimator: &EstimatorMetrics) -> Vec<Notice> {
    let Some(grade) = estimator.grade.filter(|grade| *grade != Grade::NoEstimate) else { return Vec::new() };
    let severity = severity_of(grade);
    let topic = if order(severity) >= order(NoticeSeverity::Warning) { "overconfident" } else { "verdict" };
    let because = |why: String| Notice::new(severity, format!("{grade}: {why}")).explained_by(topic);
    // Of a motion that goes the other way the errors are what they are.
    let goes_the_other_way = estimator.verdict == Verdict::WrongSign;
    let claims = estimator.contradicted_claims().filter(|_| !goes_the_other_way);
    // Before any number of the device is blamed.
    let steps = estimator.step_errors.filter(StepErrors::is_remarkable).map(|steps| {
        let found = because(steps.to_string());
        let severity = if steps.is_large() { found.severity } else { NoticeSeverity::Note };
        let brief = format!("{grade}: {}", steps.in_brief());
        Notice { severity, size: f64::MAX, brief, ..found }.explained_by("step")
    });
    let mut why: Vec<Notice> = steps.into_iter().collect();
    why.extend(claims.map(|(name, claim)| Notice {
        size: claim.mean_square.sqrt(),
        brief: format!("{grade}: errors of {} {} times the claim", named(name), times_the_claim(&claim)),
        ..because(of_the_claim(name, &claim))
    }));
    why.extend(estimator.doubts().map(|(text, topic)| because(text).explained_by(topic)));
    why.extend(estimator.of_the_device().filter_map(|number| {
        let off = number.contradicted()?;
        let text = format!(
            "by the recording `{}` is {:.1} stated standard deviations {} the value in the device's table; correct the value, or state a \
             larger uncertainty",
            number.name,
            off.abs(),
            if off > 0.0 { "above" } else { "below" }
        );
        let brief = format!("{grade}: the recording contradicts `{}`; correct it", number.name);
        Some(Notice { brief, ..because(text).explained_by("uncertainty") })
    }));
    why.extend(of_the_innovations(estimator).map(|(text, brief)| {
        let brief = format!("{grade}: the innovations show {brief}");
        Notice { brief, ..because(text) }
    }));
    if why.is_empty() && !goes_the_other_way {
        let found = estimator.consistency.as_ref();
        why.extend(found.map(|consistency| because(of_the_mean_nis(estimator, consistency))));
    }
    if let Some(first) = why.first_mut().filter(|_| !estimator.arbitrary.is_empty()) {
        first.text += &format!("; arbitrary: {}", estimator.arbitrary.join(", "));
    }
    why
}

/// What the innovations show, in one sentence, what tells most of a cause first; and the first in a few words.
fn of_the_innovations(estimator: &EstimatorMetrics) -> Option<(String, String)> {
    let mut failing = estimator.failing();
    let first = failing.next()?;
    let others: Vec<String> = failing.map(TestResult::in_short).collect();
    let also =
        if others.is_empty() { String::new() } else { format!(". Found as well: {}", others.join(", ")) };
    Some((format!("{first}{also}"), first.in_short()))
}

/// A state in a sentence: a word with its article, a symbol as it is.
pub(super) fn named(state: &str) -> String {
    let is_word = state.len() > 2 && state.chars().all(|c| c.is_ascii_lowercase() || c == '_');
    if is_word { format!("the {state}") } else { state.to_owned() }
}

/// How many times as large as claimed errors against a reference are.
fn times_the_claim(claim: &Claim) -> String {
    let larger = claim.mean_square.sqrt();
    if larger < 100.0 { format!("{larger:.1}") } else { significant(larger) }
}

/// What a reference shows of a claim that does not hold.
fn of_the_claim(name: &str, claim: &Claim) -> String {
    let mut text = format!(
        "the errors of {} against the reference are {} times as large as claimed, {:.0} % of them within three standard deviations",
        named(name),
        times_the_claim(claim),
        100.0 * claim.within
    );
    if let Some(ErrorDecomposition { scale, early_s, share, .. }) =
        claim.explained.filter(|found| found.share > 0.5)
    {
        let size = if scale < 0.0 { "small" } else { "large" };
        let late = if early_s < 0.0 { "late" } else { "early" };
        text += &format!(
            "; an estimate that is {:.2} % too {size} and {} too {late}, and an offset, explain {:.0} % of their mean square",
            100.0 * scale.abs(),
            quantity(significant_value(early_s.abs()), "s"),
            100.0 * share
        );
    }
    text
}

/// What its mean NIS says, where nothing is found.
fn of_the_mean_nis(estimator: &EstimatorMetrics, consistency: &NisConsistency) -> String {
    let NisConsistency { mean_nis, lower, upper, .. } = consistency;
    match (estimator.grade, estimator.verdict) {
        (Some(Grade::Passes), _) => {
            let tests = match estimator.tests.len() {
                1 => "1 test of the innovations finds".to_owned(),
                tests => format!("{tests} tests of the innovations find"),
            };
            format!("{tests} no contradiction; the mean NIS is {mean_nis:.3}")
        }
        (_, Verdict::Consistent) => format!(
            "the innovations of the accepted samples agree with the model, with a mean NIS of {mean_nis:.3}"
        ),
        (_, Verdict::Cautious) => format!(
            "the mean NIS of {mean_nis:.3} lies below {lower:.3}, so that the filter claims larger errors than it makes"
        ),
        _ => format!(
            "the mean NIS of {mean_nis:.3} lies above {upper:.3}, as it does in 25 of 1000 recordings with a true model"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_warning_in_short_names_what_to_do_and_how_many_further_findings_there_are() {
        let notice = |filter: &str, text: &str| {
            let notice =
                Notice::new(NoticeSeverity::Warning, text).explained_by("overconfident").at("recording.csv");
            Notice { filter: filter.to_owned(), ..notice }
        };
        let said = |notice: Notice, others: usize| {
            let mut short = notice.in_short(others);
            short.cut();
            short.to_string()
        };
        assert_eq!(
            said(notice("EKF", "doubtful: the mean is 3; the usual cause: an offset"), 2),
            "WARNING: recording.csv: EKF: doubtful: the mean is 3 (2 more; `kalmems help overconfident`)"
        );
        let long = "doubtful: ".to_owned() + &"word ".repeat(100);
        let names = "EKF with stiffness; EKF with damping; EKF with inertia";
        let cut = said(notice(names, &long), 11);
        assert!(cut.chars().count() <= SHORT, "{cut}");
        assert!(
            cut.starts_with("WARNING: recording.csv: EKF with stiffness and 2 more filters: doubtful: word")
        );
        assert!(cut.ends_with("word … (11 more; `kalmems help overconfident`)"), "{cut}");
    }
}
