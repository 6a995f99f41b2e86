//! From continuous time to one interval, exactly.

use crate::notation::{lower, matrix, sum, vector};
use crate::{Covariance, Mat, NoiseDensity, Scalar};

/// A linear differential equation ẋ = A·x + B·u + w over one interval h.
#[derive(Clone, Copy, Debug)]
pub struct Discretization<T, const N: usize> {
    /// Φ = e^{A·h}.
    pub transition: Mat<T, N, N>,
    /// ∫₀ʰ e^{A·s} ds: times B, what an input does that is held over the interval.
    pub input_integral: Mat<T, N, N>,
    /// ∫₀ʰ e^{A·s} · density · e^{Aᵀ·s} ds: the covariance that the noise adds (Van Loan's integral).
    pub noise: Covariance<T, N>,
}

/// The terms of the Taylor series that are summed before the doublings: 2⁻³ᵏ/k! is below half an ulp of f64.
const TERMS: usize = 12;

/// Discretises ẋ = A·x + B·u + w exactly over `interval`, which may be negative to look back (Φ alone is
/// meaningful then).
///
/// Φ, its integral and the noise covariance are summed as Taylor series over an interval short enough for
/// ‖A‖·h ≤ 1/8 and doubled from there: Φ(2h) = Φ(h)², Q(2h) = Q(h) + Φ(h)·Q(h)·Φ(h)ᵀ. That is the same integral
/// as Van Loan's block exponential (IEEE Trans. Automatic Control 23, 395, 1978) without its 2N × 2N matrix,
/// which stable Rust cannot name, and without e^{−A·h}, which overflows for a stiff A. Before that A is
/// balanced by a diagonal similarity, so that an angle in rad beside a rate of 10⁵ rad/s costs no digits.
///
/// ```
/// use kalmems_core::{Mat, NoiseDensity, discretize::discretize};
/// // White acceleration on a point mass.
/// let step = discretize(&Mat([[0.0, 1.0], [0.0, 0.0]]), &NoiseDensity::none().on::<1>(3.0), 2.0);
/// assert_eq!(step.transition, Mat([[1.0, 2.0], [0.0, 1.0]]));
/// let variance: f64 = step.noise.get(0, 0);
/// assert!((variance - 3.0 * 8.0 / 3.0).abs() < 1e-14);
/// ```
pub fn discretize<T: Scalar, const N: usize>(
    a: &Mat<T, N, N>,
    density: &NoiseDensity<T, N>,
    interval: T,
) -> Discretization<T, N> {
    let scale = balance(a);
    let a = matrix!(|i, j| a.0[i][j] * scale[j] / scale[i]);
    let density = lower!(|i, j| density.get(i, j) / (scale[i] * scale[j]));

    let (h, doublings) = short_interval(&a, interval);
    let (mut transition, mut integral) = series(&a, h);
    let mut noise = noise_series(&a, &density, h);
    for _ in 0..doublings {
        noise = noise.plus(&noise.transformed(&transition));
        integral = integral.plus(&transition.times(&integral));
        transition = transition.times(&transition);
    }

    let unscaled = |m: &Mat<T, N, N>| matrix!(|i, j| m.0[i][j] * scale[i] / scale[j]);
    Discretization {
        transition: unscaled(&transition),
        input_integral: unscaled(&integral),
        noise: lower!(|i, j| noise.get(i, j) * scale[i] * scale[j]),
    }
}

/// e^Z, φ₁(Z), φ₂(Z) and φ₃(Z) of a matrix Z, with φₖ(Z) = ∫₀¹ e^{(1−s)·Z}·s^{k−1}/(k−1)! ds, so that φₖ = 1/k! + Z·φₖ₊₁.
#[derive(Clone, Copy, Debug)]
pub struct PhiFunctions<T, const N: usize> {
    /// e^Z.
    pub exponential: Mat<T, N, N>,
    /// φ₁(Z).
    pub first: Mat<T, N, N>,
    /// φ₂(Z).
    pub second: Mat<T, N, N>,
    /// φ₃(Z).
    pub third: Mat<T, N, N>,
}

impl<T: Scalar, const N: usize> PhiFunctions<T, N> {
    /// Those of 2·Z: 2ᵏ·φₖ(2·Z) = e^Z·φₖ(Z) + Σ φⱼ(Z)/(k−j)! over j from 1 to k.
    #[must_use]
    pub fn doubled(&self) -> Self {
        let Self { exponential, first, second, third } = self;
        let quarter = T::of(0.25);
        let of = |phi: &Mat<T, N, N>| exponential.times(phi);
        Self {
            exponential: exponential.times(exponential),
            first: of(first).plus(first).scaled(T::of(0.5)),
            second: of(second).plus(first).plus(second).scaled(quarter),
            third: of(third).plus(&first.scaled(T::of(0.5))).plus(second).plus(third).scaled(quarter.half()),
        }
    }
}

/// The φ-functions of A·`interval`, balanced and doubled as in [`discretize`].
pub fn phi_functions<T: Scalar, const N: usize>(a: &Mat<T, N, N>, interval: T) -> PhiFunctions<T, N> {
    let scale = balance(a);
    let a = matrix!(|i, j| a.0[i][j] * scale[j] / scale[i]);
    let (h, doublings) = short_interval(&a, interval);
    let z = a.scaled(h);
    // φ₃ = 1/6·(1 + z/4·(1 + z/5·(1 + …))); the others follow from it.
    let mut inner = Mat::identity();
    let mut k = T::of((TERMS + 2) as f64);
    for _ in 4..=TERMS + 2 {
        inner = Mat::identity().plus(&z.times(&inner).scaled(k.recip()));
        k = k - T::of(1.0);
    }
    let third = inner.scaled(T::of(1.0 / 6.0));
    let second = Mat::identity().scaled(T::of(0.5)).plus(&z.times(&third));
    let first = Mat::identity().plus(&z.times(&second));
    let mut phi = PhiFunctions { exponential: Mat::identity().plus(&z.times(&first)), first, second, third };
    for _ in 0..doublings {
        phi = phi.doubled();
    }
    let unscaled = |m: &Mat<T, N, N>| matrix!(|i, j| m.0[i][j] * scale[i] / scale[j]);
    PhiFunctions {
        exponential: unscaled(&phi.exponential),
        first: unscaled(&phi.first),
        second: unscaled(&phi.second),
        third: unscaled(&phi.third),
    }
}

/// e^A, by the same series and doublings as [`discretize`].
pub fn matrix_exponential<T: Scalar, const N: usize>(a: &Mat<T, N, N>) -> Mat<T, N, N> {
    discretize(a, &NoiseDensity::none(), T::of(1.0)).transition
}

/// Scales d so that the entries `a_ij·d_j/d_i` have rows and columns of about the same size (Osborne 1960).
pub(crate) fn balance<T: Scalar, const N: usize>(a: &Mat<T, N, N>) -> [T; N] {
    let mut d = [T::of(1.0); N];
    // A bounded number of sweeps: a chain of integrators would go on for ever, and needs no balance.
    for _ in 0..16 {
        for i in 0..N {
            let others = |f: &dyn Fn(usize) -> T| sum!(N, |j| if i == j { T::of(0.0) } else { f(j).abs() });
            let row = others(&|j| a.0[i][j] * d[j] / d[i]);
            let column = others(&|j| a.0[j][i] * d[i] / d[j]);
            let usable = T::of(0.0).lt(row) && T::of(0.0).lt(column) && (row / column).is_finite();
            if usable {
                d[i] = d[i] * (row / column).sqrt();
            }
        }
    }
    d
}

/// Halves the interval until the largest row sum of |A|·h is at most 1/8.
fn short_interval<T: Scalar, const N: usize>(a: &Mat<T, N, N>, interval: T) -> (T, u32) {
    let mut norm = T::of(0.0);
    for row in &a.0 {
        let size = sum!(N, |j| row[j].abs());
        norm = T::select(size.gt(norm), size, norm);
    }
    let (mut h, mut doublings) = (interval, 0);
    // An infinite A stays infinite: the bound ends the loop, and the filter refuses the result.
    while (norm * h.abs()).gt(T::of(0.125)) && doublings < 1100 {
        h = h.half();
        doublings += 1;
    }
    (h, doublings)
}

/// e^{A·h} and its integral, by their Taylor series in Horner's form.
fn series<T: Scalar, const N: usize>(a: &Mat<T, N, N>, h: T) -> (Mat<T, N, N>, Mat<T, N, N>) {
    let ah = a.scaled(h);
    // ∫ = h·(1 + Ah/2·(1 + Ah/3·(1 + …)))
    let mut inner = Mat::identity();
    // Counted in T: 1/k in f64 would be a division in software on a microcontroller.
    let mut k = T::of(TERMS as f64);
    for _ in 2..=TERMS {
        inner = Mat::identity().plus(&ah.times(&inner).scaled(k.recip()));
        k = k - T::of(1.0);
    }
    (Mat::identity().plus(&ah.times(&inner)), inner.scaled(h))
}

/// ∫₀ʰ e^{A·s} D e^{Aᵀ·s} ds = Σ h^{k+1}/(k+1)! · L^k(D), with L(X) = A·X + X·Aᵀ.
fn noise_series<T: Scalar, const N: usize>(
    a: &Mat<T, N, N>,
    density: &Covariance<T, N>,
    h: T,
) -> Covariance<T, N> {
    let mut term = lower!(|i, j| density.get(i, j) * h);
    let mut total = term;
    // Twice the terms: ‖L‖ ≤ 2·‖A‖.
    let mut k = T::of(2.0);
    for _ in 2..=(TERMS + 4) {
        let factor = h * k.recip();
        k = k + T::of(1.0);
        let ax: [[T; N]; N] = vector!(|i| vector!(|j| sum!(N, |l| a.0[i][l] * term.get(l, j))));
        term = lower!(|i, j| (ax[i][j] + ax[j][i]) * factor);
        total = total.plus(&term);
    }
    total
}
