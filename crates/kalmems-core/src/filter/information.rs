//! A start without any knowledge.

use super::Gaussian;
use crate::linalg::{Lu, Mat, epsilon, triangularize};
use crate::notation::{finite, sum, vector};
use crate::smooth::Backward;
use crate::{Cholesky, Covariance, LinearMeasurement, LinearProcess, Process, Scalar};
use core::fmt;

/// What is known of a state, as a square root of information: R·x = z + e with e ~ N(0, I), R upper
/// triangular.
///
/// It starts from exactly nothing, R = 0, where a covariance would have to be infinite and a large one only
/// costs digits. Measurements add rows H·x = y − v, and reflections bring R back to its triangle; a step goes
/// through the inverse of its transition (Dyer and McReynolds, J. Optimization Theory and Applications 3,
/// 444, 1969; Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapter VI). As soon
/// as the measurements determine every state, [`gaussian`](Self::gaussian) starts a filter with it: the exact
/// diffuse start.
///
/// For set-up code: the few samples that a start takes. A nonlinear model can be given linearised at a guess.
///
/// ```
/// use kalmems_core::filter::{Information, InformationError};
/// use kalmems_core::{Covariance, LinearMeasurement, LinearProcess, Mat, ProcessNoise};
/// let position = LinearMeasurement { matrix: Mat([[1.0, 0.0]]) };
/// let step = LinearProcess::<f64, 2, 0> {
///     transition: Mat([[1.0, 0.5], [0.0, 1.0]]), // constant velocity over 0.5 s
///     input: Mat::zero(),
///     noise: ProcessNoise::none(),
/// };
/// let r = Covariance::from_variances([0.01]);
/// let mut start = Information::nothing();
/// start.update(&position, &[1.0], &r)?;
/// assert_eq!(start.gaussian(), Err(InformationError::Undetermined { rank: 1, states: 2 }));
/// start.predict(&step, &[])?;
/// start.update(&position, &[2.0], &r)?;
/// let known = start.gaussian()?;
/// assert!((known.mean[1] - 2.0_f64).abs() < 1e-13); // (2 − 1)/0.5
/// assert!((known.covariance.get(1, 1) - 2.0 * 0.01 / 0.25).abs() < 1e-14);
/// # Ok::<(), InformationError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Information<T, const N: usize> {
    /// R.
    root: Mat<T, N, N>,
    /// z.
    sought: [T; N],
}

/// Why a step of an [`Information`] was refused, which is then as it was, or has no Gaussian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InformationError {
    /// The measurements so far determine only some combinations of the states.
    Undetermined {
        /// How many.
        rank: usize,
        /// Of how many states.
        states: usize,
    },
    /// A measurement noise covariance is not positive definite.
    MeasurementNoiseNotPositive,
    /// A transition cannot be inverted: it forgets a direction for good, of which nothing was known.
    TransitionSingular,
    /// Something is infinite or not a number.
    NonFinite,
}

impl fmt::Display for InformationError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Undetermined { rank, states } => {
                write!(f, "not yet determined: {rank} of {states} combinations of the states are known")
            }
            Self::MeasurementNoiseNotPositive => {
                f.write_str("the measurement noise covariance is not positive definite")
            }
            Self::TransitionSingular => f.write_str("the transition cannot be inverted"),
            Self::NonFinite => f.write_str("a number is infinite or not a number"),
        }
    }
}

impl core::error::Error for InformationError {}

impl<T: Scalar, const N: usize> Information<T, N> {
    /// Nothing is known: zero information on every state.
    pub fn nothing() -> Self {
        Self { root: Mat::zero(), sought: [T::of(0.0); N] }
    }

    /// Adds a measurement `y` = H·x + v of noise covariance `r`.
    pub fn update<const M: usize>(
        &mut self,
        measurement: &LinearMeasurement<T, N, M>,
        y: &[T; M],
        r: &Covariance<T, M>,
    ) -> Result<(), InformationError> {
        let cholesky = Cholesky::of(r);
        if !cholesky.positive {
            return Err(InformationError::MeasurementNoiseNotPositive);
        }
        // L⁻¹·[H y], row by row.
        let l = &cholesky.factor.0;
        let (mut h, mut y) = (measurement.matrix.0, *y);
        for i in 0..M {
            let recip = l[i][i].recip();
            for j in 0..N {
                h[i][j] = (h[i][j] - sum!(i, |k| l[i][k] * h[k][j])) * recip;
            }
            y[i] = (y[i] - sum!(i, |k| l[i][k] * y[k])) * recip;
        }
        let mut next = *self;
        for (row, y) in h.iter().zip(y) {
            next.fold(*row, y);
        }
        self.replace(next)
    }

    /// Moves by one step x′ = Φ·x + Γ·u + w, and gives the way back for a smoother: with it the states before
    /// the start was complete can be smoothed as well, by [`Backward::apply`].
    pub fn predict<const U: usize>(
        &mut self,
        process: &LinearProcess<T, N, U>,
        u: &[T; U],
    ) -> Result<Backward<T, N>, InformationError> {
        let back = inverse(&process.transition).ok_or(InformationError::TransitionSingular)?;
        let known = process.step(&[T::of(0.0); N], u);
        let w = process.noise.root();
        let back_w = back.times(w);

        // With w = W·ν and x = Φ⁻¹·(x′ − Γ·u − W·ν), the rows R·x = z speak of ν and x′. Eliminating ν from
        // them and from ν = 0 + e leaves rows on ν, which lead back, and rows on x′ alone.
        let (on_noise, on_state) = (self.root.times(&back_w), self.root.times(&back));
        let mut noise = Information { root: Mat::identity(), sought: [T::of(0.0); N] };
        let mut cross = Mat::<T, N, N>::zero();
        let mut next = Self::nothing();
        for i in 0..N {
            let mut on_nu = on_noise.0[i].map(|a| -a);
            let mut on_x = on_state.0[i];
            let mut sought = self.sought[i] + sum!(N, |k| on_x[k] * known[k]);
            for j in 0..N {
                let (c, s) = rotation(noise.root.0[j][j], on_nu[j]);
                rotate(&mut noise.root.0[j], &mut on_nu, c, s);
                rotate(&mut cross.0[j], &mut on_x, c, s);
                (noise.sought[j], sought) = rotated(noise.sought[j], sought, c, s);
            }
            next.fold(on_x, sought);
        }

        // ν = A·(z_ν − B·x′ + e): A the inverse of a triangle with a diagonal of at least one.
        let a = noise.inverse_root();
        let lead = back_w.times(&a);
        let x_from = back.plus(&lead.times(&cross));
        let offset = lead.times_vector(&noise.sought);
        let start = back.times_vector(&known);
        let mean = vector!(|i| -(start[i] + offset[i]));
        let root = triangularize(lead, Mat::<T, N, 0>::zero(), Mat::zero());
        if !(finite(&mean) && x_from.is_finite() && root.is_finite()) {
            return Err(InformationError::NonFinite);
        }
        self.replace(next)?;
        Ok(Backward::from_parts(mean, x_from, root))
    }

    /// How many combinations of the states are known well enough for a covariance of this precision.
    ///
    /// R's columns are brought to unit length, so that units do not matter, and made orthogonal in the order
    /// of what each adds; one that adds less than √ε of its length to those before it would have a variance
    /// that rounding in the others' swamps, and is not counted.
    pub fn rank(&self) -> usize {
        let column = |j: usize| -> [T; N] { vector!(|i| self.root.0[i][j]) };
        let mut columns: [[T; N]; N] = vector!(|j| {
            let length = norm(&column(j));
            let scale = T::select(length.gt(T::of(0.0)), length, T::of(1.0)).recip();
            column(j).map(|x| x * scale)
        });
        let threshold = epsilon::<T>().sqrt();
        let mut rank = 0;
        for _ in 0..N {
            let mut longest = ([T::of(0.0); N], threshold);
            for column in &columns {
                let length = norm(column);
                if length.gt(longest.1) {
                    longest = (column.map(|x| x / length), length);
                }
            }
            let (direction, length) = longest;
            if !length.gt(threshold) {
                break;
            }
            rank += 1;
            for column in &mut columns {
                let along = sum!(N, |i| column[i] * direction[i]);
                *column = vector!(|i| column[i] - along * direction[i]);
            }
        }
        rank
    }

    /// Mean and covariance, x = R⁻¹·z and R⁻¹·R⁻ᵀ, once every state is determined.
    pub fn gaussian(&self) -> Result<Gaussian<T, N>, InformationError> {
        let rank = self.rank();
        if rank < N {
            return Err(InformationError::Undetermined { rank, states: N });
        }
        let inverse = self.inverse_root();
        let covariance = Covariance::from_lower(inverse.times_transposed(&inverse));
        let known = Gaussian { mean: inverse.times_vector(&self.sought), covariance };
        if known.is_finite() { Ok(known) } else { Err(InformationError::NonFinite) }
    }

    /// Adds one row `row`·x = `sought` + e of unit variance, rotated into R.
    fn fold(&mut self, mut row: [T; N], mut sought: T) {
        for j in 0..N {
            let (c, s) = rotation(self.root.0[j][j], row[j]);
            rotate(&mut self.root.0[j], &mut row, c, s);
            (self.sought[j], sought) = rotated(self.sought[j], sought, c, s);
            // What rounding leaves below the diagonal is zero.
            row[j] = T::of(0.0);
        }
    }

    /// R⁻¹, upper triangular.
    fn inverse_root(&self) -> Mat<T, N, N> {
        let r = &self.root.0;
        let mut a = Mat::<T, N, N>::zero();
        for j in 0..N {
            a.0[j][j] = r[j][j].recip();
            for i in (0..j).rev() {
                a.0[i][j] = -sum!(j - i, |k| r[i][i + 1 + k] * a.0[i + 1 + k][j]) / r[i][i];
            }
        }
        a
    }

    fn replace(&mut self, next: Self) -> Result<(), InformationError> {
        let finite = next.root.is_finite() && next.sought.iter().all(|z| z.is_finite());
        if !finite {
            return Err(InformationError::NonFinite);
        }
        *self = next;
        Ok(())
    }
}

/// The rotation that turns (a, b) into (√(a² + b²), 0).
fn rotation<T: Scalar>(a: T, b: T) -> (T, T) {
    let length = (a.sq() + b.sq()).sqrt();
    // Nothing to turn: a row that is zero here is passed on as it is.
    if b.abs().gt(T::of(0.0)) || !length.is_finite() {
        (a / length, b / length)
    } else {
        (T::of(1.0), T::of(0.0))
    }
}

/// The rotation of one pair.
fn rotated<T: Scalar>(a: T, b: T, c: T, s: T) -> (T, T) {
    (c * a + s * b, c * b - s * a)
}

/// The rotation of two rows.
fn rotate<T: Scalar, const N: usize>(upper: &mut [T; N], lower: &mut [T; N], c: T, s: T) {
    for (a, b) in upper.iter_mut().zip(lower) {
        (*a, *b) = rotated(*a, *b, c, s);
    }
}

fn norm<T: Scalar, const N: usize>(v: &[T; N]) -> T {
    sum!(N, |i| v[i].sq()).sqrt()
}

/// Φ⁻¹; `None` where Φ is singular to rounding.
fn inverse<T: Scalar, const N: usize>(transition: &Mat<T, N, N>) -> Option<Mat<T, N, N>> {
    let inverse = Lu::of(transition)?.inverse();
    // ‖Φ‖·‖Φ⁻¹‖, each by its largest row sum, is how much an error may grow.
    let condition = largest_row(transition) * largest_row(&inverse);
    (condition * epsilon::<T>()).lt(T::of(1.0)).then_some(inverse)
}

/// The largest sum of the sizes of a row's entries.
fn largest_row<T: Scalar, const N: usize>(matrix: &Mat<T, N, N>) -> T {
    let mut largest = T::of(0.0);
    for row in &matrix.0 {
        let size = sum!(N, |j| row[j].abs());
        largest = T::select(size.gt(largest), size, largest);
    }
    largest
}
