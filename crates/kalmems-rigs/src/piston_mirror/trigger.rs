//! What the trigger of the drive tells.

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

/// The frequency in Hz of a mirror that is driven at twice its frequency, from the rising edges of the drive's trigger: half
/// of the rate of the straight line through their times.
pub fn motion_frequency(time_s: &[f64], trigger: &[f64], interval_s: f64) -> Result<f64, NoTrigger> {
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
    Ok(0.5 / period)
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
        let found = motion_frequency(&time_s, &square(1003.7), 5e-5).unwrap();
        // 200 edges over 0.2 s, each known to a sample's twelfth: √12·14 µs/(√200·0.2 s) of the frequency is 9 mHz.
        assert!((found - 501.85).abs() < 0.03, "{found}");
        assert_eq!(motion_frequency(&time_s, &vec![0.0; 4000], 5e-5), Err(NoTrigger::TooFew { edges: 0 }));
        let mut lost = square(1000.0);
        lost[1000..1400].fill(0.0);
        assert!(matches!(motion_frequency(&time_s, &lost, 5e-5), Err(NoTrigger::Irregular { .. })));
    }
}
