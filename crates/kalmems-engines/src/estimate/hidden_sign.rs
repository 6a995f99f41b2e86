//! Signs that the signals do not tell: which branch an answer is on is arbitrary, and two answers are compared on the same one.

use super::trajectory::PHASE;
use super::{StateSeries, Trajectory};
use kalmems_core::Portable;
use std::f64::consts::{PI, TAU};

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
    /// For each state 1 or −1, and what is added to it: half a period of one that comes round.
    changes: Vec<[f64; 2]>,
}

impl BranchAlignment {
    /// A value of the state with this place, on the other branch if that is needed.
    pub fn of(&self, place: usize, value: f64) -> f64 {
        self.changes.get(place).map_or(value, |[sign, shift]| sign * value + shift)
    }
}

/// Whether two sequences are rather the opposite of one another than equal: Σ a·b < 0.
pub fn are_opposite(one: &[f64], other: &[f64]) -> bool {
    correlation(one, other) < 0.0
}

/// Half a period more or less, between 0 and the period.
fn turn_half(state: &mut StateSeries, period: f64) {
    for mean in &mut state.mean {
        *mean += if *mean < 0.5 * period { 0.5 * period } else { -0.5 * period };
    }
}

/// The mean cosine of the angle between two sequences that come round, with a shift of the second, of what is known of both.
fn coherence(one: &[f64], other: &[f64], (shift, period): (f64, f64)) -> f64 {
    let both = one.iter().zip(other).filter(|(a, b)| a.is_finite() && b.is_finite());
    let cosine = |(a, b): (&f64, &f64)| (TAU / period * (b + shift - a)).portable_cos();
    let (count, sum) = both.map(cosine).fold((0.0, 0.0), |(count, sum), cosine| (count + 1.0, sum + cosine));
    if count > 0.0 { sum / count } else { 0.0 }
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

    /// The period of a state that comes round, by its place.
    pub fn period(&self, place: usize) -> Option<f64> {
        let of_motion = self.states.get(place).filter(|state| state.name == PHASE).map(|_| TAU);
        of_motion
            .or_else(|| self.periods.iter().find(|(other, _)| *other == place).map(|(_, period)| *period))
    }

    /// How another answer to the same samples is brought onto the branch of this one: of each sign that the signals hide, by the states that
    /// it belongs to together.
    pub fn alignment(&self, other: &Self) -> BranchAlignment {
        let mut changes = vec![[1.0, 0.0]; self.states.len()];
        for group in &self.hidden_signs {
            let of = |place: &usize| {
                let (own, other) = (self.states.get(*place)?, other.states.get(*place)?);
                let [sign, shift] = *changes.get(*place)?;
                Some(match self.period(*place) {
                    Some(period) => coherence(&own.mean, &other.mean, (shift, period)),
                    None => sign * correlation(&own.mean, &other.mean),
                })
            };
            if group.iter().filter_map(of).sum::<f64>() < 0.0 {
                for place in group {
                    let Some([sign, shift]) = changes.get_mut(*place) else { continue };
                    match self.period(*place) {
                        Some(period) => *shift = if *shift == 0.0 { 0.5 * period } else { 0.0 },
                        None => *sign = -*sign,
                    }
                }
            }
        }
        let is_mirrored = changes.iter().any(|[sign, _]| *sign < 0.0);
        // What follows from the states changes its sign with them or not.
        for (place, change) in changes.iter_mut().enumerate().filter(|_| is_mirrored) {
            let (Some(own), Some(other)) = (self.states.get(place), other.states.get(place)) else {
                continue;
            };
            if own.name == PHASE {
                change[1] = PI;
            } else if place >= self.own_states && are_opposite(&own.mean, &other.mean) {
                change[0] = -1.0;
            }
        }
        BranchAlignment { changes }
    }

    /// Turns the sign of the states with these places, of one that comes round half its period.
    fn turn_states(&mut self, places: &[usize]) {
        for place in places {
            let period = self.period(*place);
            let Some(state) = self.states.get_mut(*place) else { continue };
            match period {
                Some(period) => turn_half(state, period),
                None => state.mean.iter_mut().for_each(|mean| *mean = -*mean),
            }
        }
    }

    /// Turns the sign of the states with these places, and the phase of the motion by half a turn.
    pub(super) fn mirror(&mut self, places: &[usize]) {
        self.mirrored = true;
        self.turn_states(places);
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
        other.turn_states(group.map_or(&[], Vec::as_slice));
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
            (PHASE, "rad", &kind::ANGLE),
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
        assert_eq!([0, 1, 2].map(|place| alignment.of(place, -0.5)), [0.5, 0.5, -0.5]);
        assert_eq!(alignment.of(3, 0.25), 0.25 + PI);
        assert_eq!(one.alignment(&answer(0.999)).of(0, -0.5), -0.5);
        let mirrored = other.mirrored_in(1);
        assert_eq!(
            (mirrored.states[0].mean[3], mirrored.states[2].mean[3]),
            (-other.states[0].mean[3], -0.3)
        );
        assert!(!mirrored.hides_sign(0) && other.hides_sign(0));
    }

    /// A cos φ is −A cos(φ + π), here with a phase in turns.
    #[test]
    fn a_phase_is_compared_half_a_turn_later_with_the_other_sign_of_its_amplitude() {
        let answer = |sign: f64, turns: f64| {
            let mut of = answer(sign);
            of.states[0].mean.iter_mut().for_each(|mean| *mean = sign * (2.0 + 0.1 * mean.abs()));
            for (k, turn) in of.states[1].mean.iter_mut().enumerate() {
                *turn = (0.01 * k as f64 + turns).fract();
            }
            of.periods = vec![(1, 1.0)];
            of
        };
        let (one, other) = (answer(1.0, 0.0), answer(-1.001, 0.501));
        let alignment = one.alignment(&other);
        for k in 0..one.time_s.len() {
            let apart = alignment.of(1, other.states[1].mean[k]) - one.states[1].mean[k];
            assert!((apart - apart.round() - 0.001).abs() < 1e-9, "{k}: {apart}");
        }
        assert_eq!(alignment.of(0, -2.0), 2.0);
        let mirrored = other.mirrored_in(0);
        assert!(mirrored.states[1].mean.iter().all(|turn| (0.0..1.0).contains(turn)));
        let apart = mirrored.states[1].mean[9] - one.states[1].mean[9];
        assert!((apart - 0.001).abs() < 1e-9 && mirrored.states[0].mean[9] > 0.0);
        // An answer on the same branch stays as it is.
        assert_eq!(one.alignment(&answer(1.0, 0.001)), BranchAlignment { changes: vec![[1.0, 0.0]; 4] });
    }
}
