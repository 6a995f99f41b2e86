//! The recorded drive, between its samples and where samples are missing.

use crate::signal::{Sine, cubic_between, fit_sine};
use kalmems_core::Nodes;

/// The drive of one segment.
#[derive(Clone, Debug)]
pub struct Drive<'a> {
    time_s: &'a [f64],
    volts: &'a [f64],
    /// The sine that the drive follows, where it follows one.
    sine: Option<Sine>,
}

impl<'a> Drive<'a> {
    /// Takes the samples and looks for a steady sine in them.
    pub fn new(time_s: &'a [f64], volts: &'a [f64], interval_s: f64) -> Self {
        let sine = fit_sine(time_s, volts, interval_s).filter(Sine::is_steady);
        Self { time_s, volts, sine }
    }

    /// Its samples in V.
    pub fn volts(&self) -> &'a [f64] {
        self.volts
    }

    /// The sine that the drive follows, where it follows one.
    pub fn sine(&self) -> Option<&Sine> {
        self.sine.as_ref()
    }

    /// The sample at `k`, or the sine's value where it is missing; whether it was missing.
    pub fn sample(&self, k: usize) -> (f64, bool) {
        let v = self.volts[k];
        match &self.sine {
            Some(sine) if !v.is_finite() => (sine.at(self.time_s[k]), true),
            _ => (v, false),
        }
    }

    /// Where nothing tells what the drive was: the time of the first such sample and how many there are, gaps in
    /// the time included. `None` where the drive is known throughout, if only by its sine.
    pub fn unknown(&self, interval_s: f64) -> Option<(f64, usize)> {
        if self.sine.is_some() {
            return None;
        }
        let (mut first, mut count) = (None, 0);
        for (k, volts) in self.volts.iter().enumerate() {
            let interval = if k > 0 { self.time_s[k] - self.time_s[k - 1] } else { interval_s };
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count, saturating
            let missing = usize::from(!volts.is_finite()) + (interval / interval_s - 0.5) as usize;
            if missing > 0 {
                first.get_or_insert(self.time_s[k]);
                count += missing;
            }
        }
        first.map(|first_s| (first_s, count))
    }

    /// The drive at the ends and in the middle of the interval that ends at sample `to`.
    ///
    /// In the middle it is a cubic through the four samples around it; a drive that is held between samples costs
    /// far more than the integrator does (see [`Nodes`]).
    pub fn nodes(&self, to: usize) -> Nodes<f64> {
        let start = self.sample(to - 1).0;
        let end = self.sample(to).0;
        let middle = self.time_s[to - 1].midpoint(self.time_s[to]);
        Nodes { start, middle: cubic_between(self.time_s, |k| self.sample(k).0, to, middle), end }
    }

    /// The drive from its sine, for a sub-step of an interval in which samples are missing.
    pub fn nodes_from_sine(sine: &Sine, from_s: f64, to_s: f64) -> Nodes<f64> {
        Nodes { start: sine.at(from_s), middle: sine.at(from_s.midpoint(to_s)), end: sine.at(to_s) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn volts(t: f64) -> f64 {
        90.0 + 90.0 * (TAU * 31_350.0 * t - 0.4).sin()
    }

    #[test]
    fn the_middle_is_cubic_even_at_the_ends_and_with_jitter() {
        let time: Vec<f64> =
            (0..3000).map(|i| f64::from(i) * 1e-6 + 2e-7 * f64::from(i * 7919 % 11) / 11.0).collect();
        let v: Vec<f64> = time.iter().map(|t| volts(*t)).collect();
        let drive = Drive::new(&time, &v, 1e-6);
        for to in 1..time.len() {
            let middle = time[to - 1].midpoint(time[to]);
            // The fourth derivative over 4! times the products of distances: 5 mV inside, 15 at the ends.
            let edge = to == 1 || to == time.len() - 1;
            let bound = if edge { 0.015 } else { 0.005 };
            assert!((drive.nodes(to).middle - volts(middle)).abs() < bound, "{to}");
        }
    }

    #[test]
    fn what_is_missing_comes_from_the_sine_and_is_told() {
        let time: Vec<f64> = (0..3000).map(|i| f64::from(i) * 1e-6).collect();
        let mut v: Vec<f64> = time.iter().map(|t| volts(*t)).collect();
        v[1000..1040].fill(f64::NAN);
        let drive = Drive::new(&time, &v, 1e-6);
        let (value, missing) = drive.sample(1020);
        assert!(missing && (value - volts(time[1020])).abs() < 1e-4);
        assert!(!drive.sample(999).1);
        // Without a sine there is nothing to take it from.
        let sweep: Vec<f64> = time.iter().map(|t| (TAU * (3e4 + 1e7 * t) * t).sin()).collect();
        let mut sweep = sweep;
        sweep[5] = f64::NAN;
        let drive = Drive::new(&time, &sweep, 1e-6);
        assert!(drive.sine().is_none() && drive.sample(5).0.is_nan());
        assert_eq!(drive.unknown(1e-6), Some((time[5], 1)));
    }
}
