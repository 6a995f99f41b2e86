//! Products of matrices of many rows and columns.
//!
//! Those of few are written out for each size, which is what makes filters of few states fast. These loops are compiled once for all sizes.
//! Each entry is summed in the same order as there, so that the numbers are the same to the last bit.

use crate::Scalar;
use crate::notation::{nothing, plus};

/// Whether a matrix product of so many rows, terms of a sum and columns is one of those here; products of dual numbers dissolve into their callers.
#[inline(always)]
pub(crate) const fn are_many<T>(rows: usize, terms: usize, columns: usize) -> bool {
    size_of::<T>() <= size_of::<f64>() && rows * terms * columns > 6 * 6 * 6
}

/// Row `i` of a matrix that is held row by row.
#[inline(always)]
fn row<T>(matrix: &[T], i: usize, columns: usize) -> Option<&[T]> {
    matrix.get(i * columns..)?.get(..columns)
}

/// A·B, each term added, or in one operation where a number has one.
#[inline(never)]
pub(crate) fn product<T: Scalar>(
    (a, terms): (&[T], usize),
    (b, columns): (&[T], usize),
    is_fused: bool,
    to: &mut [T],
) {
    for i in 0..to.len() / columns.max(1) {
        let Some(to) = to.get_mut(i * columns..).and_then(|rest| rest.get_mut(..columns)) else { return };
        for j in 0..columns {
            to[j] = nothing();
        }
        for k in 0..terms {
            let (Some(&factor), Some(other)) = (a.get(i * terms + k), row(b, k, columns)) else { return };
            for j in 0..columns {
                to[j] = if is_fused { to[j].mac(factor, other[j]) } else { plus(to[j], factor * other[j]) };
            }
        }
    }
}

/// The lower triangle of F·P·Fᵀ, from that of P of `n` states and with room for P and F·P.
#[inline(never)]
pub(crate) fn spread<T: Scalar>(f: &[T], (p, n): (&[T], usize), [whole, fp]: [&mut [T]; 2], to: &mut [T]) {
    for i in 0..n {
        for j in 0..n {
            let known = p.get(i.max(j) * n + i.min(j));
            if let (Some(to), Some(known)) = (whole.get_mut(i * n + j), known) {
                *to = *known;
            }
        }
    }
    product((f, n), (whole, n), true, fp);
    let rows = fp.len() / n.max(1);
    for i in 0..rows {
        for j in 0..=i {
            let (Some(one), Some(other)) = (row(fp, i, n), row(f, j, n)) else { return };
            let mut sum = nothing();
            for k in 0..n {
                sum = T::mac(sum, one[k], other[k]);
            }
            if let Some(to) = to.get_mut(i * rows + j) {
                *to = sum;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::are_many;
    use crate::notation::{matrix, sum};
    use crate::{Covariance, Mat};

    /// Numbers of many sizes, some of them zeros of either sign.
    fn filled<const R: usize, const C: usize>(seed: u32) -> Mat<f64, R, C> {
        let mut state = seed;
        let mut matrix = Mat::zero();
        for entry in matrix.0.as_flattened_mut() {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let number = f64::from(state) / f64::from(1_u32 << 31) - 1.0;
            *entry = if state.is_multiple_of(5) { 0.0_f64.copysign(number) } else { number.powi(5) };
        }
        matrix
    }

    fn bits<const R: usize, const C: usize>(matrix: &Mat<f64, R, C>) -> [[u64; C]; R] {
        matrix.0.map(|row| row.map(f64::to_bits))
    }

    #[test]
    fn products_of_many_states_are_those_written_out_to_the_last_bit() {
        assert!(are_many::<f64>(9, 7, 8) && are_many::<f32>(8, 9, 9) && !are_many::<f64>(6, 6, 6));
        assert!(!are_many::<[f64; 4]>(9, 7, 8));
        for seed in 0..50 {
            let (a, b) = (filled::<9, 7>(seed), filled::<7, 8>(seed + 1000));
            let written_out: Mat<f64, 9, 8> = matrix!(|i, j| sum!(7, |k| a.0[i][k] * b.0[k][j]));
            assert_eq!(bits(&a.times(&b)), bits(&written_out));
            let (f, p) = (filled::<8, 9>(seed), Covariance::from_lower(filled::<9, 9>(seed + 2000)));
            let (called, written_out) = (p.transformed(&f), p.transformed_where(&f, |_, _| true));
            assert_eq!(bits(called.lower_triangle()), bits(written_out.lower_triangle()));
        }
    }
}
