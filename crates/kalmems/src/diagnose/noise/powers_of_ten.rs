//! The powers of ten of densities of process noise at which a search for the likeliest begins.

use super::unknown::UnknownNoise;
use crate::diagnose::bench::{TestedRows, TrialBench};
use crate::diagnose::change::TrialChange;
use crate::diagnose::trial::TrialBlocks;

/// Rows after the settling time by which the largest density is found that the signal allows.
const FIRST_ROWS: TestedRows = TestedRows(3000);

/// Powers of ten that are tried, from the largest on, in the unit of a density, and from one to the next.
const LARGEST: i32 = 24;
const SMALLEST: i32 = -36;
const STEP: usize = 3;

/// ln p below that of the likeliest power of ten at which another is as good.
const AS_GOOD: f64 = 1.0;

/// ln p that a further power of ten has to gain.
const GAIN: f64 = 0.5;

/// How often all densities are tried in turn.
const ROUNDS: usize = 20;

/// For each density of a process noise among `sought` its likeliest power of ten with the others at theirs; `numbers` has those of the
/// readout.
///
/// A filter follows the signal with densities that are too large, and may lose it with those that are too small. The search
/// therefore comes from above: from the largest power of ten that the beginning of the recordings allows of each alone, on by powers of ten
/// of each in turn as long as the innovations of all rows become likelier.
pub(super) fn from_powers_of_ten(
    bench: &TrialBench,
    sought: &[UnknownNoise],
    mut numbers: Vec<f64>,
) -> Option<Vec<f64>> {
    let walks: Vec<usize> = (0..sought.len()).filter(|place| sought[*place].walk().is_some()).collect();
    if walks.is_empty() {
        return Some(numbers);
    }
    let short = bench.shortened(FIRST_ROWS);
    for place in &walks {
        let alone = |number: f64| {
            let mut alone = numbers.clone();
            for walk in &walks {
                alone[*walk] = 0.0;
            }
            alone[*place] = number;
            likelihood(&short, sought, &alone)
        };
        let powers = (SMALLEST..=LARGEST).rev().step_by(STEP);
        let powers = powers.filter_map(|power| format!("1e{power}").parse::<f64>().ok());
        let tried: Vec<(f64, f64)> = powers.filter_map(|number| Some((number, alone(number)?))).collect();
        let most = tried.iter().map(|(_, likelihood)| *likelihood).fold(f64::NEG_INFINITY, f64::max);
        let (largest, _) = tried.iter().find(|(_, likelihood)| *likelihood > most - AS_GOOD)?;
        numbers[*place] = *largest;
    }
    let mut best = likelihood(bench, sought, &numbers)?;
    for _ in 0..ROUNDS {
        let before = best;
        for place in &walks {
            for factor in [0.1, 10.0] {
                loop {
                    let mut next = numbers.clone();
                    next[*place] *= factor;
                    match likelihood(bench, sought, &next) {
                        Some(found) if found > best + GAIN => (best, numbers) = (found, next),
                        _ => break,
                    }
                }
            }
        }
        if best == before {
            break;
        }
    }
    Some(numbers)
}

/// ln p of the innovations with these numbers; `None` where the filter cannot be run with them.
fn likelihood(bench: &TrialBench, sought: &[UnknownNoise], numbers: &[f64]) -> Option<f64> {
    let each = sought.iter().zip(numbers);
    let changes: Vec<TrialChange> =
        each.map(|(one, number)| TrialChange::Key(one.key_in_bench(), one.written(*number))).collect();
    let found = bench.run_unjudged(&changes)?.log_likelihood(TrialBlocks::All);
    found.is_finite().then_some(found)
}
