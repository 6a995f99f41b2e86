//! What noises add to Allan's and Hadamard's variances, and the likeliest sizes of them.

use super::octave_covariance::{OctavePair, PARTS, PhaseDifference, QUANTISATION, low_passed};
use super::passed_flicker::passed_flicker;
use kalmems_core::{Lu, Mat, Portable};
use std::f64::consts::{LN_2, PI};

/// The floor of flicker noise in Allan's variance by the square of its bias instability.
pub(super) const FLOOR: f64 = 2.0 * LN_2 / PI;
/// The same in Hadamard's variance, ln(256/27)/(2π).
const HADAMARD_FLOOR: f64 = 0.357_993_671_761_516_7;
/// Steps towards the likeliest parts, and halvings of one.
const STEPS: usize = 60;
const STEP_HALVINGS: usize = 12;
/// The shortest time constant that is looked for, as a part of the shortest averaging time, which is the longest one: noise with a longer
/// memory is none of the four, and the fit begins later.
const SHORTEST_MEMORY: f64 = 1.0 / 16.0;
/// Time constants that are tried by factors of two, and golden sections about the best.
const SECTIONS: usize = 24;

/// A variance with its degrees of freedom, and what each part adds to it.
#[derive(Clone)]
pub(super) struct FittedOctave {
    pub difference: PhaseDifference,
    pub factor: usize,
    pub time_s: f64,
    pub variance: f64,
    pub freedom: f64,
    /// The stretches with differences, as lengths in samples with their number.
    pub stretches: Vec<(usize, usize)>,
}

impl FittedOctave {
    /// Allan's variance at an averaging time, of which only what the parts add to it is known.
    pub fn at(time_s: f64, interval_s: f64) -> Self {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a count of samples
        let factor = (time_s / interval_s).round().max(1.0) as usize;
        Self {
            difference: PhaseDifference::ALLAN,
            factor,
            time_s,
            variance: f64::NAN,
            freedom: f64::NAN,
            stretches: Vec::new(),
        }
    }

    /// Minus the logarithm of the likelihood of the variance, by that of a perfect fit.
    pub fn deviance(&self, expected: f64) -> f64 {
        let ratio = self.variance / expected;
        0.5 * self.freedom * (ratio - 1.0 - ratio.portable_ln())
    }
}

/// Squares of the sizes, and the time constant of the low pass.
#[derive(Clone, Copy)]
pub(super) struct Model {
    pub sizes: [f64; PARTS],
    /// The time constant in intervals.
    pub memory: f64,
}

impl Model {
    pub fn correlation(self) -> f64 {
        correlation(self.memory)
    }

    pub fn expected(&self, octave: &FittedOctave) -> f64 {
        parts(octave, self.memory).iter().zip(&self.sizes).map(|(part, size)| part * size).sum()
    }

    pub fn shares(&self, octave: &FittedOctave) -> [f64; PARTS] {
        let parts = parts(octave, self.memory);
        let all = self.expected(octave);
        std::array::from_fn(|part| parts[part] * self.sizes[part] / all)
    }
}

/// The correlation of neighbouring samples of white noise behind a low pass with this time constant in intervals.
fn correlation(memory: f64) -> f64 {
    if memory > 0.0 { (-memory.recip()).portable_exp() } else { 0.0 }
}

/// What the squares of Q, N, B and K add to Allan's variance (IEEE Std 952, annex C) or to Hadamard's behind a low pass with this time constant in
/// intervals, of which a random walk has little to lose.
pub(super) fn parts(octave: &FittedOctave, memory: f64) -> [f64; PARTS] {
    let FittedOctave { difference, factor, time_s, .. } = *octave;
    let white = low_passed(difference, factor, correlation(memory)) * factor as f64 / time_s;
    let is_allan = difference == PhaseDifference::ALLAN;
    let [quantisation, flicker, walk] =
        if is_allan { [3.0, FLOOR, 3.0] } else { [10.0 / 3.0, HADAMARD_FLOOR, 6.0] };
    let flicker = flicker * passed_flicker(difference, memory / factor as f64);
    [quantisation / (time_s * time_s), white, flicker, time_s / walk]
}

/// Cov(A₁, A₂)/(E A₁·E A₂) of the variances at two averaging times, of which the first is not the longer one.
pub(super) fn covariance(model: &Model, octaves: [&FittedOctave; 2]) -> Option<f64> {
    let [first, second] = octaves.map(|octave| model.shares(octave));
    let pair = OctavePair {
        difference: octaves[0].difference,
        factors: octaves.map(|octave| octave.factor),
        shares: std::array::from_fn(|part| [first[part], second[part]]),
        memory: model.correlation(),
    };
    pair.covariance(octaves.map(|octave| octave.stretches.as_slice()))
}

/// The square of a part that alone explains the smallest of the variances by it.
pub(super) fn largest_possible(octaves: &[FittedOctave], part: usize, memory: f64) -> f64 {
    octaves.iter().map(|o| o.variance / parts(o, memory)[part]).fold(f64::INFINITY, f64::min)
}

pub(super) fn cost(octaves: &[FittedOctave], model: &Model) -> f64 {
    octaves.iter().map(|octave| octave.deviance(model.expected(octave))).sum()
}

pub(super) fn likeliest_of_all(octaves: &[FittedOctave]) -> Model {
    likeliest(octaves, None, None).0
}

/// The likeliest model with or without quantisation, one of its parts held where that is wanted; with its cost. The time constant is
/// looked for about `near`.
pub(super) fn likeliest(
    octaves: &[FittedOctave],
    held: Option<(usize, f64)>,
    near: Option<f64>,
) -> (Model, f64) {
    let with = |memory: f64| {
        let sizes = likeliest_sizes(octaves, held, memory);
        let model = Model { sizes, memory };
        (model, cost(octaves, &model))
    };
    let mut best = with(0.0);
    // Held quantisation leaves no room for a low pass.
    if held.is_some_and(|(part, size)| part == QUANTISATION && size > 0.0) {
        return best;
    }
    let longest = octaves.first().map_or(0.0, |octave| octave.factor as f64);
    let (low, high) = match near {
        Some(near) if near > 0.0 => (0.25 * near, (4.0 * near).min(longest)),
        _ => (SHORTEST_MEMORY * longest, longest),
    };
    let mut middle = None;
    let mut memory = low;
    while memory <= high {
        let found = with(memory);
        if found.1 < best.1 {
            best = found;
            middle = Some(memory);
        }
        memory *= 2.0;
    }
    let Some(middle) = middle else { return best };
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut a, mut b) = ((0.5 * middle).portable_ln(), (2.0 * middle).min(longest).portable_ln());
    let at = |logarithm: f64| with(logarithm.portable_exp());
    let (mut left, mut right) = (at(b - golden * (b - a)), at(a + golden * (b - a)));
    for _ in 0..SECTIONS {
        if left.1 < right.1 {
            b = a + golden * (b - a);
            right = left;
            left = at(b - golden * (b - a));
        } else {
            a = b - golden * (b - a);
            left = right;
            right = at(a + golden * (b - a));
        }
    }
    for found in [left, right] {
        if found.1 < best.1 {
            best = found;
        }
    }
    best
}

/// The likeliest squares of the parts for a time constant, by scoring: each step is a weighted least squares with sizes of at least 0.
fn likeliest_sizes(octaves: &[FittedOctave], held: Option<(usize, f64)>, memory: f64) -> [f64; PARTS] {
    let columns: Vec<[f64; PARTS]> = octaves.iter().map(|octave| parts(octave, memory)).collect();
    // Quantisation and a low pass are not told apart.
    let is_possible = |part: usize| part != QUANTISATION || memory <= 0.0;
    let fixed = held.filter(|(part, _)| is_possible(*part));
    let is_free = |part: usize| held.is_none_or(|(own, _)| own != part) && is_possible(part);
    // All parts begin as if each explained the variances by itself.
    let count = octaves.len() as f64;
    let mut sizes: [f64; PARTS] = std::array::from_fn(|part| match fixed {
        Some((own, size)) if own == part => size,
        _ if is_free(part) => largest_possible(octaves, part, memory) / count,
        _ => 0.0,
    });
    let expected = |place: usize, sizes: &[f64; PARTS]| -> f64 {
        columns[place].iter().zip(sizes).map(|(part, size)| part * size).sum()
    };
    let of = |sizes: &[f64; PARTS]| -> f64 {
        octaves.iter().enumerate().map(|(place, octave)| octave.deviance(expected(place, sizes))).sum()
    };
    let mut least = of(&sizes);
    for _ in 0..STEPS {
        let each = octaves.iter().enumerate();
        let weights: Vec<f64> =
            each.map(|(place, octave)| octave.freedom / expected(place, &sizes).powi(2)).collect();
        let target = bounded_least_squares(octaves, &columns, &weights, fixed, is_free);
        let mut part_of_step = 1.0;
        let mut next = None;
        for _ in 0..STEP_HALVINGS {
            let trial: [f64; PARTS] =
                std::array::from_fn(|part| sizes[part] + part_of_step * (target[part] - sizes[part]));
            let found = of(&trial);
            if found < least {
                next = Some((trial, found));
                break;
            }
            part_of_step *= 0.5;
        }
        let Some((trial, found)) = next else { break };
        let gained = least - found;
        (sizes, least) = (trial, found);
        if gained < 1e-11 * (1.0 + least) {
            break;
        }
    }
    sizes
}

/// Σ w·(A − Σ p·θ)² at its least with no θ below 0: the best of all subsets of the free parts.
fn bounded_least_squares(
    octaves: &[FittedOctave],
    columns: &[[f64; PARTS]],
    weights: &[f64],
    fixed: Option<(usize, f64)>,
    is_free: impl Fn(usize) -> bool,
) -> [f64; PARTS] {
    let start =
        || std::array::from_fn(|part| fixed.filter(|(own, _)| *own == part).map_or(0.0, |(_, size)| size));
    let left: Vec<f64> = octaves
        .iter()
        .zip(columns)
        .map(|(octave, column)| octave.variance - fixed.map_or(0.0, |(part, size)| column[part] * size))
        .collect();
    let scales: [f64; PARTS] = std::array::from_fn(|part| {
        columns.iter().zip(weights).map(|(c, w)| w * c[part] * c[part]).sum::<f64>().sqrt()
    });
    let (mut best, mut least) = (start(), f64::INFINITY);
    for subset in 0_usize..1 << PARTS {
        let chosen = |part: usize| subset >> part & 1 == 1;
        if (0..PARTS).any(|part| chosen(part) && !is_free(part)) {
            continue;
        }
        let mut normal = Mat::<f64, PARTS, PARTS>::identity();
        let mut right = Mat::<f64, PARTS, 1>::zero();
        for a in (0..PARTS).filter(|part| chosen(*part)) {
            for b in (0..PARTS).filter(|part| chosen(*part)) {
                let sum: f64 = columns.iter().zip(weights).map(|(c, w)| w * c[a] * c[b]).sum();
                normal.0[a][b] = sum / (scales[a] * scales[b]);
            }
            let each = columns.iter().zip(weights).zip(&left);
            right.0[a][0] = each.map(|((c, w), left)| w * c[a] * left).sum::<f64>() / scales[a];
        }
        let Some(lu) = Lu::of(&normal) else { continue };
        let solution = lu.solve(&right);
        if (0..PARTS).any(|part| chosen(part) && solution.0[part][0] < 0.0) {
            continue;
        }
        let mut sizes: [f64; PARTS] = start();
        for part in (0..PARTS).filter(|part| chosen(*part)) {
            sizes[part] = solution.0[part][0] / scales[part];
        }
        let each = columns.iter().zip(weights).zip(&left);
        let sum: f64 = each
            .map(|((c, w), left)| {
                let beyond = left
                    - (0..PARTS).filter(|part| chosen(*part)).map(|part| c[part] * sizes[part]).sum::<f64>();
                w * beyond * beyond
            })
            .sum();
        if sum < least {
            (best, least) = (sizes, sum);
        }
    }
    best
}
