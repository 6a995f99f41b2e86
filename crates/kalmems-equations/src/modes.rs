//! The modes of a linear motion: the eigenvalues of its matrix.
//!
//! For set-up work on matrices of at most [`MOST_STATES`](crate::MOST_STATES) rows; nothing in a step of a filter needs them.

// Index loops over rows and columns are the notation of the method.
#![allow(clippy::needless_range_loop, clippy::many_single_char_names)]

use std::ops::{Add, Div, Mul, Sub};

/// An eigenvalue λ = decay + i·rate of ẋ = A·x, in 1/s: its motion is e^{λt}.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mode {
    /// The real part in 1/s; negative for a motion that dies away.
    pub growth: f64,
    /// The imaginary part in rad/s; 0 for one that does not oscillate.
    pub rate: f64,
}

impl Mode {
    /// Cycles per second.
    pub fn frequency_hz(&self) -> f64 {
        self.rate.abs() / std::f64::consts::TAU
    }

    /// |λ| in 1/s: how fast it is.
    pub fn size(&self) -> f64 {
        ComplexNumber(self.growth, self.rate).size()
    }

    /// The ratio of damping to critical damping, −Re λ/|λ|.
    pub fn damping_ratio(&self) -> f64 {
        -self.growth / self.size()
    }

    /// Whether it oscillates.
    pub fn oscillates(&self) -> bool {
        self.rate != 0.0
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct ComplexNumber(f64, f64);

impl ComplexNumber {
    const ZERO: Self = Self(0.0, 0.0);

    fn size(self) -> f64 {
        let Self(a, b) = self;
        let most = a.abs().max(b.abs());
        if most == 0.0 { 0.0 } else { most * ((a / most).powi(2) + (b / most).powi(2)).sqrt() }
    }

    fn conjugate(self) -> Self {
        Self(self.0, -self.1)
    }

    fn scaled(self, by: f64) -> Self {
        Self(self.0 * by, self.1 * by)
    }

    /// The root with a real part that is not negative.
    fn root(self) -> Self {
        let size = self.size();
        let real = ((size + self.0) * 0.5).max(0.0).sqrt();
        let imaginary = ((size - self.0) * 0.5).max(0.0).sqrt();
        Self(real, imaginary.copysign(self.1))
    }
}

impl Add for ComplexNumber {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }
}

impl Sub for ComplexNumber {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0, self.1 - other.1)
    }
}

impl Mul for ComplexNumber {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self(self.0 * other.0 - self.1 * other.1, self.0 * other.1 + self.1 * other.0)
    }
}

impl Div for ComplexNumber {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let square = other.0 * other.0 + other.1 * other.1;
        (self * other.conjugate()).scaled(square.recip())
    }
}

/// The shape of a mode of a square matrix, row by row: real and imaginary part of the v with A·v = λ·v whose largest entry is 1.
/// `None` for what is not finite.
///
/// By inverse iteration (Wilkinson, chapter 9): two solutions with a matrix that is singular but for a shift by rounding. Where an
/// eigenvalue is a multiple one, it is one of the shapes.
pub fn shape(matrix: &[f64], size: usize, mode: &Mode) -> Option<[Vec<f64>; 2]> {
    const SHIFT: f64 = 1e-10;
    if size == 0 || matrix.len() != size * size || !matrix.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    let shift = ComplexNumber(mode.growth, mode.rate)
        + ComplexNumber(SHIFT * mode.size().max(f64::MIN_POSITIVE), 0.0);
    let mut v = vec![ComplexNumber(1.0, 0.0); size];
    for _ in 0..3 {
        let shifted = |i: usize, j: usize| {
            let entry = ComplexNumber(matrix[i * size + j], 0.0);
            if i == j { entry - shift } else { entry }
        };
        let mut rows: Vec<Vec<ComplexNumber>> =
            (0..size).map(|i| (0..size).map(|j| shifted(i, j)).chain([v[i]]).collect()).collect();
        v = solved(&mut rows)?;
        let largest = v.iter().copied().reduce(|a, b| if b.size() > a.size() { b } else { a })?;
        for entry in &mut v {
            *entry = *entry / largest;
        }
        if !v.iter().all(|entry| entry.0.is_finite() && entry.1.is_finite()) {
            return None;
        }
    }
    Some([v.iter().map(|entry| entry.0).collect(), v.iter().map(|entry| entry.1).collect()])
}

/// The solution of rows of a system with its right side behind them, by elimination with row pivots.
fn solved(rows: &mut [Vec<ComplexNumber>]) -> Option<Vec<ComplexNumber>> {
    let size = rows.len();
    for column in 0..size {
        // The largest pivot for the size of its row.
        let of = |row: &Vec<ComplexNumber>| {
            let most = row[..size].iter().fold(0.0_f64, |most, entry| most.max(entry.size()));
            if most > 0.0 { row[column].size() / most } else { 0.0 }
        };
        let pivot = (column..size).max_by(|a, b| of(&rows[*a]).total_cmp(&of(&rows[*b])))?;
        rows.swap(column, pivot);
        let (above, below) = rows.split_at_mut(column + 1);
        let row = &above[column];
        if row[column].size() == 0.0 {
            return None;
        }
        for other in below {
            let factor = other[column] / row[column];
            for j in column..=size {
                other[j] = other[j] - factor * row[j];
            }
        }
    }
    let mut x = vec![ComplexNumber::ZERO; size];
    for i in (0..size).rev() {
        let known = (i + 1..size).fold(rows[i][size], |left, j| left - rows[i][j] * x[j]);
        x[i] = known / rows[i][i];
    }
    Some(x)
}

/// Steps for one eigenvalue at most; a handful is usual.
const MOST_STEPS: usize = 200;

/// The eigenvalues of a square matrix, row by row, by falling size of their rate and then of their growth; those of a pair stand
/// side by side. `None` for a matrix that is not finite, or where the iteration does not end.
///
/// Balanced (Osborne 1960), reduced to Hessenberg's form by elimination, and iterated by complex QR steps with Wilkinson's
/// shift (Wilkinson, The Algebraic Eigenvalue Problem, 1965, chapters 6 and 8).
pub fn modes(matrix: &[f64], size: usize) -> Option<Vec<Mode>> {
    if size == 0 || matrix.len() != size * size || !matrix.iter().all(|entry| entry.is_finite()) {
        return None;
    }
    let mut rows: Vec<Vec<f64>> = matrix.chunks_exact(size).map(<[f64]>::to_vec).collect();
    balance(&mut rows);
    reduce(&mut rows);
    let complex = |row: &Vec<f64>| row.iter().map(|entry| ComplexNumber(*entry, 0.0)).collect();
    let mut h: Vec<Vec<ComplexNumber>> = rows.iter().map(complex).collect();
    let mut found = Vec::with_capacity(size);
    let mut last = size - 1;
    let mut steps = 0;
    loop {
        let first = (1..=last).rev().find(|k| is_split(&h, *k)).unwrap_or(0);
        if first == last {
            found.push(h[last][last]);
            steps = 0;
            if last == 0 {
                break;
            }
            last -= 1;
            continue;
        }
        steps += 1;
        if steps > MOST_STEPS {
            return None;
        }
        // Now and then another shift, so that no cycle of steps is endless.
        let shift =
            if steps % 10 == 0 { ComplexNumber(h[last][last - 1].size(), 0.0) } else { wilkinson(&h, last) };
        qr_step(&mut h, (first, last), shift);
    }
    Some(paired(found))
}

/// Makes rows and columns of about the same size, by powers of two, and returns these: row i is divided by its own, and column i multiplied
/// by it.
pub(crate) fn balance(a: &mut [Vec<f64>]) -> Vec<f64> {
    let n = a.len();
    let mut scales = vec![1.0; n];
    for _ in 0..32 {
        let mut settled = true;
        for i in 0..n {
            let others = (0..n).filter(|j| *j != i);
            let (row, column) = others
                .fold((0.0, 0.0), |(row, column), j| (row + f64::abs(a[i][j]), column + f64::abs(a[j][i])));
            if row == 0.0 || column == 0.0 {
                continue;
            }
            let (mut by, mut grown): (f64, f64) = (1.0, column);
            while grown < row * 0.5 && by < 1e150 {
                (by, grown) = (by * 2.0, grown * 4.0);
            }
            while grown > row * 2.0 && by > 1e-150 {
                (by, grown) = (by * 0.5, grown * 0.25);
            }
            if by != 1.0 {
                settled = false;
                scales[i] *= by;
                for entry in &mut a[i] {
                    *entry /= by;
                }
                for row in a.iter_mut() {
                    row[i] *= by;
                }
            }
        }
        if settled {
            break;
        }
    }
    scales
}

/// To a form with zeros below the first subdiagonal, by elimination with pivots.
fn reduce(a: &mut [Vec<f64>]) {
    let n = a.len();
    for m in 1..n.saturating_sub(1) {
        let pivot = (m..n).max_by(|i, j| a[*i][m - 1].abs().total_cmp(&a[*j][m - 1].abs())).unwrap_or(m);
        a.swap(pivot, m);
        for row in a.iter_mut() {
            row.swap(pivot, m);
        }
        let x = a[m][m - 1];
        if x == 0.0 {
            continue;
        }
        for i in m + 1..n {
            let y = a[i][m - 1] / x;
            if y == 0.0 {
                continue;
            }
            for j in 0..n {
                a[i][j] -= y * a[m][j];
            }
            for row in a.iter_mut() {
                row[m] += y * row[i];
            }
            a[i][m - 1] = 0.0;
        }
    }
}

/// Whether the entry before this row's diagonal is nothing against its neighbours.
fn is_split(h: &[Vec<ComplexNumber>], k: usize) -> bool {
    let around = h[k - 1][k - 1].size() + h[k][k].size();
    h[k][k - 1].size() <= f64::EPSILON * around || h[k][k - 1] == ComplexNumber::ZERO
}

/// The eigenvalue of the last two rows and columns that is nearer to the last entry.
fn wilkinson(h: &[Vec<ComplexNumber>], last: usize) -> ComplexNumber {
    let (a, b) = (h[last - 1][last - 1], h[last - 1][last]);
    let (c, d) = (h[last][last - 1], h[last][last]);
    let half = (a - d).scaled(0.5);
    let root = (half * half + b * c).root();
    let (plus, minus) = (half + root, half - root);
    let far = if plus.size() >= minus.size() { plus } else { minus };
    if far == ComplexNumber::ZERO { d } else { d - b * c / far }
}

/// One step H − s = QR, H ← RQ + s on the rows and columns from `first` to `last`, by rotations.
fn qr_step(h: &mut [Vec<ComplexNumber>], (first, last): (usize, usize), shift: ComplexNumber) {
    for k in first..=last {
        h[k][k] = h[k][k] - shift;
    }
    let mut rotations = Vec::with_capacity(last - first);
    for k in first..last {
        let (x, y) = (h[k][k], h[k + 1][k]);
        let size = ComplexNumber(x.size(), y.size()).size();
        let (c, s) = if size == 0.0 {
            (ComplexNumber(1.0, 0.0), ComplexNumber::ZERO)
        } else {
            (x.scaled(size.recip()), y.scaled(size.recip()))
        };
        rotations.push((c, s));
        for j in k..=last {
            let (top, below) = (h[k][j], h[k + 1][j]);
            h[k][j] = c.conjugate() * top + s.conjugate() * below;
            h[k + 1][j] = c * below - s * top;
        }
    }
    for (k, (c, s)) in (first..last).zip(rotations) {
        for i in first..=last.min(k + 1) {
            let (left, right) = (h[i][k], h[i][k + 1]);
            h[i][k] = left * c + right * s;
            h[i][k + 1] = right * c.conjugate() - left * s.conjugate();
        }
    }
    for k in first..=last {
        h[k][k] = h[k][k] + shift;
    }
}

/// In order, an imaginary part that is rounding taken off.
fn paired(values: Vec<ComplexNumber>) -> Vec<Mode> {
    let most = values.iter().map(|value| value.size()).fold(0.0, f64::max);
    let mode = |value: ComplexNumber| {
        let is_real = value.1.abs() <= 1e-9 * value.size() || value.1.abs() <= 1e-14 * most;
        Mode { growth: value.0, rate: if is_real { 0.0 } else { value.1 } }
    };
    let mut modes: Vec<Mode> = values.into_iter().map(mode).collect();
    modes.sort_by(|a, b| {
        let by_rate = b.rate.abs().total_cmp(&a.rate.abs());
        by_rate.then(a.growth.total_cmp(&b.growth)).then(b.rate.total_cmp(&a.rate))
    });
    modes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The matrix whose characteristic polynomial has these coefficients, the highest power's being 1.
    fn companion(coefficients: &[f64]) -> Vec<f64> {
        let n = coefficients.len();
        let mut a = vec![0.0; n * n];
        for i in 0..n {
            a[i * n + n - 1] = -coefficients[i];
            if i > 0 {
                a[i * n + i - 1] = 1.0;
            }
        }
        a
    }

    #[test]
    fn a_resonator_has_the_modes_of_its_formula() {
        let (rate, damping) = (1.0e5, 2e-3);
        let found = modes(&[0.0, 1.0, -rate * rate, -2.0 * damping * rate], 2).unwrap();
        let damped = rate * f64::sqrt(1.0 - damping * damping);
        assert!((found[0].rate / damped - 1.0).abs() < 1e-12, "{found:?}");
        assert!((found[0].growth / (-damping * rate) - 1.0).abs() < 1e-9, "{found:?}");
        assert!((found[0].damping_ratio() / damping - 1.0).abs() < 1e-9);
        assert!((found[1].rate / found[0].rate + 1.0).abs() < 1e-12, "{found:?}");
    }

    #[test]
    fn roots_of_a_polynomial_are_found() {
        // (x − 1)(x + 2)(x − 3)(x² + 4x + 13)(x + 0.5).
        let roots = [(1.0, 0.0), (-2.0, 0.0), (3.0, 0.0), (-2.0, 3.0), (-2.0, -3.0), (-0.5, 0.0)];
        let mut polynomial = vec![ComplexNumber(1.0, 0.0)];
        for (re, im) in roots {
            let mut next = vec![ComplexNumber::ZERO; polynomial.len() + 1];
            for (k, coefficient) in polynomial.iter().enumerate() {
                next[k + 1] = next[k + 1] + *coefficient;
                next[k] = next[k] - *coefficient * ComplexNumber(re, im);
            }
            polynomial = next;
        }
        let coefficients: Vec<f64> = polynomial[..6].iter().map(|c| c.0).collect();
        let found = modes(&companion(&coefficients), 6).unwrap();
        for (re, im) in roots {
            let near = found.iter().map(|mode| ComplexNumber(mode.growth - re, mode.rate - im).size());
            assert!(near.fold(f64::INFINITY, f64::min) < 1e-9, "{re} {im}: {found:?}");
        }
    }

    #[test]
    fn chains_of_integrators_and_matrices_of_zeros_end() {
        assert_eq!(modes(&[0.0; 9], 3).unwrap(), [Mode::default(); 3]);
        let found = modes(&[0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 3).unwrap();
        assert!(found.iter().all(|mode| mode.growth.abs() < 1e-4 && mode.rate.abs() < 1e-4), "{found:?}");
        assert!(modes(&[f64::NAN], 1).is_none() && modes(&[], 0).is_none());
    }

    #[test]
    fn sum_and_product_are_those_of_random_matrices() {
        let mut random = 0x9e37_79b9_7f4a_7c15_u64;
        let mut uniform = || {
            random ^= random << 13;
            random ^= random >> 7;
            random ^= random << 17;
            (random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for n in 2..=16 {
            for _ in 0..20 {
                let matrix: Vec<f64> = (0..n * n).map(|_| uniform()).collect();
                let found = modes(&matrix, n).unwrap();
                let trace: f64 = (0..n).map(|i| matrix[i * n + i]).sum();
                let square: f64 =
                    (0..n).map(|i| (0..n).map(|j| matrix[i * n + j] * matrix[j * n + i]).sum::<f64>()).sum();
                let of = |each: fn(&Mode) -> f64| found.iter().map(each).sum::<f64>();
                assert!((of(|m| m.growth) - trace).abs() < 1e-11, "{n}");
                assert!((of(|m| m.growth * m.growth - m.rate * m.rate) - square).abs() < 1e-11, "{n}");
                assert!(of(|m| m.rate).abs() < 1e-11, "{n}");
            }
        }
    }
}
