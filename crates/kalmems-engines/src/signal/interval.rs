//! The usual interval between samples.

/// Two samples further apart than this many usual intervals have a gap between them, over which nothing is
/// interpolated.
pub const GAP: f64 = 2.5;

/// The median interval between times, in their unit; 0 where there are not two.
pub fn usual_interval(time_s: &[f64]) -> f64 {
    let mut intervals: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals.is_empty() {
        return 0.0;
    }
    let middle = intervals.len() / 2;
    *intervals.select_nth_unstable_by(middle, f64::total_cmp).1
}
