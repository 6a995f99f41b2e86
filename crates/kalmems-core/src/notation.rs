//! The notation of equations, as macros: `sum!(N, |k| a[k] * b[k])`, `vector!(|i| x[i] + k[i])`,
//! `matrix!(|i, j| …)` and `lower!(|i, j| …)` for the lower triangle of a covariance.
//!
//! They look like functions that take closures, and are loops. A closure cannot be marked for inlining, and one that is
//! not inlined into the function of its instruction set costs lanes a call for each operation: a hundred times the
//! operation. In all that filters do per sample write these, and no closure that computes.

use crate::{Mask, Mat, Scalar};

/// What an array holds before it is filled.
pub(crate) trait Blank: Copy {
    fn blank() -> Self;
}

impl<T: Scalar> Blank for T {
    #[inline(always)]
    fn blank() -> Self {
        T::of(0.0)
    }
}

impl<A: Blank, const N: usize> Blank for [A; N] {
    #[inline(always)]
    fn blank() -> Self {
        [A::blank(); N]
    }
}

/// How many elements, where an array's type is yet to be inferred.
#[inline(always)]
pub(crate) fn length<A, const N: usize>(_: &[A; N]) -> usize {
    N
}

/// How many rows and columns, where a matrix's type is yet to be inferred.
#[inline(always)]
pub(crate) fn size<T, const R: usize, const C: usize>(_: &Mat<T, R, C>) -> (usize, usize) {
    (R, C)
}

/// Where every element is finite.
#[inline(always)]
pub(crate) fn finite<T: Scalar, const N: usize>(array: &[T; N]) -> T::Mask {
    let mut finite = T::of(0.0).is_finite();
    for element in array {
        finite = finite.and(element.is_finite());
    }
    finite
}

/// Sets an element.
#[inline(always)]
pub(crate) fn set<A, const N: usize>(array: &mut [A; N], i: usize, value: A) {
    array[i] = value;
}

/// The number from which sums start: −0.0, the neutral element that a compiler may drop; 0.0 would turn −0.0 into 0.0
/// and stays.
#[inline(always)]
pub(crate) fn nothing<T: Scalar>() -> T {
    T::of(-0.0)
}

/// a + b, of one type: `+` alone would leave the total's open.
#[inline(always)]
pub(crate) fn plus<T: Scalar>(a: T, b: T) -> T {
    a + b
}

/// The sum of a term for k from 0 to below n; with a condition, of those for which it holds.
macro_rules! sum {
    ($n:expr, |$k:ident| $term:expr) => {
        sum!($n, |$k| true, |$k| $term)
    };
    ($n:expr, |$i:ident| $keep:expr, |$k:ident| $term:expr) => {{
        let mut total = $crate::notation::nothing();
        for $i in 0..$n {
            if $keep {
                let $k = $i;
                total = $crate::notation::plus(total, $term);
            }
        }
        total
    }};
}

/// `start` less a term for each k from 0 to below n, and `start` itself where there is none: x − (−0.0) is an
/// addition that stays.
macro_rules! less {
    ($start:expr, $n:expr, |$k:ident| $term:expr) => {{
        let mut rest = $start;
        for $k in 0..$n {
            rest = rest - $term;
        }
        rest
    }};
}

/// The array with this element at i.
macro_rules! vector {
    (|$i:ident| $element:expr) => {{
        let mut array = $crate::notation::Blank::blank();
        for $i in 0..$crate::notation::length(&array) {
            let element = $element;
            $crate::notation::set(&mut array, $i, element);
        }
        array
    }};
}

/// The matrix with this element in row i and column j.
macro_rules! matrix {
    (|$i:ident, $j:ident| $element:expr) => {{
        let mut matrix = $crate::Mat::zero();
        let (rows, columns) = $crate::notation::size(&matrix);
        for $i in 0..rows {
            for $j in 0..columns {
                let element = $element;
                $crate::notation::set(&mut matrix.0[$i], $j, element);
            }
        }
        matrix
    }};
}

/// The covariance with this element in row i and column j ≤ i.
macro_rules! lower {
    (|$i:ident, $j:ident| $element:expr) => {{
        let mut matrix = $crate::Mat::zero();
        let (rows, _) = $crate::notation::size(&matrix);
        for $i in 0..rows {
            // Over all columns: an inclusive range leaves bounds checks in large bodies.
            for $j in 0..rows {
                if $j <= $i {
                    let element = $element;
                    $crate::notation::set(&mut matrix.0[$i], $j, element);
                }
            }
        }
        $crate::Covariance::from_lower(matrix)
    }};
}

pub(crate) use {less, lower, matrix, sum, vector};
