//! What a kernel may do with its lanes, beside computing.

use super::packed::Packed;
use crate::Scalar;
use crate::math::Register;

/// A [`Scalar`] of [`WIDTH`](Lane::WIDTH) numbers side by side, each of type `F`; one number by itself is one of them.
///
/// Every operation works on each lane by itself and gives it the same bits that it gives one number. A comparison's
/// mask has a truth value for each lane.
///
/// ```
/// use kalmems_core::Scalar;
/// use kalmems_core::lanes::{Isa, Kernel, Lane};
/// struct SquareRoots<'a>(&'a mut [f64]);
/// impl Kernel<f64> for SquareRoots<'_> {
///     type Output = ();
///     #[inline(always)]
///     fn run<L: Lane<f64>>(self) {
///         for chunk in self.0.chunks_mut(L::WIDTH) {
///             L::load(chunk, 1.0).sqrt().store(chunk);
///         }
///     }
/// }
/// let mut numbers: Vec<f64> = (0..37).map(|i| f64::from(i * i)).collect();
/// Isa::Portable.run(SquareRoots(&mut numbers));
/// assert!(numbers.iter().zip(0..).all(|(x, i)| *x == f64::from(i)));
/// ```
pub trait Lane<F>: Scalar + Sealed {
    /// How many lanes.
    const WIDTH: usize;

    /// The same number in every lane.
    fn splat(value: F) -> Self;

    /// `f(i)` in lane `i`, asked in order.
    fn from_fn(f: impl FnMut(usize) -> F) -> Self;

    /// The first numbers of a slice; `rest` in the lanes for which it has none.
    fn load(values: &[F], rest: F) -> Self;

    /// Writes lane after lane, as many as the slice takes.
    fn store(self, values: &mut [F]);

    /// The number in one lane, if there is such a lane.
    fn lane(self, index: usize) -> Option<F>;

    /// Whether a mask is set in one lane; not if there is no such lane.
    fn is_set(mask: Self::Mask, index: usize) -> bool;
}

/// Lanes are sound only where [`super::Isa`] makes them.
pub trait Sealed {}

impl Sealed for f64 {}
impl Sealed for f32 {}
impl<V: Register> Sealed for Packed<V> {}

macro_rules! single {
    ($float:ident) => {
        impl Lane<$float> for $float {
            const WIDTH: usize = 1;

            #[inline(always)]
            fn splat(value: $float) -> Self {
                value
            }
            #[inline(always)]
            fn from_fn(f: impl FnMut(usize) -> $float) -> Self {
                Register::from_fn(f)
            }
            #[inline(always)]
            fn load(values: &[$float], rest: $float) -> Self {
                Register::load(values, rest)
            }
            #[inline(always)]
            fn store(self, values: &mut [$float]) {
                Register::store(self, values);
            }
            #[inline(always)]
            fn lane(self, index: usize) -> Option<$float> {
                Register::lane(self, index)
            }
            #[inline(always)]
            fn is_set(mask: bool, index: usize) -> bool {
                <Self as Register>::is_set(mask, index)
            }
        }
    };
}

single!(f64);
single!(f32);

impl<V: Register> Lane<V::Float> for Packed<V> {
    const WIDTH: usize = V::WIDTH;

    #[inline(always)]
    fn splat(value: V::Float) -> Self {
        Self(V::splat(value))
    }
    #[inline(always)]
    fn from_fn(f: impl FnMut(usize) -> V::Float) -> Self {
        Self(V::from_fn(f))
    }
    #[inline(always)]
    fn load(values: &[V::Float], rest: V::Float) -> Self {
        Self(V::load(values, rest))
    }
    #[inline(always)]
    fn store(self, values: &mut [V::Float]) {
        self.0.store(values);
    }
    #[inline(always)]
    fn lane(self, index: usize) -> Option<V::Float> {
        self.0.lane(index)
    }
    #[inline(always)]
    fn is_set(mask: V::Mask, index: usize) -> bool {
        V::is_set(mask, index)
    }
}
