//! What the columns of a recording seem to be, before anybody has said which device was recorded.

use super::columns::{LONGEST_WORD, is_named, unit_fits};
use crate::inspect::{InspectedChannel, Inspection};
use crate::rigs::{Template, TemplateChannel};
use serde::Serialize;

/// What a column seems to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ColumnUse {
    /// The voltage that drives the device.
    Drive,
    /// The output of a readout.
    Signal,
    /// What a loop feeds back.
    Feedback,
    /// A measurement of the motion by another instrument.
    Reference,
    /// Not known.
    Unknown,
}

/// A column, with what it seems to be and by what.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct GuessedColumn {
    /// The column.
    pub column: String,
    /// What it seems to be.
    pub seems: ColumnUse,
    /// In words, such as `the drive, by its name`.
    pub words: String,
}

/// What each column seems to be, by the names and units of the channels that known devices have.
pub(super) fn guess(inspection: &Inspection, templates: &[Template]) -> Vec<GuessedColumn> {
    let mut guessed: Vec<Option<(ColumnUse, String)>> =
        inspection.channels.iter().map(|channel| by_name(channel, templates)).collect();
    let is_signal = |one: &Option<(ColumnUse, String)>| matches!(one, Some((ColumnUse::Signal, _)));
    let voltages: Vec<usize> = (0..guessed.len())
        .filter(|place| guessed[*place].is_none() && inspection.channels[*place].si_unit == "V")
        .collect();
    // A recording of a device has its signal.
    if let [only] = voltages[..]
        && !guessed.iter().any(is_signal)
    {
        guessed[only] = Some((ColumnUse::Signal, "the signal, as the only voltage that is left".to_owned()));
    }
    let told = inspection.channels.iter().zip(guessed);
    told.map(|(channel, guessed)| {
        let (seems, words) = guessed.unwrap_or_else(|| by_unit(channel));
        GuessedColumn { column: channel.column.clone(), seems, words }
    })
    .collect()
}

/// What the longest word of its name says that a channel of a known device has.
fn by_name(channel: &InspectedChannel, templates: &[Template]) -> Option<(ColumnUse, String)> {
    let known = || {
        let channels = templates.iter().flat_map(|template| template.channels.iter().map(|one| (one, false)));
        let references = templates.iter().flat_map(|one| one.references.iter().map(|one| (one, true)));
        channels.chain(references).filter(|(one, _)| unit_fits(channel, one))
    };
    let of_length = |length: usize| {
        known().find(|(one, _)| is_named(&channel.column, one.words, length)).map(|(one, is_reference)| {
            let seems = if is_reference { ColumnUse::Reference } else { of_channel(one) };
            let words = match seems {
                ColumnUse::Reference => format!("a reference ({})", one.what),
                ColumnUse::Drive => "the drive".to_owned(),
                ColumnUse::Feedback => format!("the feedback ({})", one.what),
                _ if one.meaning == "signal" => "the signal".to_owned(),
                _ => format!("a signal ({})", one.what),
            };
            (seems, format!("{words}, by its name"))
        })
    };
    (1..=LONGEST_WORD).rev().find_map(of_length)
}

fn of_channel(channel: &TemplateChannel) -> ColumnUse {
    match channel.meaning {
        "drive" => ColumnUse::Drive,
        "feedback" => ColumnUse::Feedback,
        _ => ColumnUse::Signal,
    }
}

/// What its unit says where its name says nothing.
fn by_unit(channel: &InspectedChannel) -> (ColumnUse, String) {
    let reference = |what: &str| (ColumnUse::Reference, format!("a reference ({what}), by its unit"));
    match channel.si_unit.as_str() {
        "rad" => reference("an angle"),
        "rad/s" => reference("an angular rate"),
        "m" => reference("a position"),
        "m/s" => reference("a velocity"),
        "m/s²" => reference("an acceleration"),
        "F" => (ColumnUse::Signal, "a signal (a capacitance), by its unit".to_owned()),
        "" => (ColumnUse::Unknown, "unknown: its name has no unit".to_owned()),
        _ => (ColumnUse::Unknown, "unknown: drive, signal or reference, as its name does not say".to_owned()),
    }
}
