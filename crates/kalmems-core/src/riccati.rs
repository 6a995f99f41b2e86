//! Where the covariance of a filter settles: Riccati's equations and Lyapunov's.
//!
//! All are solved by doubling: each iteration does the work of as many steps of the recursion as all before it
//! together, so that the convergence is quadratic and a slow filter costs a few iterations more. Set-up work,
//! without allocation.

use crate::linalg::{Cholesky, Ldl, Lu};
use crate::notation::{lower, matrix, sum, vector};
use crate::{Covariance, Mat, NoiseDensity, Scalar, discretize};
use core::fmt;

/// Why there is no steady state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RiccatiError {
    /// A matrix that was given holds something infinite or not a number.
    NonFinite,
    /// The process noise is not positive semi-definite.
    ProcessNoiseNotPositive,
    /// The measurement noise is not positive definite.
    MeasurementNoiseNotPositive,
    /// Part of the state does not decay and is not seen: its variance grows without bound, or stays what it was
    /// at the start.
    NotDetectable,
    /// Part of the state does not decay and is moved by no noise. Where it stands, the filter learns it ever
    /// better and its gain goes to zero; where it grows, the end depends on the start. Give that part some noise.
    NotStabilizable,
    /// The error does not decay under this gain.
    Unstable,
    /// The equation is too ill-conditioned for these numbers: two methods disagree by more than half of the
    /// digits. A part of the state that is hardly seen, or hardly moved, does that.
    IllConditioned,
}

impl fmt::Display for RiccatiError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NonFinite => "a matrix holds something that is not a finite number",
            Self::ProcessNoiseNotPositive => "the process noise is not positive semi-definite",
            Self::MeasurementNoiseNotPositive => "the measurement noise is not positive definite",
            Self::NotDetectable => "part of the state neither decays nor is seen by the measurement",
            Self::NotStabilizable => "part of the state neither decays nor is moved by noise",
            Self::Unstable => "the error does not decay under this gain",
            Self::IllConditioned => "the steady state is too ill-conditioned for these numbers",
        })
    }
}

impl core::error::Error for RiccatiError {}

/// 2⁶⁴ steps: what has not settled by then differs from one that never does by less than an ulp of f64.
const DOUBLINGS: usize = 64;

/// The predicted covariance in which a Kalman filter settles: the stabilising solution of
/// P = F·P·Fᵀ − F·P·Hᵀ·(H·P·Hᵀ + R)⁻¹·H·P·Fᵀ + Q.
///
/// F is N × N, H is M × N; P and Q are in the states' units squared, R in the measurements'. By the
/// structure-preserving doubling algorithm (Chu, Fan, Lin and Wang, Int. J. Control 77, 767, 2004), followed by
/// a step of Hewer's iteration (IEEE Trans. Automatic Control 16, 382, 1971): the Lyapunov equation for the gain
/// that was found. That step makes the result positive semi-definite by construction, takes the rounding errors
/// of the doubling out, and tells where the two disagree.
///
/// It exists where all that does not decay is seen (detectable) and moved by noise (stabilisable).
///
/// ```
/// use kalmems_core::{Covariance, Mat, riccati::discrete_riccati};
/// // A random walk with q = 1, r = 2: p² = q·p + q·r.
/// let one = Mat([[1.0_f64]]);
/// let (q, r) = (Covariance::from_variances([1.0]), Covariance::from_variances([2.0]));
/// let p = discrete_riccati(&one, &one, &q, &r)?;
/// assert!((p.get(0, 0) - 2.0).abs() < 1e-15);
/// # Ok::<(), kalmems_core::riccati::RiccatiError>(())
/// ```
pub fn discrete_riccati<T: Scalar, const N: usize, const M: usize>(
    f: &Mat<T, N, N>,
    h: &Mat<T, M, N>,
    q: &Covariance<T, N>,
    r: &Covariance<T, M>,
) -> Result<Covariance<T, N>, RiccatiError> {
    let information = checked_information(f, h, q, r)?;
    let start = doubled(transposed(f), information, *q)?;
    refine(start, |p| {
        let gain = f.times(&kalman_gain(p, h, r));
        let closed: Mat<T, N, N> = matrix!(|i, j| f.0[i][j] - sum!(M, |k| gain.0[i][k] * h.0[k][j]));
        discrete_lyapunov(&closed, &q.plus(&r.transformed(&gain)))
    })
}

/// The covariance in which a Kalman–Bucy filter settles: the stabilising solution of
/// A·P + P·Aᵀ − P·Hᵀ·R⁻¹·H·P + Q = 0, whose gain is K = P·Hᵀ·R⁻¹.
///
/// Q is the density of the process noise in state²/s, R that of the measurement noise in measurement²·s (two-sided
/// both). By doubling after a Cayley transform (Chu, Fan and Lin, Linear Algebra Appl. 396, 55, 2005), and a
/// step of Kleinman's iteration (IEEE Trans. Automatic Control 13, 114, 1968) for the same reasons as in
/// [`discrete_riccati`].
///
/// ```
/// use kalmems_core::{Mat, NoiseDensity, riccati::continuous_riccati};
/// // A random walk: p² = q·r.
/// let p = continuous_riccati(
///     &Mat([[0.0_f64]]),
///     &Mat([[1.0]]),
///     &NoiseDensity::none().on::<0>(9.0),
///     &NoiseDensity::none().on::<0>(4.0),
/// )?;
/// assert!((p.get(0, 0) - 6.0).abs() < 1e-14);
/// # Ok::<(), kalmems_core::riccati::RiccatiError>(())
/// ```
pub fn continuous_riccati<T: Scalar, const N: usize, const M: usize>(
    a: &Mat<T, N, N>,
    h: &Mat<T, M, N>,
    q: &NoiseDensity<T, N>,
    r: &NoiseDensity<T, M>,
) -> Result<Covariance<T, N>, RiccatiError> {
    checked_information(a, h, q.matrix(), r.matrix())?;
    // In balanced units: a pivot is chosen by size, and m beside m/s would mislead it.
    let balance = discretize::balance(a);
    let equation = |units: &[T; N]| {
        let (a, q) = in_units(units, a, q.matrix());
        let h: Mat<T, M, N> = matrix!(|i, j| h.0[i][j] * units[j]);
        (a, information(&h, r.matrix()), q)
    };
    let (scaled, seen, noise) = equation(&balance);
    let start = cayley(&scaled, &seen, &noise)?;

    // What is found says better what the size of each state is.
    let units = vector!(|i| balance[i] * one_if_zero(start.get(i, i).sqrt()));
    let (a, seen, q) = equation(&units);
    let start = lower!(|i, j| start.get(i, j) * (balance[i] / units[i]) * (balance[j] / units[j]));
    let p = refine(start, |p| {
        let closed = a.plus(&p.to_full().times(&seen.to_full()).scaled(T::of(-1.0)));
        continuous_lyapunov_balanced(&closed, &q.plus(&seen.transformed(&p.to_full())))
    })?;
    Ok(lower!(|i, j| p.get(i, j) * units[i] * units[j]))
}

/// K = P·Hᵀ·(H·P·Hᵀ + R)⁻¹ of a predicted covariance P.
///
/// R must be positive definite, and P positive semi-definite.
pub fn kalman_gain<T: Scalar, const N: usize, const M: usize>(
    p: &Covariance<T, N>,
    h: &Mat<T, M, N>,
    r: &Covariance<T, M>,
) -> Mat<T, N, M> {
    through_inverse(p, h, &p.transformed(h).plus(r))
}

/// K = P·Hᵀ·R⁻¹, in state per measurement and second: the gain of
/// dx̂/dt = f(x̂, u) + K·(y − h(x̂)) for a covariance P of [`continuous_riccati`].
pub fn kalman_bucy_gain<T: Scalar, const N: usize, const M: usize>(
    p: &Covariance<T, N>,
    h: &Mat<T, M, N>,
    r: &NoiseDensity<T, M>,
) -> Mat<T, N, M> {
    through_inverse(p, h, r.matrix())
}

/// P = A·P·Aᵀ + C: the covariance in which x′ = A·x + w settles, with C that of w.
///
/// By doubling (Smith, SIAM J. Appl. Math. 16, 198, 1968): a sum of terms that are positive semi-definite. It is
/// refused as [`Unstable`](RiccatiError::Unstable) where a power of A does not go to zero.
pub fn discrete_lyapunov<T: Scalar, const N: usize>(
    a: &Mat<T, N, N>,
    c: &Covariance<T, N>,
) -> Result<Covariance<T, N>, RiccatiError> {
    if !a.is_finite() || !c.is_finite() {
        return Err(RiccatiError::NonFinite);
    }
    let (mut power, mut total) = (*a, *c);
    for _ in 0..DOUBLINGS {
        let next = total.plus(&total.transformed(&power));
        power = power.times(&power);
        if !next.is_finite() || !power.is_finite() {
            break;
        }
        let settled = vanishes(&power) && !growth(&total, &next).gt(rounding());
        total = next;
        if settled {
            return Ok(total);
        }
    }
    Err(RiccatiError::Unstable)
}

/// A·P + P·Aᵀ + C = 0: the covariance in which ẋ = A·x + w settles, with C the density of w.
///
/// By a Cayley transform to [`discrete_lyapunov`], in balanced units.
///
/// ```
/// use kalmems_core::{Mat, NoiseDensity, riccati::{RiccatiError, continuous_lyapunov}};
/// let noise = NoiseDensity::none().on::<0>(3.0_f64);
/// let p = continuous_lyapunov(&Mat([[-0.5]]), &noise)?;
/// assert!((p.get(0, 0) - 3.0).abs() < 1e-14);
/// assert_eq!(continuous_lyapunov(&Mat([[0.1]]), &noise), Err(RiccatiError::Unstable));
/// # Ok::<(), RiccatiError>(())
/// ```
pub fn continuous_lyapunov<T: Scalar, const N: usize>(
    a: &Mat<T, N, N>,
    c: &NoiseDensity<T, N>,
) -> Result<Covariance<T, N>, RiccatiError> {
    if !a.is_finite() || !c.matrix().is_finite() {
        return Err(RiccatiError::NonFinite);
    }
    let scale = discretize::balance(a);
    let (a, c) = in_units(&scale, a, c.matrix());
    let p = continuous_lyapunov_balanced(&a, &c)?;
    Ok(lower!(|i, j| p.get(i, j) * scale[i] * scale[j]))
}

/// A matrix and a covariance of states that are measured in these units.
fn in_units<T: Scalar, const N: usize>(
    units: &[T; N],
    a: &Mat<T, N, N>,
    c: &Covariance<T, N>,
) -> (Mat<T, N, N>, Covariance<T, N>) {
    (matrix!(|i, j| a.0[i][j] * units[j] / units[i]), lower!(|i, j| c.get(i, j) / units[i] / units[j]))
}

/// The same without the balance: with E = (A − γ)⁻¹, P = E·(A + γ)·P·(A + γ)ᵀ·Eᵀ + 2γ·E·C·Eᵀ for any γ > 0.
fn continuous_lyapunov_balanced<T: Scalar, const N: usize>(
    a: &Mat<T, N, N>,
    c: &Covariance<T, N>,
) -> Result<Covariance<T, N>, RiccatiError> {
    // Above every eigenvalue, so that A − γ has an inverse.
    let shift = one_if_zero(largest_row_sum(a).twice());
    let shifted = |by: T| a.plus(&Mat::identity().scaled(by));
    let lu = Lu::of(&shifted(-shift)).ok_or(RiccatiError::NonFinite)?;
    let inverse = lu.inverse();
    let noise = c.transformed(&inverse);
    discrete_lyapunov(&lu.solve(&shifted(shift)), &lower!(|i, j| noise.get(i, j) * shift.twice()))
}

/// The continuous equation as a discrete one with the same solution, and that solution.
///
/// For the dual pair B = Aᵀ − γ, M = B + G·B⁻ᵀ·Q: I + 2γ·M⁻¹, 2γ·B⁻¹·G·M⁻ᵀ and 2γ·M⁻ᵀ·Q·B⁻¹.
fn cayley<T: Scalar, const N: usize>(
    a: &Mat<T, N, N>,
    g: &Covariance<T, N>,
    q: &Covariance<T, N>,
) -> Result<Covariance<T, N>, RiccatiError> {
    let (g, q) = (g.to_full(), q.to_full());
    // Above every eigenvalue of A and of the Hamiltonian matrix, so that B and M have inverses.
    let size = largest(largest_row_sum(a), largest_row_sum(&transposed(a)));
    let shift = one_if_zero((size + largest_row_sum(&g).sqrt() * largest_row_sum(&q).sqrt()) * T::of(1.25));
    let b = transposed(a).plus(&Mat::identity().scaled(-shift));
    let b = (b, Lu::of(&b).ok_or(RiccatiError::IllConditioned)?);
    let bg = b.1.solve(&g);
    let m = transposed(&b.0).plus(&q.times(&bg));
    let m = Lu::of(&m).ok_or(RiccatiError::IllConditioned)?;
    let inverse = m.inverse();
    let twice = shift.twice();
    let transition = Mat::identity().plus(&transposed(&inverse).scaled(twice));
    let seen = bg.times(&inverse);
    let driven = m.solve(&q.times(&b.1.inverse()));
    doubled(transition, lower!(|i, j| seen.0[i][j] * twice), lower!(|i, j| driven.0[i][j] * twice))
}

/// The doubling: X = Aᵀ·X·(I + G·X)⁻¹·A + Q for A, G and Q.
///
/// After k doublings Q is the covariance after 2ᵏ steps from a known start, G the information that as many
/// measurements hold about that start, and A what is left of it. A goes to zero where there is a steady state.
/// Where not, Q grows without bound if something is not seen, and G if something is not moved.
fn doubled<T: Scalar, const N: usize>(
    mut a: Mat<T, N, N>,
    mut g: Covariance<T, N>,
    mut q: Covariance<T, N>,
) -> Result<Covariance<T, N>, RiccatiError> {
    let (mut g_growth, mut q_growth) = (T::of(0.0), T::of(0.0));
    for _ in 0..DOUBLINGS {
        let full = (g.to_full(), q.to_full());
        let Some(lu) = Lu::of(&Mat::identity().plus(&full.0.times(&full.1))) else { break };
        let weighted = lu.solve(&a);
        let g_added = a.times(&lu.solve(&full.0)).times_transposed(&a);
        let q_added = transposed(&a).times(&full.1).times(&weighted);
        let next_a = a.times(&weighted);
        let next_g: Covariance<T, N> = lower!(|i, j| g.get(i, j) + g_added.0[i][j]);
        let next_q: Covariance<T, N> = lower!(|i, j| q.get(i, j) + q_added.0[i][j]);
        if !next_a.is_finite() || !next_g.is_finite() || !next_q.is_finite() {
            break;
        }
        (g_growth, q_growth) = (growth(&g, &next_g), growth(&q, &next_q));
        (a, g, q) = (next_a, next_g, next_q);
        if vanishes(&a) && !q_growth.gt(rounding()) {
            return Ok(q);
        }
    }
    // Half of the digits tell growth from rounding.
    let grows = |by: T| by.gt(rounding::<T>().sqrt());
    if grows(q_growth) || !grows(g_growth) {
        Err(RiccatiError::NotDetectable)
    } else {
        Err(RiccatiError::NotStabilizable)
    }
}

/// Newton's steps from a solution that is nearly right, until one changes less than half of the digits: the
/// error after it is then of the order of rounding, because the convergence is quadratic.
fn refine<T: Scalar, const N: usize>(
    mut p: Covariance<T, N>,
    step: impl Fn(&Covariance<T, N>) -> Result<Covariance<T, N>, RiccatiError>,
) -> Result<Covariance<T, N>, RiccatiError> {
    for _ in 0..4 {
        let Ok(next) = step(&p) else { break };
        let change = growth(&p, &next);
        p = next;
        if !change.gt(rounding::<T>().sqrt()) {
            return Ok(p);
        }
    }
    Err(RiccatiError::IllConditioned)
}

/// Refuses what no equation can be made of; Hᵀ·R⁻¹·H otherwise.
fn checked_information<T: Scalar, const N: usize, const M: usize>(
    f: &Mat<T, N, N>,
    h: &Mat<T, M, N>,
    q: &Covariance<T, N>,
    r: &Covariance<T, M>,
) -> Result<Covariance<T, N>, RiccatiError> {
    if !f.is_finite() || !h.is_finite() || !q.is_finite() || !r.is_finite() {
        return Err(RiccatiError::NonFinite);
    }
    if !Ldl::of(r).positive {
        return Err(RiccatiError::MeasurementNoiseNotPositive);
    }
    // What is positive semi-definite is the product of its root; half of the digits allow for rounding.
    let root = Cholesky::of_semidefinite(q);
    let product = root.times_transposed(&root);
    for i in 0..N {
        for j in 0..=i {
            let size = q.get(i, i).abs().sqrt() * q.get(j, j).abs().sqrt();
            if (product.0[i][j] - q.get(i, j)).abs().gt(size * rounding::<T>().sqrt()) {
                return Err(RiccatiError::ProcessNoiseNotPositive);
            }
        }
    }
    Ok(information(h, r))
}

/// Hᵀ·R⁻¹·H.
fn information<T: Scalar, const N: usize, const M: usize>(
    h: &Mat<T, M, N>,
    r: &Covariance<T, M>,
) -> Covariance<T, N> {
    let ldl = Ldl::of(r);
    let weighted: [[T; M]; N] = vector!(|j| ldl.solve(&vector!(|k| h.0[k][j])));
    lower!(|i, j| sum!(M, |k| h.0[k][i] * weighted[j][k]))
}

/// P·Hᵀ·S⁻¹.
fn through_inverse<T: Scalar, const N: usize, const M: usize>(
    p: &Covariance<T, N>,
    h: &Mat<T, M, N>,
    s: &Covariance<T, M>,
) -> Mat<T, N, M> {
    let ldl = Ldl::of(s);
    Mat(vector!(|i| ldl.solve(&vector!(|k| sum!(N, |j| h.0[k][j] * p.get(i, j))))))
}

/// The largest relative change of a variance. Where none changes, no covariance does.
fn growth<T: Scalar, const N: usize>(old: &Covariance<T, N>, new: &Covariance<T, N>) -> T {
    (0..N).fold(T::of(0.0), |most, i| {
        let change = (new.get(i, i) - old.get(i, i)).abs();
        if change.gt(T::of(0.0)) { largest(most, change / new.get(i, i).abs()) } else { most }
    })
}

/// Whether every row sum is below ½, so that every eigenvalue is, in whatever units.
fn vanishes<T: Scalar, const N: usize>(a: &Mat<T, N, N>) -> bool {
    largest_row_sum(a).lt(T::of(0.5))
}

/// max Σ_j |a_ij|.
pub(crate) fn largest_row_sum<T: Scalar, const N: usize>(a: &Mat<T, N, N>) -> T {
    a.0.iter().fold(T::of(0.0), |most, row| largest(most, sum!(N, |j| row[j].abs())))
}

/// The transposed matrix.
fn transposed<T: Scalar, const N: usize>(a: &Mat<T, N, N>) -> Mat<T, N, N> {
    matrix!(|i, j| a.0[j][i])
}

/// A few ulps of one.
pub(crate) fn rounding<T: Scalar>() -> T {
    let mut ulp = T::of(1.0);
    // f64 ends after 53 halvings.
    for _ in 0..64 {
        if (T::of(1.0) + ulp.half()).gt(T::of(1.0)) {
            ulp = ulp.half();
        }
    }
    ulp * T::of(4.0)
}

fn largest<T: Scalar>(a: T, b: T) -> T {
    T::select(a.lt(b), b, a)
}

fn one_if_zero<T: Scalar>(a: T) -> T {
    if a.gt(T::of(0.0)) { a } else { T::of(1.0) }
}
