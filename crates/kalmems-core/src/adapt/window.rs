//! R, or the scale of Q, from the innovations themselves.

use crate::linalg::Ldl;
use crate::notation::{lower, sum, vector};
use crate::{Covariance, Innovation, Mat, Scalar};

/// What the innovations of the last samples say of the noise.
///
/// Two estimates are made of the same innovations r with their stated covariances S:
///
/// R̂ = mean(ε·εᵀ + H·P⁺·Hᵀ), ε = y − H·x⁺, the residual after the correction. As ε = R·S⁻¹·r and H·P⁺·Hᵀ =
/// R·S⁻¹·(S − R), nothing but r, S and R is needed. It is positive semi-definite by construction, where
/// mean(r·rᵀ) − H·P⁻·Hᵀ (Mehra, IEEE Trans. Automatic Control 15, 175, 1970) is not. Source: Mohamed &
/// Schwarz, J. Geodesy 73, 193 (1999); in the form with P⁺ also Akhlaghi, Zhou & Huang (IEEE PES General
/// Meeting 2017).
///
/// α̂ = mean(wᵀ·(S − R)·w) / mean(tr(S⁻¹·(S − R))), w = S⁻¹·r: by how much the part of S that is not R is too
/// small. It is positive, and one where the innovations are as large as they should be. The usual Q̂ =
/// K·mean(r·rᵀ)·Kᵀ holds in the steady state alone and has the rank of the measurement, often one; without
/// that assumption it is Q + K·(mean(r·rᵀ) − S)·Kᵀ, which need not be positive. One scale of the given Q is
/// what a window can tell.
///
/// Both are steps of a fixed-point iteration: the filter's own P depends on R and Q. Put the estimate in, go
/// on, and repeat; the step is the slower the less of S is the noise looked for. Both come to rest where
/// mean(r·rᵀ) agrees with S, one condition: **R and the scale of Q cannot be found together from this
/// window.** One of them must be known, or use [`Score`](super::Score), which uses the correlation in time as
/// well. For linear or linearised measurements.
///
/// Samples count with weights 1, λ, λ², … into the past. With λ = 1 all count alike: then start
/// [anew](Self::clear) when an estimate was put in.
///
/// ```
/// use kalmems_core::adapt::InnovationWindow;
/// use kalmems_core::{Covariance, Ekf, Filter, LinearMeasurement, Mat};
/// let seen = LinearMeasurement { matrix: Mat([[1.0]]) };
/// let (mut r, mut window) = (Covariance::from_variances([1.0]), InnovationWindow::new(1.0));
/// let mut filter = Ekf::new([0.0_f64], Covariance::from_variances([1e-6]));
/// for k in 0..10_000 {
///     let y = if k % 2 == 0 { 0.2 } else { -0.2 };
///     window.add(&filter.update(&seen, &[y], &r)?, &r);
///     if window.samples() == 100.0 {
///         r = window.measurement_noise();
///         window.clear();
///     }
/// }
/// assert!((r.get(0, 0) - 0.04).abs() < 1e-4);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct InnovationWindow<T, const M: usize> {
    forgetting: T,
    weight: T,
    squared_weight: T,
    noise: Covariance<T, M>,
    found: T,
    stated: T,
}

impl<T: Scalar, const M: usize> InnovationWindow<T, M> {
    /// Nothing yet. `forgetting` is λ, above 0 and at most 1: 1 − 1/n remembers about 2n samples.
    pub fn new(forgetting: T) -> Self {
        let zero = T::of(0.0);
        Self {
            forgetting,
            weight: zero,
            squared_weight: zero,
            noise: Covariance::zero(),
            found: zero,
            stated: zero,
        }
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        *self = Self::new(self.forgetting);
    }

    /// Counts one innovation, made with the measurement noise `r`. One that was refused is not counted.
    ///
    /// What a gate declined is counted if it is handed over. Left out, R̂ is that of the noise within the
    /// gate, and smaller.
    #[inline(always)]
    pub fn add(&mut self, innovation: &Innovation<T, M>, r: &Covariance<T, M>) {
        let s = &innovation.covariance;
        let ldl = Ldl::of(s);
        let usable = ldl.positive & innovation.nis.is_finite();
        let weighted = ldl.solve(&innovation.residual);
        // R·S⁻¹ and S − R = H·P·Hᵀ.
        let share: Mat<T, M, M> = Mat(vector!(|i| ldl.solve(&vector!(|k| r.get(k, i)))));
        let state = Covariance::<T, M>::lower(|i, j| s.get(i, j) - r.get(i, j));
        let after: [T; M] = vector!(|i| sum!(M, |k| r.get(i, k) * weighted[k]));

        let keep = |old: T, new: T| T::select(usable, old * self.forgetting + new, old);
        self.noise = lower!(|i, j| {
            let term = after[i] * after[j] + sum!(M, |k| share.0[i][k] * state.get(k, j));
            keep(self.noise.get(i, j), term)
        });
        let pushed = sum!(M, |i| sum!(M, |j| weighted[i] * state.get(i, j) * weighted[j]));
        let trace = sum!(M, |j| {
            let column = ldl.solve(&vector!(|i| state.get(i, j)));
            column[j]
        });
        self.found = keep(self.found, pushed);
        self.stated = keep(self.stated, trace);
        self.squared_weight =
            T::select(usable, self.squared_weight * self.forgetting.sq() + T::of(1.0), self.squared_weight);
        self.weight = keep(self.weight, T::of(1.0));
    }

    /// How many samples of equal weight the window is worth.
    pub fn samples(&self) -> T {
        self.weight.sq() / self.squared_weight
    }

    /// R̂. Not a number where nothing was counted.
    pub fn measurement_noise(&self) -> Covariance<T, M> {
        let recip = self.weight.recip();
        lower!(|i, j| self.noise.get(i, j) * recip)
    }

    /// α̂: Q·α̂ is the better process noise. Not a number where nothing was counted.
    pub fn process_noise_scale(&self) -> T {
        self.found / self.stated
    }
}
