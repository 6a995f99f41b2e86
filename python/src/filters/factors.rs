//! Covariances taken apart.

/// C = U·D·Uᵀ with U lower triangular, ones on its diagonal and D ≥ 0, of a covariance row by row; `false` of what is none. A pivot below the rounding
/// of its variance is zero.
pub fn factor(matrix: &[f64], count: usize, lower: &mut [f64], variances: &mut [f64]) -> bool {
    for j in 0..count {
        lower[j * count..(j + 1) * count].fill(0.0);
        lower[j * count + j] = 1.0;
    }
    for j in 0..count {
        let known: f64 = (0..j).map(|k| lower[j * count + k].powi(2) * variances[k]).sum();
        let whole = matrix[j * count + j];
        let rounding = 8.0 * count as f64 * f64::EPSILON * whole.abs();
        let left = whole - known;
        if left.is_nan() || left < -rounding {
            return false;
        }
        variances[j] = if left > rounding { left } else { 0.0 };
        if variances[j] == 0.0 {
            continue;
        }
        for i in j + 1..count {
            let known: f64 = (0..j).map(|k| lower[i * count + k] * lower[j * count + k] * variances[k]).sum();
            lower[i * count + j] = (matrix[i * count + j] - known) / left;
        }
    }
    true
}

/// Σ zᵢ²/dᵢ with z = U⁻¹·b, which takes the place of b.
pub fn normalised_square(lower: &[f64], variances: &[f64], b: &mut [f64]) -> f64 {
    let count = b.len();
    let mut sum = 0.0;
    for i in 0..count {
        let (before, own) = b.split_at_mut(i);
        own[0] -= dot(&lower[i * count..i * count + i], before);
        sum += own[0] * own[0] / variances[i];
    }
    sum
}

/// A row of U⁻¹, written to `to`.
pub fn row_of_inverse(lower: &[f64], row: usize, to: &mut [f64]) {
    let count = to.len();
    to.fill(0.0);
    to[row] = 1.0;
    for i in (0..row).rev() {
        to[i] = -(i + 1..=row).map(|j| lower[j * count + i] * to[j]).sum::<f64>();
    }
}

pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
