//! The rate ramp of a record at rest (IEEE Std 952): a bias that changes evenly.
//!
//! It is the slope of the means of pieces of the record by generalised least squares. White noise and quantisation have the sizes that were fitted to
//! Hadamard's variances, which contain no ramp. Flicker and a random walk decide how well the slope is known: its distribution is the mean of those
//! for their sizes, all as likely before, weighted with the restricted likelihood of the means, which is exact for normal noise and tells a ramp from
//! a random walk as well as the record can.

use super::inputs::PROBABILITY;
use super::noise_model::{FittedOctave, Model, parts};
use super::octave_covariance::{FLICKER, PARTS, QUANTISATION, WALK, phase_covariance};
use super::rest_samples::Piece;
use kalmems_core::Portable;
use statrs::distribution::{ContinuousCDF, Normal};

/// Pieces of a record whose means tell the slope.
pub(super) const RAMP_PIECES: usize = 32;
/// Squares of the sizes of flicker and of a random walk that are tried: by this factor from one to the next, and so many. The largest
/// alone makes differences of four times the variance that they have.
const FINENESS: f64 = 1.259_921_049_894_873;
const SIZES: usize = 40;
const LARGEST: f64 = 4.0;
/// The averaging time in intervals at which the covariances of the phase have the scale of the variances.
const SCALE_AT: f64 = 1024.0;
/// How far from the mean the end of an interval is looked for, in standard deviations, and halvings of that.
const FARTHEST: f64 = 20.0;
const HALVINGS: usize = 40;

/// An even change of the bias in rad/s², or in m/s³.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RateRamp {
    /// The ramp.
    pub value: f64,
    /// The interval that holds it 95 times in 100.
    pub interval: [f64; 2],
}

/// A slope for one size of flicker and of the random walk.
struct Slope {
    value: f64,
    /// The inverse of its variance.
    information: f64,
    /// Minus the logarithm of the restricted likelihood of the sizes.
    cost: f64,
}

impl RateRamp {
    /// From the pieces of one record, whose white noise and quantisation are those of a model.
    pub fn of(model: &Model, pieces: &[Piece], interval_s: f64) -> Option<Self> {
        let steps = PieceSteps::of(model, pieces, interval_s)?;
        let sizes = |part: usize| {
            let most = LARGEST * steps.largest(part);
            (0..SIZES).map(move |k| most * FINENESS.powi(-signed(k)))
        };
        let mut each = Vec::new();
        for flicker in sizes(FLICKER) {
            for walk in sizes(WALK) {
                let mut own = *model;
                (own.sizes[FLICKER], own.sizes[WALK]) = (flicker, walk);
                // As likely before at each size.
                let wider = -0.5 * (flicker.portable_ln() + walk.portable_ln());
                each.extend(steps.slope(&own).map(|slope| Slope { cost: slope.cost + wider, ..slope }));
            }
        }
        let least = each.iter().map(|slope| slope.cost).min_by(f64::total_cmp)?;
        let weights: Vec<f64> = each.iter().map(|slope| (least - slope.cost).portable_exp()).collect();
        let all: f64 = weights.iter().sum();
        let mean = |of: &dyn Fn(&Slope) -> f64| {
            each.iter().zip(&weights).map(|(slope, weight)| weight * of(slope)).sum::<f64>() / all
        };
        let value = mean(&|slope| slope.value);
        let deviation = mean(&|slope| (slope.value - value).powi(2) + slope.information.recip()).sqrt();
        let standard = Normal::standard();
        let end = |probability: f64| {
            let below =
                |ramp: f64| mean(&|slope| standard.cdf((ramp - slope.value) * slope.information.sqrt()));
            let [mut low, mut high] = [-FARTHEST, FARTHEST].map(|times| value + times * deviation);
            for _ in 0..HALVINGS {
                let middle = f64::midpoint(low, high);
                *(if below(middle) < probability { &mut low } else { &mut high }) = middle;
            }
            f64::midpoint(low, high)
        };
        Some(Self { value, interval: [0.5 * (1.0 - PROBABILITY), 0.5 * (1.0 + PROBABILITY)].map(end) })
    }

    /// Whether 0 is not in the interval.
    pub const fn is_seen(&self) -> bool {
        self.interval[0] > 0.0 || self.interval[1] < 0.0
    }

    /// Whether 0 is not in an interval that is half as wide again.
    pub const fn is_certain(&self) -> bool {
        self.value.abs() > 0.75 * (self.interval[1] - self.interval[0])
    }
}

#[allow(clippy::cast_possible_wrap, clippy::cast_possible_truncation)] // a count of sizes
const fn signed(count: usize) -> i32 {
    count as i32
}

/// The differences of the means of neighbouring pieces.
struct PieceSteps {
    means: Vec<f64>,
    times_s: Vec<f64>,
    /// The covariance of the differences by the square of each noise.
    covariances: [Vec<Vec<f64>>; PARTS],
}

impl PieceSteps {
    fn of(model: &Model, pieces: &[Piece], interval_s: f64) -> Option<Self> {
        let whole: Vec<&Piece> = pieces.iter().filter(|piece| piece.is_of_one_stretch()).collect();
        if whole.len() < 3 {
            return None;
        }
        let ends: Vec<[f64; 2]> = whole
            .iter()
            .map(|piece| {
                let [first, last] = piece.time_s.map(|time_s| (time_s / interval_s).round());
                [first, last + 1.0]
            })
            .collect();
        let correlation = model.correlation();
        let covariances = std::array::from_fn(|part| {
            let phase = |lag: f64| match part {
                QUANTISATION => f64::from(u8::from(lag < 0.5)),
                _ => phase_covariance(part, lag, correlation),
            };
            let scale = scale_of_phase(part, phase, model.memory, interval_s);
            covariance_of_steps(&ends, |lag| scale * phase(lag))
        });
        let each = |of: &dyn Fn(usize) -> f64| (1..whole.len()).map(|k| of(k) - of(k - 1)).collect();
        Some(Self {
            means: each(&|k| whole[k].moments.mean),
            times_s: each(&|k| 0.5 * interval_s * (ends[k][0] + ends[k][1])),
            covariances,
        })
    }

    /// The square of a noise that alone makes differences as large as these.
    fn largest(&self, part: usize) -> f64 {
        let squares = self.means.iter().map(|step| step * step).sum::<f64>();
        let by_size = (0..self.means.len()).map(|k| self.covariances[part][k][k]).sum::<f64>();
        squares / by_size
    }

    /// The slope by generalised least squares, and how likely the sizes of this model are.
    fn slope(&self, model: &Model) -> Option<Slope> {
        let of = |i: usize, j: usize| -> f64 {
            self.covariances.iter().zip(model.sizes).map(|(part, size)| size * part[i][j]).sum()
        };
        let (white, logarithm) = whitened(of, [&self.times_s, &self.means])?;
        let along = |a: usize, b: usize| white[a].iter().zip(&white[b]).map(|(x, y)| x * y).sum::<f64>();
        let information = along(0, 0);
        let value = along(0, 1) / information;
        let left = along(1, 1) - value * value * information;
        let cost = 0.5 * (logarithm + information.portable_ln() + left);
        cost.is_finite().then_some(Slope { value, information, cost })
    }
}

/// What a generalised covariance of a phase in intervals is multiplied by to be that of an angle by the square of the noise, over the square of the interval.
fn scale_of_phase(part: usize, phase: impl Fn(f64) -> f64, memory: f64, interval_s: f64) -> f64 {
    let octave = FittedOctave::at(SCALE_AT * interval_s, interval_s);
    let found = octave.difference.variance(|times| phase(times * SCALE_AT)) / (SCALE_AT * SCALE_AT);
    parts(&octave, memory)[part] / found
}

/// The covariance of the differences of neighbouring means, of means from one place to another.
fn covariance_of_steps(ends: &[[f64; 2]], phase: impl Fn(f64) -> f64) -> Vec<Vec<f64>> {
    let of_means = |i: usize, j: usize| {
        let (own, other) = (ends[i], ends[j]);
        let at = |a: usize, b: usize| phase((own[a] - other[b]).abs());
        (at(0, 0) + at(1, 1) - at(0, 1) - at(1, 0)) / ((own[1] - own[0]) * (other[1] - other[0]))
    };
    let means: Vec<Vec<f64>> =
        (0..ends.len()).map(|i| (0..ends.len()).map(|j| of_means(i, j)).collect()).collect();
    let step = |i: usize, j: usize| means[i + 1][j + 1] + means[i][j] - means[i + 1][j] - means[i][j + 1];
    (0..ends.len() - 1).map(|i| (0..ends.len() - 1).map(|j| step(i, j)).collect()).collect()
}

/// L⁻¹·b for each b, and ln det C, of a positive definite matrix C = L·Lᵀ; `None` of another one.
fn whitened<const N: usize>(
    of: impl Fn(usize, usize) -> f64,
    right: [&[f64]; N],
) -> Option<([Vec<f64>; N], f64)> {
    let count = right[0].len();
    let mut lower = vec![vec![0.0; count]; count];
    let mut white = right.map(<[f64]>::to_vec);
    let mut logarithm = 0.0;
    for i in 0..count {
        for j in 0..=i {
            let (own, other) = (&lower[i][..j], &lower[j][..j]);
            let left = of(i, j) - own.iter().zip(other).map(|(a, b)| a * b).sum::<f64>();
            lower[i][j] = if i == j { left.sqrt() } else { left / lower[j][j] };
        }
        if lower[i][i].is_nan() || lower[i][i] <= 0.0 {
            return None;
        }
        logarithm += 2.0 * lower[i][i].portable_ln();
        for values in &mut white {
            let taken: f64 = lower[i][..i].iter().zip(&*values).map(|(l, value)| l * value).sum();
            values[i] = (values[i] - taken) / lower[i][i];
        }
    }
    Some((white, logarithm))
}
