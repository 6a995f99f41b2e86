//! Elementary functions that the core does not have, over its own.

use kalmems_core::Scalar;

/// tanh x.
///
/// Below 1 by Lambert's continued fraction, thirteen levels of which leave less than the last digit; above by e^{2|x|}, where
/// nothing cancels.
pub(crate) fn tanh(x: f64) -> f64 {
    if x.abs() < 1.0 {
        let square = x * x;
        let fraction = (0..13).rev().fold(0.0, |rest, level| square / (f64::from(2 * level + 3) + rest));
        return x / (1.0 + fraction);
    }
    let size = 1.0 - 2.0 / (Scalar::exp(2.0 * x.abs()) + 1.0);
    size.copysign(x)
}

/// Below this z² the series of [`atanhc`] is used.
const SMALL: f64 = 0.0225;

/// atanh(z)/z = 1 + z²/3 + z⁴/5 + … for |z| < 1, with all its digits near 0.
pub(crate) fn atanhc<S: Scalar>(z: S) -> S {
    let square = z.sq();
    // Of so many terms the third derivative has all digits too.
    let series = (0..16).rev().fold(S::of(0.0), |sum, k| sum * square + S::of(1.0 / f64::from(2 * k + 1)));
    S::select(square.lt(S::of(SMALL)), series, z.atanh() * z.recip())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tanh_agrees_with_the_platform() {
        for k in -4000..=4000 {
            let x = f64::from(k) * 5.013e-3;
            let (ours, theirs) = (tanh(x), x.tanh());
            assert!((ours - theirs).abs() <= 4e-16 * theirs.abs(), "{x}: {ours} {theirs}");
        }
        assert_eq!((tanh(1e-300), tanh(400.0), tanh(-1e9)), (1e-300, 1.0, -1.0));
        assert!(tanh(f64::NAN).is_nan());
    }

    #[test]
    fn atanhc_is_continuous_where_its_forms_meet() {
        for z in [0.149_999, 0.150_001, 0.01, 0.9] {
            assert!((atanhc(z) / (f64::atanh(z) / z) - 1.0).abs() < 1e-15, "{z}");
        }
        assert_eq!(atanhc(0.0), 1.0);
    }
}
