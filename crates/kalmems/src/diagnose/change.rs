//! What is changed for a trial, in the experiment or in what was recorded.

use crate::config::put;
use crate::config::{ConfigFault, Key};
use crate::recording::SampledRecording;
use crate::signal::Sine;
use kalmems_core::Scalar;
use toml::{Table, Value};

/// A change for a trial.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TrialChange {
    /// A key of the experiment gets this value.
    Key(Key, Value),
    /// The numbers of a channel.
    Channel {
        /// The channel, by its meaning.
        meaning: String,
        /// What becomes of them.
        how: ChannelAlteration,
    },
    /// Two channels, by their meanings, have the numbers of each other.
    Exchanged([String; 2]),
}

/// What becomes of the numbers of a channel, in SI.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum ChannelAlteration {
    /// They are multiplied.
    Scaled(f64),
    /// Something is added.
    Raised(f64),
    /// They are read so many samples later, between samples by cubic polynomials.
    Later(f64),
    /// a·cos 2πft + b·sin 2πft is subtracted.
    WithoutLine {
        /// f in Hz.
        frequency_hz: f64,
        /// a and b.
        amplitude: [f64; 2],
    },
    /// Those at these times in s are missing.
    Without(Vec<f64>),
    /// They are those of a sine.
    Sine(Sine),
}

impl TrialChange {
    /// Puts it into the document, where it is about a key.
    pub(super) fn write(&self, document: &mut Table) -> Result<(), ConfigFault> {
        match self {
            Self::Key(key, value) => put(document, key, value.clone()),
            Self::Channel { .. } | Self::Exchanged(_) => Ok(()),
        }
    }

    /// Makes it in a recording whose columns have these meanings, where it is about channels.
    pub(super) fn alter(
        &self,
        recording: &SampledRecording,
        columns: &[(String, String)],
    ) -> Option<SampledRecording> {
        let column =
            |meaning: &String| columns.iter().find(|(own, _)| own == meaning).map(|(_, column)| column);
        match self {
            Self::Key(..) => None,
            Self::Channel { meaning, how } => {
                Some(recording.what_if(column(meaning)?, |times, values| how.apply(times, values)))
            }
            Self::Exchanged([one, other]) => Some(recording.exchanged(column(one)?, column(other)?)),
        }
    }
}

impl ChannelAlteration {
    fn apply(&self, times: &[f64], values: &mut [f64]) {
        match self {
            Self::Scaled(factor) => values.iter_mut().for_each(|value| *value *= factor),
            Self::Raised(by) => values.iter_mut().for_each(|value| *value += by),
            Self::Later(samples) => {
                let read: Vec<f64> = (0..values.len()).map(|k| between(values, k as f64 + samples)).collect();
                values.copy_from_slice(&read);
            }
            Self::WithoutLine { frequency_hz, amplitude: [a, b] } => {
                for (time, value) in times.iter().zip(values) {
                    let phase = std::f64::consts::TAU * frequency_hz * time;
                    *value -= a * Scalar::cos(phase) + b * Scalar::sin(phase);
                }
            }
            Self::Sine(sine) => {
                for (time, value) in times.iter().zip(values) {
                    *value = sine.at(*time);
                }
            }
            Self::Without(gone) => {
                for time in gone {
                    let place = times.partition_point(|own| own < time);
                    if times.get(place) == Some(time)
                        && let Some(value) = values.get_mut(place)
                    {
                        *value = f64::NAN;
                    }
                }
            }
        }
    }
}

/// The value between samples, by the cubic polynomial through the four around (Catmull and Rom); that of the end beyond it.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a place within the samples
fn between(values: &[f64], place: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let place = place.clamp(0.0, last as f64);
    let (k, part) = (place as usize, place.fract());
    let at = |k: usize| values[k.min(last)];
    let [before, here, next, after] = [at(k.saturating_sub(1)), at(k), at(k + 1), at(k + 2)];
    if part == 0.0 {
        return here;
    }
    let (low, high) = (0.5 * (next - before), 0.5 * (after - here));
    let (rise, d) = (next - here, part);
    here + d * (low + d * (3.0 * rise - 2.0 * low - high + d * (low + high - 2.0 * rise)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_between_samples_is_nearly_the_sine() {
        let times: Vec<f64> = (0..200).map(|k| f64::from(k) * 1e-3).collect();
        let sine = |t: f64| (40.0 * t).sin();
        let mut values: Vec<f64> = times.iter().map(|t| sine(*t)).collect();
        ChannelAlteration::Later(0.3).apply(&times, &mut values);
        for (t, value) in times.iter().zip(&values).take(190).skip(5) {
            assert!((value - sine(t + 0.3e-3)).abs() < 1e-5, "{t}: {value}");
        }
        assert_eq!(values[199], sine(times[199]));
    }

    #[test]
    fn a_line_is_taken_away_and_a_sample_made_missing() {
        let times: Vec<f64> = (0..50).map(|k| f64::from(k) * 1e-3).collect();
        let mut values: Vec<f64> =
            times.iter().map(|t| 2.0 + 0.3 * (std::f64::consts::TAU * 50.0 * t).sin()).collect();
        ChannelAlteration::WithoutLine { frequency_hz: 50.0, amplitude: [0.0, 0.3] }
            .apply(&times, &mut values);
        assert!(values.iter().all(|value| (value - 2.0).abs() < 1e-12));
        ChannelAlteration::Without(vec![times[7]]).apply(&times, &mut values);
        assert!(values[7].is_nan() && values.iter().filter(|value| value.is_nan()).count() == 1);
    }
}
