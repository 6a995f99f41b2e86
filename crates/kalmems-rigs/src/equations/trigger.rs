//! What the trigger of a drive tells of the motion's frequency.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::num::NonZeroU8;

/// A channel that a recording may have, which rises with the motion.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TriggerTable {
    /// The channel, in V.
    pub channel: String,
    /// How often it rises in a cycle of the motion: 2 of a drive at twice the frequency.
    pub rises: NonZeroU8,
}

/// Why a trigger tells no frequency.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoTrigger {
    /// It rises too seldom.
    #[error("rises {edges} times; expected at least {FEWEST}, one per period of the drive")]
    TooFew {
        /// How often.
        edges: usize,
    },
    /// It does not rise at equal intervals.
    #[error("rises at intervals that differ by {scatter_s:.2e} s rms; expected those of a constant drive")]
    Irregular {
        /// By how much its edges are off equal intervals.
        scatter_s: f64,
    },
}

/// The fewest edges that are taken for a drive.
const FEWEST: usize = 4;
/// How far edges may be off equal intervals, in samples: half a sample is what sampling makes of them.
const SCATTER: f64 = 1.0;

/// The frequency in Hz of a motion from a trigger's rising edges, so many in a cycle: by the straight line through their times.
pub fn motion_frequency(
    (time_s, trigger): (&[f64], &[f64]),
    rises: NonZeroU8,
    interval_s: f64,
) -> Result<f64, NoTrigger> {
    let finite = || trigger.iter().copied().filter(|v| v.is_finite());
    let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let level = low.midpoint(high);
    let edges: Vec<f64> = (trigger.windows(2).zip(time_s.windows(2)))
        .filter(|(values, _)| values[0] < level && values[1] >= level)
        .map(|(_, times)| times[0].midpoint(times[1]))
        .collect();
    if edges.len() < FEWEST {
        return Err(NoTrigger::TooFew { edges: edges.len() });
    }
    let count = edges.len() as f64;
    let (middle, mean) = (0.5 * (count - 1.0), edges.iter().sum::<f64>() / count);
    let (mut products, mut squares) = (0.0, 0.0);
    for (index, edge) in edges.iter().enumerate() {
        let off = index as f64 - middle;
        products += off * (edge - mean);
        squares += off * off;
    }
    let period = products / squares;
    let left = |(index, edge): (usize, &f64)| (edge - mean - period * (index as f64 - middle)).powi(2);
    let scatter_s = (edges.iter().enumerate().map(left).sum::<f64>() / count).sqrt();
    if scatter_s > SCATTER * interval_s {
        return Err(NoTrigger::Irregular { scatter_s });
    }
    Ok(1.0 / (f64::from(rises.get()) * period))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edges_of_a_square_wave_tell_half_its_frequency() {
        let time_s: Vec<f64> = (0..4000).map(|k| f64::from(k) * 5e-5).collect();
        let square = |hz: f64| -> Vec<f64> {
            time_s.iter().map(|t| if (hz * t + 0.3).fract() < 0.5 { 3.3 } else { 0.0 }).collect()
        };
        let twice = NonZeroU8::new(2).unwrap();
        let frequency = |trigger: &[f64]| motion_frequency((&time_s, trigger), twice, 5e-5);
        let found = frequency(&square(1003.7)).unwrap();
        // 200 edges over 0.2 s, each known to a sample's twelfth: √12·14 µs/(√200·0.2 s) of the frequency is 9 mHz.
        assert!((found - 501.85).abs() < 0.03, "{found}");
        assert_eq!(frequency(&vec![0.0; 4000]), Err(NoTrigger::TooFew { edges: 0 }));
        let mut lost = square(1000.0);
        lost[1000..1400].fill(0.0);
        assert!(matches!(frequency(&lost), Err(NoTrigger::Irregular { .. })));
    }
}
