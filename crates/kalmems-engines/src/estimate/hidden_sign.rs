//! Signs that the signals do not tell: which branch an answer is on is arbitrary, and two answers are compared on the same one.

use super::Trajectory;
use super::trajectory::PHASE;
use std::f64::consts::PI;

/// The sign of a motion that the signals do not tell, as an experiment states it (`estimate.first_peak`).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StatedSign {
    /// Which of the angles it is of, from 0.
    pub axis: usize,
    /// The place of the state that is its rate.
    pub rate: usize,
    /// The places of all that changes its sign with it.
    pub states: Vec<usize>,
    /// Whether the first turning point after the drive's first peak after the settling time is a maximum.
    pub is_positive: bool,
}

/// How another answer is brought onto the branch of a first one.
#[derive(Clone, Debug, PartialEq)]
pub struct BranchAlignment {
    /// 1 or −1 for each state.
    signs: Vec<f64>,
    /// What is added to a phase: half a turn where the motion is mirrored.
    phase: f64,
}

impl BranchAlignment {
    /// A value of the state with this place and name, on the other branch if that is needed.
    pub fn of(&self, (place, name): (usize, &str), value: f64) -> f64 {
        if name == PHASE { value + self.phase } else { self.signs.get(place).map_or(value, |s| s * value) }
    }
}

/// Whether two sequences are rather the opposite of one another than equal: Σ a·b < 0.
pub fn are_opposite(one: &[f64], other: &[f64]) -> bool {
    correlation(one, other) < 0.0
}

/// Σ a·b over Σ a², of what is known of both.
fn correlation(one: &[f64], other: &[f64]) -> f64 {
    let both = one.iter().zip(other).filter(|(a, b)| a.is_finite() && b.is_finite());
    let (product, square) = both.fold((0.0, 0.0), |(p, s), (a, b)| (p + a * b, s + a * a));
    if square > 0.0 { product / square } else { 0.0 }
}

impl Trajectory {
    /// Whether the sign of a state, by its place, is one that the signals do not tell.
    pub fn hides_sign(&self, place: usize) -> bool {
        self.hidden_signs.iter().any(|group| group.contains(&place))
    }

    /// How another answer to the same samples is brought onto the branch of this one: of each sign that the signals hide, by the states that
    /// it belongs to together.
    pub fn alignment(&self, other: &Self) -> BranchAlignment {
        let mut signs = vec![1.0; self.states.len()];
        for group in &self.hidden_signs {
            let of = |place: &usize| {
                let (own, other) = (self.states.get(*place)?, other.states.get(*place)?);
                Some(signs.get(*place)? * correlation(&own.mean, &other.mean))
            };
            if group.iter().filter_map(of).sum::<f64>() < 0.0 {
                for place in group {
                    if let Some(sign) = signs.get_mut(*place) {
                        *sign = -*sign;
                    }
                }
            }
        }
        let is_mirrored = signs.iter().any(|sign| *sign < 0.0);
        // What follows from the states changes its sign with them or not.
        for (place, sign) in signs.iter_mut().enumerate() {
            let (Some(own), Some(other)) = (self.states.get(place), other.states.get(place)) else {
                continue;
            };
            let follows = is_mirrored && place >= self.own_states && own.name != PHASE;
            if follows && are_opposite(&own.mean, &other.mean) {
                *sign = -1.0;
            }
        }
        BranchAlignment { signs, phase: if is_mirrored { PI } else { 0.0 } }
    }

    /// Turns the sign of the states with these places, and the phase of the motion by half a turn.
    pub(super) fn mirror(&mut self, places: &[usize]) {
        self.mirrored = true;
        for place in places {
            let Some(state) = self.states.get_mut(*place) else { continue };
            state.mean.iter_mut().for_each(|mean| *mean = -*mean);
        }
        let phases = self.states.iter_mut().skip(self.own_states).filter(|state| state.name == PHASE);
        for phase in phases.flat_map(|state| &mut state.mean) {
            *phase = if *phase > 0.0 { *phase - PI } else { *phase + PI };
        }
    }

    /// The same answer with the other sign of a state, by its place, and of those that it belongs to; nothing of it is arbitrary any more.
    #[must_use]
    pub fn mirrored_in(&self, place: usize) -> Self {
        let mut other = Self { hidden_signs: Vec::new(), ..self.clone() };
        let group = self.hidden_signs.iter().find(|group| group.contains(&place));
        for place in group.into_iter().flatten() {
            if let Some(state) = other.states.get_mut(*place) {
                state.mean.iter_mut().for_each(|mean| *mean = -*mean);
            }
        }
        other
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::TrajectoryKind;
    use crate::units::kind;

    fn answer(sign: f64) -> Trajectory {
        let time_s: Vec<f64> = (0..200).map(f64::from).collect();
        let states = [
            ("angle", "rad", &kind::ANGLE),
            ("rate", "rad_per_s", &kind::ANGLE),
            ("gain", "1", &kind::ANGLE),
        ];
        let mut of =
            Trajectory::blank(("a", "A"), TrajectoryKind::Filtered, (&time_s, &time_s, &(0..200)), &states);
        for (k, t) in time_s.iter().enumerate() {
            of.states[0].mean[k] = sign * (0.1 * t).sin();
            of.states[1].mean[k] = sign * (0.1 * t).cos();
            of.states[2].mean[k] = -0.3;
        }
        of.states[0].mean[7] = f64::NAN;
        of.hidden_signs = vec![vec![0, 1]];
        of.own_states = 3;
        of
    }

    #[test]
    fn answers_of_both_branches_are_compared_on_one() {
        let (one, other) = (answer(1.0), answer(-1.001));
        let alignment = one.alignment(&other);
        assert_eq!(alignment.of((0, "angle"), -0.5), 0.5);
        assert_eq!(alignment.of((1, "rate"), 2.0), -2.0);
        assert_eq!(alignment.of((2, "gain"), -0.3), -0.3);
        assert_eq!(alignment.of((3, PHASE), 0.25), 0.25 + PI);
        assert_eq!(one.alignment(&answer(0.999)).of((0, "angle"), -0.5), -0.5);
        let mirrored = other.mirrored_in(1);
        assert_eq!(
            (mirrored.states[0].mean[3], mirrored.states[2].mean[3]),
            (-other.states[0].mean[3], -0.3)
        );
        assert!(!mirrored.hides_sign(0) && other.hides_sign(0));
    }
}
