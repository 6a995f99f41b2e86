//! What kind of motion a recording shows, and which role it has by that.

use crate::config::RecordingRole;
use crate::inspect::{Character, InspectedChannel, Inspection, SwingCourse, quantity};
use crate::units::{ColumnHeader, kind};
use serde::Serialize;

/// What kind of motion a recording shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordingKind {
    /// No channel of the device moves.
    Still,
    /// The motion has a steady size.
    Steady,
    /// The motion decays without a drive.
    RingDown,
    /// The frequency of the drive passes through a range.
    Sweep,
    /// The device moves, and none of the others.
    Moving,
}

/// A kind, with a sentence that says by what.
pub(super) struct FoundKind {
    pub(super) kind: RecordingKind,
    pub(super) sentence: String,
}

impl RecordingKind {
    /// The role of a recording of this kind that is given beside the one to be estimated.
    pub const fn role(self) -> RecordingRole {
        match self {
            Self::Still => RecordingRole::ZeroDrive,
            Self::Steady => RecordingRole::SteadyState,
            Self::RingDown => RecordingRole::RingDown,
            Self::Sweep => RecordingRole::Sweep,
            Self::Moving => RecordingRole::Test,
        }
    }

    /// Whether the device is driven in such a recording, so that the drive has to be known.
    pub const fn is_driven(self) -> bool {
        !matches!(self, Self::Still | Self::RingDown)
    }
}

/// What kind of recording this is, by the column of the drive, where there is one, and those of the device's signals.
pub(super) fn kind(inspection: &Inspection, drive: Option<&str>, signals: &[&str]) -> FoundKind {
    let of = |column: &str| inspection.channels.iter().find(|channel| channel.column == column);
    let character = |channel: &InspectedChannel| inspection.character(channel);
    let frequency = |value: f64| quantity(value, inspection.frequency_unit);
    let found = |kind, sentence: String| FoundKind { kind, sentence };
    let drive = drive.and_then(of).and_then(character);
    let signals: Vec<Character> = signals.iter().copied().filter_map(of).filter_map(character).collect();
    if let Some(steps) = stepped(inspection) {
        return found(RecordingKind::Sweep, format!("A sweep: {steps}."));
    }
    if let Some(Character::Swing { swept: Some((first, last)), .. }) = drive {
        let (first, last) = (frequency(first), frequency(last));
        return found(
            RecordingKind::Sweep,
            format!("A sweep: the frequency of the drive goes from about {first} to {last}."),
        );
    }
    let silent = !matches!(drive, Some(Character::Swing { .. } | Character::Slow(_)));
    let moves = |one: &&Character| matches!(one, Character::Swing { .. } | Character::Slow(_));
    let Some(moving) = signals.iter().find(moves) else {
        let sentence = if silent {
            "At rest: neither drive nor signal changes beyond its noise."
        } else {
            "The drive changes, and no signal of the device does."
        };
        return found(if silent { RecordingKind::Still } else { RecordingKind::Moving }, sentence.to_owned());
    };
    let drive = match drive {
        Some(Character::Swing { frequency: at, .. }) => format!("the drive at {}", frequency(at)),
        Some(Character::Slow(_)) => "the drive changes slowly".to_owned(),
        Some(Character::Constant(value)) => format!("the drive is always {}", quantity(value, "V")),
        Some(Character::Noise(_)) => "the drive is noise".to_owned(),
        None => "no column is a drive".to_owned(),
    };
    match *moving {
        Character::Swing { frequency: at, course: SwingCourse::Decays(_), .. } if silent => {
            let sentence = format!("A free decay: the signal is at {}, {drive}.", frequency(at));
            found(RecordingKind::RingDown, sentence)
        }
        Character::Swing { frequency: at, course: SwingCourse::Steady, swept: None, .. } => {
            let sentence = format!("A steady motion: the signal is at {}, {drive}.", frequency(at));
            found(RecordingKind::Steady, sentence)
        }
        _ => found(RecordingKind::Moving, format!("The device moves: {drive}.")),
    }
}

/// Where the records are labelled by a frequency, a sweep in steps; in words.
fn stepped(inspection: &Inspection) -> Option<String> {
    let column = inspection.segment_column.as_ref()?;
    let unit = ColumnHeader::parse(column).unit?;
    let records = inspection.segments.len();
    (records > 2 && kind::FREQUENCY.accepts(unit.dimension()))
        .then(|| format!("`{column}` labels {records} records, each at a frequency of its own"))
}
