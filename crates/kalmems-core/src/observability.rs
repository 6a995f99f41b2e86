//! What a sensor can tell of the state along a trajectory.

use crate::linalg::{Ldl, Svd};
use crate::notation::vector;
use crate::{Covariance, Mat, Scalar};
use core::array;

/// The observability matrix along a trajectory, in square-root form.
///
/// The rows R^{-1/2}·H_k·Φ(k, 0)·D of all measurements, D being the states' scales, are rotated as they come
/// into one upper triangular N×N factor 𝒪 with the same 𝒪ᵀ·𝒪: the information that the measurements hold of
/// the state at the start, process noise aside, in units of the scales. No product HᵀR⁻¹H is formed, so that
/// weak directions are seen down to the rounding of 𝒪 and not of its square.
///
/// The rows are linearised along the trajectory: `transition` of a [`StateTransition`](crate::StateTransition), and
/// [`linearize`](crate::Measurement::linearize) of the measurement. The state looked for is the one at the
/// start; where everything decays, what comes late tells nothing of it.
///
/// Source: the observability Gramian of linear time-varying systems (Kalman 1960) as an information matrix;
/// square-root form after Bierman (1977).
///
/// ```
/// use kalmems_core::{Covariance, Mat, Observability};
/// // Two masses that move freely, seen through their distance alone.
/// let step = Mat([[1.0, 0.1, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.1], [0.0, 0.0, 0.0, 1.0]]);
/// let distance = Mat([[1.0, 0.0, -1.0, 0.0]]);
/// let mut seen = Observability::new([1.0; 4]);
/// for _ in 0..100 {
///     seen.observe(&distance, &Covariance::from_variances([1e-4_f64]));
///     seen.advance(&step);
/// }
/// assert_eq!(seen.rank(1e-9), 2);
/// // In the directions that are not seen both masses move alike: x₁ = x₂ and v₁ = v₂.
/// for unseen in &seen.directions()[2..] {
///     let [x1, v1, x2, v2] = unseen.components;
///     assert!((x1 - x2).abs() < 1e-9 && (v1 - v2).abs() < 1e-9);
/// }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Observability<T, const N: usize> {
    factor: Mat<T, N, N>,
    transition: Mat<T, N, N>,
    scales: [T; N],
}

impl<T: Scalar, const N: usize> Observability<T, N> {
    /// Starts a trajectory. `scales` are the natural sizes of the states, in their units; ranks and
    /// directions depend on them.
    pub fn new(scales: [T; N]) -> Self {
        Self { factor: Mat::zero(), transition: Mat::identity(), scales }
    }

    /// One step of the trajectory, with its Jacobian F: Φ(k+1, 0) = F·Φ(k, 0).
    #[inline(always)]
    pub fn advance(&mut self, f: &Mat<T, N, N>) {
        self.transition = f.times(&self.transition);
    }

    /// One measurement with Jacobian H and noise covariance `r`, which must be positive definite: otherwise
    /// nothing that follows is a number.
    #[inline(always)]
    pub fn observe<const M: usize>(&mut self, h: &Mat<T, M, N>, r: &Covariance<T, M>) {
        let noise = Ldl::of(r);
        let rows = h.times(&self.transition);
        let columns: [[T; M]; N] =
            vector!(|j| noise.decorrelate(&vector!(|m| rows.0[m][j] * self.scales[j])));
        for m in 0..M {
            let weight = noise.diagonal[m].sqrt().recip();
            self.insert(vector!(|j| columns[j][m] * weight));
        }
    }

    /// Rotates one row into the factor (Givens).
    #[inline(always)]
    fn insert(&mut self, mut row: [T; N]) {
        let zero = T::of(0.0);
        for j in 0..N {
            let (a, b) = (self.factor.0[j][j], row[j]);
            let length = (a.sq() + b.sq()).sqrt();
            // Two zeros need no rotation.
            let turned = length.gt(zero);
            let recip = T::select(turned, length, T::of(1.0)).recip();
            let (c, s) = (T::select(turned, a * recip, T::of(1.0)), b * recip);
            for k in j..N {
                let (x, y) = (self.factor.0[j][k], row[k]);
                self.factor.0[j][k] = c * x + s * y;
                row[k] = c * y - s * x;
            }
        }
    }

    /// 𝒪, upper triangular.
    pub const fn factor(&self) -> &Mat<T, N, N> {
        &self.factor
    }
}

impl<T: Scalar, const N: usize> Observability<T, N> {
    /// How many directions are seen: singular values above `tolerance` times the largest.
    ///
    /// Below N·ε, about 1e-15 in `f64`, is rounding alone. Models that come from an integrator or a sum of
    /// rounded coefficients deserve a tolerance of their own accuracy.
    pub fn rank(&self, tolerance: T) -> usize {
        Svd::of(&self.factor).rank(tolerance)
    }

    /// The directions of the state at the start, from the one seen best to the one seen worst.
    pub fn directions(&self) -> [StateDirection<T, N>; N] {
        let svd = Svd::of(&self.factor);
        array::from_fn(|j| StateDirection {
            singular_value: svd.values[j],
            components: vector!(|i| svd.right.0[i][j]),
        })
    }
}

/// One direction of the state and how well it is seen.
#[derive(Clone, Copy, Debug)]
pub struct StateDirection<T, const N: usize> {
    /// The singular value of 𝒪. Its reciprocal is the standard deviation, in units of the scales, that the
    /// measurements alone leave along this direction: above one, they say less than the scales do.
    pub singular_value: T,
    /// The share of each state, in units of its scale; their squares add up to one. Times the scales it is
    /// the change of the state that moves the measurements by `singular_value` standard deviations.
    pub components: [T; N],
}

impl<T: Scalar, const N: usize> StateDirection<T, N> {
    /// The state with the largest share: what to name the direction by.
    pub fn leading_state(&self) -> usize {
        let mut leading = (0, T::of(0.0));
        for (i, share) in self.components.iter().enumerate() {
            if share.abs().gt(leading.1) {
                leading = (i, share.abs());
            }
        }
        leading.0
    }
}
