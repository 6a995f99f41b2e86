//! What the estimators see of a segment.

/// One segment of a recording as the estimators see it.
#[derive(Clone, Copy, Debug)]
pub struct PistonSegment<'a> {
    /// When, in s.
    pub time_s: &'a [f64],
    /// The capacitance in F.
    pub signal: &'a [f64],
    /// The usual interval between samples in s.
    pub interval_s: f64,
    /// The variance of a sample in F².
    pub noise_variance: f64,
    /// The frequency of the motion in Hz where a trigger tells it.
    pub motion_hz: Option<f64>,
}
