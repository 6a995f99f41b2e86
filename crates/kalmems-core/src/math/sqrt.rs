//! The square root of one number: by the hardware where it is known to have one, by `libm` elsewhere.
//!
//! Correctly rounded in either case.

#![allow(unsafe_code)]

#[cfg(all(target_arch = "x86_64", target_feature = "sse2"))]
mod here {
    use core::arch::x86_64::{
        _mm_cvtsd_f64, _mm_cvtss_f32, _mm_set_sd, _mm_set_ss, _mm_sqrt_sd, _mm_sqrt_ss,
    };

    #[inline(always)]
    pub(crate) fn sqrt_f64(x: f64) -> f64 {
        // SAFETY: these need SSE2, for which this is compiled.
        unsafe {
            let x = _mm_set_sd(x);
            _mm_cvtsd_f64(_mm_sqrt_sd(x, x))
        }
    }

    #[inline(always)]
    pub(crate) fn sqrt_f32(x: f32) -> f32 {
        // SAFETY: as above.
        unsafe { _mm_cvtss_f32(_mm_sqrt_ss(_mm_set_ss(x))) }
    }
}

#[cfg(all(feature = "vfpv4", target_arch = "arm"))]
mod here {
    pub(crate) use libm::sqrt as sqrt_f64;

    #[inline(always)]
    pub(crate) fn sqrt_f32(x: f32) -> f32 {
        core::f32::math::sqrt(x)
    }
}

#[cfg(not(any(
    all(target_arch = "x86_64", target_feature = "sse2"),
    all(feature = "vfpv4", target_arch = "arm")
)))]
mod here {
    pub(crate) use libm::{sqrt as sqrt_f64, sqrtf as sqrt_f32};
}

pub(crate) use here::{sqrt_f32, sqrt_f64};
