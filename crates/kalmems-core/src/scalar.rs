//! The numbers that models and filters are written over.

use crate::{Dual, math};
use core::ops::{Add, Div, Mul, Neg, Sub};

/// A real number, or one with its derivatives. Physics is written once over this trait.
///
/// Elementary functions are within 2 units in the last place, and the crate's own, not the platform's: the same input
/// gives the same bytes everywhere. `tests/math.rs` measures them.
///
/// ```
/// use kalmems_core::Scalar;
/// /// The larger of two numbers, without a branch.
/// fn larger<S: Scalar>(a: S, b: S) -> S {
///     S::select(a.gt(b), a, b)
/// }
/// assert_eq!(larger(2.0_f32, 3.0), 3.0);
/// ```
pub trait Scalar:
    Copy
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A constant, rounded to this number's precision.
    fn of(value: f64) -> Self;
    /// `self < other`; false where either is not a number.
    fn lt(self, other: Self) -> bool;
    /// `self > other`; false where either is not a number.
    #[inline(always)]
    fn gt(self, other: Self) -> bool {
        other.lt(self)
    }
    /// Neither infinite nor not a number.
    fn is_finite(self) -> bool;
    /// `yes` where the condition holds, `no` elsewhere.
    #[must_use]
    fn select(condition: bool, yes: Self, no: Self) -> Self;
    /// `self + a·b`.
    #[inline(always)]
    #[must_use]
    fn mac(self, a: Self, b: Self) -> Self {
        self + a * b
    }
    /// |x|.
    #[inline(always)]
    #[must_use]
    fn abs(self) -> Self {
        Self::select(self.lt(Self::of(0.0)), -self, self)
    }
    /// √x.
    #[must_use]
    fn sqrt(self) -> Self;
    /// eˣ.
    #[must_use]
    fn exp(self) -> Self;
    /// The natural logarithm.
    #[must_use]
    fn ln(self) -> Self;
    /// The sine of an angle in radians.
    #[must_use]
    fn sin(self) -> Self;
    /// The cosine of an angle in radians.
    #[must_use]
    fn cos(self) -> Self;
    /// The inverse hyperbolic tangent.
    #[must_use]
    fn atanh(self) -> Self;
    /// 1/x.
    #[inline(always)]
    #[must_use]
    fn recip(self) -> Self {
        Self::of(1.0) / self
    }
    /// x².
    #[inline(always)]
    #[must_use]
    fn sq(self) -> Self {
        self * self
    }
    /// 2x.
    #[inline(always)]
    #[must_use]
    fn twice(self) -> Self {
        self + self
    }
    /// x/2.
    #[inline(always)]
    #[must_use]
    fn half(self) -> Self {
        self * Self::of(0.5)
    }
}

/// A number that numbers of type `T` can enter: `T` itself, or a [`Dual`](crate::Dual) over it.
///
/// A model holds its parameters as `T` and computes in any `S: Over<T>`; that is how one definition gives the
/// value and its Jacobian. A product of `S` with a parameter costs no derivative of the parameter.
///
/// ```
/// use kalmems_core::{Dual, Over, Scalar};
/// fn force<T: Scalar, S: Over<T>>(stiffness: T, x: S) -> S {
///     x * stiffness
/// }
/// assert_eq!(force(3.0, 2.0), 6.0);
/// assert_eq!(force(3.0, Dual::<f64, 1>::variable(2.0, 0)).gradient(), [3.0]);
/// ```
pub trait Over<T: Scalar>:
    Scalar + Add<T, Output = Self> + Sub<T, Output = Self> + Mul<T, Output = Self>
{
    /// A constant.
    fn lift(value: T) -> Self;

    /// `self + a·b` with a constant b.
    #[inline(always)]
    #[must_use]
    fn mac_by(self, a: Self, b: T) -> Self {
        self + a * b
    }

    /// This number as the only variable, for a function of it alone; [`chained`](Over::chained) leads back.
    ///
    /// The same value and derivatives as the function itself; but where this number carries the derivatives by all
    /// states of a model, each operation of the function would carry them all.
    ///
    /// ```
    /// use kalmems_core::{Dual, Over, Scalar};
    /// fn bell<S: Over<f64>>(x: S) -> S {
    ///     let alone = x.alone();
    ///     x.chained((-alone.sq()).exp())
    /// }
    /// let x = Dual::<f64, 3>::variable(0.5, 1);
    /// assert_eq!(bell(0.5), bell(x).value());
    /// assert_eq!(bell(x).gradient(), [0.0, -bell(0.5), 0.0]);
    /// ```
    fn alone(self) -> Dual<T, 1>;

    /// What a function made of it [alone](Over::alone), with this number's derivatives by the chain rule.
    #[must_use]
    fn chained(self, y: Dual<T, 1>) -> Self;
}

impl<T: Scalar> Over<T> for T {
    #[inline(always)]
    fn lift(value: T) -> Self {
        value
    }
    #[inline(always)]
    fn mac_by(self, a: T, b: T) -> T {
        self.mac(a, b)
    }
    #[inline(always)]
    fn alone(self) -> Dual<T, 1> {
        Dual::variable(self, 0)
    }
    #[inline(always)]
    fn chained(self, y: Dual<T, 1>) -> Self {
        // The derivative is asked for by nobody, and not computed.
        y.value()
    }
}

/// Functions of a number that are those of `math`.
macro_rules! each {
    ($($method:ident = $function:path),*) => {$(
        #[inline(always)]
        fn $method(self) -> Self {
            $function(self)
        }
    )*};
}

macro_rules! float {
    ($t:ident) => {
        impl Scalar for $t {
            #[inline(always)]
            #[allow(clippy::cast_possible_truncation)] // rounding a constant to f32 is what `of` says
            fn of(value: f64) -> Self {
                value as Self
            }
            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn is_finite(self) -> bool {
                math::Register::is_finite(self)
            }
            #[inline(always)]
            fn select(condition: bool, yes: Self, no: Self) -> Self {
                if condition { yes } else { no }
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $t::abs(self)
            }
            #[inline(always)]
            fn mac(self, a: Self, b: Self) -> Self {
                math::Register::mac(self, a, b)
            }
            each!(sqrt = math::Register::sqrt);
            each!(exp = math::exp, ln = math::ln, sin = math::sin, cos = math::cos, atanh = math::atanh);
        }
    };
}

float!(f64);
float!(f32);
