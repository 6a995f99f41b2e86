//! The triangular form of a least-squares problem, built row by row.

/// R and z of the QR factorisation of rows [J | r]: the sum of squares |J·d + r|² is |R·d + z|² + rest².
///
/// Rows enter by Givens rotations. Unlike normal equations that loses no digits, and it needs P² numbers however
/// many rows there are.
use kalmems_core::Portable;
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle<const P: usize> {
    /// Upper triangular.
    pub r: [[f64; P]; P],
    pub z: [f64; P],
    /// The part of the sum of squares that no d can remove.
    pub rest: f64,
}

impl<const P: usize> Triangle<P> {
    pub fn new() -> Self {
        Self { r: [[0.0; P]; P], z: [0.0; P], rest: 0.0 }
    }

    /// Adds a row.
    #[allow(clippy::needless_range_loop)] // a row for each sample: an adapter of iterators is a call
    pub fn push(&mut self, mut row: [f64; P], mut value: f64) {
        for i in 0..P {
            if row[i] == 0.0 {
                continue;
            }
            let length = self.r[i][i].portable_hypot(row[i]);
            let (c, s) = (self.r[i][i] / length, row[i] / length);
            for j in i..P {
                let (above, below) = (self.r[i][j], row[j]);
                self.r[i][j] = c * above + s * below;
                row[j] = c * below - s * above;
            }
            let (above, below) = (self.z[i], value);
            self.z[i] = c * above + s * below;
            value = c * below - s * above;
        }
        self.rest += value * value;
    }

    /// The length of each column of J.
    pub fn column_norms(&self) -> [f64; P] {
        std::array::from_fn(|j| (0..=j).map(|i| self.r[i][j].powi(2)).sum::<f64>().sqrt())
    }

    /// Jᵀ·r, half the gradient of the sum of squares.
    pub fn gradient(&self) -> [f64; P] {
        std::array::from_fn(|j| (0..=j).map(|i| self.r[i][j] * self.z[i]).sum())
    }

    /// |R·d|².
    pub fn square_of(&self, d: &[f64; P]) -> f64 {
        (0..P).map(|i| (i..P).map(|j| self.r[i][j] * d[j]).sum::<f64>().powi(2)).sum()
    }

    /// The d that makes |R·d + z| smallest. A column that R does not determine gets no part of it.
    pub fn solve(&self) -> [f64; P] {
        let mut d = [0.0; P];
        for i in (0..P).rev() {
            let rest: f64 = ((i + 1)..P).map(|j| self.r[i][j] * d[j]).sum();
            d[i] = if self.r[i][i] == 0.0 { 0.0 } else { -(self.z[i] + rest) / self.r[i][i] };
        }
        d
    }

    /// R⁻ᵀ·v, for a triangle without a zero on its diagonal.
    pub fn solve_transposed(&self, v: &[f64; P]) -> [f64; P] {
        let mut w = *v;
        for i in 0..P {
            let rest: f64 = (0..i).map(|j| self.r[j][i] * w[j]).sum();
            w[i] = if self.r[i][i] == 0.0 { 0.0 } else { (w[i] - rest) / self.r[i][i] };
        }
        w
    }

    /// The same with only some columns: the others are held.
    pub fn restricted(&self, free: &[bool; P]) -> Self {
        let mut kept = Self { rest: self.rest, ..Self::new() };
        for i in 0..P {
            let row = std::array::from_fn(|j| if free[j] { self.r[i][j] } else { 0.0 });
            kept.push(row, self.z[i]);
        }
        kept
    }
}
