//! Quantisation, white noise, flicker and a random walk, fitted to Allan's variances, with intervals.

use crate::signal::Confident;
use kalmems_core::Portable;
use serde::Serialize;
use std::f64::consts::{LN_2, PI};

/// Quantisation of the angle, white noise, flicker, and a random walk of the rate.
const PARTS: usize = 4;
/// Where each part is.
const QUANTISATION: usize = 0;
const WHITE: usize = 1;
const FLICKER: usize = 2;
const WALK: usize = 3;
/// The power of the frequency in the density of each.
const EXPONENTS: [i32; PARTS] = [2, 0, -1, -2];

/// The floor of flicker noise in Allan's variance by the square of its bias instability.
const FLOOR: f64 = 2.0 * LN_2 / PI;
/// Overlapping variances of neighbouring octaves have a correlation of one half, in white noise and in flicker: all of them together tell as much
/// as if each had its degrees of freedom divided by this (2.0 in 400 records of white noise, 2.4 in 300 of flicker).
const OVERLAP: f64 = 2.2;
/// Half of what χ² of one degree of freedom exceeds in 5 of 100 cases: by so much a likelihood may fall.
const FALL: f64 = OVERLAP * 3.841_458_820_694_124 / 2.0;
/// Steps towards the likeliest parts.
const STEPS: usize = 600;
/// Halvings of a search for the end of an interval, on a logarithmic scale.
const HALVINGS: usize = 40;
/// How far from the likeliest value the end of an interval is looked for, as a factor of the variance.
const FARTHEST: f64 = 1e4;

/// What the noise of a rate at rest is made of, as far as its Allan variances tell it.
///
/// The likeliest parts, none below 0, for variances that each have the distribution of χ² with their own degrees of freedom. That those of
/// neighbouring averaging times hang together makes the intervals wider by a factor that holds for white noise and flicker.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NoiseFit {
    /// The angle random walk N in rad/√s, with the interval that holds it 95 times in 100.
    pub angle_random_walk: (f64, [f64; 2]),
    /// The bias instability B of flicker in rad/s, with the same; from 0 on where the record shows none.
    pub bias_instability: (f64, [f64; 2]),
    /// The rate random walk K in rad/s/√s, with the same.
    pub rate_random_walk: (f64, [f64; 2]),
    /// The quantisation Q of the angle in rad, with the same.
    pub quantisation: (f64, [f64; 2]),
}

/// An Allan variance with its degrees of freedom, and what each part adds to it.
struct Octave {
    variance: f64,
    freedom: f64,
    parts: [f64; PARTS],
}

impl Octave {
    fn expected(&self, sizes: &[f64; PARTS]) -> f64 {
        self.parts.iter().zip(sizes).map(|(part, size)| part * size).sum()
    }
}

impl NoiseFit {
    /// Of Allan deviations; `None` of fewer than four that are known.
    pub fn of(deviations: &[Confident]) -> Option<Self> {
        let octaves = octaves(deviations);
        if octaves.len() < PARTS + 1 {
            return None;
        }
        let best = likeliest(&octaves, None);
        let of = |part: usize| (best[part].sqrt(), interval(&octaves, &best, part).map(f64::sqrt));
        Some(Self {
            angle_random_walk: of(WHITE),
            bias_instability: of(FLICKER),
            rate_random_walk: of(WALK),
            quantisation: of(QUANTISATION),
        })
    }

    /// What each part adds to Allan's variance at an averaging time in s, with its power of the frequency.
    pub(super) fn shares(&self, time_s: f64) -> [(i32, f64); PARTS] {
        let sizes =
            [self.quantisation.0, self.angle_random_walk.0, self.bias_instability.0, self.rate_random_walk.0];
        let parts = parts(time_s);
        std::array::from_fn(|part| (EXPONENTS[part], parts[part] * sizes[part] * sizes[part]))
    }

    /// Allan's variance at an averaging time in s.
    pub fn variance(&self, time_s: f64) -> f64 {
        self.shares(time_s).iter().map(|(_, share)| share).sum()
    }
}

/// What the squares of Q, N, B and K add to Allan's variance (IEEE Std 952, annex C).
fn parts(time_s: f64) -> [f64; PARTS] {
    [3.0 / (time_s * time_s), time_s.recip(), FLOOR, time_s / 3.0]
}

fn octaves(deviations: &[Confident]) -> Vec<Octave> {
    let usable = |d: &&Confident| d.freedom.is_finite() && d.freedom > 0.0 && d.averaged.deviation > 0.0;
    let of = |d: &Confident| Octave {
        variance: d.averaged.deviation.powi(2),
        freedom: d.freedom,
        parts: parts(d.averaged.time_s),
    };
    deviations.iter().filter(usable).map(of).collect()
}

/// Minus the logarithm of the likelihood.
fn cost(octaves: &[Octave], sizes: &[f64; PARTS]) -> f64 {
    let one = |octave: &Octave| {
        let ratio = octave.variance / octave.expected(sizes);
        // ln by the ratio to the variance itself, which is far from none of both.
        0.5 * octave.freedom * (ratio - 1.0 - ratio.portable_ln())
    };
    octaves.iter().map(one).sum()
}

/// The likeliest squares of the parts, one of them held where that is wanted. Each step multiplies a square by the root of what its gradient has on
/// one side over what it has on the other: the cost never rises and nothing becomes negative (Févotte, Bertin and Durrieu, Neural Computation
/// 21, 793, 2009).
fn likeliest(octaves: &[Octave], held: Option<(usize, f64)>) -> [f64; PARTS] {
    // All parts begin as if each explained the variances by itself.
    let count = octaves.len() as f64;
    let mut sizes: [f64; PARTS] = std::array::from_fn(|part| {
        octaves.iter().map(|octave| octave.variance / octave.parts[part]).fold(f64::INFINITY, f64::min)
            / count
    });
    if let Some((part, size)) = held {
        sizes[part] = size;
    }
    for _ in 0..STEPS {
        let mut up = [0.0; PARTS];
        let mut down = [0.0; PARTS];
        for octave in octaves {
            let expected = octave.expected(&sizes);
            for (part, share) in octave.parts.iter().enumerate() {
                up[part] += octave.freedom * share * octave.variance / (expected * expected);
                down[part] += octave.freedom * share / expected;
            }
        }
        for part in 0..PARTS {
            if held.is_none_or(|(place, _)| place != part) {
                sizes[part] *= (up[part] / down[part]).sqrt();
            }
        }
    }
    sizes
}

/// The squares of a part that are as likely as χ² of one degree of freedom lets them be, the others being the likeliest beside them.
fn interval(octaves: &[Octave], best: &[f64; PARTS], part: usize) -> [f64; 2] {
    let least = cost(octaves, best);
    let falls = |size: f64| cost(octaves, &likeliest(octaves, Some((part, size)))) - least - FALL;
    // A part that is nowhere seen is looked for from what it may be at most.
    let most =
        octaves.iter().map(|octave| octave.variance / octave.parts[part]).fold(f64::INFINITY, f64::min);
    let middle = best[part].max(1e-12 * most);
    let end = |factor: f64| {
        let (mut near, mut far) = (middle, middle * factor);
        if falls(far) < 0.0 {
            return None;
        }
        for _ in 0..HALVINGS {
            let between = (near * far).sqrt();
            if falls(between) < 0.0 { near = between } else { far = between }
        }
        Some((near * far).sqrt())
    };
    let low = if falls(0.0) < 0.0 { Some(0.0) } else { end(1.0 / FARTHEST) };
    // Upwards from the larger of what is likeliest and a millionth of what there may be.
    let high = end(FARTHEST * (most / middle).max(1.0));
    [low.unwrap_or(0.0), high.unwrap_or(f64::INFINITY)]
}
