//! Combinations of numbers that no innovation shows, although each of them by itself is seen.

use super::change::TrialChange;
use super::sensitivity::NumberSensitivity;

/// Numbers that are wrong together: the relative errors of each for one of the combination, the largest of which is 1.
pub(super) type HiddenDirection = Vec<(usize, f64)>;

/// The information below which a number is hidden beside others that make up for it: with it five standard deviations are a tenth of the number.
const HIDDEN: f64 = 2500.0;

/// The part of the largest below which a number of a combination is not told; it is changed with the others all the same.
const NO_PART: f64 = 0.02;

/// Combinations that are followed up.
const MOST: usize = 8;

/// The combinations of these numbers, by their places, of which the innovations hardly tell anything to first order.
///
/// Of the slopes s of the predictions the matrix Σ s·sᵀ is what they tell of the numbers together. Its Cholesky factor, of those numbers first that
/// are known best beside the ones before, leaves of each other number what the innovations tell of it while those make up for it: where that is
/// nearly nothing, the number and what makes up for it are a combination that is hidden. Numbers that are hidden by themselves are no part of it.
pub(super) fn hidden_directions(numbers: &[NumberSensitivity]) -> Vec<HiddenDirection> {
    let known = |one: &NumberSensitivity| {
        one.suspect.is_factor() && !one.suspect.is_noise() && one.information > HIDDEN
    };
    let places: Vec<usize> = (0..numbers.len()).filter(|place| known(&numbers[*place])).collect();
    let product = |i: usize, j: usize| -> f64 {
        let slopes = numbers[places[i]].slopes.iter().zip(&numbers[places[j]].slopes);
        slopes.map(|(a, b)| a * b).filter(|product| product.is_finite()).sum()
    };
    let n = places.len();
    let mut left = vec![vec![0.0; n]; n];
    for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
        left[i][j] = product(i, j);
        left[j][i] = left[i][j];
    }
    let whole: Vec<f64> = (0..n).map(|i| left[i][i]).collect();
    let (mut taken, mut columns): (Vec<usize>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    loop {
        let open = (0..n).filter(|i| !taken.contains(i) && left[*i][*i] > HIDDEN);
        let Some(pivot) = open.max_by(|a, b| left[*a][*a].total_cmp(&left[*b][*b])) else { break };
        let root = left[pivot][pivot].sqrt();
        let column: Vec<f64> = (0..n).map(|i| left[i][pivot] / root).collect();
        for (row, own) in left.iter_mut().zip(&column) {
            row.iter_mut().zip(&column).for_each(|(entry, other)| *entry -= own * other);
        }
        taken.push(pivot);
        columns.push(column);
    }
    let hidden = (0..n).filter(|i| !taken.contains(i) && whole[*i] > HIDDEN);
    let of = |number: usize| {
        // Rᵀ·c = the number's row, from the last that was taken.
        let mut parts = vec![0.0; taken.len()];
        for k in (0..taken.len()).rev() {
            let others: f64 = ((k + 1)..taken.len()).map(|l| columns[k][taken[l]] * parts[l]).sum();
            parts[k] = (columns[k][number] - others) / columns[k][taken[k]];
        }
        let all = taken.iter().zip(parts).map(|(place, part)| (places[*place], -part));
        let all: HiddenDirection = std::iter::once((places[number], 1.0)).chain(all).collect();
        let largest = all.iter().map(|(_, part)| part.abs()).fold(0.0, f64::max);
        all.into_iter().map(|(place, part)| (place, part / largest)).collect::<HiddenDirection>()
    };
    hidden.map(of).filter(|direction| told(direction).count() > 1).take(MOST).collect()
}

/// The numbers of a combination that are told.
pub(super) fn told(direction: &[(usize, f64)]) -> impl Iterator<Item = &(usize, f64)> {
    direction.iter().filter(|(_, part)| part.abs() > NO_PART)
}

/// What a combination changes where its largest part is wrong by a size.
pub(super) fn changes(
    numbers: &[NumberSensitivity],
    direction: &[(usize, f64)],
    size: f64,
) -> Option<Vec<TrialChange>> {
    let mut all = Vec::new();
    for (place, part) in direction {
        all.extend(numbers.get(*place)?.suspect.changes(part * size)?);
    }
    Some(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Key;
    use crate::diagnose::suspect::{NumberRole, Suspect, WrittenNumber};

    #[test]
    fn a_number_and_what_makes_up_for_it_are_a_combination() {
        let suspects: Vec<Suspect> = ["a", "b", "c", "d"]
            .iter()
            .map(|name| {
                let number = WrittenNumber { key: Key::from(*name), written: 1.0, unit: String::new() };
                Suspect { what: NumberRole::Factor(vec![number]), sizes: vec![0.1] }
            })
            .collect();
        // d is half of a less twice b; c is seen by itself.
        let slopes = |place: usize| -> Vec<f64> {
            (0..300)
                .map(|k| {
                    let all = [f64::from(k % 7), f64::from(k % 5), f64::from(k % 11)].map(|x| 100.0 * x);
                    all.get(place).copied().unwrap_or(0.5 * all[0] - 2.0 * all[1])
                })
                .collect()
        };
        let of = |(place, suspect)| {
            let slopes = slopes(place);
            let information = slopes.iter().map(|slope| slope * slope).sum();
            NumberSensitivity { suspect, step: 1e-3, slopes, information, change: None }
        };
        let numbers: Vec<NumberSensitivity> = suspects.iter().enumerate().map(of).collect();
        let found = hidden_directions(&numbers);
        let [one] = &found[..] else { panic!("{found:?}") };
        let part = |place: usize| one.iter().find(|(own, _)| *own == place).map_or(0.0, |(_, part)| *part);
        // d − a/2 + 2·b = 0: in units of the largest, −1/4, 1 and 1/2.
        for (place, expected) in [(0, -0.25), (1, 1.0), (2, 0.0), (3, 0.5)] {
            assert!((part(place) - expected).abs() < 1e-9, "{found:?}");
        }
        assert!(hidden_directions(&numbers[..3]).is_empty());
    }
}
