//! a + b·c of one number: in one instruction on a small processor that is told to have it, in two elsewhere.
//!
//! Nowhere else, because machines would then give different bytes.

/// Whether it is one.
pub(crate) const FUSED_F32: bool = cfg!(all(feature = "vfpv4", target_arch = "arm"));

#[cfg(all(feature = "vfpv4", target_arch = "arm"))]
#[inline(always)]
pub(crate) fn mac_f32(a: f32, b: f32, c: f32) -> f32 {
    core::f32::math::mul_add(b, c, a)
}

#[cfg(not(all(feature = "vfpv4", target_arch = "arm")))]
#[inline(always)]
pub(crate) fn mac_f32(a: f32, b: f32, c: f32) -> f32 {
    a + b * c
}

#[inline(always)]
pub(crate) fn mac_f64(a: f64, b: f64, c: f64) -> f64 {
    a + b * c
}
