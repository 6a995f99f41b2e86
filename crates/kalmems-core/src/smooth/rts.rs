//! The backward step of Rauch, Tung and Striebel, in square-root form.

use crate::linalg::{Semidefinite, epsilon, reduced, times_inverse, triangularize};
use crate::notation::{lower, matrix, sum, vector};
use crate::{Covariance, FilterError, Gaussian, Mat, Scalar, StateTransition};

/// A Gaussian over a state, given measurements before and after it. The covariance is held as a factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothed<T: Scalar, const N: usize> {
    /// Its mean.
    pub mean: [T; N],
    /// The lower triangular L of its covariance L·Lᵀ.
    pub root: Mat<T, N, N>,
}

impl<T: Scalar, const N: usize> Smoothed<T, N> {
    /// The newest state, which the filter has smoothed already: nothing later is known. It counts as no better known than the arithmetic of its
    /// mean, as in [`Backward`].
    ///
    /// A covariance that is singular to rounding is factored as singular. Refused with
    /// [`FilterError::CovarianceNotPositive`] where it has a negative variance in some direction.
    #[inline(never)]
    pub fn newest(filtered: &Gaussian<T, N>) -> Result<Self, FilterError> {
        let factors = known(filtered);
        if !factors.sound {
            return Err(FilterError::CovarianceNotPositive);
        }
        Ok(Self { mean: filtered.mean, root: factors.root })
    }

    /// L·Lᵀ.
    #[inline(always)]
    pub fn covariance(&self) -> Covariance<T, N> {
        Covariance::from_lower(self.root.times_transposed(&self.root))
    }

    /// Mean and covariance.
    #[inline(always)]
    pub fn gaussian(&self) -> Gaussian<T, N> {
        Gaussian { mean: self.mean, covariance: self.covariance() }
    }
}

/// As much of variances as rounding leaves of a combination of N states that is known exactly.
#[inline(always)]
fn rounded<T: Scalar, const N: usize>(variances: &[T; N]) -> [T; N] {
    let factored = epsilon::<T>() * T::of(2.0 * N as f64);
    vector!(|i| variances[i] * factored)
}

/// The factor of a covariance with what the arithmetic adds to it: the rounding of its variances, and that of these means.
#[inline(always)]
fn floored<T: Scalar, const N: usize>(
    covariance: &Covariance<T, N>,
    rounding: &[T; N],
    means: &[T; N],
) -> Semidefinite<T, N> {
    // Rounding that is accumulated over as many steps as a decay may take: 8192 units in the last place of f64, 54 of f32.
    let accumulated = epsilon::<T>().sqrt() * epsilon::<T>().sqrt().sqrt();
    Semidefinite::of(&lower!(|i, j| {
        let known = covariance.get(i, j);
        if i == j { known + rounding[i] + (means[i] * accumulated).sq() } else { known }
    }))
}

/// The factor of what is known of a state, no better than its own arithmetic.
#[inline(always)]
fn known<T: Scalar, const N: usize>(state: &Gaussian<T, N>) -> Semidefinite<T, N> {
    floored(&state.covariance, &rounded(&vector!(|i| state.covariance.get(i, i))), &state.mean)
}

/// How an earlier state depends on a later one, given all measurements up to the earlier: one step of a
/// smoother, or several taken together.
///
/// x = m + G·(x⁺ − p) + e with e ~ N(0, Z·Zᵀ). For one step with x⁺ ≈ F·x + c + w, w ~ N(0, Ω), from the
/// filtered x ~ N(m, P) to the predicted x⁺ ~ N(p, P⁺):
///
/// - G = P·Fᵀ·(P⁺)⁻¹ with P⁺ = F·P·Fᵀ + Ω,
/// - Z·Zᵀ = P − G·P⁺·Gᵀ = (I − G·F)·P·(I − G·F)ᵀ + G·Ω·Gᵀ.
///
/// Given the smoothed x⁺ ~ N(s⁺, P_s⁺), the smoothed x has the mean m + G·(s⁺ − p) and the covariance
/// Z·Zᵀ + G·P_s⁺·Gᵀ (Rauch, Tung and Striebel, AIAA Journal 3, 1445, 1965; the published P + G·(P_s⁺ − P⁺)·Gᵀ
/// is the same, but a difference). No covariance is formed. With P = L·Lᵀ and Ω = W·Wᵀ one triangularisation
/// gives all:
///
/// ```text
/// [ F·L  W ]  ─▶  [ X  0 ]    P⁺ = X·Xᵀ,  G = Y·X⁻¹
/// [  L   0 ]      [ Y  Z ]
/// ```
///
/// For the unscented filter, whose F is the regression of x⁺ on x over the sigma points, P·Fᵀ is the sigma
/// points' cross-covariance, and this is the smoother of Särkkä (IEEE Trans. Automatic Control 53, 845,
/// 2008).
///
/// Where a decaying state has no process noise, G = F⁻¹, and what rounding has left of s⁺ − p would grow backwards with e^{t/τ}. So P and Ω
/// count as no smaller than the arithmetic of the means and of the covariance: a standard deviation of ε^¾ of the mean is added to each
/// state, and a variance of 2·N·ε of its own to P and of (Σ|F|·σ)², whose parts may cancel in P⁺, to Ω. As soon as P falls below that in
/// some direction, later samples tell no more of the earlier state there. The rounding of P⁺ is no noise that later samples have taken away:
/// it is added to P_s⁺ too, without which a smoothed standard deviation would be smaller by up to 30 %. A filter that has determined some
/// combination of its states to the last digit is factored by it too.
///
/// P, Ω and P⁺ may be singular, where no noise enters, a state is known exactly or a transition forgets one.
/// G is then any solution of G·X = Y; which one does not matter, because s⁺ − p has no part outside the range
/// of X.
///
/// ```
/// use kalmems_core::smooth::{Backward, Smoothed};
/// use kalmems_core::{Covariance, Ekf, Filter, Gaussian, LinearMeasurement, LinearProcess, Mat};
/// // A level that walks at random, seen twice.
/// let walk = LinearProcess::<f64, 1, 0> {
///     transition: Mat::identity(),
///     input: Mat::zero(),
///     noise: Covariance::from_variances([1.0]).into(),
/// };
/// let level = LinearMeasurement { matrix: Mat([[1.0]]) };
/// let r = Covariance::from_variances([1.0]);
/// let mut filter = Ekf::new([0.0], Covariance::from_variances([1.0]));
/// filter.update(&level, &[2.0], &r)?; // mean 1, variance 1/2
/// let before = Gaussian { mean: *filter.mean(), covariance: filter.covariance() };
/// let link = filter.predict_linked(&walk, &[])?; // variance 3/2
/// let back = Backward::new(&before, &link, filter.mean())?;
/// filter.update(&level, &[6.0], &r)?; // gain 3/5: mean 4, variance 3/5
/// let now = Gaussian { mean: *filter.mean(), covariance: filter.covariance() };
/// let smoothed = back.apply(&Smoothed::newest(&now)?);
/// assert!((smoothed.mean[0] - 2.0).abs() < 1e-15); // 1 + 1/3·(4 − 1)
/// assert!((smoothed.covariance().get(0, 0) - 0.4).abs() < 1e-15);
/// # Ok::<(), kalmems_core::FilterError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Backward<T: Scalar, const N: usize> {
    /// m.
    mean: [T; N],
    /// G.
    gain: Mat<T, N, N>,
    /// p.
    predicted: [T; N],
    /// Z.
    root: Mat<T, N, N>,
}

impl<T: Scalar, const N: usize> Backward<T, N> {
    /// The earlier state is the later one: what a step that was not taken leaves.
    #[inline(always)]
    pub fn identity() -> Self {
        Self { mean: [T::of(0.0); N], gain: Mat::identity(), predicted: [T::of(0.0); N], root: Mat::zero() }
    }

    /// One step of a filter, from its state before the prediction, the link, and the predicted mean.
    ///
    /// A variance of P or Ω that is zero to rounding counts as zero: one that the states before it explain but for N·ε/2 of it. Refused with
    /// [`FilterError::CovarianceNotPositive`] where P or Ω has a negative variance in some
    /// direction (sigma points with a negative weight in the centre can leave such an Ω), and with
    /// [`FilterError::NonFiniteState`] where the step is not finite.
    #[inline(never)]
    pub fn new(
        before: &Gaussian<T, N>,
        link: &StateTransition<T, N>,
        predicted: &[T; N],
    ) -> Result<Self, FilterError> {
        let reached: [T; N] = vector!(|i| {
            predicted[i].abs() + sum!(N, |k| (link.transition.0[i][k] * before.mean[k]).abs())
        });
        // Of what may cancel in F·P·Fᵀ each part is rounded.
        let deviations: [T; N] = vector!(|i| before.covariance.get(i, i).abs().sqrt());
        let sums: [T; N] = vector!(|i| {
            sum!(N, |k| link.transition.0[i][k].abs() * deviations[k]).sq() + link.noise.get(i, i)
        });
        let rounding = rounded(&sums);
        let (state, noise) = (known(before), floored(&link.noise, &rounding, &reached));
        let mut below = [[state.root, Mat::zero()]];
        let (x, [y]) = reduced([link.transition.times(&state.root), noise.root], &mut below);
        let [[rest, noise_rest]] = below;
        // G·X = Y; a column of zeros asks for nothing.
        let gain = times_inverse(&y, &x);
        let kept = matrix!(|i, j| gain.0[i][j] * rounding[j].sqrt());
        let kept = triangularize(kept, Mat::<T, N, 0>::zero(), Mat::zero());
        let root = triangularize(rest, noise_rest, kept);

        if !(state.sound && noise.sound) {
            return Err(FilterError::CovarianceNotPositive);
        }
        if !(gain.is_finite() && root.is_finite()) {
            return Err(FilterError::NonFiniteState);
        }
        Ok(Self { mean: before.mean, gain, predicted: *predicted, root })
    }

    /// x = m + G·x⁺ + e with e ~ N(0, Z·Zᵀ), from what an information filter knows.
    #[inline(always)]
    pub(crate) fn from_parts(mean: [T; N], gain: Mat<T, N, N>, root: Mat<T, N, N>) -> Self {
        Self { mean, gain, predicted: [T::of(0.0); N], root }
    }

    /// The earlier state, from the later one as smoothed.
    #[inline(never)]
    #[must_use]
    pub fn apply(&self, later: &Smoothed<T, N>) -> Smoothed<T, N> {
        Smoothed {
            mean: self.mean_given(&later.mean),
            root: triangularize(self.gain.times(&later.root), Mat::<T, N, 0>::zero(), self.root),
        }
    }

    /// This step after a `later` one, as one step.
    #[inline(never)]
    #[must_use]
    pub fn after(&self, later: &Self) -> Self {
        Self {
            mean: self.mean_given(&later.mean),
            gain: self.gain.times(&later.gain),
            predicted: later.predicted,
            root: triangularize(self.gain.times(&later.root), Mat::<T, N, 0>::zero(), self.root),
        }
    }

    /// m + G·(x⁺ − p).
    #[inline(always)]
    fn mean_given(&self, later: &[T; N]) -> [T; N] {
        let news: [T; N] = vector!(|i| later[i] - self.predicted[i]);
        vector!(|i| self.mean[i] + sum!(N, |k| self.gain.0[i][k] * news[k]))
    }
}
