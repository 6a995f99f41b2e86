//! What may be the cause, with its size.

use super::change::{ChannelAlteration, TrialChange};
use super::coloured_noise::ColouredNoiseCause;
use super::suspect::Suspect;

/// Something that may be wrong, and by how much.
#[derive(Clone, Debug)]
pub(super) enum Cause {
    /// Numbers of the device, or of what was recorded, by their places among the suspects, with their sizes.
    Numbers(Vec<(usize, f64)>),
    /// A line in the signal: its frequency in Hz, the amplitudes of cosine and sine, and which harmonic of the motion it is, if it is one.
    Line { signal: String, frequency_hz: f64, amplitude: [f64; 2], harmonic: Option<usize> },
    /// Noise in the signal that a sample shares with those before it, beside the white noise.
    ColouredNoise(ColouredNoiseCause),
    /// Samples of a signal that are none of its noise, by their times in s.
    Outliers { signal: String, times: Vec<f64> },
}

impl Cause {
    /// What would have to be changed; `None` of a size that there cannot be.
    pub(super) fn changes(&self, suspects: &[Suspect]) -> Option<Vec<TrialChange>> {
        let of = |signal: &String, how| Some(vec![TrialChange::Channel { meaning: signal.clone(), how }]);
        match self {
            Self::Numbers(numbers) => {
                let mut changes = Vec::new();
                for (place, size) in numbers {
                    changes.extend(suspects.get(*place)?.changes(*size)?);
                }
                Some(changes)
            }
            Self::Line { signal, frequency_hz, amplitude, .. } => of(
                signal,
                ChannelAlteration::WithoutLine { frequency_hz: *frequency_hz, amplitude: *amplitude },
            ),
            Self::ColouredNoise(noise) => Some(vec![noise.change()]),
            Self::Outliers { signal, times } => of(signal, ChannelAlteration::Without(times.clone())),
        }
    }

    /// The same with other sizes.
    pub(super) fn resized(&self, sizes: &[f64]) -> Self {
        match self {
            Self::Numbers(numbers) => {
                Self::Numbers(numbers.iter().zip(sizes).map(|((place, _), size)| (*place, *size)).collect())
            }
            Self::Line { signal, frequency_hz, harmonic, .. } => match *sizes {
                [a, b] => Self::Line {
                    signal: signal.clone(),
                    frequency_hz: *frequency_hz,
                    amplitude: [a, b],
                    harmonic: *harmonic,
                },
                _ => self.clone(),
            },
            Self::ColouredNoise(noise) => match *sizes {
                [sd, time] => Self::ColouredNoise(noise.resized([sd, time])),
                _ => self.clone(),
            },
            Self::Outliers { .. } => self.clone(),
        }
    }

    /// Its sizes.
    pub(super) fn sizes(&self) -> Vec<f64> {
        match self {
            Self::Numbers(numbers) => numbers.iter().map(|(_, size)| *size).collect(),
            Self::Line { amplitude, .. } => amplitude.to_vec(),
            Self::ColouredNoise(noise) => noise.sizes().to_vec(),
            Self::Outliers { .. } => Vec::new(),
        }
    }
}
