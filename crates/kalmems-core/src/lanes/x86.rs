//! The registers of AVX2 and AVX-512.
//!
//! An instruction that a machine has not is undefined behaviour, and the operators of these registers are safe
//! functions. What makes them sound: the types are private to this folder, no public item names them, and code over
//! them is instantiated in the four functions `run_…` below alone, which look for the instructions first. A kernel
//! gets them as a type parameter that it cannot carry out of its `run`, or only into code that runs after it.

#![allow(unsafe_code)]

use super::Kernel;
use super::packed::Packed;
use super::pair::Pair;
use crate::Mask;
use crate::math::{Constants, Register};
use core::arch::x86_64::{
    __m256, __m256d, __m512, __m512d, _CMP_LT_OQ, _mm256_add_epi32, _mm256_add_epi64, _mm256_add_pd,
    _mm256_add_ps, _mm256_and_pd, _mm256_and_ps, _mm256_blendv_pd, _mm256_blendv_ps, _mm256_castpd_si256,
    _mm256_castps_si256, _mm256_castsi256_pd, _mm256_castsi256_ps, _mm256_cmp_pd, _mm256_cmp_ps,
    _mm256_cmpgt_epi32, _mm256_cmpgt_epi64, _mm256_div_pd, _mm256_div_ps, _mm256_max_pd, _mm256_max_ps,
    _mm256_min_pd, _mm256_min_ps, _mm256_movemask_pd, _mm256_movemask_ps, _mm256_mul_pd, _mm256_mul_ps,
    _mm256_or_pd, _mm256_or_ps, _mm256_set1_pd, _mm256_set1_ps, _mm256_slli_epi32, _mm256_slli_epi64,
    _mm256_sqrt_pd, _mm256_sqrt_ps, _mm256_srli_epi32, _mm256_srli_epi64, _mm256_sub_epi32, _mm256_sub_epi64,
    _mm256_sub_pd, _mm256_sub_ps, _mm256_xor_pd, _mm256_xor_ps, _mm512_add_epi32, _mm512_add_epi64,
    _mm512_add_pd, _mm512_add_ps, _mm512_and_pd, _mm512_and_ps, _mm512_castpd_si512, _mm512_castps_si512,
    _mm512_castsi512_pd, _mm512_castsi512_ps, _mm512_cmp_pd_mask, _mm512_cmp_ps_mask,
    _mm512_cmplt_epi32_mask, _mm512_cmplt_epi64_mask, _mm512_div_pd, _mm512_div_ps, _mm512_mask_blend_pd,
    _mm512_mask_blend_ps, _mm512_max_pd, _mm512_max_ps, _mm512_min_pd, _mm512_min_ps, _mm512_mul_pd,
    _mm512_mul_ps, _mm512_set1_pd, _mm512_set1_ps, _mm512_setzero_si512, _mm512_slli_epi32,
    _mm512_slli_epi64, _mm512_sqrt_pd, _mm512_sqrt_ps, _mm512_srli_epi32, _mm512_srli_epi64,
    _mm512_sub_epi32, _mm512_sub_epi64, _mm512_sub_pd, _mm512_sub_ps, _mm512_xor_pd, _mm512_xor_ps,
};
use core::array;
use core::mem::transmute;
use core::ops::{Add, Div, Mul, Neg, Sub};

cpufeatures::new!(avx2, "avx2");
cpufeatures::new!(avx512, "avx512f", "avx512dq");

/// Whether this machine and its operating system have AVX2.
pub(super) fn has_avx2() -> bool {
    avx2::get()
}

/// Whether this machine and its operating system have AVX-512F and AVX-512DQ.
pub(super) fn has_avx512() -> bool {
    avx512::get()
}

/// The function that a kernel is compiled into, and the one that looks before it calls it.
macro_rules! entry {
    ($run:ident, $float:ident, $register:ident, $has:ident, $features:literal) => {
        /// Runs a kernel with these registers, where this machine has them.
        #[inline]
        pub(super) fn $run<K: Kernel<$float>>(kernel: K) -> Option<K::Output> {
            #[target_feature(enable = $features)]
            fn inside<K: Kernel<$float>>(kernel: K) -> K::Output {
                kernel.run::<Packed<Pair<$register>>>()
            }
            // SAFETY: the features that the function is compiled for are there.
            $has().then(|| unsafe { inside(kernel) })
        }
    };
}

entry!(run_avx2_f64, f64, Avx2F64, has_avx2, "avx2");
entry!(run_avx2_f32, f32, Avx2F32, has_avx2, "avx2");
entry!(run_avx512_f64, f64, Avx512F64, has_avx512, "avx512f,avx512dq");
entry!(run_avx512_f32, f32, Avx512F32, has_avx512, "avx512f,avx512dq");

/// An operator that is one instruction.
macro_rules! operator {
    ($register:ident, $trait:ident, $method:ident, $instruction:ident) => {
        impl $trait for $register {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                // SAFETY: code over this type runs only where its instructions are; see above.
                Self(unsafe { $instruction(self.0, other.0) })
            }
        }
    };
}

/// Methods with two operands that are one instruction.
macro_rules! instructions {
    ($($method:ident $instruction:ident),*) => {$(
        #[inline(always)]
        fn $method(self, other: Self) -> Self {
            // SAFETY: code over this type runs only where its instructions are; see above.
            Self(unsafe { $instruction(self.0, other.0) })
        }
    )*};
}

/// What the registers of both sets have in common.
macro_rules! register {
    (
        $register:ident, $raw:ident, $float:ident, $width:literal, $mask:ident,
        add $add:ident, sub $sub:ident, mul $mul:ident, div $div:ident, sqrt $sqrt:ident, min $min:ident,
        max $max:ident, set1 $set1:ident, and $and:ident, xor $xor:ident,
        bits $bits:ident, float $from_bits:ident, plus $plus:ident, minus $minus:ident, left $left:ident,
        right $right:ident, mantissa $mantissa:literal, top $top:literal
    ) => {
        #[derive(Clone, Copy, Debug)]
        pub struct $register($raw);

        operator!($register, Add, add, $add);
        operator!($register, Sub, sub, $sub);
        operator!($register, Mul, mul, $mul);
        operator!($register, Div, div, $div);

        impl Neg for $register {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                self.xor(Self::splat($float::SIGN))
            }
        }

        impl $register {
            #[inline(always)]
            fn from_array(values: [$float; $width]) -> Self {
                // SAFETY: both are the same numbers in the same order, and any bits are valid.
                Self(unsafe { transmute::<[$float; $width], $raw>(values) })
            }
            #[inline(always)]
            fn to_array(self) -> [$float; $width] {
                // SAFETY: as above.
                unsafe { transmute::<$raw, [$float; $width]>(self.0) }
            }
        }

        // SAFETY, of every instruction below: code over this type runs only where its instructions are; see above.
        impl Register for $register {
            type Float = $float;
            type Mask = $mask;
            const WIDTH: usize = $width;

            #[inline(always)]
            fn from_fn(f: impl FnMut(usize) -> $float) -> Self {
                Self::from_array(array::from_fn(f))
            }
            #[inline(always)]
            fn load(values: &[$float], rest: $float) -> Self {
                match values.first_chunk::<$width>() {
                    Some(values) => Self::from_array(*values),
                    None => Self::from_fn(|i| values.get(i).copied().unwrap_or(rest)),
                }
            }
            #[inline(always)]
            fn store(self, values: &mut [$float]) {
                match values.first_chunk_mut::<$width>() {
                    Some(values) => *values = self.to_array(),
                    None => {
                        for (to, from) in values.iter_mut().zip(self.to_array()) {
                            *to = from;
                        }
                    }
                }
            }
            #[inline(always)]
            fn lane(self, index: usize) -> Option<$float> {
                self.to_array().get(index).copied()
            }
            #[inline(always)]
            fn is_set(mask: $mask, index: usize) -> bool {
                index < $width && (mask.bits() >> index) & 1 != 0
            }

            #[inline(always)]
            fn splat(value: $float) -> Self {
                Self(unsafe { $set1(value) })
            }
            #[inline(always)]
            fn lt(self, other: Self) -> $mask {
                $mask::less(self.0, other.0)
            }
            #[inline(always)]
            fn select(mask: $mask, yes: Self, no: Self) -> Self {
                Self(mask.choose(yes.0, no.0))
            }
            // Both give the second operand where either is not a number.
            #[inline(always)]
            fn at_most(self, bound: Self) -> Self {
                Self(unsafe { $min(bound.0, self.0) })
            }
            #[inline(always)]
            fn at_least(self, bound: Self) -> Self {
                Self(unsafe { $max(bound.0, self.0) })
            }
            #[inline(always)]
            fn is_finite(self) -> $mask {
                $mask::bits_less(self.abs().0, Self::splat($float::INFINITY).0)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(unsafe { $sqrt(self.0) })
            }
            #[cold]
            #[inline(never)]
            fn map(self, f: fn($float) -> $float) -> Self {
                Self::from_array(self.to_array().map(f))
            }

            instructions!(and $and, xor $xor);
            #[inline(always)]
            fn plus_bits(self, other: Self) -> Self {
                Self(unsafe { $from_bits($plus($bits(self.0), $bits(other.0))) })
            }
            #[inline(always)]
            fn minus_bits(self, other: Self) -> Self {
                Self(unsafe { $from_bits($minus($bits(self.0), $bits(other.0))) })
            }
            #[inline(always)]
            fn halved_bits(self) -> Self {
                Self(unsafe { $from_bits($right::<1>($bits(self.0))) })
            }
            #[inline(always)]
            fn exponent_as_integer(self) -> Self {
                Self(unsafe { $from_bits($right::<$mantissa>($bits(self.0))) })
            }
            #[inline(always)]
            fn integer_as_exponent(self) -> Self {
                Self(unsafe { $from_bits($left::<$mantissa>($bits(self.0))) })
            }
            #[inline(always)]
            fn second_bit_as_sign(self) -> Self {
                Self(unsafe { $from_bits($left::<{ $top - 1 }>($bits(self.0))) })
            }
            #[inline(always)]
            fn is_odd(self) -> $mask {
                $mask::negative(unsafe { $from_bits($left::<$top>($bits(self.0))) })
            }
        }
    };
}

/// Truth values, and what a comparison of two registers makes of them.
macro_rules! mask {
    ($mask:ident($bits:ident), $raw:ident, $compare:ident) => {
        #[derive(Clone, Copy, Debug)]
        pub struct $mask($bits);

        impl $mask {
            #[inline(always)]
            fn less(a: $raw, b: $raw) -> Self {
                // SAFETY: code over this type runs only where its instructions are; see above.
                Self(unsafe { $compare::<_CMP_LT_OQ>(a, b) })
            }
        }
    };
}

/// A truth value for each number, in the sign's bit; the other bits of a number may be anything.
macro_rules! vector_mask {
    (
        $mask:ident, $raw:ident, $full:literal, compare $compare:ident, blend $blend:ident, and $and:ident,
        or $or:ident, xor $xor:ident, set1 $set1:ident, signs $signs:ident, bits $bits:ident, float $from_bits:ident,
        greater $greater:ident
    ) => {
        mask!($mask($raw), $raw, $compare);

        // SAFETY, of every instruction below: code over this type runs only where its instructions are; see above.
        impl $mask {
            /// The bits compared as integers.
            #[inline(always)]
            fn bits_less(a: $raw, b: $raw) -> Self {
                Self(unsafe { $from_bits($greater($bits(b), $bits(a))) })
            }
            #[inline(always)]
            fn negative(a: $raw) -> Self {
                Self(a)
            }
            #[inline(always)]
            fn choose(self, yes: $raw, no: $raw) -> $raw {
                unsafe { $blend(no, yes, self.0) }
            }
            #[inline(always)]
            fn bits(self) -> i32 {
                unsafe { $signs(self.0) }
            }
        }

        impl Mask for $mask {
            instructions!(and $and, or $or);
            #[inline(always)]
            fn not(self) -> Self {
                Self(unsafe { $xor(self.0, $set1(-0.0)) })
            }
            #[inline(always)]
            fn all(self) -> bool {
                self.bits() == $full
            }
            #[inline(always)]
            fn any(self) -> bool {
                self.bits() != 0
            }
        }
    };
}

/// A truth value for each number, in a bit.
macro_rules! bit_mask {
    (
        $mask:ident, $raw:ident, $integer:ident, compare $compare:ident, blend $blend:ident, bits $bits:ident,
        less $less:ident
    ) => {
        mask!($mask($integer), $raw, $compare);

        // SAFETY, of every instruction below: code over this type runs only where its instructions are; see above.
        impl $mask {
            /// The bits compared as integers.
            #[inline(always)]
            fn bits_less(a: $raw, b: $raw) -> Self {
                Self(unsafe { $less($bits(a), $bits(b)) })
            }
            #[inline(always)]
            fn negative(a: $raw) -> Self {
                Self(unsafe { $less($bits(a), _mm512_setzero_si512()) })
            }
            #[inline(always)]
            fn choose(self, yes: $raw, no: $raw) -> $raw {
                unsafe { $blend(self.0, no, yes) }
            }
            #[inline(always)]
            fn bits(self) -> $integer {
                self.0
            }
        }

        impl Mask for $mask {
            #[inline(always)]
            fn and(self, other: Self) -> Self {
                Self(self.0 & other.0)
            }
            #[inline(always)]
            fn or(self, other: Self) -> Self {
                Self(self.0 | other.0)
            }
            #[inline(always)]
            fn not(self) -> Self {
                Self(!self.0)
            }
            #[inline(always)]
            fn all(self) -> bool {
                self.0 == $integer::MAX
            }
            #[inline(always)]
            fn any(self) -> bool {
                self.0 != 0
            }
        }
    };
}

vector_mask!(
    Avx2Mask64, __m256d, 0xf, compare _mm256_cmp_pd, blend _mm256_blendv_pd, and _mm256_and_pd, or _mm256_or_pd,
    xor _mm256_xor_pd, set1 _mm256_set1_pd, signs _mm256_movemask_pd, bits _mm256_castpd_si256,
    float _mm256_castsi256_pd, greater _mm256_cmpgt_epi64
);
vector_mask!(
    Avx2Mask32, __m256, 0xff, compare _mm256_cmp_ps, blend _mm256_blendv_ps, and _mm256_and_ps, or _mm256_or_ps,
    xor _mm256_xor_ps, set1 _mm256_set1_ps, signs _mm256_movemask_ps, bits _mm256_castps_si256,
    float _mm256_castsi256_ps, greater _mm256_cmpgt_epi32
);
bit_mask!(
    Avx512Mask64, __m512d, u8, compare _mm512_cmp_pd_mask, blend _mm512_mask_blend_pd, bits _mm512_castpd_si512,
    less _mm512_cmplt_epi64_mask
);
bit_mask!(
    Avx512Mask32, __m512, u16, compare _mm512_cmp_ps_mask, blend _mm512_mask_blend_ps, bits _mm512_castps_si512,
    less _mm512_cmplt_epi32_mask
);
register!(
    Avx2F64, __m256d, f64, 4, Avx2Mask64, add _mm256_add_pd, sub _mm256_sub_pd, mul _mm256_mul_pd,
    div _mm256_div_pd, sqrt _mm256_sqrt_pd, min _mm256_min_pd, max _mm256_max_pd, set1 _mm256_set1_pd,
    and _mm256_and_pd, xor _mm256_xor_pd, bits _mm256_castpd_si256,
    float _mm256_castsi256_pd, plus _mm256_add_epi64, minus _mm256_sub_epi64, left _mm256_slli_epi64,
    right _mm256_srli_epi64, mantissa 52, top 63
);
register!(
    Avx2F32, __m256, f32, 8, Avx2Mask32, add _mm256_add_ps, sub _mm256_sub_ps, mul _mm256_mul_ps,
    div _mm256_div_ps, sqrt _mm256_sqrt_ps, min _mm256_min_ps, max _mm256_max_ps, set1 _mm256_set1_ps,
    and _mm256_and_ps, xor _mm256_xor_ps, bits _mm256_castps_si256,
    float _mm256_castsi256_ps, plus _mm256_add_epi32, minus _mm256_sub_epi32, left _mm256_slli_epi32,
    right _mm256_srli_epi32, mantissa 23, top 31
);
register!(
    Avx512F64, __m512d, f64, 8, Avx512Mask64, add _mm512_add_pd, sub _mm512_sub_pd, mul _mm512_mul_pd,
    div _mm512_div_pd, sqrt _mm512_sqrt_pd, min _mm512_min_pd, max _mm512_max_pd, set1 _mm512_set1_pd,
    and _mm512_and_pd, xor _mm512_xor_pd, bits _mm512_castpd_si512,
    float _mm512_castsi512_pd, plus _mm512_add_epi64, minus _mm512_sub_epi64, left _mm512_slli_epi64,
    right _mm512_srli_epi64, mantissa 52, top 63
);
register!(
    Avx512F32, __m512, f32, 16, Avx512Mask32, add _mm512_add_ps, sub _mm512_sub_ps, mul _mm512_mul_ps,
    div _mm512_div_ps, sqrt _mm512_sqrt_ps, min _mm512_min_ps, max _mm512_max_ps, set1 _mm512_set1_ps,
    and _mm512_and_ps, xor _mm512_xor_ps, bits _mm512_castps_si512,
    float _mm512_castsi512_ps, plus _mm512_add_epi32, minus _mm512_sub_epi32, left _mm512_slli_epi32,
    right _mm512_srli_epi32, mantissa 23, top 31
);
