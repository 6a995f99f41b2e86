//! The amplitude of a motion by the line of its signal at twice its frequency.
//!
//! With θ = A·sin φ and z = A²/(2·θ₀²) the comb's law is C₀·e^{−z}·e^{z·cos 2φ} + C_b, whose component at twice the motion's frequency is
//! 2·C₀·e^{−z}·I₁(z)·cos 2φ (Abramowitz and Stegun, 9.6.34). z is found where e^{−z}·I₁(z) rises, up to an amplitude of 1.76·θ₀; a larger one
//! gives the same signal as a smaller one.

use kalmems_core::Portable;
use kalmems_models::capacitance::GaussianComb;

/// Where e^{−z}·I₁(z) is largest.
const LARGEST: f64 = 1.545_127_3;

/// The amplitude in rad of a motion whose signal has this share of 2a·C₀ at twice its frequency. `None` where none has.
pub fn amplitude_of(share: f64, comb: &GaussianComb<f64>) -> Option<f64> {
    inverse(share).map(|z| comb.angular_width * (2.0 * z).sqrt())
}

/// The z at which e^{−z}·I₁(z) has a value, where it rises. `None` above its largest.
fn inverse(value: f64) -> Option<f64> {
    if value.is_nan() || value <= 0.0 || value > scaled_bessel(LARGEST) {
        return None;
    }
    let (mut low, mut high) = (0.0, LARGEST);
    while high - low > 1e-15 * high {
        let middle = f64::midpoint(low, high);
        if middle <= low || middle >= high {
            break;
        }
        if scaled_bessel(middle) < value { low = middle } else { high = middle }
    }
    Some(f64::midpoint(low, high))
}

/// e^{−z}·I₁(z) by its series (Abramowitz and Stegun, 9.6.10), for z up to 2.
fn scaled_bessel(z: f64) -> f64 {
    let mut term = z / 2.0;
    let mut sum = term;
    for k in 1..20 {
        term *= z * z / (4.0 * f64::from(k) * f64::from(k + 1));
        sum += term;
    }
    sum * (-z).portable_exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_is_that_of_published_tables() {
        // I₁ at 0.5, 1 and 1.5 as tables have it.
        for (z, bessel) in [(0.5, 0.257_894_305_4), (1.0, 0.565_159_104_0), (1.5, 0.981_666_428_6)] {
            let value = bessel * f64::exp(-z);
            assert!((scaled_bessel(z) - value).abs() < 1e-10, "{z}: {}", scaled_bessel(z));
            assert!((inverse(value).unwrap() - z).abs() < 1e-5);
        }
        // The slope vanishes at the largest.
        let [below, at, above] = [-1e-3, 0.0, 1e-3].map(|d| scaled_bessel(LARGEST + d));
        assert!(at > below && at > above && (below - above).abs() < 1e-9);
        assert_eq!(inverse(at * 1.001), None);
        assert_eq!(inverse(f64::NAN), None);
    }
}
