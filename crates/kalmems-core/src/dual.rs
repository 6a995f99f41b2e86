//! Numbers that carry their derivatives.

use crate::notation::vector;
use crate::{Over, Scalar};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A value and its gradient with respect to `N` variables: forward-mode differentiation.
///
/// ```
/// use kalmems_core::{Dual, Scalar};
/// let x = Dual::<f64, 2>::variable(0.5, 0);
/// let y = Dual::variable(2.0, 1);
/// let f = x.sin() * y;
/// assert_eq!(f.value(), 0.5_f64.sin() * 2.0);
/// assert_eq!(f.gradient(), [0.5_f64.cos() * 2.0, 0.5_f64.sin()]);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Dual<T, const N: usize> {
    value: T,
    gradient: [T; N],
}

impl<T: Scalar, const N: usize> Dual<T, N> {
    /// A value with its derivatives.
    #[inline(always)]
    pub const fn new(value: T, gradient: [T; N]) -> Self {
        Self { value, gradient }
    }

    /// A constant.
    #[inline(always)]
    pub fn constant(value: T) -> Self {
        Self { value, gradient: [T::of(-0.0); N] }
    }

    /// The variable with this index.
    #[inline(always)]
    pub fn variable(value: T, index: usize) -> Self {
        Self { value, gradient: vector!(|i| T::of(if i == index { 1.0 } else { -0.0 })) }
    }

    /// All variables of a vector, each with its own index.
    #[inline(always)]
    pub fn variables(values: &[T; N]) -> [Self; N] {
        vector!(|i| Self::variable(values[i], i))
    }

    /// The value.
    #[inline(always)]
    pub fn value(self) -> T {
        self.value
    }

    /// The derivatives with respect to each variable.
    #[inline(always)]
    pub fn gradient(self) -> [T; N] {
        self.gradient
    }

    /// `value`, with the gradient times `slope`: the chain rule.
    #[inline(always)]
    fn chain(self, value: T, slope: T) -> Self {
        Self { value, gradient: vector!(|i| self.gradient[i] * slope) }
    }
}

impl<T: Scalar, const N: usize> Add for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, gradient: vector!(|i| self.gradient[i] + other.gradient[i]) }
    }
}

impl<T: Scalar, const N: usize> Sub for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, gradient: vector!(|i| self.gradient[i] - other.gradient[i]) }
    }
}

impl<T: Scalar, const N: usize> Mul for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        let (u, v) = (self.value, other.value);
        Self { value: u * v, gradient: vector!(|i| (self.gradient[i] * v).mac(u, other.gradient[i])) }
    }
}

impl<T: Scalar, const N: usize> Div for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    #[allow(clippy::suspicious_arithmetic_impl)] // the quotient rule has a product and a difference
    fn div(self, other: Self) -> Self {
        // The value exactly as plain numbers give it; the gradient may use the reciprocal.
        let quotient = self.value / other.value;
        let recip = other.value.recip();
        Self {
            value: quotient,
            gradient: vector!(|i| (self.gradient[i] - quotient * other.gradient[i]) * recip),
        }
    }
}

impl<T: Scalar, const N: usize> Neg for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, gradient: vector!(|i| -self.gradient[i]) }
    }
}

impl<T: Scalar, const N: usize> Add<T> for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: T) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl<T: Scalar, const N: usize> Sub<T> for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: T) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl<T: Scalar, const N: usize> Mul<T> for Dual<T, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: T) -> Self {
        self.chain(self.value * other, other)
    }
}

/// a·slope, and a itself where it is zero.
#[inline(always)]
fn scaled<T: Scalar>(a: T, slope: T) -> T {
    let zero = T::of(0.0);
    T::select(a.lt(zero) | zero.lt(a), a * slope, a)
}

impl<T: Scalar, const N: usize> Over<T> for Dual<T, N> {
    #[inline(always)]
    fn lift(value: T) -> Self {
        Self::constant(value)
    }
    #[inline(always)]
    fn mac_by(self, a: Self, b: T) -> Self {
        let gradient = vector!(|i| self.gradient[i] + a.gradient[i] * b);
        Self { value: self.value.mac(a.value, b), gradient }
    }
    #[inline(always)]
    fn alone(self) -> Dual<T, 1> {
        Dual::variable(self.value, 0)
    }
    #[inline(always)]
    fn chained(self, y: Dual<T, 1>) -> Self {
        let [slope] = y.gradient;
        // What does not depend on a variable is left as it is: the compiler sees that it is constant, which a
        // product with the slope would hide.
        Self { value: y.value, gradient: vector!(|i| scaled(self.gradient[i], slope)) }
    }
}

impl<T: Scalar, const N: usize> Scalar for Dual<T, N> {
    #[inline(always)]
    fn of(value: f64) -> Self {
        Self::constant(T::of(value))
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self.value.lt(other.value)
    }
    #[inline(always)]
    fn is_finite(self) -> bool {
        self.value.is_finite()
    }
    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        Self {
            value: T::select(mask, yes.value, no.value),
            gradient: vector!(|i| T::select(mask, yes.gradient[i], no.gradient[i])),
        }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, root.twice().recip())
    }
    #[inline(always)]
    fn exp(self) -> Self {
        let e = self.value.exp();
        self.chain(e, e)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.chain(self.value.ln(), self.value.recip())
    }
    #[inline(always)]
    fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }
    #[inline(always)]
    fn cos(self) -> Self {
        self.chain(self.value.cos(), -self.value.sin())
    }
    #[inline(always)]
    fn atanh(self) -> Self {
        self.chain(self.value.atanh(), (T::of(1.0) - self.value.sq()).recip())
    }
    #[inline(always)]
    fn twice(self) -> Self {
        self.chain(self.value.twice(), T::of(2.0))
    }
    #[inline(always)]
    fn half(self) -> Self {
        self.chain(self.value.half(), T::of(0.5))
    }
    #[inline(always)]
    fn sq(self) -> Self {
        self.chain(self.value.sq(), self.value.twice())
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let r = self.value.recip();
        self.chain(r, -r.sq())
    }
}
