//! Errors of a position.

use super::{ErrorSeries, Reference};
use crate::estimate::Trajectory;
use serde::Serialize;

/// All errors of one trajectory's position.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PositionErrors {
    /// The root mean square in nm.
    pub rms_nm: f64,
    /// The mean in nm.
    pub mean_nm: f64,
    /// The largest in nm.
    pub largest_nm: f64,
    /// Samples compared.
    pub samples: usize,
    /// The share of them within three standard deviations; `None` for a filter that claims none.
    pub within_three_sigma: Option<f64>,
    /// The error over time, for plots.
    #[serde(skip)]
    pub error: ErrorSeries,
}

/// Compares the position of a trajectory with the reference, from a time in s on. `None` where not one sample can be
/// compared.
pub fn evaluate_position(
    trajectory: &Trajectory,
    reference: &Reference,
    from_s: f64,
) -> Option<PositionErrors> {
    let (estimated, sd) = reference.estimate_at(trajectory);
    let from = reference.time_s.partition_point(|t| *t < from_s);
    let sd = sd.get(from..).unwrap_or_default();
    let error: Vec<f64> =
        estimated[from..].iter().zip(&reference.angle[from..]).map(|(e, r)| e - r).collect();
    let finite = || error.iter().copied().filter(|e| e.is_finite());
    let samples = finite().count();
    let judged = || error.iter().zip(sd).filter(|(e, s)| e.is_finite() && s.is_finite());
    let within = judged().filter(|(e, s)| e.abs() <= 3.0 * **s).count();
    if samples == 0 {
        return None;
    }
    Some(PositionErrors {
        rms_nm: (finite().map(|e| e * e).sum::<f64>() / samples as f64).sqrt() * NANO,
        mean_nm: finite().sum::<f64>() / samples as f64 * NANO,
        largest_nm: finite().map(f64::abs).fold(0.0, f64::max) * NANO,
        samples,
        within_three_sigma: (judged().count() > 0).then(|| within as f64 / judged().count() as f64),
        error: ErrorSeries { time_s: reference.time_s[from..].to_vec(), sd: sd.to_vec(), error },
    })
}

/// Nanometres in a metre.
const NANO: f64 = 1e9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{StateName, TrajectoryKind};
    use crate::units::kind;

    const STATES: [StateName; 2] =
        [("position", "m", &kind::LENGTH), ("velocity", "m_per_s", &kind::VELOCITY)];

    #[test]
    fn errors_are_counted_after_the_settling_time() {
        let time_s: Vec<f64> = (0..100).map(f64::from).collect();
        let mut trajectory = Trajectory::blank(("ekf", "EKF"), TrajectoryKind::Filtered, &time_s, &STATES);
        // 3 nm and −1 nm in turn, after errors of 1 µm in the first ten samples.
        for (k, t) in time_s.iter().enumerate() {
            let off = if k < 10 {
                1e-6
            } else if k % 2 == 0 {
                3e-9
            } else {
                -1e-9
            };
            trajectory.states[0].mean[k] = 1e-3 + 1e-6 * t + off;
            trajectory.states[0].sd[k] = 0.5e-9;
        }
        let angle = time_s.iter().map(|t| 1e-3 + 1e-6 * t).collect();
        let reference = Reference { states: ["position", "velocity"], time_s, angle, rate: None };
        let errors = evaluate_position(&trajectory, &reference, 10.0).unwrap();
        assert!((errors.rms_nm - 5_f64.sqrt()).abs() < 1e-6, "{errors:?}");
        assert!((errors.mean_nm - 1.0).abs() < 1e-6 && (errors.largest_nm - 3.0).abs() < 1e-6);
        assert_eq!((errors.samples, errors.within_three_sigma), (90, Some(0.5)));
        assert!(evaluate_position(&trajectory, &reference, 1e3).is_none());
    }
}
