//! The notation of equations, as macros: `sum!(N, |k| a[k] * b[k])`, `vector!(|i| x[i] + k[i])`,
//! `matrix!(|i, j| …)` and `lower!(|i, j| …)` for the lower triangle of a covariance.
//!
//! They look like functions that take closures, and are loops. A closure cannot be marked for inlining, and one that is
//! not inlined costs a call for each operation. In all that filters do per sample write these, and no closure that computes.

use crate::{Mat, Scalar};

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

/// Whether numbers are finite, looked at together: 0·x is zero where x is finite and not a number elsewhere, and so is
/// their sum.
///
/// One product and sum for each number and one look at the end; a look at each would cost a small processor three times
/// as much.
#[derive(Clone, Copy)]
pub(crate) struct Zeros<T>(Option<T>);

impl<T: Scalar> Zeros<T> {
    /// Of no numbers.
    #[inline(always)]
    pub fn none() -> Self {
        Self(None)
    }

    /// With one more number.
    #[inline(always)]
    pub fn with(self, x: T) -> Self {
        let zero = T::of(0.0);
        Self(Some(match self.0 {
            Some(sum) => sum.mac(x, zero),
            None => x * zero,
        }))
    }

    /// With all of an array.
    #[inline(always)]
    pub fn with_all<const N: usize>(mut self, array: &[T; N]) -> Self {
        for element in array {
            self = self.with(*element);
        }
        self
    }

    /// Where all of them were finite.
    #[inline(always)]
    pub fn finite(self) -> bool {
        self.finite_and_positive(&[T::of(1.0)])
    }

    /// Where all of them were finite and these are positive.
    #[inline(always)]
    pub fn finite_and_positive<const N: usize>(self, others: &[T; N]) -> bool {
        // Zero, or not a number and below nothing.
        let zero = self.0.unwrap_or(T::of(0.0));
        let mut below = T::of(0.0).is_finite();
        for other in others {
            below &= zero.lt(*other);
        }
        below
    }
}

/// Where every element is finite.
#[inline(always)]
pub(crate) fn finite<T: Scalar, const N: usize>(array: &[T; N]) -> bool {
    Zeros::none().with_all(array).finite()
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

/// The sum of products a·b for k from 0 to below n, of those for which the condition holds: the numbers of
/// `sum!(n, |k| keep, |k| a * b)`, and fused where [`Scalar::mac`] is. The first is a product alone.
macro_rules! dot {
    ($n:expr, |$k:ident| $a:expr, $b:expr) => {
        dot!($n, |$k| true, |$k| $a, $b)
    };
    ($n:expr, |$i:ident| $keep:expr, |$k:ident| $a:expr, $b:expr) => {{
        let mut total = $crate::notation::nothing();
        let mut begun = false;
        for $i in 0..$n {
            if $keep {
                let $k = $i;
                total = if begun { $crate::Scalar::mac(total, $a, $b) } else { $a * $b };
                begun = true;
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

pub(crate) use {dot, less, lower, matrix, sum, vector};
