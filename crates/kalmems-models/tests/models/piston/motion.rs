//! A mirror that moves as the filter's model has it, and its filters.

use kalmems_core::bound::CramerRao;
use kalmems_core::{Cholesky, Covariance, Ekf, Filter, FixedGain, Measurement, NoiseDensity, Process};
use kalmems_models::capacitance::DistanceSeries;
use kalmems_models::dynamics::DriftingPhasor;
use kalmems_models::readout::{DriftingPhasorCapacitance, PhasorDetector};
use std::f64::consts::{PI, TAU};

/// Normal random numbers: SplitMix (Steele, Lea and Flood, 2014), and Box and Muller.
pub struct Normal(pub u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) as f64 + 0.5) / 2_f64.powi(64)
    }

    pub fn sample(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }

    /// With this covariance.
    pub fn vector(&mut self, covariance: &Covariance<f64, 5>) -> [f64; 5] {
        let root = Cholesky::of_semidefinite(covariance);
        let white: [f64; 5] = std::array::from_fn(|_| self.sample());
        std::array::from_fn(|i| (0..=i).map(|j| root.0[i][j] * white[j]).sum())
    }
}

/// What is simulated and estimated.
#[derive(Clone, Copy)]
pub struct Case {
    /// In aF/√Hz.
    pub noise_af: f64,
    pub rate_hz: f64,
    pub duration_s: f64,
    /// From here on errors count.
    pub from_s: f64,
    /// Relative, per minute.
    pub drift: f64,
    /// Whether frequency, rest position and the amplitude's rate walk as the filter thinks.
    pub walks: bool,
    pub seed: u64,
}

/// Root mean squares over the position's errors, in m, and the bound on them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Errors {
    pub filter: f64,
    pub lock: f64,
    /// The posterior bound along the true motion.
    pub bound: f64,
    /// What the filter claims.
    pub claim: f64,
    /// What the loop claims.
    pub lock_claim: f64,
    /// Between the loop and an extended filter from the same start and covariance.
    pub apart: f64,
    pub last: [f64; 5],
    pub last_bound: Option<Covariance<f64, 5>>,
}

pub const PLATE: DistanceSeries<f64, 2> =
    DistanceSeries { reference_distance: 1e-3, coefficients: [0.0, 109.3e-15] };
/// What a start from 20 ms of the signal knows, about.
pub const START_SD: [f64; 5] = [1e-8, 4e-4, 4e-5, 1e-8, 2.5e-6];

fn square_of_position(gradient_at: &[f64; 5], p: &Covariance<f64, 5>) -> f64 {
    let (s, c) = gradient_at[2].sin_cos();
    let g = [c, 0.0, -gradient_at[0] * s, 1.0, 0.0];
    (0..5).map(|i| (0..5).map(|j| g[i] * p.get(i, j) * g[j]).sum::<f64>()).sum()
}

impl Case {
    /// The noise of a sample in F².
    pub fn variance(&self) -> f64 {
        (self.noise_af * 1e-18).powi(2) * self.rate_hz / 2.0
    }

    /// The filter's process.
    pub fn process(&self) -> DriftingPhasor<f64> {
        let density = NoiseDensity::none().on::<1>(1e-8).on::<3>(1e-19).on::<4>(1e-14);
        DriftingPhasor::new(1.0 / self.rate_hz, &density)
    }

    pub fn run(&self) -> Errors {
        let still = DriftingPhasor::new(1.0 / self.rate_hz, &NoiseDensity::none());
        let process = if self.walks { self.process() } else { still };
        // A filter of a motion that does not walk is told so where there is no drift either.
        let assumed = if self.walks || self.drift != 0.0 { self.process() } else { still };
        let (readout, detector) =
            (DriftingPhasorCapacitance { series: PLATE }, PhasorDetector { series: PLATE });
        let mut normal = Normal(self.seed);
        let r = Covariance::from_variances([self.variance()]);
        let prior = Covariance::from_standard_deviations(START_SD);
        let mut truth = [0.5e-3, 500.0, 0.7, 1e-3, self.drift * 0.5e-3 / 60.0];
        let off = normal.vector(&prior);
        let start = std::array::from_fn(|i| truth[i] + off[i]);
        let mut filter = Ekf::new(start, prior);
        // A gain that does not go to zero needs noise in the model.
        let point = detector.operating_point(&self.process(), &truth, self.variance());
        // It starts as well as it will ever be: a gain that is right at the end takes seconds to forget a start.
        let settled = FixedGain::<f64, 5, 3>::steady_state(start, &point).unwrap();
        let off = normal.vector(settled.filtered_covariance());
        let start = std::array::from_fn(|i| truth[i] + off[i]);
        let mut lock = FixedGain::<f64, 5, 3>::steady_state(start, &point).unwrap();
        let mut twin = Ekf::new(start, *settled.filtered_covariance());
        let mut bound = CramerRao::new(prior);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some millions
        let samples = (self.rate_hz * self.duration_s).round() as u64;
        let mut sums = [0.0; 6];
        let mut counted = 0.0;
        for k in 0..samples {
            if k > 0 {
                let turns = (truth[2] / TAU + truth[1] / self.rate_hz).round();
                let (next, transition) = process.linearize(&truth, &turns);
                let walked = if self.walks { normal.vector(process.noise().covariance()) } else { [0.0; 5] };
                truth = std::array::from_fn(|i| next[i] + walked[i]);
                bound.advance(&transition, assumed.noise().covariance());
                filter.predict(&assumed, &turns).unwrap();
                lock.predict(&assumed, &turns).unwrap();
                twin.predict(&assumed, &turns).unwrap();
            }
            let [clean] = readout.predict(&truth);
            let y = clean + self.variance().sqrt() * normal.sample();
            bound.observe(&readout.linearize(&truth).1, &r).unwrap();
            filter.update(&readout, &[y], &r).unwrap();
            twin.update(&readout, &[y], &r).unwrap();
            lock.update(&detector, &detector.mixed(lock.mean(), y)).unwrap();
            if k as f64 >= self.from_s * self.rate_hz {
                let position = |x: &[f64; 5]| x[3] + x[0] * x[2].cos();
                sums[0] += (position(filter.mean()) - position(&truth)).powi(2);
                sums[1] += (position(lock.mean()) - position(&truth)).powi(2);
                sums[2] += square_of_position(&truth, bound.covariance());
                sums[3] += square_of_position(filter.mean(), &filter.covariance());
                sums[4] += square_of_position(lock.mean(), lock.filtered_covariance());
                sums[5] += (position(lock.mean()) - position(twin.mean())).powi(2);
                counted += 1.0;
            }
        }
        let [filter_rms, lock_rms, bound_rms, claim, lock_claim, apart] =
            sums.map(|sum| (sum / counted).sqrt());
        let mut last: [f64; 5] = std::array::from_fn(|i| filter.mean()[i] - truth[i]);
        last[2] -= TAU * ((last[2] + PI) / TAU).floor();
        Errors {
            filter: filter_rms,
            lock: lock_rms,
            bound: bound_rms,
            claim,
            lock_claim,
            apart,
            last,
            last_bound: Some(*bound.covariance()),
        }
    }
}

/// The root of the mean of squares over seeds.
pub fn pooled(all: &[Errors], of: fn(&Errors) -> f64) -> f64 {
    (all.iter().map(|e| of(e).powi(2)).sum::<f64>() / all.len() as f64).sqrt()
}

/// The smallest and the largest.
pub fn ends(all: &[Errors], of: fn(&Errors) -> f64) -> [f64; 2] {
    let values = || all.iter().map(of);
    [values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max)]
}
