//! The time derivative of a signal at its samples.

use super::GAP;

/// Samples on each side that a derivative is computed from.
pub const SLOPE_REACH: usize = 2;

/// The derivative at each of these times of what has these values there: that of the polynomial through the samples around, two on each
/// side where there are as many without a gap between.
///
/// Of a sine with ω·Δt from sample to sample it is (ω·Δt)⁴/30 too small. Not a number where a sample stands alone.
pub fn sample_slopes(time_s: &[f64], value: impl Fn(usize) -> f64, interval_s: f64) -> Vec<f64> {
    let is_near = |k: usize| time_s[k] - time_s[k - 1] <= GAP * interval_s;
    (0..time_s.len())
        .map(|k| {
            let before = (1..=SLOPE_REACH).take_while(|back| *back <= k && is_near(k + 1 - back)).count();
            let behind = (1..=SLOPE_REACH).take_while(|on| k + on < time_s.len() && is_near(k + on)).count();
            slope_at(time_s, &value, k, (k - before, k + behind))
        })
        .collect()
}

/// The derivative at sample `k` of the polynomial through these samples, the last of them included.
fn slope_at(time_s: &[f64], value: impl Fn(usize) -> f64, k: usize, (first, last): (usize, usize)) -> f64 {
    if first == last {
        return f64::NAN;
    }
    let here = value(k);
    let others = |but: usize| (first..=last).filter(move |m| *m != but);
    // Σ (y_j − y_k)·l′_j with Lagrange's polynomials l_j, whose derivatives add up to nothing.
    let part = |j: usize| {
        let numerator: f64 = others(j).filter(|m| *m != k).map(|m| time_s[k] - time_s[m]).product();
        let denominator: f64 = others(j).map(|m| time_s[j] - time_s[m]).product();
        (value(j) - here) * (numerator / denominator)
    };
    others(k).map(part).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn the_slope_of_a_sine_lacks_what_the_order_of_the_difference_leaves_out() {
        let (per_cycle, interval_s) = (32.0, 1e-5);
        let phase = |k: usize| TAU * k as f64 / per_cycle + 0.4;
        let time_s: Vec<f64> = (0..500).map(|k| f64::from(k) * interval_s).collect();
        let found = sample_slopes(&time_s, |k| 3.0 + phase(k).sin(), interval_s);
        let step = TAU / per_cycle;
        for (k, found) in found.iter().enumerate().skip(SLOPE_REACH).take(500 - 2 * SLOPE_REACH) {
            let expected = phase(k).cos() * step / interval_s * (1.0 - step.powi(4) / 30.0);
            assert!((found - expected).abs() < 1e-5 * step / interval_s, "{k}: {found} {expected}");
        }
        // At the ends the polynomial has three samples: their error is (ω·Δt)²/3 at most.
        assert!((found[0] * interval_s / step - phase(0).cos()).abs() < 0.4 * step * step);
    }

    #[test]
    fn samples_beyond_a_gap_are_not_asked() {
        let interval_s = 1e-3;
        let mut time_s: Vec<f64> = (0..20).map(|k| f64::from(k) * interval_s).collect();
        time_s[10..].iter_mut().for_each(|t| *t += 0.5);
        // A line on either side, with a jump between.
        let value = |k: usize| if k < 10 { 2.0 * time_s[k] } else { 7.0 - 3.0 * time_s[k] };
        let found = sample_slopes(&time_s, value, interval_s);
        assert!(found[..10].iter().all(|slope| (slope - 2.0).abs() < 1e-9), "{found:?}");
        assert!(found[10..].iter().all(|slope| (slope + 3.0).abs() < 1e-9), "{found:?}");
        assert!(sample_slopes(&[0.0], |_| 1.0, interval_s)[0].is_nan());
    }
}
