//! Quantisation, white noise, flicker and a random walk, fitted to Allan's or Hadamard's variances: sizes with intervals, and whether they fit at all.

use super::noise_model::{
    FittedOctave, Model, cost, covariance, largest_possible, likeliest, likeliest_of_all, parts,
};
use super::octave_covariance::{FLICKER, PARTS, PhaseDifference, QUANTISATION, WALK, WHITE};
use crate::signal::{Confident, OctaveSums};
use kalmems_core::{Lu, Mat, Portable};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Columns of derivatives: the parts, and the time constant of the low pass.
const COLUMNS: usize = PARTS + 1;
/// A fit that leaves more than chance does in all but so many of true ones begins at a longer averaging time.
const SIGNIFICANCE: f64 = 0.05;
/// Where all of them do, one that chance leaves so often is taken.
const RARE: f64 = 1e-3;
/// By what part the Allan variance of sampled flicker may be above that of averaged flicker, at one interval and by the square of the intervals
/// (the integral over its spectrum up to half the sampling rate: 0.189, 0.089, 0.029, 0.0092 at 1, 2, 4 and 8), and how much of a variance's
/// standard deviation that may be.
const SAMPLED_FLICKER: [f64; 2] = [0.2, 0.5];
const TOLERATED: f64 = 0.5;
/// Octaves that a fit has at least.
const FEWEST: usize = COLUMNS + 1;
/// Half of what χ² of one degree of freedom exceeds in 5 of 100 cases: by so much a likelihood of independent variances may fall.
const FALL: f64 = 3.841_458_820_694_124 / 2.0;
/// By how much more at least: neighbouring octaves have a correlation of one half in white noise and in flicker (2.0 in 400 records of white noise,
/// 2.4 in 300 of flicker), and parts that are 0 at the best fit are none at the end of an interval.
const OVERLAP: f64 = 2.2;
/// The same of Hadamard's variances, whose differences extend over half as much time again.
const HADAMARD_OVERLAP: f64 = 1.5 * OVERLAP;
/// By how much more a likelihood may fall where another part of the best fit has vanished: such a fit has used that part to follow the scatter, so
/// that it is two numbers by which it is likelier than the truth (χ² of two degrees of freedom exceeds 5.991 in 5 of 100 cases).
const VANISHED: f64 = 5.991_464_547_107_979 / 3.841_458_820_694_124;
/// Rounds in which the degrees of freedom follow the parts that were found.
const ROUNDS: usize = 3;
/// Halvings of a search for the end of an interval, on a logarithmic scale.
const HALVINGS: usize = 34;
/// How far from the likeliest value the end of an interval is looked for, as a factor of the variance.
const FARTHEST: f64 = 1e4;
/// What the noise of a rate at rest is made of, by its Allan variances.
///
/// The likeliest parts, none below 0, for variances that each have the distribution of χ² with the degrees of freedom of the mixture. All noise
/// may have passed a low pass of first order before it was sampled: at averaging times of many time constants any low pass takes the same from
/// a variance. Quantisation and a low pass change the shortest times in opposite directions and are not told apart beyond; one of them is 0.
/// Intervals are those of the profile of the likelihood, which falls by as much as the covariances of the variances make it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NoiseFit {
    /// The angle random walk N in rad/√s, with the interval that holds it 95 times in 100.
    #[serde(skip)]
    pub angle_random_walk: (f64, [f64; 2]),
    /// The bias instability B of flicker in rad/s, with the same; from 0 on where the record shows none.
    #[serde(skip)]
    pub bias_instability: (f64, [f64; 2]),
    /// The rate random walk K in rad/s/√s, with the same.
    #[serde(skip)]
    pub rate_random_walk: (f64, [f64; 2]),
    /// The quantisation Q of the angle in rad, with the same.
    #[serde(skip)]
    pub quantisation: (f64, [f64; 2]),
    /// The time constant in s of the low pass before the sampling; 0 if the fit has none.
    pub time_constant_s: f64,
    /// The averaging time in s from which the fit holds.
    pub from_s: f64,
    /// How many averaging times before that are not described.
    pub left_out: usize,
    /// How often variances of such noise would leave as much as these.
    pub p: f64,
    #[serde(skip)]
    interval_s: f64,
    /// The degrees of freedom of the fitted variance at the length of the record: 2·σ⁴/var σ² (JCGM 100, G.4.2).
    #[serde(skip)]
    pub(super) freedom_of_whole: f64,
}

/// Why no noise is stated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoFit {
    /// A record that is too short.
    #[error("the record has {octaves} averaging times with a deviation; a fit of the noise takes {FEWEST}")]
    TooShort {
        /// Octaves.
        octaves: usize,
    },
    /// No mixture describes it.
    #[error(
        "quantisation, low-passed white noise, flicker and a random walk together do not describe the deviations from any averaging time on (such \
         noise would leave as much in {p:.1e} of records at best): no angle random walk, bias instability or rate random walk is stated. \
         A line of the spectrum, a motion, or a drift with temperature is a likely reason"
    )]
    None {
        /// The largest of the tests.
        p: f64,
    },
}

impl NoiseFit {
    /// Allan's variance at an averaging time of so many intervals.
    fn variance(&self, time_s: f64) -> f64 {
        self.model().expected(&FittedOctave::at(time_s, self.interval_s))
    }

    /// Allan's deviation at an averaging time in s.
    pub fn deviation(&self, time_s: f64) -> f64 {
        self.variance(time_s).sqrt()
    }

    /// The degrees of freedom of the deviation at an averaging time in s over stretches of so many samples, each so often.
    pub(super) fn freedom(&self, time_s: f64, stretches: Vec<(usize, usize)>) -> Option<f64> {
        covariance(
            &self.model(),
            [&FittedOctave { stretches, ..FittedOctave::at(time_s, self.interval_s) }; 2],
        )
        .map(|c| 2.0 / c)
    }

    /// The power of the frequency in the density of the largest noise at an averaging time in s.
    pub(super) fn exponent(&self, time_s: f64) -> i32 {
        let shares = self.model().shares(&FittedOctave::at(time_s, self.interval_s));
        let largest = (0..PARTS).max_by(|a, b| shares[*a].total_cmp(&shares[*b]));
        [2, 0, -1, -2][largest.unwrap_or(WHITE)]
    }

    fn model(&self) -> Model {
        let sizes = [self.quantisation, self.angle_random_walk, self.bias_instability, self.rate_random_walk];
        Model { sizes: sizes.map(|(size, _)| size * size), memory: self.time_constant_s / self.interval_s }
    }
}

/// The likeliest model of some octaves, and how their variances scatter about it.
pub(super) struct OctaveFit {
    octaves: Vec<FittedOctave>,
    pub model: Model,
    cost: f64,
    /// How often variances of such noise would leave as much, and how many averaging times before are not described.
    p: f64,
    left_out: usize,
    /// Cov(A_i, A_j)/(E A_i·E A_j).
    covariance: Vec<Vec<f64>>,
    /// The square of a random walk below which an interval begins all the same, as what looks like one may be a ramp.
    walk_from: f64,
}

impl OctaveFit {
    /// The fit to the deviations of these sums, from the first averaging time on from which it holds.
    pub fn of(
        difference: PhaseDifference,
        deviations: &[Confident],
        sums: &OctaveSums,
    ) -> Result<Self, NoFit> {
        let usable = |d: &&Confident| d.freedom.is_finite() && d.freedom > 0.0 && d.averaged.deviation > 0.0;
        let octave = |d: &Confident| FittedOctave {
            difference,
            factor: d.averaged.factor,
            time_s: d.averaged.time_s,
            variance: d.averaged.deviation.powi(2),
            freedom: d.freedom,
            stretches: sums.stretches(d.averaged.factor),
        };
        let octaves: Vec<FittedOctave> = deviations.iter().filter(usable).map(octave).collect();
        if octaves.len() < FEWEST {
            return Err(NoFit::TooShort { octaves: octaves.len() });
        }
        let mut best: Option<Self> = None;
        for left_out in 0..=octaves.len() - FEWEST {
            let Some(mut found) = Self::of_octaves(octaves[left_out..].to_vec()) else { continue };
            (found.p, found.left_out) = (found.probability(), left_out);
            if best.as_ref().is_none_or(|best| found.p > best.p) && !found.begins_within_flicker() {
                best = Some(found);
            }
            if best.as_ref().is_some_and(|best| best.p >= SIGNIFICANCE) {
                break;
            }
        }
        let p = best.as_ref().map_or(0.0, |best| best.p);
        best.filter(|best| best.p >= RARE).ok_or(NoFit::None { p })
    }

    fn of_octaves(mut octaves: Vec<FittedOctave>) -> Option<Self> {
        let mut model = likeliest_of_all(&octaves);
        for _ in 0..ROUNDS {
            for octave in &mut octaves {
                octave.freedom = 2.0 / covariance(&model, [octave; 2])?;
            }
            model = likeliest_of_all(&octaves);
        }
        let rows = octaves.iter().enumerate().map(|(i, first)| {
            let entries = octaves.iter().enumerate().map(|(j, second)| {
                let ordered = if i <= j { [first, second] } else { [second, first] };
                covariance(&model, ordered)
            });
            entries.collect::<Option<Vec<f64>>>()
        });
        let matrix = rows.collect::<Option<_>>()?;
        let cost = cost(&octaves, &model);
        Some(Self { octaves, model, cost, p: 0.0, left_out: 0, covariance: matrix, walk_from: f64::INFINITY })
    }

    /// The same, of a record that may have a ramp: the interval of its random walk begins no later than that by differences without one.
    #[must_use]
    pub fn with_possible_ramp(self, without: &Self) -> Self {
        Self { walk_from: without.interval(WALK)[0], ..self }
    }

    /// The derivatives of ln E A by the squares of the parts, each times a scale of its own, and by the logarithm of the time constant.
    fn gradient(&self, octave: &FittedOctave) -> [f64; COLUMNS] {
        let parts = parts(octave, self.model.memory);
        let expected = self.model.expected(octave);
        let mut gradient = [0.0; COLUMNS];
        for (part, value) in parts.iter().enumerate() {
            gradient[part] = value * self.scale(part) / expected;
        }
        if self.model.memory > 0.0 {
            let more = Model { memory: 1.001 * self.model.memory, ..self.model };
            gradient[PARTS] = (more.expected(octave) / expected).portable_ln() / 1.001_f64.portable_ln();
        }
        gradient
    }

    /// A size of a part at which it is seen: its own, or the largest that it could be.
    fn scale(&self, part: usize) -> f64 {
        let most = || largest_possible(&self.octaves, part, self.model.memory);
        if self.model.sizes[part] > 0.0 { self.model.sizes[part] } else { most() }
    }

    /// Whether the first variance has so much flicker that it matters how the samples were made of it.
    fn begins_within_flicker(&self) -> bool {
        self.octaves.first().is_some_and(|octave| {
            let [most, by_square] = SAMPLED_FLICKER;
            let off = most.min(by_square / (octave.factor as f64).powi(2));
            self.model.shares(octave)[FLICKER] * off * (0.5 * octave.freedom).sqrt() > TOLERATED
        })
    }

    fn is_free(&self, column: usize) -> bool {
        if column == PARTS { self.model.memory > 0.0 } else { self.model.sizes[column] > 0.0 }
    }

    /// H⁻¹ of the cost over these columns and the covariance H⁻¹·J·H⁻¹ of the estimates, which the variances' own covariances make.
    fn sandwich(&self, free: [bool; COLUMNS]) -> Option<[Mat<f64, COLUMNS, COLUMNS>; 2]> {
        let gradients: Vec<[f64; COLUMNS]> =
            self.octaves.iter().map(|octave| self.gradient(octave)).collect();
        let mut hessian = Mat::<f64, COLUMNS, COLUMNS>::zero();
        let mut spread = Mat::<f64, COLUMNS, COLUMNS>::zero();
        for (i, first) in gradients.iter().enumerate() {
            for (j, second) in gradients.iter().enumerate() {
                let weight = 0.25 * self.octaves[i].freedom * self.octaves[j].freedom * self.covariance[i][j];
                for a in (0..COLUMNS).filter(|a| free[*a]) {
                    for b in (0..COLUMNS).filter(|b| free[*b]) {
                        spread.0[a][b] += weight * first[a] * second[b];
                        if i == j {
                            hessian.0[a][b] += 0.5 * self.octaves[i].freedom * first[a] * first[b];
                        }
                    }
                }
            }
        }
        for a in (0..COLUMNS).filter(|a| !free[*a]) {
            hessian.0[a][a] = 1.0;
        }
        let inverse = Lu::of(&hessian)?.inverse();
        Some([inverse, inverse.times(&spread).times(&inverse)])
    }

    /// How often variances of such noise leave more than these: the sum of their deviances has the mean and the variance of the residuals of a
    /// linear fit to numbers with their covariances, and about the distribution of a multiple of χ².
    fn probability(&self) -> f64 {
        let free: [bool; COLUMNS] = std::array::from_fn(|column| self.is_free(column));
        let Some([inverse, _]) = self.sandwich(free) else { return 0.0 };
        let count = self.octaves.len();
        let gradients: Vec<[f64; COLUMNS]> =
            self.octaves.iter().map(|octave| self.gradient(octave)).collect();
        // I − P, with P = G·(Gᵀ·W·G)⁻¹·Gᵀ·W.
        let residual = |i: usize, j: usize| {
            let mut projected = 0.0;
            for a in (0..COLUMNS).filter(|a| free[*a]) {
                for b in (0..COLUMNS).filter(|b| free[*b]) {
                    projected += gradients[i][a] * inverse.0[a][b] * gradients[j][b];
                }
            }
            f64::from(u8::from(i == j)) - projected * 0.5 * self.octaves[j].freedom
        };
        let square = |of: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
            (0..count).map(|i| (0..count).map(|j| of(i, j)).collect()).collect()
        };
        let taken = square(&residual);
        let half = square(&|i, j| (0..count).map(|k| taken[i][k] * self.covariance[k][j]).sum());
        // W·(I − P)·C·(I − P)ᵀ.
        let weighted = square(&|i, j| {
            0.5 * self.octaves[i].freedom * (0..count).map(|k| half[i][k] * taken[j][k]).sum::<f64>()
        });
        let mean: f64 = (0..count).map(|i| weighted[i][i]).sum();
        let variance: f64 = 2.0
            * (0..count)
                .map(|i| (0..count).map(|j| weighted[i][j] * weighted[j][i]).sum::<f64>())
                .sum::<f64>();
        // The deviance of χ² of few degrees of freedom is larger than a square by this.
        let deviance: f64 = self
            .octaves
            .iter()
            .map(|octave| {
                2.0 * octave.deviance(self.model.expected(octave)) / (1.0 + (3.0 * octave.freedom).recip())
            })
            .sum();
        let scale = 0.5 * variance / mean;
        ChiSquared::new(mean / scale).map_or(0.0, |law| 1.0 - law.cdf(deviance / scale))
    }

    /// The sizes with their intervals, of a record of so many s.
    pub fn result(&self, interval_s: f64, duration_s: f64) -> NoiseFit {
        let of = |part: usize| (self.model.sizes[part].sqrt(), self.interval(part).map(f64::sqrt));
        NoiseFit {
            angle_random_walk: of(WHITE),
            bias_instability: of(FLICKER),
            rate_random_walk: of(WALK),
            quantisation: of(QUANTISATION),
            time_constant_s: self.model.memory * interval_s,
            from_s: self.octaves.first().map_or(f64::NAN, |octave| octave.time_s),
            left_out: self.left_out,
            p: self.p,
            interval_s,
            freedom_of_whole: self.freedom(interval_s, duration_s),
        }
    }

    /// The degrees of freedom of the fitted Allan variance at the length of a record, by the covariance of the parts that are not 0; no fewer than
    /// the variance at an eighth of it has of itself, of which a part that is hardly seen would leave next to none.
    fn freedom(&self, interval_s: f64, duration_s: f64) -> f64 {
        let mut within = self.octaves.iter().filter(|octave| octave.time_s <= duration_s / 8.0);
        let own = within.next_back().or(self.octaves.first()).map_or(1.0, |octave| octave.freedom);
        let Some([_, covariance]) = self.sandwich(std::array::from_fn(|column| self.is_free(column))) else {
            return own;
        };
        let slopes = self.gradient(&FittedOctave::at(duration_s, interval_s));
        let places = (0..COLUMNS).flat_map(|a| (0..COLUMNS).map(move |b| (a, b)));
        let free = places.filter(|(a, b)| self.is_free(*a) && self.is_free(*b));
        own.max(2.0 / free.map(|(a, b)| slopes[a] * covariance.0[a][b] * slopes[b]).sum::<f64>())
    }

    /// By how much more than that of independent variances the likelihood may fall along a part.
    fn inflation(&self, part: usize) -> f64 {
        // The others are free along the profile where they are 0 at its end.
        let seen: [bool; COLUMNS] = std::array::from_fn(|column| column == part || self.is_free(column));
        let all = std::array::from_fn(|column| {
            column == part || (column != QUANTISATION && column != PARTS) || seen[column]
        });
        let of = |free: [bool; COLUMNS]| {
            let found = self.sandwich(free);
            found.map_or(f64::INFINITY, |[inverse, covariance]| {
                covariance.0[part][part] / inverse.0[part][part]
            })
        };
        let is_allan = self.octaves.first().is_some_and(|octave| octave.difference == PhaseDifference::ALLAN);
        let least = match part {
            // It is seen at the shortest times alone, whose variances have known covariances.
            QUANTISATION => 1.0,
            _ if is_allan => OVERLAP,
            _ => HADAMARD_OVERLAP,
        };
        of(seen).max(of(all)).max(least)
    }

    /// The likeliest model with this square of a part, and its cost above the least one.
    fn profile(&self, part: usize, size: f64) -> (Model, f64) {
        let (model, cost) = likeliest(&self.octaves, Some((part, size)), Some(self.model.memory));
        (model, cost - self.cost)
    }

    /// The squares of a part that are likely enough, the others being the likeliest beside them.
    fn interval(&self, part: usize) -> [f64; 2] {
        let best = self.model.sizes[part];
        let fall = FALL * self.inflation(part);
        // A part that is nowhere seen is looked for from what it may be at most.
        let middle = best.max(1e-12 * largest_possible(&self.octaves, part, self.model.memory));
        let end = |factor: f64, fall: f64| {
            let falls = |size: f64| self.profile(part, size).1 - fall;
            let (mut near, mut far) = (middle, middle * factor);
            if falls(far) < 0.0 {
                return None;
            }
            for _ in 0..HALVINGS {
                let size = (near * far).sqrt();
                let place = if falls(size) < 0.0 { &mut near } else { &mut far };
                *place = size;
            }
            Some((near * far).sqrt())
        };
        let low = if best > 0.0 { end(FARTHEST.recip(), fall).unwrap_or(0.0) } else { 0.0 };
        let low = if part == WALK { low.min(self.walk_from) } else { low };
        let farthest = if best > 0.0 { FARTHEST } else { 1e16 };
        let high = end(farthest, fall);
        let is_alone = high.is_some_and(|size| self.has_vanished_in(&self.profile(part, size).0, part));
        let high = if is_alone { end(farthest, VANISHED * fall) } else { high };
        // The likeliest size is in its interval, however flat the likelihood is there.
        [low.min(best), high.unwrap_or(f64::INFINITY).max(best)]
    }

    /// Whether a part of the best fit other than this one is 0 in another model.
    fn has_vanished_in(&self, model: &Model, part: usize) -> bool {
        (0..PARTS).any(|other| other != part && self.model.sizes[other] > 0.0 && model.sizes[other] <= 0.0)
    }
}
