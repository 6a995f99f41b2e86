//! What a densely sampled signal was between its samples.

use std::ops::Range;

/// Lagrange's polynomial through up to four samples around the interval that ends at sample `to`, at a time in it.
///
/// For samples that may be irregular, and many per cycle: at 32 per cycle the error is below 4 · 10⁻⁵ of the amplitude. For
/// few samples per cycle there is [`band_limited`](super::band_limited).
pub fn cubic_between(time_s: &[f64], sample: impl Fn(usize) -> f64, to: usize, at_s: f64) -> f64 {
    polynomial_between(4, time_s, sample, to, at_s)
}

/// The polynomial of fifth order through up to six samples around the interval that ends at sample `to`, at a time in it: what the drive of a
/// device is between its samples.
///
/// At 26 samples per cycle the error in the middle of an interval is 10⁻⁶ of the amplitude; that of the cubic, 8·10⁻⁵, would be several times
/// what a filter of a sharp resonance claims.
pub fn quintic_between(time_s: &[f64], sample: impl Fn(usize) -> f64, to: usize, at_s: f64) -> f64 {
    polynomial_between(6, time_s, sample, to, at_s)
}

/// How far an interval may be from the one that ends at the sample, relative to it, for samples to be taken as evenly spaced.
const EVEN: f64 = 1e-6;

/// The same in the middle of the interval, quickly where the samples are evenly spaced, through two samples behind `to`, or through one or none
/// and as many more before it: of a sine the error is then 1.4 and 4.2 times as large.
#[inline]
pub fn quintic_middle(time_s: &[f64], sample: impl Fn(usize) -> f64, to: usize, behind: usize) -> f64 {
    let interval = time_s[to] - time_s[to - 1];
    let is_even = |around: &&[f64]| {
        around.windows(2).all(|pair| (pair[1] - pair[0] - interval).abs() <= EVEN * interval)
    };
    let first = (to + behind).checked_sub(5);
    let around = first.and_then(|first| time_s.get(first..first + 6)).filter(is_even);
    if around.is_none() {
        let last = (to + behind + 1).min(time_s.len());
        let rows = last.saturating_sub(6)..last.max(time_s.len().min(6));
        return polynomial_through(rows, time_s, sample, time_s[to - 1].midpoint(time_s[to]));
    }
    if behind == 1 {
        let early = 3.0 * (7.0 * sample(to - 3) - sample(to - 4)) - 70.0 * sample(to - 2);
        return (early + 210.0 * sample(to - 1) + 105.0 * sample(to) - 7.0 * sample(to + 1)) * (1.0 / 256.0);
    }
    if behind == 0 {
        let early = 7.0 * sample(to - 5) - 45.0 * sample(to - 4) + 126.0 * sample(to - 3);
        return (early - 210.0 * sample(to - 2) + 315.0 * sample(to - 1) + 63.0 * sample(to)) * (1.0 / 256.0);
    }
    let pair = |away: usize| sample(to - 1 - away) + sample(to + away);
    (3.0 * pair(2) - 25.0 * pair(1) + 150.0 * pair(0)) * (1.0 / 256.0)
}

/// Lagrange's polynomial through up to `points` samples, an even number: with six, a sine of 32 samples per cycle is off by less than
/// 3 · 10⁻⁷ of the amplitude.
#[inline]
pub fn polynomial_between(
    points: usize,
    time_s: &[f64],
    sample: impl Fn(usize) -> f64,
    to: usize,
    at_s: f64,
) -> f64 {
    let n = time_s.len();
    let first = to.saturating_sub(points / 2).min(n.saturating_sub(points));
    polynomial_through(first..(first + points).min(n), time_s, sample, at_s)
}

/// Lagrange's polynomial through these samples.
fn polynomial_through(rows: Range<usize>, time_s: &[f64], sample: impl Fn(usize) -> f64, at_s: f64) -> f64 {
    let (t, first) = (&time_s[rows.clone()], rows.start);
    (0..t.len())
        .map(|i| {
            let weight: f64 =
                (0..t.len()).filter(|j| *j != i).map(|j| (at_s - t[j]) / (t[i] - t[j])).product();
            weight * sample(first + i)
        })
        .sum()
}

/// The cubic with these values and slopes at both ends of an interval of length `h`, at the fraction `s` of it.
pub fn hermite(start: (f64, f64), end: (f64, f64), h: f64, s: f64) -> f64 {
    let (s2, s3) = (s * s, s * s * s);
    start.0 * (2.0 * s3 - 3.0 * s2 + 1.0)
        + start.1 * h * (s3 - 2.0 * s2 + s)
        + end.0 * (3.0 * s2 - 2.0 * s3)
        + end.1 * h * (s3 - s2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn cubics_are_followed_exactly_and_sines_nearly() {
        let time: Vec<f64> = (0..40).map(|k| f64::from(k) + 0.2 * f64::from(k * 7 % 5)).collect();
        let cubic = |t: f64| 3.0 - t + 0.5 * t * t - 0.01 * t.powi(3);
        let sine = |t: f64| (TAU * t / 32.0).sin();
        let even: Vec<f64> = (0..40).map(f64::from).collect();
        for to in 1..40 {
            let at = time[to - 1] + 0.3 * (time[to] - time[to - 1]);
            assert!((cubic_between(&time, |k| cubic(time[k]), to, at) - cubic(at)).abs() < 1e-9);
            // (2π/32)⁴·(9/16)/4! in the middle; four times as much where the polynomial is one-sided.
            let bound = if (2..39).contains(&to) { 4e-5 } else { 1.6e-4 };
            let middle = f64::from(u32::try_from(to).unwrap()) - 0.5;
            let error = cubic_between(&even, |k| sine(even[k]), to, middle) - sine(middle);
            assert!(error.abs() < bound, "{to}: {error}");
        }
    }

    #[test]
    fn a_cubic_is_kept() {
        let f = |t: f64| 2.0 - t + 3.0 * t * t - 0.5 * t * t * t;
        let d = |t: f64| -1.0 + 6.0 * t - 1.5 * t * t;
        let h = 0.7;
        for s in [0.0, 0.2, 0.5, 1.0] {
            let t = 1.0 + s * h;
            approx::assert_relative_eq!(
                hermite((f(1.0), d(1.0)), (f(1.7), d(1.7)), h, s),
                f(t),
                max_relative = 1e-14
            );
        }
    }

    #[test]
    fn the_middle_of_an_interval_is_on_the_polynomial_through_six_samples() {
        let polynomial = |t: f64| ((((0.3 * t - 1.0) * t + 0.5) * t - 2.0) * t + 1.0) * t - 4.0;
        let even: Vec<f64> = (0..9).map(|k| f64::from(k) * 0.25).collect();
        let uneven: Vec<f64> = even.iter().map(|t| t + 0.01 * (9.0 * t).sin()).collect();
        for (time_s, behind) in [&even, &uneven].into_iter().flat_map(|t| [0, 1, 2].map(|behind| (t, behind)))
        {
            for to in 1..time_s.len() {
                let middle = time_s[to - 1].midpoint(time_s[to]);
                let found = quintic_middle(time_s, |k| polynomial(time_s[k]), to, behind);
                assert!((found - polynomial(middle)).abs() < 1e-12, "{behind} {to}");
            }
        }
        // Two samples, of which a line is all that is known.
        assert!((quintic_middle(&[0.0, 1.0], |k| k as f64, 1, 2) - 0.5).abs() < 1e-15);
    }
}
