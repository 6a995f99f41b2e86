//! What is uncertain of the device and no state of a filter: its part in every answer, and in what the signal is expected to be.
//!
//! A filter is told p₀ of parameters that are p₀ + Σ b_j·s_j, with independent b_j of the standard normal distribution (the directions s_j
//! are the columns of the Cholesky factor of their covariance). Another one beside it is told p₀ + s_j. To first order
//!
//! - D_j = x̂(p₀ + s_j) − x̂(p₀) is how one standard deviation enters the answer, whatever the filter, smoothed or not. The error of x̂(p₀) is
//!   that of a filter that is told right, less Σ b_j·D_j, and its covariance P + Σ D_j·D_jᵀ (consider covariance analysis: Tapley, Schutz
//!   & Born, Statistical Orbit Determination, 2004, chapter 6).
//! - N_j = ν(p₀ + s_j) − ν(p₀) is how it enters the innovation: ν(p₀) = ν* − Σ b_j·N_j with the white ν* of a filter that is told right. The
//!   innovations so far therefore tell b, by a Kalman filter of b alone (Friedland's separate-bias estimation, IEEE Trans. Autom. Control 14,
//!   359, 1969), and less what they predict, ν' = ν + Σ b̂_j·N_j is white with the variance S + N·P_b·Nᵀ. That is the innovation of the
//!   device as it is stated, with its uncertainty.
//!
//! The answer itself is not changed by what the recording tells of b: a parameter that is to be learnt is a state.

use super::{StateSeries, Trajectory};
use kalmems_core::{Covariance, Scalar};
use kalmems_models::control::MotionPhase;
use std::f64::consts::TAU;
use std::sync::Arc;

/// By how much ln p of a number is smaller where its normalised square is larger by so much, and its variance by this factor.
fn less_likely(nis: f64, factor: f64) -> f64 {
    0.5 * (nis + Scalar::ln(factor))
}

/// What one direction of the device's uncertainty contributes to an answer.
#[derive(Clone, Debug)]
pub struct Contribution {
    /// The uncertain numbers, by their keys below the device's table.
    pub name: Arc<str>,
    /// For each state, over the samples, by how much one standard deviation moves it.
    pub states: Vec<Vec<f64>>,
    /// What the innovations until the last of these samples tell of it, in standard deviations of what is stated: mean and standard
    /// deviation, 0 and 1 where they tell nothing.
    pub told: [f64; 2],
}

/// What innovations have told of the directions of the device's uncertainty.
#[derive(Clone, Debug, Default)]
pub(crate) struct DirectionInformation {
    mean: Vec<f64>,
    /// Row by row.
    covariance: Vec<f64>,
}

impl DirectionInformation {
    fn of(directions: usize) -> Self {
        let diagonal = |k: usize| f64::from(u8::from(k / directions == k % directions));
        Self { mean: vec![0.0; directions], covariance: (0..directions * directions).map(diagonal).collect() }
    }

    /// As numbers, for another run to go on from.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        self.mean.iter().chain(&self.covariance).copied()
    }

    /// From such numbers.
    pub(crate) fn read(numbers: &[f64]) -> Option<Self> {
        let directions = (1..=numbers.len()).find(|n| n * (n + 1) == numbers.len())?;
        let (mean, covariance) = numbers.split_at(directions);
        Some(Self { mean: mean.to_vec(), covariance: covariance.to_vec() })
    }

    /// The innovation of the stated device and its variance, from that of what the filter is told, and from how each direction enters
    /// it; learns from it where that is wanted.
    fn take(&mut self, (value, variance): (f64, f64), enters: &[f64], learns: bool) -> (f64, f64) {
        let n = enters.len();
        // P·N.
        let spread = |i: usize| {
            let row = &self.covariance[i * n..(i + 1) * n];
            row.iter().zip(enters).map(|(p, e)| p * e).sum::<f64>()
        };
        let spread: Vec<f64> = (0..n).map(spread).collect();
        let predicted: f64 = self.mean.iter().zip(enters).map(|(b, e)| b * e).sum();
        let whole = variance + spread.iter().zip(enters).map(|(s, e)| s * e).sum::<f64>();
        let left = value + predicted;
        if learns && whole > 0.0 {
            for i in 0..n {
                let gain = spread[i] / whole;
                self.mean[i] -= gain * left;
                for (entry, other) in self.covariance[i * n..(i + 1) * n].iter_mut().zip(&spread) {
                    *entry -= gain * other;
                }
            }
        }
        (left, whole)
    }
}

impl Trajectory {
    /// Takes into account what is uncertain of the device: `varied` are the answers of the same filter that is told one standard deviation
    /// more in each direction, `learnt` what the samples before have told; those before `from_s` tell nothing.
    ///
    /// Of what makes no claim nothing is changed.
    pub(crate) fn consider(
        &mut self,
        varied: &[(Arc<str>, &Self)],
        learnt: &mut DirectionInformation,
        from_s: f64,
    ) {
        if varied.is_empty() || !self.claims() {
            return;
        }
        if learnt.mean.len() != varied.len() {
            *learnt = DirectionInformation::of(varied.len());
        }
        let before = self.considered.len();
        let contributions = varied
            .iter()
            .map(|(name, other)| {
                // Both on one branch, where the signals do not tell which it is.
                let turned = self.turned_like(other);
                let other = turned.as_ref().unwrap_or(other);
                let alignment = self.alignment(other);
                let difference = |(place, (own, other)): (usize, (&StateSeries, &StateSeries))| {
                    // A phase is known but for whole turns.
                    let period = self.period(place);
                    let whole = |apart: f64| period.map_or(0.0, |period| period * (apart / period).round());
                    let aligned = |other: &f64| alignment.of(place, *other);
                    let apart = own.mean.iter().zip(&other.mean).map(|(own, other)| aligned(other) - own);
                    apart.map(|apart| apart - whole(apart)).collect::<Vec<f64>>()
                };
                let states = self.states.iter().zip(&other.states).enumerate().map(difference).collect();
                Contribution { name: Arc::clone(name), states, told: [0.0, 1.0] }
            })
            .collect();
        self.widen(contributions);
        self.expect(varied, learnt, from_s);
        let directions = varied.len();
        for (place, one) in self.considered[before..].iter_mut().enumerate() {
            one.told = [learnt.mean[place], learnt.covariance[place * (directions + 1)].max(0.0).sqrt()];
        }
    }

    /// Takes independent errors into account that the filter does not know of: they are in the standard deviations of the states from then on.
    pub fn widen(&mut self, contributions: Vec<Contribution>) {
        for (place, state) in self.states.iter_mut().enumerate() {
            for (k, sd) in state.sd.iter_mut().enumerate() {
                let moved = contributions.iter().filter_map(|one| one.states.get(place)?.get(k));
                *sd = (*sd * *sd + moved.map(|moved| moved * moved).sum::<f64>()).sqrt();
            }
        }
        self.considered.extend(contributions);
    }

    /// By how much one standard deviation in each direction of the device's uncertainty moves the phase in rad, at a sample of which this is the time
    /// in s, of a motion of which the first states are the angle and the rate, at this rate in rad/s. Nothing where there is no such sample.
    pub(crate) fn moved_phases(&self, time_s: f64, rate: f64) -> Vec<f64> {
        let k = self.time_s.partition_point(|time| *time < time_s);
        let [angle, velocity, ..] = &*self.states else { return Vec::new() };
        let (Some(angle), Some(velocity)) = (angle.mean.get(k), velocity.mean.get(k)) else {
            return Vec::new();
        };
        let phase = |angle: f64, velocity: f64| {
            MotionPhase::of(&[angle, velocity], &Covariance::from_standard_deviations([0.0; 2]), rate).phase
        };
        let moved = |one: &Contribution| {
            let of = |place: usize| Some(*one.states.get(place)?.get(k)?);
            let apart = phase(angle + of(0)?, velocity + of(1)?) - phase(*angle, *velocity);
            Some(apart - TAU * (apart / TAU).round())
        };
        self.considered.iter().filter_map(moved).collect()
    }

    /// Gives the innovations that of the stated device.
    fn expect(&mut self, varied: &[(Arc<str>, &Self)], learnt: &mut DirectionInformation, from_s: f64) {
        let mut enters = vec![0.0; varied.len()];
        for k in 0..self.time_s.len() {
            let learns = self.time_s[k] >= from_s;
            let enter = |enters: &mut [f64], own: f64, other: &dyn Fn(&Self) -> Option<f64>| {
                for (enter, (_, varied)) in enters.iter_mut().zip(varied) {
                    // A sample that one of them refuses tells nothing of their difference.
                    *enter = other(varied).map_or(0.0, |other| other - own);
                    if !enter.is_finite() {
                        *enter = 0.0;
                    }
                }
            };
            let (own, sd) = (self.innovation[k], self.innovation_sd[k]);
            if own.is_finite() && sd.is_finite() {
                enter(&mut enters, own, &|varied| varied.innovation.get(k).copied());
                let (left, variance) = learnt.take((own, sd * sd), &enters, learns);
                let nis = left * left / variance;
                self.log_likelihood[k] -= less_likely(nis - self.nis[k], variance / (sd * sd));
                (self.innovation[k], self.innovation_sd[k], self.nis[k]) = (left, variance.sqrt(), nis);
            }
            for (place, signal) in self.further.iter_mut().enumerate() {
                let (own, sd) = (signal.innovation[k], signal.sd[k]);
                if own.is_finite() && sd.is_finite() {
                    enter(&mut enters, own, &|varied| varied.further.get(place)?.innovation.get(k).copied());
                    let (left, variance) = learnt.take((own, sd * sd), &enters, learns);
                    let nis = left * left / variance;
                    self.log_likelihood[k] -= less_likely(nis - signal.nis[k], variance / (sd * sd));
                    signal.enter(k, [left, variance.sqrt()]);
                }
            }
        }
    }

    /// Which share of the claimed variance of a state, by its place, each direction of the device's uncertainty has between these times, in s,
    /// on average: an error that all samples have in common.
    pub fn common_shares(&self, state: usize, from_s: f64, to_s: f64) -> Vec<f64> {
        let Some(series) = self.states.get(state) else { return Vec::new() };
        let share = |one: &Contribution| {
            let moved = one.states.get(state).map_or(&[][..], Vec::as_slice);
            let each = self.time_s.iter().zip(moved.iter().zip(&series.sd));
            let within = each.filter(|(time_s, _)| (from_s..=to_s).contains(*time_s));
            let shares =
                within.map(|(_, (moved, sd))| (moved / sd).powi(2)).filter(|share| share.is_finite());
            let (count, sum) = shares.fold((0.0, 0.0), |(count, sum), share| (count + 1.0, sum + share));
            if count > 0.0 { sum / count } else { 0.0 }
        };
        self.considered.iter().map(share).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// The second way: y = Σ b_j·a_j + v with independent b of the standard normal distribution is normal with the covariance R + A·Aᵀ, whose
    /// density is that of all whitened innovations together; and b given y is what ordinary least squares with its prior finds.
    #[test]
    fn whitened_innovations_have_the_density_of_all_samples_together() {
        const VARIANCE: f64 = 0.3;
        let measured = DVector::from_fn(12, |k, _| ((k * k) as f64 * 0.37).sin() * 2.0);
        let enters =
            DMatrix::from_fn(
                12,
                2,
                |k, j| if j == 0 { 1.5 + 0.1 * k as f64 } else { (k as f64 * 0.8).cos() },
            );
        let mut learnt = DirectionInformation::of(2);
        let mut sum = 0.0;
        for k in 0..12 {
            // A filter that is told b + 1 predicts a_j more.
            let of_each: Vec<f64> = enters.row(k).iter().map(|enter| -enter).collect();
            let (left, variance) = learnt.take((measured[k], VARIANCE), &of_each, true);
            sum -= 0.5 * (left * left / variance + variance.ln());
        }
        let covariance = DMatrix::identity(12, 12) * VARIANCE + &enters * enters.transpose();
        let factor = covariance.cholesky().unwrap();
        let log_determinant = 2.0 * factor.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let together = -0.5 * (measured.dot(&factor.solve(&measured)) + log_determinant);
        approx::assert_relative_eq!(sum, together, max_relative = 1e-12);

        let information = DMatrix::identity(2, 2) + enters.transpose() * &enters / VARIANCE;
        let inverse = information.try_inverse().unwrap();
        let mean = &inverse * enters.transpose() * measured / VARIANCE;
        for i in 0..2 {
            approx::assert_relative_eq!(learnt.mean[i], mean[i], max_relative = 1e-10);
            for j in 0..2 {
                approx::assert_relative_eq!(
                    learnt.covariance[2 * i + j],
                    inverse[(i, j)],
                    max_relative = 1e-10
                );
            }
        }
    }

    #[test]
    fn what_was_learnt_is_read_back_from_its_numbers() {
        let mut learnt = DirectionInformation::of(3);
        learnt.take((0.4, 0.1), &[1.0, -0.3, 0.2], true);
        let numbers: Vec<f64> = learnt.numbers().collect();
        let again = DirectionInformation::read(&numbers).unwrap();
        assert_eq!((again.mean, again.covariance), (learnt.mean, learnt.covariance));
        assert!(DirectionInformation::read(&numbers[1..]).is_none());
    }
}
