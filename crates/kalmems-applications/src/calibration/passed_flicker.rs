//! What a low pass of first order before the sampling leaves of flicker in Allan's and Hadamard's variances.
//!
//! With the density of flicker, B²/(2πf), and a low pass of the time constant T, a variance of n-th differences is by its floor
//! ∫ sin²ⁿ(u)/u³/(1 + 4·(T/τ)²·u²) du over the same without T; without T and for n = 2 the integral is ln 2 (IEEE Std 952, annex C).

use super::octave_covariance::PhaseDifference;
use kalmems_core::Portable;
use std::f64::consts::{LN_2, PI};
use std::sync::OnceLock;

/// Ratios of the time constant to the averaging time: powers of two so far to either side of 1, with so many steps from one to the next.
const OCTAVES: u32 = 10;
const DIVISIONS: u32 = 4;
/// Periods of sin² over which it is summed, and steps of each.
const PERIODS: usize = 60;
const STEPS: usize = 64;

/// The part of the floor that is left, by the time constant over the averaging time.
pub(super) fn passed_flicker(difference: PhaseDifference, ratio: f64) -> f64 {
    static TABLES: [OnceLock<Vec<f64>>; 2] = [const { OnceLock::new() }; 2];
    let place = f64::from(DIVISIONS) * (ratio.portable_ln() / LN_2 + f64::from(OCTAVES));
    // What comes before the table takes less than a part in 10⁴.
    if !(ratio > 0.0 && place > 0.0) {
        return 1.0;
    }
    let order = difference.order();
    let table = TABLES[usize::from(order > 2)].get_or_init(|| {
        let whole = integral(order, 0.0);
        let logarithm = |k: u32| f64::from(k) / f64::from(DIVISIONS) - f64::from(OCTAVES);
        let of = |k: u32| integral(order, (logarithm(k) * LN_2).portable_exp()) / whole;
        (0..=2 * OCTAVES * DIVISIONS).map(of).collect()
    });
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, and bounded by the table
    let below = (place as usize).min(table.len() - 2);
    let share = (place - below as f64).min(1.0);
    table[below] + share * (table[below + 1] - table[below])
}

/// The integral by Simpson's rule, and beyond its end with the mean of the power of the sine.
fn integral(order: usize, ratio: f64) -> f64 {
    let step = PI / STEPS as f64;
    let of = |k: usize| {
        let u = k as f64 * step;
        // The powers of the sine and of u leave u at the beginning.
        if k == 0 {
            0.0
        } else {
            power(u.portable_sin(), 2 * order) / (u * u * u * (1.0 + 4.0 * ratio * ratio * u * u))
        }
    };
    let last = PERIODS * STEPS;
    let weighted = (0..=last).map(|k| match k {
        _ if k == 0 || k == last => of(k),
        _ if k % 2 == 1 => 4.0 * of(k),
        _ => 2.0 * of(k),
    });
    let (end, factor) = (last as f64 * step, 4.0 * ratio * ratio);
    let beyond = 0.5 / (end * end) - 0.5 * factor * (1.0 + 1.0 / (factor * end * end)).portable_ln();
    // The mean of sin²ⁿ is ∏ (2k − 1)/(2k).
    let mean: f64 = (1..=order).map(|k| (2 * k - 1) as f64 / (2 * k) as f64).product();
    step / 3.0 * weighted.sum::<f64>() + mean * if factor > 0.0 { beyond } else { 0.5 / (end * end) }
}

fn power(base: f64, exponent: usize) -> f64 {
    (0..exponent).fold(1.0, |product, _| product * base)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_low_pass_the_floor_is_that_of_the_standard() {
        assert!((integral(2, 0.0) / LN_2 - 1.0).abs() < 1e-6);
        // Hadamard's floor is ln(256/27)/(2π) by B², and 2/(6·π)·4³/2 times the integral of sin⁶ by that.
        assert!(((integral(3, 0.0) * 16.0 / 3.0) / (256.0_f64 / 27.0).ln() - 1.0).abs() < 1e-6);
    }

    /// A first-order low pass of the samples themselves: the variance of sums of an autoregression that is driven by flicker, summed over its spectrum.
    #[test]
    fn it_is_the_variance_of_samples_that_a_low_pass_has_passed() {
        let (memory, count) = (8.0_f64, 1_usize << 16);
        let decay = (-1.0 / memory).exp();
        for factor in [4_usize, 16, 64, 256] {
            let m = factor as f64;
            let mut passed = 0.0;
            for k in 1..count / 2 {
                let w = 2.0 * PI * k as f64 / count as f64;
                let low_pass = (1.0 - decay).powi(2) / (1.0 - 2.0 * decay * w.cos() + decay * decay);
                // The mean of `factor` samples, and the difference of two of them.
                let transfer = (0.5 * w * m).sin().powi(4) / (0.5 * w).sin().powi(2) / (m * m);
                passed += transfer / k as f64 * low_pass;
            }
            // ∫ sin⁴(u)/u³ du = ln 2 of continuous time.
            let found = passed / LN_2;
            let expected = passed_flicker(PhaseDifference::ALLAN, memory / m);
            assert!((found / expected - 1.0).abs() < 0.02, "{factor}: {found} and {expected}");
        }
    }
}
