//! Turning points to a fraction of a sample.

use super::{GAP, fit_sine_at, usual_interval};
use std::f64::consts::TAU;

/// A turning point of an angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extreme {
    /// When, in s.
    pub time_s: f64,
    /// Whether the angle is largest there, not smallest.
    pub maximum: bool,
}

/// Where the rate goes through zero, by a straight line between the two samples around it.
///
/// For a sine sampled 64 times per cycle the line is right to two thousandths of a degree of the cycle. What happens
/// in a gap is not known.
pub fn extremes_of_rate(time_s: &[f64], rate: &[f64]) -> Vec<Extreme> {
    let longest = GAP * usual_interval(time_s);
    time_s
        .windows(2)
        .zip(rate.windows(2))
        .filter_map(|(t, r)| match (t, r) {
            (&[t0, t1], &[r0, r1])
                if (r0 > 0.0) != (r1 > 0.0) && (r0 - r1).is_finite() && t1 - t0 <= longest =>
            {
                Some(Extreme { time_s: t0 + (t1 - t0) * r0 / (r0 - r1), maximum: r0 > 0.0 })
            }
            _ => None,
        })
        .collect()
}

/// Turning points of an angle alone, by a sine of the motion's frequency through the eighth of a cycle on each
/// side: noise averages out, and harmonics cancel by symmetry.
pub fn extremes_of_angle(time_s: &[f64], angle: &[f64], frequency_hz: f64) -> Vec<Extreme> {
    let reach = 0.125 / frequency_hz;
    let n = time_s.len().min(angle.len());
    let mut found = Vec::new();
    let mut i = 0;
    while i < n {
        let lo = time_s.partition_point(|t| *t < time_s[i] - reach);
        let hi = time_s.partition_point(|t| *t <= time_s[i] + reach).min(n);
        let window = &angle[lo..hi];
        let whole = lo > 0 && hi < n && window.iter().all(|a| a.is_finite());
        let above = |a: &f64| *a > angle[i];
        let below = |a: &f64| *a < angle[i];
        // The sample that no other one around it exceeds is within noise of the turning point.
        let (maximum, minimum) = (!window.iter().any(above), !window.iter().any(below));
        if whole && maximum != minimum {
            let local: Vec<f64> = time_s[lo..hi].iter().map(|t| t - time_s[i]).collect();
            if let Some(fit) = fit_sine_at(&local, window, frequency_hz) {
                // The cosine's phase is measured from the sample; a minimum is half a cycle away from it.
                let phase = fit.phase_rad + if maximum { 0.0 } else { TAU / 2.0 };
                let shift = -(phase - TAU * (phase / TAU).round()) / (TAU * frequency_hz);
                found.push(Extreme { time_s: time_s[i] + shift, maximum });
            }
            i = hi;
        } else {
            i += 1;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn both_ways_agree_with_the_sine() {
        let (f, h) = (15_675.0, 1e-6);
        let phase = |t: f64| TAU * f * t - 0.7;
        let time: Vec<f64> = (0..2000).map(|i| f64::from(i) * h).collect();
        let angle: Vec<f64> = time.iter().map(|t| 0.15 * phase(*t).cos()).collect();
        let rate: Vec<f64> = time.iter().map(|t| -phase(*t).sin()).collect();
        let by_rate = extremes_of_rate(&time, &rate);
        let by_angle = extremes_of_angle(&time, &angle, f);
        assert!(by_rate.len() > 60);
        for (extremes, tolerance_deg) in [(&by_rate, 2e-3), (&by_angle, 1e-6)] {
            for extreme in extremes {
                let at = phase(extreme.time_s) / TAU * 360.0;
                let nearest = (at / 180.0).round() * 180.0;
                assert_abs_diff_eq!(at, nearest, epsilon = tolerance_deg);
                assert_eq!(extreme.maximum, (nearest / 360.0).fract() == 0.0);
            }
        }
        // The angle's first and last eighth of a cycle have no window.
        assert!(by_rate.len() - by_angle.len() <= 2);
    }
}
