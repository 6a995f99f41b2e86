//! Turns of states that the signals do not tell: an answer is compared with what is known after the turn that brings it nearest.

use super::Trajectory;
use kalmems_core::Portable;
use std::f64::consts::TAU;

/// A pair of states that turns, or a state that comes round and is shifted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnedStates {
    /// The places of both states; twice that of one that comes round.
    pub places: [usize; 2],
    /// The angle in a common turn of 1 rad.
    pub rate: f64,
}

/// Angles at which the best turn is sought first.
const ANGLES: u32 = 360;
/// Parts of 0.618 by which the interval of the best turn is made shorter.
const SHORTER: usize = 60;

/// How far one state of a turn is from what is known of it, as a function of the turn: sums over the samples.
struct TurnedDistance {
    rate: f64,
    /// Which one of a pair it is; `None` for a state that comes round.
    of_pair: Option<usize>,
    /// Σ r², Σ r·a, Σ r·b, Σ a², Σ b², Σ a·b of the known r and the states a and b of a pair; of one that comes round the number of samples, and
    /// Σ cos and Σ sin of how far it is ahead.
    sums: [f64; 6],
}

impl TurnedDistance {
    /// Sums over the known values of the state with this place and, if it comes round, this period; `own` has both states at these samples.
    fn of(
        (turned, place, period): (&TurnedStates, usize, Option<f64>),
        known: &[f64],
        own: impl Fn(usize) -> [f64; 2],
    ) -> Self {
        let of_pair = period.is_none().then(|| usize::from(turned.places[1] == place));
        let mut sums = [0.0; 6];
        for (k, known) in known.iter().enumerate() {
            let [a, b] = own(k);
            let terms = match period {
                Some(period) => {
                    let (sine, cosine) = (TAU * (a - known) / period).portable_sin_cos();
                    [1.0, cosine, sine, 0.0, 0.0, 0.0]
                }
                None => [known * known, known * a, known * b, a * a, b * b, a * b],
            };
            if terms.iter().all(|term| term.is_finite()) {
                sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
            }
        }
        Self { rate: turned.rate, of_pair, sums }
    }

    /// The mean square over that of what is known, after a turn by an angle.
    fn at(&self, angle: f64) -> f64 {
        let (sine, cosine) = (self.rate * angle).portable_sin_cos();
        let [whole, ..] = self.sums;
        let left = match self.of_pair {
            None => 2.0 * (whole - cosine * self.sums[1] + sine * self.sums[2]),
            Some(which) => {
                let [_, to_a, to_b, of_a, of_b, of_both] = self.sums;
                let [u, v] = if which == 0 { [cosine, -sine] } else { [sine, cosine] };
                whole - 2.0 * (u * to_a + v * to_b) + u * u * of_a + v * v * of_b + 2.0 * u * v * of_both
            }
        };
        if whole > 0.0 { left / whole } else { 0.0 }
    }
}

/// The standard deviation of a sum of independent errors.
fn size([a, b]: [f64; 2]) -> f64 {
    (a * a + b * b).sqrt()
}

/// The angle of the smallest sum of these distances, and that.
fn nearest(distances: &[TurnedDistance]) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let sum = |angle: f64| distances.iter().map(|distance| distance.at(angle)).sum::<f64>();
    let step = TAU / f64::from(ANGLES);
    let tried = (0..ANGLES).map(|k| step * f64::from(k));
    let first = tried.min_by(|a, b| sum(*a).total_cmp(&sum(*b))).unwrap_or(0.0);
    let (mut low, mut high) = (first - step, first + step);
    for _ in 0..SHORTER {
        let [lower, upper] = [high - GOLDEN * (high - low), low + GOLDEN * (high - low)];
        if sum(lower) < sum(upper) { high = upper } else { low = lower }
    }
    let angle = 0.5 * (low + high);
    (angle, sum(angle))
}

/// A state that is known at some times.
pub(crate) struct KnownState<'a> {
    /// The state, by its place.
    pub(crate) place: usize,
    /// The known values.
    pub(crate) values: &'a [f64],
    /// The values of any state of an answer, by its place, at the time of each of them.
    pub(crate) own: &'a dyn Fn(&Trajectory, usize, usize) -> f64,
}

impl Trajectory {
    /// Whether a state, by its place, is one of those that a turn changes which the signals do not tell.
    pub fn hides_turn(&self, place: usize) -> bool {
        self.hidden_turns.iter().flatten().any(|turned| turned.places.contains(&place))
    }

    /// The same answer after the turns, and the changes of sign among the states that turn, which bring it nearest to what is known; `None` if
    /// there is no hidden turn of a state that is known.
    pub(crate) fn turned_to(&self, known: &[KnownState<'_>]) -> Option<Self> {
        let mut found: Option<Self> = None;
        for turn in &self.hidden_turns {
            let before = found.as_ref().unwrap_or(self);
            let has = |place: &usize| turn.iter().any(|turned| turned.places.contains(place));
            if !known.iter().any(|known| has(&known.place)) {
                continue;
            }
            let signs = before.hidden_signs.iter().filter_map(|group| group.iter().copied().find(has));
            let mirrored = signs.map(|place| Self { hidden_turns: Vec::new(), ..before.mirrored_in(place) });
            let branches: Vec<Self> = std::iter::once(before.clone()).chain(mirrored).collect();
            let fits = branches.into_iter().map(|branch| {
                let (angle, left) = nearest(&branch.distances(turn, known));
                (left, angle, branch)
            });
            found = fits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, angle, branch)| {
                let hidden_signs =
                    self.hidden_signs.iter().filter(|group| !group.iter().any(has)).cloned().collect();
                Self { hidden_signs, ..branch.turned(turn, angle) }
            });
        }
        found
    }

    fn distances(&self, turn: &[TurnedStates], known: &[KnownState<'_>]) -> Vec<TurnedDistance> {
        let each = known.iter().filter_map(|known| {
            let turned = turn.iter().find(|turned| turned.places.contains(&known.place))?;
            let [first, second] = turned.places;
            let period = if first == second { self.period(first) } else { None };
            let own = |k: usize| [first, second].map(|place| (known.own)(self, place, k));
            Some(TurnedDistance::of((turned, known.place, period), known.values, own))
        });
        each.collect()
    }

    /// The same answer turned by an angle in rad; what was known of the turn's own direction is not.
    fn turned(mut self, turn: &[TurnedStates], angle: f64) -> Self {
        for TurnedStates { places: [first, second], rate } in turn {
            if first == second {
                let Some(period) = self.period(*first) else { continue };
                let Some(state) = self.states.get_mut(*first) else { continue };
                let by = period * rate * angle / TAU;
                state.mean.iter_mut().for_each(|mean| *mean = (*mean + by).rem_euclid(period));
                continue;
            }
            let Ok([a, b]) = self.states.get_disjoint_mut([*first, *second]) else { continue };
            let (sine, cosine) = (rate * angle).portable_sin_cos();
            for (a, b) in a.mean.iter_mut().zip(&mut b.mean) {
                (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
            }
            for (a, b) in a.sd.iter_mut().zip(&mut b.sd) {
                let [of_a, of_b] = [[cosine * *a, sine * *b], [sine * *a, cosine * *b]];
                (*a, *b) = (size(of_a), size(of_b));
            }
        }
        self
    }

    /// Another answer to the same samples after the turns that bring it nearest to this one; `None` where no turn is hidden.
    pub fn turned_like(&self, other: &Self) -> Option<Self> {
        let own = |of: &Self, place: usize, k: usize| {
            of.states.get(place).and_then(|state| state.mean.get(k)).copied().unwrap_or(f64::NAN)
        };
        let turned = self.hidden_turns.iter().flatten().flat_map(|turned| turned.places);
        let known: Vec<KnownState<'_>> = turned
            .filter_map(|place| Some(KnownState { place, values: &self.states.get(place)?.mean, own: &own }))
            .collect();
        let other = Self { hidden_turns: self.hidden_turns.clone(), ..other.clone() };
        if known.is_empty() { None } else { other.turned_to(&known) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::TrajectoryKind;
    use crate::units::kind;

    /// A motion on an ellipse and a phase, turned by an angle in rad.
    fn answer(angle: f64, mirrored: f64) -> Trajectory {
        let time_s: Vec<f64> = (0..300).map(f64::from).collect();
        let states = [("x", "m", &kind::LENGTH), ("y", "m", &kind::LENGTH), ("phi", "rad", &kind::ANGLE)];
        let all = (&time_s[..], &time_s[..], &(0..300));
        let mut of = Trajectory::blank(("a", "A"), TrajectoryKind::Filtered, all, &states);
        let (sine, cosine) = angle.sin_cos();
        for (k, t) in time_s.iter().enumerate() {
            let (x, y) = (mirrored * 2.0 * (0.1 * t).cos(), (0.1 * t).sin());
            of.states[0].mean[k] = cosine * x - sine * y;
            of.states[1].mean[k] = sine * x + cosine * y;
            of.states[2].mean[k] = (0.3 * t + angle).rem_euclid(TAU);
        }
        of.states[1].mean[5] = f64::NAN;
        of.periods = vec![(2, TAU)];
        of.hidden_signs = vec![vec![0]];
        let turned = |places| TurnedStates { places, rate: 1.0 };
        of.hidden_turns = vec![vec![turned([0, 1]), turned([2, 2])]];
        of
    }

    #[test]
    fn an_answer_is_turned_to_what_is_known_and_mirrored_if_that_is_nearer() {
        let one = answer(0.0, 1.0);
        let apart = |turned: &Trajectory, place: usize| {
            let both = turned.states[place].mean.iter().zip(&one.states[place].mean);
            let apart = both.map(|(a, b)| (a - b).abs()).filter(|apart| apart.is_finite());
            apart.map(|apart| apart.min((apart - TAU).abs())).fold(0.0, f64::max)
        };
        for angle in [0.0, 0.7, 3.3, -1.0] {
            let turned = one.turned_like(&answer(angle, 1.0)).unwrap();
            assert!((0..3).all(|place| apart(&turned, place) < 1e-6), "{angle}");
        }
        // The phase is that of another turn here: the pair alone is known.
        let own = |of: &Trajectory, place: usize, k: usize| of.states[place].mean[k];
        let known = [0, 1].map(|place| KnownState { place, values: &one.states[place].mean, own: &own });
        let turned = answer(0.7, -1.0).turned_to(&known).unwrap();
        assert!(apart(&turned, 0) < 1e-6 && apart(&turned, 1) < 1e-6);
        // One of both is enough, and of what does not turn nothing is found.
        let turned = answer(2.0, 1.0).turned_to(&known[..1]).unwrap();
        assert!(apart(&turned, 0) < 1e-6);
        let straight = Trajectory { hidden_turns: Vec::new(), ..one.clone() };
        assert!(straight.turned_like(&answer(0.7, 1.0)).is_none() && straight.turned_to(&known).is_none());
    }
}
