//! How finely the states that no equation moves have to be known for the linear part of a step.

use super::Motion;
use crate::modes::{balance, modes};
use crate::program::ProgramNumbers;

/// The part of its size by which the linear part may be off: what that costs a step is far less than what the rest of its error does.
const ALIKE: f64 = 1.0 / 65536.0;

/// The smallest step that is tried, and how many that are each twice as large as the one before.
const SMALLEST: f64 = 1e-36;
const TRIED: usize = 240;

impl Motion {
    /// The states that no equation moves and on which the linear part depends, such as a resonance or a turning rate, each with the size by
    /// which it may be off about this point under these inputs, in SI; 0 where none is small enough, or where there is nothing to compare
    /// with.
    ///
    /// What may be off is told by the balanced linear part, since entries of different units have no common size.
    pub fn held(&self, work: &mut ProgramNumbers, at: &[f64], inputs: &[f64]) -> Vec<(usize, f64)> {
        let n = self.states;
        let (mut rates, mut jacobian) = (vec![0.0; at.len()], vec![0.0; at.len() * at.len()]);
        let mut linear = |x: &[f64]| -> Vec<Vec<f64>> {
            self.linearize(work, x, inputs, &mut rates, &mut jacobian);
            jacobian
                .chunks(at.len().max(1))
                .take(n)
                .map(|row| row.iter().take(n).copied().collect())
                .collect()
        };
        let size = |rows: &[Vec<f64>]| -> f64 {
            rows.iter().map(|row| row.iter().map(|entry| entry.abs()).sum()).fold(0.0, f64::max)
        };
        let here = linear(at);
        let mut balanced = here.clone();
        let scales = balance(&mut balanced);
        let whole = size(&balanced);
        let mut step = |place: usize| -> f64 {
            let mut change = |by: f64| -> f64 {
                let mut x = at.to_vec();
                x[place] += by;
                let mut there = linear(&x);
                for (i, (row, here)) in there.iter_mut().zip(&here).enumerate() {
                    for (j, (entry, here)) in row.iter_mut().zip(here).enumerate() {
                        *entry = (*entry - here) * scales[j] / scales[i];
                    }
                }
                size(&there)
            };
            let tried = std::iter::successors(Some(SMALLEST), |by| Some(2.0 * by)).take(TRIED);
            let alike = tried.take_while(|by| change(*by) <= ALIKE * whole && change(-by) <= ALIKE * whole);
            alike.last().unwrap_or(0.0)
        };
        let known = modes(&here.concat(), n).unwrap_or_default();
        let has_size = whole.is_finite() && known.iter().any(|mode| mode.size() > 0.0);
        self.held.iter().map(|place| (*place, if has_size { step(*place) } else { 0.0 })).collect()
    }
}
