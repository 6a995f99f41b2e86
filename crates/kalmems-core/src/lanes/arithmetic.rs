//! The arithmetic of types that are made of registers.

/// The four operations and the sign of a tuple of registers, each register by itself.
macro_rules! arithmetic {
    ($of:ident($($field:tt),+)) => {
        arithmetic!($of, Add, add, ($($field),+));
        arithmetic!($of, Sub, sub, ($($field),+));
        arithmetic!($of, Mul, mul, ($($field),+));
        arithmetic!($of, Div, div, ($($field),+));

        impl<V: Register> Neg for $of<V> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self($(-self.$field),+)
            }
        }
    };
    ($of:ident, $trait:ident, $method:ident, ($($field:tt),+)) => {
        impl<V: Register> $trait for $of<V> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self($(self.$field.$method(other.$field)),+)
            }
        }
    };
}

pub(super) use arithmetic;
