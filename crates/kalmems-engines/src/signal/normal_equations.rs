//! Linear least squares by their normal equations.

use kalmems_core::{Covariance, Ldl, Mat};

/// AᵀA·p = Aᵀy, summed row by row of A.
pub(crate) struct NormalEquations<const P: usize> {
    /// AᵀA, its lower triangle.
    pub(crate) matrix: Mat<f64, P, P>,
    /// Aᵀy.
    pub(crate) right: [f64; P],
}

impl<const P: usize> NormalEquations<P> {
    /// Of no rows.
    pub(crate) fn new() -> Self {
        Self { matrix: Mat::zero(), right: [0.0; P] }
    }

    /// Adds a row of A with its y.
    pub(crate) fn add(&mut self, row: &[f64; P], y: f64) {
        for i in 0..P {
            for j in 0..=i {
                self.matrix.0[i][j] += row[i] * row[j];
            }
            self.right[i] += row[i] * y;
        }
    }

    /// p, and whether AᵀA is positive definite, without which p means nothing.
    pub(crate) fn solve(&self) -> ([f64; P], bool) {
        let ldl = Ldl::of(&Covariance::from_lower(self.matrix));
        (ldl.solve(&self.right), ldl.positive)
    }
}
