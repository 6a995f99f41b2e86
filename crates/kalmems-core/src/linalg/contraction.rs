//! What one measured number does to a factor.

use super::Mat;
use crate::Scalar;

/// The lower triangular T with T·Tᵀ = I − f·fᵀ/(ρ + fᵀ·f), which takes a factor S to S·T.
///
/// It is the chain of rotations that turns [√ρ, fᵀ] into [√(ρ + fᵀ·f), 0] from the last column to the first,
/// written out as Carlson did (AIAA Journal 11, 1259, 1973), for the lower triangle: with α = ρ at first and
/// α′ = α + f_k² after column k, T_kk = √(α/α′) and T_ik = −f_i·f_k/√(α·α′). One square root for each column, none of
/// ρ. Each α is a sum of squares, so that T keeps all its digits however small ρ is against f.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contraction<T, const N: usize> {
    f: [T; N],
    rho: T,
    /// α′ of each column, and its reciprocal.
    after: [T; N],
    recip: [T; N],
    /// ρ + fᵀ·f.
    pub total: T,
    /// Its reciprocal; 1 where it is zero.
    pub recip_total: T,
}

impl<T: Scalar, const N: usize> Contraction<T, N> {
    /// For f, which is zero where `seen` is not set, and ρ ≥ 0.
    #[inline(always)]
    pub fn new(f: [T; N], rho: T, seen: impl Fn(usize) -> bool) -> Self {
        let (mut after, mut recips) = ([rho; N], [rho; N]);
        let (mut total, mut recip_total) = (rho, recip_or_one(rho));
        for k in (0..N).rev() {
            if seen(k) {
                total = total + f[k].sq();
                recip_total = recip_or_one(total);
                (after[k], recips[k]) = (total, recip_total);
            }
        }
        Self { f, rho, after, recip: recips, total, recip_total }
    }

    /// A·T; columns that are not seen stay as they are, and entries (i, j) that `there` excludes are zero.
    #[inline(always)]
    #[must_use]
    pub fn applied<const R: usize>(
        &self,
        mut a: Mat<T, R, N>,
        seen: impl Fn(usize) -> bool,
        there: impl Fn(usize, usize) -> bool,
    ) -> Mat<T, R, N> {
        // Σ a_ij·f_j over the columns that are done, and whether there was one.
        let mut along = [T::of(0.0); R];
        let mut begun = [false; R];
        let (mut before, mut recip_before) = (self.rho, T::of(0.0));
        for k in (0..N).rev() {
            // Never k ≥ N: said, because a build for size does not see it and would keep a bounds check.
            if k >= N || !seen(k) {
                continue;
            }
            let some = self.after[k].gt(T::of(0.0));
            let keep = T::select(some, (before * self.recip[k]).sqrt(), T::of(1.0));
            let give = self.f[k] * keep * recip_before;
            for i in 0..R {
                if !there(i, k) {
                    continue;
                }
                let entry = a.0[i][k];
                if begun[i] {
                    a.0[i][k] = entry * keep - along[i] * give;
                    along[i] = along[i] + entry * self.f[k];
                } else {
                    a.0[i][k] = entry * keep;
                    along[i] = entry * self.f[k];
                    begun[i] = true;
                }
            }
            (before, recip_before) = (self.after[k], self.recip[k]);
        }
        a
    }
}

/// 1/α, and 1 where α is not positive.
#[inline(always)]
fn recip_or_one<T: Scalar>(alpha: T) -> T {
    T::select(alpha.gt(T::of(0.0)), alpha, T::of(1.0)).recip()
}
