//! What is told of a diagnosis.

use super::answer::{AnswerChange, moved};
use super::as_state;
use super::bench::TrialBench;
use super::cause::Cause;
use super::change::{ChannelAlteration, TrialChange};
use super::distinguish::Proposal;
use super::explain::{ExaminedCause, Explanations};
use super::invisible_parameters::ScaleNote;
use super::search::FittedCause;
use super::suspect::{NumberRole, Suspect};
use super::trial::DiagnosisTrial;
use super::unseen::unseen;
use crate::config::get;
use crate::config::{Experiment, Key, KeyStep};
use crate::evaluate::{CycleEvidence, StepErrors};
use kalmems_core::Portable;
use serde::Serialize;

/// What came of a diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Diagnosis {
    /// The experiment's name.
    pub experiment: String,
    /// The rig's.
    pub rig: &'static str,
    /// The filter whose innovations were looked at.
    pub filter: String,
    /// How much of the recordings was looked at: rows, and their duration in s.
    pub rows: usize,
    /// Their duration in s.
    pub duration_s: f64,
    /// What was found.
    pub finding: DiagnosisFinding,
    /// What speaks against the answer as it is, that is not by chance: what the tests find in the innovations, and what makes it doubtful beside
    /// them.
    pub tests: Vec<String>,
    /// How many causes were tried.
    pub tried: usize,
    /// What a gain has to be above, ln p.
    pub needed: f64,
    /// The causes that explain the recording, the likeliest first; those that it cannot tell apart.
    pub causes: Vec<CauseReport>,
    /// Of several causes how far the answers with them are apart at most, root mean square by the standard deviation that the filter claims.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub answers_differ: Option<f64>,
    /// A recording that would tell them apart, where there are several and one was found.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proposal: Option<Proposal>,
    /// Where nothing explains it: what explains most. Of a diagnosis that was interrupted what makes the recording likelier so far.
    pub closest: Vec<CauseReport>,
    /// How much each cause gains that was fitted, the likeliest first.
    pub gains: Vec<CauseGain>,
    /// The innovations over the cycle of the motion with the experiment as it is, and with the lines of the first cause; both or none.
    #[serde(skip)]
    pub cycles: Vec<CycleEvidence>,
    /// What was not tried, so that the diagnosis is no more work than twenty estimates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<String>,
    /// What the signal does not determine, and what it does to the answer.
    pub notes: Vec<ScaleNote>,
    /// What no test of the innovations can see, by the equations of the device.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unseen: Vec<String>,
}

/// How much likelier a recording is with a cause.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CauseGain {
    /// What is wrong, in a few words.
    pub name: String,
    /// By how much the blocks that were not fitted are likelier, ln p.
    pub gain: f64,
}

/// What a diagnosis comes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DiagnosisFinding {
    /// The innovations pass all tests: there is nothing that the recording could say against the experiment.
    NothingToChange,
    /// With one of the causes they do.
    Explained,
    /// They do not, whatever was tried.
    NoneOfThese,
    /// It was interrupted before it came to an end.
    Interrupted,
    /// The filter's own steps lead it astray, so that its innovations say nothing of the experiment's numbers.
    Steps,
}

/// A cause.
#[derive(Clone, Debug, Default, Serialize)]
pub struct CauseReport {
    /// What is wrong, in a few words.
    pub name: String,
    /// How many numbers of the experiment are wrong at once; 0 of what is in the signal alone.
    pub numbers: usize,
    /// By how much the blocks that were not fitted are likelier, ln p.
    pub gain: f64,
    /// Whether the innovations pass the tests with it.
    pub passes: bool,
    /// What it makes of the answer.
    pub answer: Option<AnswerChange>,
    /// The state that is the answer.
    pub answer_name: &'static str,
    /// Its SI unit.
    pub answer_unit: &'static str,
    /// What to change in the experiment; nothing where the file cannot say it.
    pub edits: Vec<Edit>,
    /// The same as entries of the filter's `states`, where it can estimate them, such as `stiffness = { start_sd = "0.6 %" }`: of a number
    /// that is not known, or that changes.
    pub states: Vec<String>,
    /// What cannot be said in the experiment.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
    /// Why nothing is to be changed in the experiment for it: with it the estimate of whole recordings is worse.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub withheld: Option<String>,
}

/// A key of the experiment with its new value.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Edit {
    /// The key.
    pub key: String,
    /// What stands there; nothing where the key is new.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// What is to stand there, as TOML.
    pub to: String,
    /// The relative standard error of a factor, or the standard error in the unit of the value, if its cause is the true one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sd: Option<f64>,
    /// The largest relative difference between this value and the one that another cause of the same list leaves or writes there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub across: Option<f64>,
}

impl Diagnosis {
    pub(super) fn of(
        (experiment, rig): (&Experiment, &'static str),
        (bench, suspects): (&TrialBench, &[Suspect]),
        (base, steps): (&DiagnosisTrial, Option<StepErrors>),
        (explained, notes, proposal): (Option<Explanations>, Vec<ScaleNote>, Option<Proposal>),
    ) -> Self {
        let (rows, duration_s) = bench.extent();
        let finding = match &explained {
            None if steps.is_some() => DiagnosisFinding::Steps,
            None => DiagnosisFinding::NothingToChange,
            Some(found) if found.is_interrupted => DiagnosisFinding::Interrupted,
            Some(found) if found.causes.is_empty() => DiagnosisFinding::NoneOfThese,
            Some(_) => DiagnosisFinding::Explained,
        };
        let reports = |all: &[ExaminedCause]| -> Vec<CauseReport> {
            all.iter().map(|found| report((bench, suspects), found)).collect()
        };
        let explained = explained.as_ref();
        let findings = if base.is_its_own() { base.findings() } else { Vec::new() };
        Self {
            experiment: experiment.name.to_string(),
            rig,
            filter: bench.filter_name.clone(),
            rows,
            duration_s,
            finding,
            tests: steps.map(|steps| steps.to_string()).into_iter().chain(findings).collect(),
            tried: explained.map_or(0, |found| found.tried),
            needed: explained.map_or(0.0, |found| found.needed),
            causes: explained.map_or_else(Vec::new, |found| compared(reports(&found.causes))),
            answers_differ: explained.and_then(|found| answers_differ(&found.causes)),
            proposal,
            closest: explained.map_or_else(Vec::new, |found| {
                if found.is_interrupted {
                    found.ranking.iter().map(|found| ranked(found, suspects)).collect()
                } else {
                    reports(&found.closest)
                }
            }),
            gains: explained.map_or_else(Vec::new, |found| {
                let gain = |found: &FittedCause| CauseGain {
                    name: name(&found.cause, suspects),
                    gain: found.held_out,
                };
                found.ranking.iter().map(gain).collect()
            }),
            cycles: Vec::new(),
            left_out: explained.map_or_else(Vec::new, |found| found.left_out.clone()),
            unseen: if finding == DiagnosisFinding::NothingToChange {
                unseen(bench.workbench, experiment)
            } else {
                Vec::new()
            },
            notes,
        }
    }
}

/// The farthest that two answers of these causes are apart by what is claimed; `None` of fewer than two.
fn answers_differ(causes: &[ExaminedCause]) -> Option<f64> {
    let claimed = causes.iter().filter_map(|found| found.answer).map(|answer| answer.claimed);
    let claimed = claimed.fold(f64::INFINITY, f64::min);
    let pairs = causes.iter().enumerate().flat_map(|(place, first)| {
        causes.iter().skip(place + 1).map(move |second| moved(&first.trial, &second.trial))
    });
    pairs.max_by(f64::total_cmp).map(|apart| apart / claimed)
}

/// How far answers may be apart, by what is claimed, for causes that are as good as one: with 0.3 of it an error grows by 5 %.
const AS_ONE: f64 = 0.3;

impl Diagnosis {
    /// Whether several causes explain the recording and give different answers, so that writing one of them is a guess; those do not count with which
    /// whole recordings are worse.
    pub fn is_ambiguous(&self) -> bool {
        self.causes.iter().filter(|cause| cause.withheld.is_none()).count() > 1
            && !self.answers_differ.is_some_and(|apart| apart <= AS_ONE)
    }

    /// The cause to write: the one of this name or at this place in the list, 1 for the first. Without a name the first, but none of an ambiguous
    /// set.
    pub fn chosen(&self, named: Option<&str>) -> Option<&CauseReport> {
        let Some(named) = named else {
            let mut usable = self.causes.iter().filter(|cause| cause.withheld.is_none());
            return usable.next().filter(|_| !self.is_ambiguous());
        };
        let place = named.parse::<usize>().ok().and_then(|place| place.checked_sub(1));
        place
            .and_then(|place| self.causes.get(place))
            .or_else(|| self.causes.iter().find(|cause| cause.name == named))
    }
}

/// The causes with how far their values are from those of one another.
fn compared(mut causes: Vec<CauseReport>) -> Vec<CauseReport> {
    let number = |text: &str| {
        let text = text.trim_matches('"');
        crate::units::Value::parse(text).map_or_else(|_| text.parse().ok(), |value| Some(value.si()))
    };
    let all = causes.clone();
    for (place, cause) in causes.iter_mut().enumerate() {
        for edit in &mut cause.edits {
            let others = all.iter().enumerate().filter(|(other, _)| *other != place).map(|(_, cause)| {
                let same = cause.edits.iter().find(|other| other.key == edit.key);
                same.map_or(edit.from.as_deref(), |other| Some(&other.to))
            });
            let Some(own) = number(&edit.to) else { continue };
            let apart = others.flatten().filter_map(number).map(|other| (other / own - 1.0).abs());
            edit.across = apart.reduce(f64::max);
        }
    }
    causes
}

fn report((bench, suspects): (&TrialBench, &[Suspect]), found: &ExaminedCause) -> CauseReport {
    let changes = found.cause.changes(suspects).unwrap_or_default();
    // The end of a search is no value, and nothing is to be written of it.
    let is_value = !found.is_end_of_search;
    CauseReport {
        name: name(&found.cause, suspects),
        numbers: match &found.cause {
            Cause::Numbers(numbers) => numbers.len(),
            Cause::Line { .. } | Cause::ColouredNoise(_) | Cause::Outliers { .. } => 0,
        },
        gain: found.gain,
        passes: found.trial.passes(),
        answer: found.answer,
        answer_name: found.trial.answer_name,
        answer_unit: found.trial.answer_unit,
        edits: if is_value {
            edits(bench, &changes, &found.cause, (suspects, &found.sd))
        } else {
            Vec::new()
        },
        states: states(bench, &found.cause, suspects).filter(|_| is_value).unwrap_or_default(),
        remedy: if is_value {
            remedy(&found.cause, &changes)
        } else {
            Some(end_of_search(&found.cause, suspects))
        },
        withheld: None,
    }
}

/// A cause that was found and not yet examined.
fn ranked(found: &FittedCause, suspects: &[Suspect]) -> CauseReport {
    let FittedCause { cause, held_out } = found;
    CauseReport {
        name: format!("{}{}", name(cause, suspects), sizes_in_words(cause, suspects)),
        gain: *held_out,
        ..CauseReport::default()
    }
}

/// The sizes of a cause behind its name.
fn sizes_in_words(cause: &Cause, suspects: &[Suspect]) -> String {
    let sizes: Vec<String> = match cause {
        Cause::Numbers(numbers) => numbers
            .iter()
            .filter_map(|(place, size)| {
                let suspect = suspects.get(*place)?;
                Some(format!("{} {}", suspect.name(), suspect.size_in_words(*size)))
            })
            .collect(),
        _ => Vec::new(),
    };
    if sizes.is_empty() { String::new() } else { format!(" ({})", sizes.join(", ")) }
}

/// What is said of a cause whose search ended where the likelihood still rises.
fn end_of_search(cause: &Cause, suspects: &[Suspect]) -> String {
    let of = sizes_in_words(cause, suspects);
    format!(
        "the search ended where the likelihood still rises{of}: no value is determined, and none is written"
    )
}

/// The numbers of a cause as states of the filter; `None` where one of them cannot be.
fn states(bench: &TrialBench, cause: &Cause, suspects: &[Suspect]) -> Option<Vec<String>> {
    let Cause::Numbers(numbers) = cause else { return None };
    // A noise is no state of a filter that is told of it.
    if numbers
        .iter()
        .any(|(place, _)| suspects.get(*place).is_some_and(|own| own.is_noise_in(&bench.document)))
    {
        return None;
    }
    numbers.iter().map(|(place, size)| as_state::entry(bench, suspects.get(*place)?, *size)).collect()
}

fn name(cause: &Cause, suspects: &[Suspect]) -> String {
    match cause {
        Cause::Numbers(numbers) => {
            let names: Vec<String> =
                numbers.iter().filter_map(|(place, _)| suspects.get(*place)).map(Suspect::name).collect();
            names.join(" and ")
        }
        Cause::Line { frequency_hz, amplitude: [a, b], harmonic, .. } => {
            let harmonic =
                harmonic.map_or_else(String::new, |number| format!(", harmonic {number} of the motion"));
            let amplitude = a.portable_hypot(*b);
            format!("a line of {} in the signal, {amplitude:.3e} in SI{harmonic}", hertz(*frequency_hz))
        }
        Cause::ColouredNoise(noise) => noise.name(),
        Cause::Outliers { times, .. } => {
            format!("{} samples of the signal that are none of its noise", times.len())
        }
    }
}

fn hertz(frequency_hz: f64) -> String {
    if frequency_hz >= 1e3 {
        format!("{:.6} kHz", frequency_hz * 1e-3)
    } else {
        format!("{frequency_hz:.4} Hz")
    }
}

/// The keys that a change is about, in the experiment as it was written.
fn edits(
    bench: &TrialBench,
    changes: &[TrialChange],
    cause: &Cause,
    (suspects, sd): (&[Suspect], &[f64]),
) -> Vec<Edit> {
    let mut edits = Vec::new();
    for change in changes {
        match change {
            TrialChange::Key(key, value) => {
                let sd = sd_of(cause, key, (suspects, sd));
                edits.push(Edit {
                    key: in_file(key, bench.filter).to_string(),
                    from: get(&bench.document, key).map(ToString::to_string),
                    to: rounded(value, sd).to_string(),
                    sd,
                    across: None,
                });
            }
            TrialChange::Exchanged([one, other]) => {
                let key = |meaning: &String| Key::from("recording").index(0).child("channels").child(meaning);
                let [column, other_column] = [one, other].map(|meaning| get(&bench.document, &key(meaning)));
                for (meaning, from, to) in [(one, column, other_column), (other, other_column, column)] {
                    let (from, to) = (from.map(ToString::to_string), to.map(ToString::to_string));
                    let Some(to) = to else { continue };
                    edits.push(Edit { key: key(meaning).to_string(), from, to, ..Edit::default() });
                }
            }
            TrialChange::Channel { meaning, how } => {
                let (name, number) = match how {
                    ChannelAlteration::Scaled(factor) => ("scale", toml::Value::Float(*factor)),
                    ChannelAlteration::Raised(by) => ("offset", toml::Value::String(format!("{by:.4e} V"))),
                    _ => continue,
                };
                let channel = Key::from("recording").index(0).child("channels").child(meaning);
                let Some(column) = get(&bench.document, &channel) else { continue };
                let mut table = match column {
                    toml::Value::Table(table) => table.clone(),
                    other => toml::Table::from_iter([("column".to_owned(), other.clone())]),
                };
                let number = match (table.get(name), &number) {
                    (Some(toml::Value::Float(own)), toml::Value::Float(factor)) => {
                        toml::Value::Float(own * factor)
                    }
                    // What stands there is not ours to add to.
                    (Some(_), _) => continue,
                    (None, toml::Value::Float(factor)) => toml::Value::Float(digits(*factor, 6)),
                    (None, _) => number,
                };
                table.insert(name.to_owned(), number);
                edits.push(Edit {
                    key: channel.to_string(),
                    from: Some(column.to_string()),
                    to: toml::Value::Table(table).to_string(),
                    sd: sd.first().copied().filter(|sd| sd.is_finite()),
                    across: None,
                });
            }
        }
    }
    edits
}

/// The key with the place that the filter has in the file.
fn in_file(key: &Key, filter: usize) -> Key {
    let own = Key::from("estimate").child("filter").index(0);
    match key.steps().strip_prefix(own.steps()) {
        Some(steps) => {
            steps.iter().fold(Key::from("estimate").child("filter").index(filter), |key, step| match step {
                KeyStep::Name(name) => key.child(name),
                KeyStep::Index(index) => key.index(*index),
            })
        }
        None => key.clone(),
    }
}

/// The relative standard error of a number by the size of its suspect.
fn sd_of(cause: &Cause, key: &Key, (suspects, sd): (&[Suspect], &[f64])) -> Option<f64> {
    let Cause::Numbers(numbers) = cause else { return None };
    let of = |place: usize| match suspects.get(place).map(|suspect| &suspect.what) {
        Some(NumberRole::Slip { of, .. }) => Some(&**of),
        what => what,
    };
    let place = numbers.iter().position(|(place, _)| match of(*place) {
        Some(NumberRole::Factor(numbers)) => numbers.iter().any(|number| number.key == *key),
        Some(NumberRole::Literal { key: own, .. }) => own == key,
        _ => false,
    })?;
    sd.get(place).copied().filter(|sd| sd.is_finite())
}

/// A quantity with as many digits as its standard error leaves sense in.
pub(super) fn rounded(value: &toml::Value, relative_sd: Option<f64>) -> toml::Value {
    let text = match value {
        toml::Value::String(text) => text,
        toml::Value::Float(number) => return toml::Value::Float(digits(*number, count_of(relative_sd))),
        toml::Value::Array(list) => {
            return toml::Value::Array(list.iter().map(|value| rounded(value, relative_sd)).collect());
        }
        toml::Value::Table(table) => {
            let each = table.iter().map(|(key, value)| (key.clone(), rounded(value, relative_sd)));
            return toml::Value::Table(each.collect());
        }
        other => return other.clone(),
    };
    let Ok(quantity) = crate::units::Value::parse(text) else { return value.clone() };
    let (number, unit) = quantity.parts();
    let Ok(number) = number.parse::<f64>() else { return value.clone() };
    let plain = digits(number, count_of(relative_sd));
    let written = if (1e-3..1e6).contains(&plain.abs()) { format!("{plain}") } else { format!("{plain:e}") };
    toml::Value::String(format!("{written} {unit}"))
}

/// How many digits a relative standard error leaves sense in: two of its own. Four where nothing is known.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped
fn count_of(relative_sd: Option<f64>) -> usize {
    relative_sd.map_or(4, |sd| (2.0 - sd.portable_log10().floor()).clamp(2.0, 12.0) as usize)
}

/// A number with so many digits.
pub(super) fn digits(number: f64, count: usize) -> f64 {
    format!("{number:.*e}", count.saturating_sub(1)).parse().unwrap_or(number)
}

/// What the experiment cannot say.
fn remedy(cause: &Cause, changes: &[TrialChange]) -> Option<String> {
    if matches!(cause, Cause::Line { harmonic: Some(_), .. }) {
        return Some(
            "the readout distorts the motion, or the motion is not quite the model's: describe either with more terms"
                .to_owned(),
        );
    }
    changes.iter().find_map(|change| match change {
        TrialChange::Channel { meaning, how: ChannelAlteration::Later(samples) } => Some(format!(
            "the {meaning}'s column shows the {meaning} {:.3} samples too {}: correct its time in the file, or how it is recorded",
            samples.abs(),
            if *samples > 0.0 { "late" } else { "early" }
        )),
        TrialChange::Channel { how: ChannelAlteration::WithoutLine { .. }, .. } => {
            Some("take it away where it gets into the signal".to_owned())
        }
        TrialChange::Channel { how: ChannelAlteration::Without(times), .. } => {
            let listed: Vec<String> = times.iter().take(10).map(|t| format!("{t} s")).collect();
            let more = times.len().saturating_sub(10);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            Some(format!("leave these samples empty in the file: {}{more}", listed.join(", ")))
        }
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn diagnosis(causes: usize, answers_differ: Option<f64>) -> Diagnosis {
        let cause = |place: usize| CauseReport {
            name: format!("number {place}"),
            numbers: 1,
            passes: true,
            ..CauseReport::default()
        };
        Diagnosis {
            experiment: String::new(),
            rig: "",
            filter: String::new(),
            rows: 0,
            duration_s: 0.0,
            finding: DiagnosisFinding::Explained,
            tests: Vec::new(),
            tried: 18,
            needed: 7.0,
            causes: (0..causes).map(cause).collect(),
            answers_differ,
            proposal: None,
            closest: Vec::new(),
            gains: Vec::new(),
            cycles: Vec::new(),
            left_out: Vec::new(),
            notes: Vec::new(),
            unseen: Vec::new(),
        }
    }

    #[test]
    fn causes_with_different_answers_are_no_choice_and_causes_with_the_same_answer_are_one() {
        assert!(!diagnosis(1, None).is_ambiguous());
        assert!(!diagnosis(2, Some(0.01)).is_ambiguous());
        assert!(diagnosis(2, Some(2.0)).is_ambiguous());
        // Where nobody knows how far they are apart, nothing is chosen.
        assert!(diagnosis(2, None).is_ambiguous() && diagnosis(2, Some(f64::NAN)).is_ambiguous());
        // A name chooses from any set.
        let (one, ambiguous) = (diagnosis(2, Some(0.01)), diagnosis(2, Some(2.0)));
        let name = |found: Option<&CauseReport>| found.map(|cause| cause.name.clone());
        assert_eq!(name(one.chosen(None)).as_deref(), Some("number 0"));
        assert!(ambiguous.chosen(None).is_none() && ambiguous.chosen(Some("3")).is_none());
        for named in ["2", "number 1"] {
            assert_eq!(name(ambiguous.chosen(Some(named))).as_deref(), Some("number 1"));
        }
    }

    /// A factor of 1.1 of one number, one of 0.9 of it beside another number, and neither.
    #[test]
    fn a_value_is_compared_with_what_the_other_causes_write_or_leave_there() {
        let edit = |key: &str, to: f64| Edit {
            key: key.to_owned(),
            from: Some("\"2 V\"".to_owned()),
            to: format!("\"{to} V\""),
            ..Edit::default()
        };
        let mut causes = diagnosis(3, None).causes;
        causes[0].edits = vec![edit("a", 2.2)];
        causes[1].edits = vec![edit("a", 1.8), edit("b", 1.0)];
        let found = compared(causes);
        let across: Vec<f64> = found.iter().flat_map(|cause| &cause.edits).filter_map(|e| e.across).collect();
        let expected = [0.4 / 2.2, 0.4 / 1.8, 1.0];
        assert!(
            across.iter().zip(expected).all(|(own, expected)| (own - expected).abs() < 1e-12),
            "{across:?}"
        );
    }
}
