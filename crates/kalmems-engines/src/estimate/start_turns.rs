//! Turns of states that the signals do not tell: which of all starts that differ by them a search takes.

use super::batch_start::StatePrior;
use super::hidden_turn::TurnedStates;
use kalmems_core::Portable;
use std::f64::consts::TAU;

/// The turns of which nothing is known before. Of all starts that differ by such a turn the search takes the one at which a state is 0: of a pair
/// the second one, with the first above 0, or a state that comes round.
pub(super) struct StartTurns<'a> {
    open: Vec<&'a [TurnedStates]>,
    periods: &'a [(usize, f64)],
}

impl<'a> StartTurns<'a> {
    /// Of turns; one that shares a state with another one before is left to the samples.
    pub(super) fn of(
        turns: &'a [Vec<TurnedStates>],
        prior: &[StatePrior],
        periods: &'a [(usize, f64)],
    ) -> Self {
        let mut open: Vec<&[TurnedStates]> = Vec::new();
        for turn in turns {
            let places = || turn.iter().flat_map(|turned| turned.places);
            let is_known = places().any(|place| prior.get(place).is_none_or(|prior| prior.sd.is_some()));
            let is_taken = |place| open.iter().copied().flatten().any(|other| other.places.contains(&place));
            if !turn.is_empty() && !is_known && !places().any(is_taken) {
                open.push(turn);
            }
        }
        Self { open, periods }
    }

    /// Whether a state is 0 in the start that is taken.
    pub(super) fn holds(&self, state: usize) -> bool {
        self.open.iter().filter_map(|turn| fixed(turn)).any(|turned| turned.places[1] == state)
    }

    /// Turns a start to the one that is taken of all that the signals do not tell from it.
    pub(super) fn take_out(&self, start: &mut [f64]) {
        for turn in &self.open {
            let Some(TurnedStates { places: [first, second], rate }) = fixed(turn) else { continue };
            let at = |place: &usize| start.get(*place).copied().unwrap_or(0.0);
            let ahead = match self.period(*first) {
                Some(period) => TAU * at(first) / period,
                None => at(second).portable_atan2(at(first)),
            };
            turn.iter().for_each(|turned| self.turn(start, turned, -ahead / rate));
            if let Some(held) = start.get_mut(*second) {
                *held = 0.0;
            }
        }
    }

    fn turn(&self, start: &mut [f64], turned: &TurnedStates, angle: f64) {
        let TurnedStates { places: [first, second], rate } = turned;
        if let Some(period) = self.period(*first) {
            start.get_mut(*first).into_iter().for_each(|phase| *phase += period * rate * angle / TAU);
        } else if let Ok([a, b]) = start.get_disjoint_mut([*first, *second]) {
            let (sine, cosine) = (rate * angle).portable_sin_cos();
            (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
        }
    }

    fn period(&self, state: usize) -> Option<f64> {
        self.periods.iter().find(|(other, _)| *other == state).map(|(_, period)| *period)
    }
}

/// What of a turn is 0: the first pair, or else the first state that comes round.
fn fixed(turn: &[TurnedStates]) -> Option<&TurnedStates> {
    turn.iter().find(|turned| turned.places[0] != turned.places[1]).or(turn.first())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_starts_that_differ_by_a_turn_are_one() {
        let pair = |places, rate| TurnedStates { places, rate };
        let turns = vec![
            vec![pair([0, 1], 1.0), pair([2, 3], 1.0), pair([4, 4], 2.0)],
            // It shares a state with the first one.
            vec![pair([1, 5], 1.0)],
        ];
        let (unknown, periods) = (StatePrior { mean: 0.0, sd: None }, [(4, 10.0)]);
        let of = StartTurns::of(&turns, &[unknown; 6], &periods);
        let held: Vec<usize> = (0..6).filter(|state| of.holds(*state)).collect();
        assert_eq!(held, [1]);
        let motion = |angle: f64| {
            let (sine, cosine) = angle.sin_cos();
            let turned = |a: f64, b: f64| [cosine * a - sine * b, sine * a + cosine * b];
            let ([x, y], [u, v]) = (turned(3.0, 0.0), turned(-1.0, 5.0));
            [x, y, u, v, 7.0 + 2.0 * angle * 10.0 / TAU, 0.25]
        };
        for angle in [0.0, 1.0, 2.5, -2.0] {
            let mut start = motion(angle);
            of.take_out(&mut start);
            assert_eq!(start[1], 0.0);
            let expected = [3.0, 0.0, -1.0, 5.0, 7.0, 0.25];
            let apart = |k: usize| {
                let apart = start[k] - expected[k];
                if k == 4 { apart - 10.0 * (apart / 10.0).round() } else { apart }
            };
            assert!((0..6).all(|k| apart(k).abs() < 1e-12), "{angle}: {start:?}");
        }
        // Of a turn of which something is known nothing is taken.
        let mut known = [unknown; 6];
        known[3].sd = Some(1.0);
        let of = StartTurns::of(&turns[..1], &known, &periods);
        let mut start = motion(1.0);
        of.take_out(&mut start);
        assert!(start == motion(1.0) && !of.holds(1));
    }
}
