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

/// How far above those that are allowed alone the search for all together begins.
const ABOVE: f64 = 1e3;

/// ln p that a further power of ten has to gain.
const GAIN: f64 = 0.5;

/// Factors by which the noises of readouts are tried beside them.
const READOUT: [f64; 2] = [0.7, 1.4];

/// How often all densities are tried in turn.
const ROUNDS: usize = 40;

/// For each density of a process noise among `sought` its likeliest power of ten with the others at theirs; `numbers` has those of the
/// readout.
///
/// A filter follows the signal with densities that are too large, and may lose it with those that are too small. The search
/// therefore comes from above: from beyond the largest power of ten that the beginning of the recordings allows of each alone, on by powers
/// of ten of all together and of each in turn, with the noises of the readout beside them, as long as the innovations of all rows become likelier.
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
        let alone = |bench: &TrialBench| {
            let powers = (SMALLEST..=LARGEST).rev().step_by(STEP);
            let powers = powers.filter_map(|power| format!("1e{power}").parse::<f64>().ok());
            let trial = |number: f64| {
                let mut alone = numbers.clone();
                for walk in &walks {
                    alone[*walk] = 0.0;
                }
                alone[*place] = number;
                Some((number, Trial::of(bench, sought, &alone)?))
            };
            powers.filter_map(trial).collect::<Vec<(f64, Trial)>>()
        };
        let mut tried = alone(&short);
        if tried.is_empty() {
            // A rig may want more of the motion than that.
            tried = alone(bench);
        }
        let updates = tried.iter().map(|(_, trial)| trial.updates).max()?;
        let comparable = || tried.iter().filter(|(_, trial)| trial.has(updates));
        let most = comparable().map(|(_, trial)| trial.likelihood).fold(f64::NEG_INFINITY, f64::max);
        let (largest, _) = comparable().find(|(_, trial)| trial.likelihood > most - AS_GOOD)?;
        numbers[*place] = *largest;
    }
    for walk in &walks {
        numbers[*walk] *= ABOVE;
    }
    let mut best = Trial::of(bench, sought, &numbers)?;
    // Each in turn, one step at a time: with a noise of the readout that is too large the others would go too far.
    let readouts: Vec<usize> = (0..sought.len()).filter(|place| !walks.contains(place)).collect();
    let mut moves: Vec<(Vec<usize>, [f64; 2])> = vec![(walks.clone(), [0.1, 0.01])];
    moves.extend(walks.iter().map(|place| (vec![*place], [0.1, 10.0])));
    if !readouts.is_empty() {
        moves.push((readouts, READOUT));
    }
    for _ in 0..ROUNDS {
        let mut gained = false;
        for (places, factors) in &moves {
            for factor in factors {
                let mut next = numbers.clone();
                for place in places {
                    next[*place] *= factor;
                }
                let Some(found) = Trial::of(bench, sought, &next) else { continue };
                if found.has(best.updates) && found.likelihood > best.likelihood + GAIN {
                    (best, numbers, gained) = (found, next, true);
                    break;
                }
            }
        }
        if !gained {
            break;
        }
    }
    Some(numbers)
}

/// What the innovations say with some numbers.
struct Trial {
    likelihood: f64,
    updates: usize,
}

impl Trial {
    /// `None` where the filter cannot be run with them.
    fn of(bench: &TrialBench, sought: &[UnknownNoise], numbers: &[f64]) -> Option<Self> {
        let each = sought.iter().zip(numbers);
        let changes: Vec<TrialChange> =
            each.map(|(one, number)| TrialChange::Key(one.key_in_bench(), one.written(*number))).collect();
        let trial = bench.run_unjudged(&changes)?;
        let likelihood = trial.log_likelihood(TrialBlocks::All);
        likelihood.is_finite().then(|| Self { likelihood, updates: trial.updates() })
    }

    /// Whether there are not much fewer updates: a filter that takes fewer samples in has more likely ones for that reason alone.
    const fn has(&self, updates: usize) -> bool {
        self.updates >= updates - updates / 1000
    }
}
