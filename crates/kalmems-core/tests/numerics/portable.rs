//! Functions that are the same on every platform, against those of this one.

use kalmems_core::Portable;

#[test]
fn each_is_within_two_units_of_the_last_place_of_the_platforms() {
    let near = |ours: f64, theirs: f64| (ours - theirs).abs() <= 2.0 * f64::EPSILON * theirs.abs();
    for k in -200..200 {
        let x = f64::from(k) * 0.037 + 0.011;
        let (positive, within) = (x.abs(), x / 8.0);
        let pairs = [
            (x.portable_sin(), x.sin()),
            (x.portable_cos(), x.cos()),
            (x.portable_tan(), x.tan()),
            (within.portable_asin(), within.asin()),
            (within.portable_acos(), within.acos()),
            (x.portable_atan(), x.atan()),
            (x.portable_exp(), x.exp()),
            (x.portable_exp_m1(), x.exp_m1()),
            (positive.portable_ln(), positive.ln()),
            (positive.portable_ln_1p(), positive.ln_1p()),
            (positive.portable_log10(), positive.log10()),
            (positive.portable_log2(), positive.log2()),
            (x.portable_sinh(), x.sinh()),
            (x.portable_cosh(), x.cosh()),
            (x.portable_tanh(), x.tanh()),
            (x.portable_asinh(), x.asinh()),
            (x.portable_cbrt(), x.cbrt()),
            (positive.portable_powf(x), positive.powf(x)),
            (x.portable_hypot(1.5), x.hypot(1.5)),
            (x.portable_atan2(-0.7), x.atan2(-0.7)),
        ];
        for (place, (ours, theirs)) in pairs.into_iter().enumerate() {
            assert!(near(ours, theirs), "function {place} of {x}: {ours:e} {theirs:e}");
        }
    }
}
