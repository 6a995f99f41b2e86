//! Propagation of distributions by a Monte Carlo method.

use super::budget::Combined;
use crate::simulate::WhiteNoise;
use kalmems_core::Portable;
use serde::Serialize;
use std::ops::ControlFlow;

/// Trials of one block, whose spread over the blocks tells the accuracy of what is found (JCGM 101, 7.9).
const BLOCK: usize = 10_000;

/// What a Monte Carlo method found of one result.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PropagatedResult {
    /// How many trials were made.
    pub trials: usize,
    /// Their mean.
    pub value: f64,
    /// Their standard deviation.
    pub standard_uncertainty: f64,
    /// The probabilistically symmetric interval of this probability.
    pub interval: [f64; 2],
    /// The probability.
    pub probability: f64,
}

/// Whether the propagation of uncertainties (JCGM 100) agrees with that of distributions (JCGM 101, clause 8).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PropagationComparison {
    /// What the trials found.
    pub propagated: PropagatedResult,
    /// δ, half a unit of the second significant digit of the standard uncertainty: by so much the ends of both intervals may differ.
    pub tolerance: f64,
    /// By how much the lower and the upper end of the interval by JCGM 100 lie above those of the trials.
    pub differences: [f64; 2],
    /// By how much these differences are uncertain themselves: twice the standard deviation of the ends over the blocks' mean.
    pub accuracy: f64,
    /// Whether both ends are within the tolerance, as far as the trials tell.
    pub agrees: bool,
}

/// Trials of `count` results at once until the ends of all intervals are accurate to a fifth of their tolerance δ, as clause 7.9 of
/// JCGM 101 proceeds, or the trials are used up. A trial that has no result is `None` and counts as none.
///
/// Returns for each result what was found and twice the standard deviation of its ends; `None` where it was interrupted, or where
/// fewer than half of the trials had results.
pub fn propagated(
    (count, most, probability): (usize, usize, f64),
    seed: u64,
    trial: &(dyn Fn(&mut WhiteNoise) -> Option<Vec<f64>> + Sync),
    heard: &mut dyn FnMut(usize) -> ControlFlow<()>,
) -> Option<Vec<(PropagatedResult, f64)>> {
    let mut values = vec![Vec::new(); count];
    // Of each block the ends of each result's interval.
    let mut ends: Vec<Vec<[f64; 2]>> = vec![Vec::new(); count];
    let mut made = 0;
    for block in 0_u64.. {
        let first = values.first().map_or(0, Vec::len);
        let mut noise = WhiteNoise::new(seed, block);
        for i in 0..BLOCK.min(most - made) {
            if i % 500 == 0 && heard(made + i).is_break() {
                return None;
            }
            if let Some(found) = trial(&mut noise) {
                values.iter_mut().zip(found).for_each(|(own, value)| own.push(value));
            }
        }
        made = most.min(made + BLOCK);
        for (values, ends) in values.iter().zip(&mut ends) {
            let mut own = values.get(first..).unwrap_or_default().to_vec();
            ends.extend(interval(&mut own, probability));
        }
        let accurate = |place: usize| {
            let spread = accuracy(&ends[place]);
            let (_, deviation) = moments(&values[place]);
            spread < 0.2 * tolerance(deviation)
        };
        if made >= most || (block >= 4 && (0..count).all(accurate)) {
            break;
        }
    }
    let found = values.iter_mut().zip(&ends).map(|(values, ends)| {
        if values.len() < made / 2 {
            return None;
        }
        let (value, standard_uncertainty) = moments(values);
        let interval = interval(values, probability)?;
        let found =
            PropagatedResult { trials: values.len(), value, standard_uncertainty, interval, probability };
        Some((found, accuracy(ends)))
    });
    found.collect()
}

/// Sets the trials beside a combined uncertainty about this value.
pub fn compared(
    value: f64,
    combined: &Combined,
    (propagated, accuracy): (PropagatedResult, f64),
) -> PropagationComparison {
    let tolerance = tolerance(combined.standard_uncertainty);
    let half = combined.expanded_uncertainty;
    let differences = [value - half - propagated.interval[0], value + half - propagated.interval[1]];
    // What the trials do not tell is no disagreement.
    let agrees = differences.iter().all(|difference| difference.abs() <= tolerance + accuracy);
    PropagationComparison { propagated, tolerance, differences, accuracy, agrees }
}

/// δ = ½·10^l of a number that is c·10^l with two digits c.
fn tolerance(standard_uncertainty: f64) -> f64 {
    if standard_uncertainty <= 0.0 || !standard_uncertainty.is_finite() {
        return 0.0;
    }
    0.5 * 10.0_f64.portable_powf(standard_uncertainty.portable_log10().floor() - 1.0)
}

fn moments(values: &[f64]) -> (f64, f64) {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (square / (count - 1.0)).sqrt())
}

/// Twice the standard deviation of the mean of the blocks' ends, the larger of both.
fn accuracy(ends: &[[f64; 2]]) -> f64 {
    let of = |side: usize| {
        let own: Vec<f64> = ends.iter().map(|ends| ends[side]).collect();
        2.0 * moments(&own).1 / (own.len() as f64).sqrt()
    };
    of(0).max(of(1))
}

/// The probabilistically symmetric interval (JCGM 101, 7.7); `None` of fewer values than would have one beyond either end.
fn interval(values: &mut [f64], probability: f64) -> Option<[f64; 2]> {
    let outside = 0.5 * (1.0 - probability) * values.len() as f64;
    if outside < 1.0 {
        return None;
    }
    values.sort_unstable_by(f64::total_cmp);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a positive number below their count
    let first = outside.floor() as usize;
    Some([*values.get(first)?, *values.get(values.len() - 1 - first)?])
}

#[cfg(test)]
mod tests {
    use super::super::Combined;
    use super::*;

    fn of(law: fn(&mut WhiteNoise) -> f64) -> (PropagatedResult, f64) {
        let trial = move |noise: &mut WhiteNoise| Some(vec![law(noise)]);
        propagated((1, 400_000, 0.95), 1, &trial, &mut |_| ControlFlow::Continue(())).unwrap()[0]
    }

    /// JCGM 101, 9.2.2: the sum of four normal inputs: u = 2.0, interval ±3.92.
    #[test]
    fn four_normal_inputs_agree_with_the_guide() {
        let found = of(|noise| (0..4).map(|_| noise.sample()).sum());
        assert!(found.0.value.abs() < 0.02 && (found.0.standard_uncertainty - 2.0).abs() < 0.02);
        let compared = compared(0.0, &Combined::of(2.0, f64::INFINITY, 0.95), found);
        assert!((compared.tolerance - 0.05).abs() < 1e-12 && compared.agrees, "{compared:?}");
    }

    /// JCGM 101, 9.2.4: four rectangular inputs of which one is ten times as wide: ±17.0 by trials and ±19.9 by JCGM 100.
    #[test]
    fn a_wide_rectangular_input_is_where_both_part() {
        let found = of(|noise| {
            let mut rectangular = || 3.0_f64.sqrt() * (2.0 * noise.uniform() - 1.0);
            rectangular() + rectangular() + rectangular() + 10.0 * rectangular()
        });
        let u = 103.0_f64.sqrt();
        assert!((found.0.interval[1] - 17.0).abs() < 0.1, "{found:?}");
        let compared = compared(0.0, &Combined::of(u, f64::INFINITY, 0.95), found);
        assert!(!compared.agrees && (compared.differences[1] - 2.9).abs() < 0.15, "{compared:?}");
        assert!((compared.tolerance - 0.5).abs() < 1e-12);
    }

    #[test]
    fn the_same_seed_gives_the_same_trials_and_an_interruption_none() {
        let (first, second) = (of(WhiteNoise::sample), of(WhiteNoise::sample));
        assert_eq!(first, second);
        let trial = |noise: &mut WhiteNoise| Some(vec![noise.sample()]);
        assert!(propagated((1, 100_000, 0.95), 1, &trial, &mut |_| ControlFlow::Break(())).is_none());
        let never = |_: &mut WhiteNoise| None;
        assert!(propagated((1, 20_000, 0.95), 1, &never, &mut |_| ControlFlow::Continue(())).is_none());
    }
}
