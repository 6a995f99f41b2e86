//! What may be the cause, with its size.

use super::change::{Altered, Change};
use super::suspect::Suspect;

/// Something that may be wrong, and by how much.
#[derive(Clone, Debug)]
pub(super) enum Cause {
    /// Numbers of the device, or of what was recorded, by their places among the suspects, with their sizes.
    Numbers(Vec<(usize, f64)>),
    /// A line in the signal: its frequency in Hz, and the amplitudes of cosine and sine.
    Line { frequency_hz: f64, amplitude: [f64; 2] },
    /// Samples of the signal that are none of its noise, by their times in s.
    Outliers(Vec<f64>),
}

/// The channel that the innovations of a filter are of.
const SIGNAL: &str = "signal";

impl Cause {
    /// What would have to be changed; `None` of a size that there cannot be.
    pub(super) fn changes(&self, suspects: &[Suspect]) -> Option<Vec<Change>> {
        let of_signal = |how| Some(vec![Change::Channel { meaning: SIGNAL.to_owned(), how }]);
        match self {
            Self::Numbers(numbers) => {
                let mut changes = Vec::new();
                for (place, size) in numbers {
                    changes.extend(suspects.get(*place)?.changes(*size)?);
                }
                Some(changes)
            }
            Self::Line { frequency_hz, amplitude } => {
                of_signal(Altered::WithoutLine { frequency_hz: *frequency_hz, amplitude: *amplitude })
            }
            Self::Outliers(times) => of_signal(Altered::Without(times.clone())),
        }
    }

    /// The same with other sizes.
    pub(super) fn resized(&self, sizes: &[f64]) -> Self {
        match self {
            Self::Numbers(numbers) => {
                Self::Numbers(numbers.iter().zip(sizes).map(|((place, _), size)| (*place, *size)).collect())
            }
            Self::Line { frequency_hz, .. } => match *sizes {
                [a, b] => Self::Line { frequency_hz: *frequency_hz, amplitude: [a, b] },
                _ => self.clone(),
            },
            Self::Outliers(_) => self.clone(),
        }
    }

    /// Its sizes.
    pub(super) fn sizes(&self) -> Vec<f64> {
        match self {
            Self::Numbers(numbers) => numbers.iter().map(|(_, size)| *size).collect(),
            Self::Line { amplitude, .. } => amplitude.to_vec(),
            Self::Outliers(_) => Vec::new(),
        }
    }
}
