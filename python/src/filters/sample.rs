//! What the numbers of a sample say of a state, all together.

use super::factors::{dot, factor, normalised_square, row_of_inverse};
use super::functions::{MOST, Model};
use kalmems::estimate::{RowFilter, Sensor};
use kalmems_core::FilterError;
use std::f64::consts::TAU;

/// Iterations of the weight of heavy-tailed noise at most, and when it has settled.
const ITERATIONS: usize = 200;
const SETTLED: f64 = 1e-9;

/// How the numbers of one sample correct a filter.
#[derive(Clone, Copy, PartialEq)]
pub enum Taking {
    /// Linearised at the predicted mean.
    Extended,
    /// Each again where it leads.
    Iterated,
    /// Along the line that fits its sigma points best, of the spread α, β, κ.
    Unscented([f64; 3]),
}

/// A sample. A number that is not one is missing.
pub struct Sample<'a> {
    pub model: Model<'a>,
    /// Its place, and its inputs.
    pub at: (usize, &'a [f64]),
    /// Its numbers, and the covariance of their noise.
    pub z: &'a [f64],
    pub r: &'a [f64],
    pub taking: Taking,
    /// The largest NIS that is believed.
    pub gate: f64,
    /// The degrees of freedom of Student's t distribution of the noise; infinite of normal noise.
    pub freedom: f64,
}

/// How well a sample was predicted, and whether it has corrected the filter.
pub struct Prediction {
    pub nis: f64,
    pub log_likelihood: f64,
    pub is_taken: bool,
}

/// Σ wᵢ·hᵢ(x) of the functions of a sample.
struct Combined<'a> {
    sample: &'a Sample<'a>,
    weights: &'a [f64],
}

impl Sensor for Combined<'_> {
    fn read(&self, x: &[f64]) -> f64 {
        let mut values = [0.0; MOST.1];
        let values = &mut values[..self.weights.len()];
        self.sample.model.value(self.sample.at, x, values);
        dot(values, self.weights)
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        if let [weight] = self.weights {
            let mut value = [0.0];
            self.sample.model.linearize(self.sample.at, x, &mut value, slopes);
            return weight * value[0];
        }
        let (mut values, mut all) = ([0.0; MOST.1], [0.0; MOST.0 * MOST.1]);
        let (values, all) = (&mut values[..self.weights.len()], &mut all[..self.weights.len() * x.len()]);
        self.sample.model.linearize(self.sample.at, x, values, all);
        for (j, slope) in slopes.iter_mut().enumerate() {
            *slope = self.weights.iter().enumerate().map(|(i, weight)| weight * all[i * x.len() + j]).sum();
        }
        dot(values, self.weights)
    }
}

/// h·(x − x₀).
struct Line<'a> {
    slopes: &'a [f64],
    from: &'a [f64],
}

impl Sensor for Line<'_> {
    fn read(&self, x: &[f64]) -> f64 {
        self.slopes.iter().zip(x).zip(self.from).map(|((slope, x), from)| slope * (x - from)).sum()
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        slopes.copy_from_slice(self.slopes);
        self.read(x)
    }
}

/// Room for what several numbers of a sample are taken by, of n states and m numbers.
pub struct Room {
    /// The predicted mean and its covariance.
    mean: Vec<f64>,
    p: Vec<f64>,
    /// What is expected there, how it depends on the state, and the covariance that neither explains.
    values: Vec<f64>,
    slopes: Vec<f64>,
    unexplained: Vec<f64>,
    /// Which numbers are there; the noise of those, P·Hᵀ, and the covariance of their innovations.
    present: Vec<usize>,
    noise: Vec<f64>,
    along: Vec<f64>,
    s: Vec<f64>,
    lower: Vec<f64>,
    variances: Vec<f64>,
    white: Vec<f64>,
    weights: Vec<f64>,
    combined: Vec<f64>,
    line: Vec<f64>,
    /// A root of P, the values at the points on either side, and those at the mean.
    root: Vec<f64>,
    sides: [Vec<f64>; 2],
    middle: Vec<f64>,
}

impl Room {
    pub fn new(n: usize, m: usize) -> Self {
        let of = |size: usize| vec![0.0; size];
        Self {
            mean: of(n),
            p: of(n * n),
            values: of(m),
            slopes: of(m * n),
            unexplained: of(m * m),
            present: Vec::with_capacity(m),
            noise: of(m * m),
            along: of(m * n),
            s: of(m * m),
            lower: of(m * m),
            variances: of(m.max(n)),
            white: of(m),
            weights: of(m),
            combined: of(m),
            line: of(n),
            root: of(n * n),
            sides: [of(n * m), of(n * m)],
            middle: of(m),
        }
    }

    /// The expected numbers, linearised at the mean.
    fn linearize(&mut self, sample: &Sample) {
        self.unexplained.fill(0.0);
        sample.model.linearize(sample.at, &self.mean, &mut self.values, &mut self.slopes);
    }

    /// With P = L·Lᵀ and points x ± c·Lⱼ the regression of h on x has the slopes H·L = (h₊ − h₋)/2c, and leaves P_hh − H·P·Hᵀ.
    fn regress(&mut self, sample: &Sample, [alpha, beta, kappa]: [f64; 3]) -> Result<(), FilterError> {
        let (n, m) = (self.mean.len(), self.values.len());
        let mut lower = std::mem::take(&mut self.root);
        if !factor(&self.p, n, &mut lower, &mut self.variances) {
            return Err(FilterError::CovarianceNotPositive);
        }
        for (place, entry) in lower.iter_mut().enumerate() {
            *entry *= self.variances[place % n].sqrt();
        }
        self.root = lower;
        let total = alpha * alpha * (n as f64 + kappa);
        let (spread, outer) = (total.sqrt(), 0.5 / total);
        let centre = 1.0 - n as f64 / total;
        sample.model.value(sample.at, &self.mean, &mut self.middle);
        for (side, sign) in self.sides.iter_mut().zip([spread, -spread]) {
            for j in 0..n {
                for i in 0..n {
                    self.line[i] = self.mean[i] + sign * self.root[i * n + j];
                }
                sample.model.value(sample.at, &self.line, &mut side[j * m..(j + 1) * m]);
            }
        }
        let [up, down] = &self.sides;
        for i in 0..m {
            let outside: f64 = (0..n).map(|j| up[j * m + i] + down[j * m + i]).sum();
            self.values[i] = centre * self.middle[i] + outer * outside;
        }
        let along = |i: usize, j: usize| 0.5 * (up[j * m + i] - down[j * m + i]) / spread;
        for i in 0..m {
            for j in (0..n).rev() {
                let later: f64 = (j + 1..n).map(|k| self.slopes[i * n + k] * self.root[k * n + j]).sum();
                let pivot = self.root[j * n + j];
                self.slopes[i * n + j] = if pivot > 0.0 { (along(i, j) - later) / pivot } else { 0.0 };
            }
            for k in 0..m {
                let off = |of: &[f64], j: usize| {
                    (of[j * m + i] - self.values[i]) * (of[j * m + k] - self.values[k])
                };
                let outside: f64 = (0..n).map(|j| off(up, j) + off(down, j)).sum();
                let explained: f64 = (0..n).map(|j| along(i, j) * along(k, j)).sum();
                let weight = centre + 1.0 - alpha * alpha + beta;
                self.unexplained[i * m + k] = weight * off(&self.middle, 0) + outer * outside - explained;
            }
        }
        Ok(())
    }

    /// What the numbers that are there are expected to be: their noise apart from the state's, whose own part is divided by a weight, and S.
    fn expect(&mut self, sample: &Sample, weight: f64) {
        let (n, m, count) = (self.mean.len(), self.values.len(), self.present.len());
        for (i, own) in self.present.iter().enumerate() {
            let row = &self.slopes[own * n..(own + 1) * n];
            for k in 0..n {
                self.along[i * n + k] = dot(&self.p[k * n..(k + 1) * n], row);
            }
        }
        for (i, own) in self.present.iter().enumerate() {
            let row = &self.slopes[own * n..(own + 1) * n];
            for (j, other) in self.present.iter().enumerate() {
                let entry = own * m + other;
                self.noise[i * count + j] = sample.r[entry] / weight + self.unexplained[entry];
                self.s[i * count + j] = dot(row, &self.along[j * n..(j + 1) * n]) + self.noise[i * count + j];
            }
        }
    }
}

impl Sample<'_> {
    /// Corrects a filter, and writes innovations and their covariance.
    pub fn correct(
        &self,
        filter: &mut dyn RowFilter,
        room: &mut Room,
        (innovation, s): (&mut [f64], &mut [f64]),
    ) -> Result<Prediction, FilterError> {
        let missing = Prediction { nis: f64::NAN, log_likelihood: f64::NAN, is_taken: false };
        innovation.fill(f64::NAN);
        s.fill(f64::NAN);
        if self.z.iter().all(|z| z.is_nan()) {
            return Ok(missing);
        }
        if let ([z], true) = (self.z, self.freedom.is_infinite()) {
            let sensor = Combined { sample: self, weights: &[1.0] };
            let found = filter.correct(&sensor, *z, self.r[0], self.gate)?;
            (innovation[0], s[0]) = (found.residual[0], found.covariance.get(0, 0));
            let is_taken = found.nis <= self.gate;
            return Ok(Prediction { nis: found.nis, log_likelihood: found.log_likelihood(), is_taken });
        }
        room.mean.copy_from_slice(filter.mean());
        filter.covariance(&mut room.p);
        room.present.clear();
        room.present.extend((0..self.z.len()).filter(|i| !self.z[*i].is_nan()));
        match self.taking {
            Taking::Unscented(spread) => room.regress(self, spread)?,
            Taking::Extended | Taking::Iterated => room.linearize(self),
        }
        room.expect(self, 1.0);
        let prediction = self.predicted(room, (innovation, s))?;
        if prediction.is_taken {
            self.weigh(room, innovation)?;
            self.take(filter, room, innovation)?;
        }
        Ok(prediction)
    }

    /// How well the numbers were predicted.
    fn predicted(
        &self,
        room: &mut Room,
        (innovation, s): (&mut [f64], &mut [f64]),
    ) -> Result<Prediction, FilterError> {
        let (m, count) = (self.z.len(), room.present.len());
        let Room { present, lower, variances, white, values, s: own_s, .. } = room;
        if !factor(own_s, count, lower, variances) || variances[..count].contains(&0.0) {
            return Err(FilterError::InnovationNotPositive);
        }
        for (i, own) in present.iter().enumerate() {
            innovation[*own] = self.z[*own] - values[*own];
            white[i] = innovation[*own];
            for (j, other) in present.iter().enumerate() {
                s[own * m + other] = own_s[i * count + j];
            }
        }
        let nis = normalised_square(lower, variances, &mut white[..count]);
        let logarithm: f64 = variances[..count].iter().map(|variance| (TAU * variance).ln()).sum();
        Ok(Prediction { nis, log_likelihood: -0.5 * (nis + logarithm), is_taken: nis <= self.gate })
    }

    /// Divides the noise R of heavy tails by the mean λ = (ν + m)/(ν + tr R⁻¹⟨v·vᵀ⟩) that the sample gives it, found in turn with the update
    /// (Agamennoni, Nieto and Nebot, IEEE Trans. Signal Process. 60, 5024, 2012): ⟨v·vᵀ⟩ = R′·S′⁻¹·r·rᵀ·S′⁻¹·R′ + R′ − R′·S′⁻¹·R′, R′ = R/λ.
    fn weigh(&self, room: &mut Room, innovation: &[f64]) -> Result<(), FilterError> {
        if self.freedom.is_infinite() {
            return Ok(());
        }
        let (m, count) = (room.values.len(), room.present.len());
        let mut weight = 1.0;
        for _ in 0..ITERATIONS {
            room.expect(self, weight);
            let Room { present, s, lower, variances, weights, combined, .. } = room;
            if !factor(s, count, lower, variances) || variances[..count].contains(&0.0) {
                return Err(FilterError::InnovationNotPositive);
            }
            // y = S′⁻¹·r and tr S′⁻¹·R by the rows of the factor's inverse.
            combined.fill(0.0);
            let (row, mut trace) = (&mut weights[..count], 0.0);
            let r_between = |i: usize, j: usize| self.r[present[i] * m + present[j]];
            for (k, variance) in variances.iter().enumerate().take(count) {
                row_of_inverse(lower, k, row);
                let along: f64 = present.iter().zip(&*row).map(|(own, w)| innovation[*own] * w).sum();
                for (i, w) in row.iter().enumerate() {
                    combined[i] += w * along / variance;
                    trace += (0..count).map(|j| w * r_between(i, j) * row[j]).sum::<f64>() / variance;
                }
            }
            let square =
                |i: usize| -> f64 { (0..count).map(|j| combined[i] * r_between(i, j) * combined[j]).sum() };
            let squares: f64 = (0..count).map(square).sum();
            let size = (squares - trace) / (weight * weight) + count as f64 / weight;
            let next = (self.freedom + count as f64) / (self.freedom + size);
            let moved = (next - weight).abs();
            weight = next;
            if moved <= SETTLED * weight {
                break;
            }
        }
        room.expect(self, weight);
        Ok(())
    }

    /// One after the other, in combinations whose noises are independent.
    fn take(
        &self,
        filter: &mut dyn RowFilter,
        room: &mut Room,
        innovation: &[f64],
    ) -> Result<(), FilterError> {
        let (n, count) = (room.mean.len(), room.present.len());
        let Room { mean, present, lower, variances, weights, combined, line, noise, slopes, .. } = room;
        if !factor(noise, count, lower, variances) {
            return Err(FilterError::InnovationNotPositive);
        }
        let weights = &mut weights[..count];
        for (k, variance) in variances.iter().enumerate().take(count) {
            row_of_inverse(lower, k, weights);
            let of = |values: &dyn Fn(usize) -> f64| -> f64 {
                present.iter().zip(&*weights).map(|(own, weight)| weight * values(*own)).sum()
            };
            if self.taking == Taking::Iterated {
                combined.fill(0.0);
                for (own, weight) in present.iter().zip(&*weights) {
                    combined[*own] = *weight;
                }
                let sensor = Combined { sample: self, weights: combined };
                filter.correct(&sensor, of(&|own| self.z[own]), *variance, f64::INFINITY)?;
            } else {
                for (j, slope) in line.iter_mut().enumerate() {
                    *slope = of(&|own| slopes[own * n + j]);
                }
                let sensor = Line { slopes: line, from: mean };
                filter.correct(&sensor, of(&|own| innovation[own]), *variance, f64::INFINITY)?;
            }
        }
        Ok(())
    }
}
