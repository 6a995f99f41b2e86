//! Sums of squares without forming them.

use super::{Mat, epsilon};
use crate::Scalar;
use crate::notation::{sum, vector};

/// The lower triangular X with X·Xᵀ = Σ B·Bᵀ over the blocks of `top`, by Householder reflections of [B₁ B₂
/// …] from the right (Householder, J. ACM 5, 339, 1958). No square is formed: X keeps the digits that Σ B·Bᵀ
/// would lose.
///
/// What stands `below` is reflected along. Its part in X's columns is the second answer, Y; the rest stays in
/// `below`.
///
/// The diagonal of X is not negative. Where a row has nothing new beside those before it but 8·N·ε of its
/// length, which is rounding, that column of X and Y is zero, and what stands there takes part in the next
/// rows. So Y = G·X has a solution even where X is singular.
#[inline(always)]
pub(crate) fn reduced<T: Scalar, const N: usize, const K: usize, const B: usize>(
    mut top: [Mat<T, N, N>; K],
    below: &mut [[Mat<T, N, N>; K]; B],
) -> (Mat<T, N, N>, [Mat<T, N, N>; B]) {
    let (zero, one) = (T::of(0.0), T::of(1.0));
    let tolerance = (epsilon::<T>() * T::of(8.0 * N as f64)).sq();
    let square_of = |row: &[[T; N]; K]| sum!(K, |b| sum!(N, |k| row[b][k].sq()));
    let whole: [T; N] = vector!(|i| square_of(&vector!(|b| top[b].0[i])));
    let (mut x, mut y) = (Mat::zero(), [Mat::zero(); B]);
    for j in 0..N {
        // Row j becomes a single number. The columns that earlier rows took are zero here by now.
        let mut v: [[T; N]; K] = vector!(|b| top[b].0[j]);
        let square = square_of(&v);
        let norm = square.sqrt();
        let news = square.gt(whole[j] * tolerance);
        // v = row ± ‖row‖·e_j with the sign of the head, so that nothing cancels; v·v/2 = ‖row‖·(‖row‖ +
        // |head|).
        let head = v[0][j];
        let negative = head.lt(zero);
        let half_square = norm * (norm + head.abs());
        let scale = T::select(news, T::select(news, half_square, one).recip(), zero);
        v[0][j] = T::select(negative, head - norm, head + norm);
        // The reflected head is ∓‖row‖: the column changes its sign where that is negative.
        let reflect = |blocks: &mut [Mat<T, N, N>; K], i: usize| -> T {
            let along = sum!(K, |b| sum!(N, |k| blocks[b].0[i][k] * v[b][k])) * scale;
            for b in 0..K {
                for k in 0..N {
                    blocks[b].0[i][k] = blocks[b].0[i][k] - along * v[b][k];
                }
            }
            let column = blocks[0].0[i][j];
            blocks[0].0[i][j] = T::select(news, zero, column);
            T::select(news, T::select(negative, column, -column), zero)
        };
        for i in (j + 1)..N {
            x.0[i][j] = reflect(&mut top, i);
        }
        for (blocks, y) in below.iter_mut().zip(&mut y) {
            for i in 0..N {
                y.0[i][j] = reflect(blocks, i);
            }
        }
        x.0[j][j] = T::select(news, norm, zero);
    }
    (x, y)
}

#[cfg(test)]
mod tests {
    use super::reduced;
    use crate::Mat;

    fn triangularised<const K: usize, const N: usize>(blocks: [Mat<f64, N, N>; K]) -> Mat<f64, N, N> {
        reduced(blocks, &mut []).0
    }

    #[test]
    fn the_squares_add_up_and_the_factor_is_triangular() {
        let blocks = [
            Mat([[-1.0_f64, 2.0, 0.5], [0.0, 3.0, -4.0], [1.0, 1.0, 1.0]]),
            Mat([[0.25, 0.0, 0.0], [7.0, -1.0, 2.0], [0.0, 0.0, 3.0]]),
        ];
        let l = triangularised(blocks);
        let wanted = blocks[0].times_transposed(&blocks[0]).plus(&blocks[1].times_transposed(&blocks[1]));
        let squared = l.times_transposed(&l);
        for i in 0..3 {
            for j in 0..3 {
                assert!((squared[(i, j)] - wanted[(i, j)]).abs() < 1e-13, "{squared:?} {wanted:?}");
                assert!(j <= i || l[(i, j)] == 0.0, "{l:?}");
            }
            assert!(l[(i, i)] > 0.0);
        }
    }

    #[test]
    fn a_singular_sum_keeps_its_zeros() {
        // One source that moves the second and third state, and nothing the first.
        let l = triangularised([Mat([[0.0_f64, 0.0, 0.0], [0.0, 3.0, 4.0], [0.0, 6.0, 8.0]])]);
        assert_eq!(l.0[0], [0.0; 3]);
        assert!((l[(1, 1)] - 5.0).abs() < 1e-15 && (l[(2, 1)] - 10.0).abs() < 4e-15, "{l:?}");
        assert_eq!(l[(2, 2)], 0.0);
    }

    #[test]
    fn what_stands_below_is_a_gain_and_a_rest_even_where_the_top_is_singular() {
        // The third row depends on the first two but for rounding; nothing below does.
        let (a, b) = ([1.0_f64 / 3.0, 2.0, -1.0 / 7.0], [0.3, 1.0 / 11.0, 0.7]);
        let top = [Mat([a, b, core::array::from_fn(|k| 0.1 * a[k] + 1.3 * b[k])]), Mat::zero()];
        let bottom = [Mat([[2.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 3.0, 5.0]]), Mat::identity()];
        let mut below = [bottom];
        let (x, [y]) = reduced(top, &mut below);
        assert!(x[(0, 0)] > 0.0 && x[(1, 1)] > 0.0 && x[(2, 2)] == 0.0, "{x:?}");
        let square = |blocks: &[Mat<f64, 3, 3>; 2], with: &[Mat<f64, 3, 3>; 2]| {
            blocks[0].times_transposed(&with[0]).plus(&blocks[1].times_transposed(&with[1]))
        };
        let rest = square(&below[0], &below[0]);
        for (ours, wanted) in [
            (x.times_transposed(&x), square(&top, &top)),
            (y.times_transposed(&x), square(&bottom, &top)),
            (y.times_transposed(&y).plus(&rest), square(&bottom, &bottom)),
        ] {
            for i in 0..3 {
                for j in 0..3 {
                    assert!((ours[(i, j)] - wanted[(i, j)]).abs() < 2e-14, "{ours:?} {wanted:?}");
                }
            }
        }
    }

    #[test]
    fn digits_survive_that_a_square_would_lose() {
        // 1 + 1e-20 is 1: the Cholesky factor of the sum would have a zero where L has 1e-10.
        let l = triangularised([Mat([[1.0_f64, 0.0], [1.0, 0.0]]), Mat([[0.0, 0.0], [1e-10, 0.0]])]);
        assert!((l[(1, 1)] - 1e-10).abs() < 1e-25, "{l:?}");
    }
}
