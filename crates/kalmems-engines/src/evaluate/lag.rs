//! Whether a reference is late by more than is stated.

use super::ReferenceMotion;
use crate::estimate::Trajectory;
use crate::progress::Interruption;
use serde::Serialize;

/// A reference whose times do not fit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ReferenceLag {
    /// How much later than stated it shows the motion, in s.
    pub lag_s: f64,
    /// The root mean square error of the angle with that taken off, in degrees.
    pub rmse_deg: f64,
}

/// Lags that are tried on each side, over half a cycle of the motion.
const TRIED: i32 = 48;

/// The share of the error that must go with the lag for it to be blamed.
const EXPLAINED: f64 = 0.5;

impl ReferenceLag {
    /// The lag within half a cycle of the motion that explains most of the error from `from_s` on; `None` where that is
    /// less than half of it.
    ///
    /// A lag and an error of the estimate's phase look the same to a comparison with one reference. Of a filter that
    /// follows its signal it is the reference that is blamed.
    pub fn of(
        trajectory: &Trajectory,
        reference: &ReferenceMotion,
        (from_s, motion_hz): (f64, f64),
        stop: &Interruption,
    ) -> Option<Self> {
        let first = reference.time_s.partition_point(|t| *t < from_s);
        // A sixteenth of a cycle apart is enough to tell.
        let step = (0.06 / motion_hz / usual(&reference.time_s[first..])?).ceil().max(1.0);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at least 1, and small
        let picked: Vec<usize> = (first..reference.time_s.len()).step_by(step as usize).collect();
        let mean_square = |lag_s: f64| {
            let shifted = ReferenceMotion {
                states: reference.states,
                time_s: picked.iter().map(|k| reference.time_s[*k] - lag_s).collect(),
                angle: Vec::new(),
                rate: None,
                accuracy: reference.accuracy,
            };
            let (estimated, _) = shifted.estimate_at(trajectory, stop);
            let squares = estimated.iter().zip(&picked).map(|(e, k)| (e - reference.angle[*k]).powi(2));
            let (count, sum) =
                squares.filter(|s| s.is_finite()).fold((0_usize, 0.0), |(n, sum), s| (n + 1, sum + s));
            if count < picked.len() / 2 { f64::NAN } else { sum / count as f64 }
        };
        let unit_s = 0.5 / motion_hz / f64::from(TRIED);
        let tried: Vec<f64> = (-TRIED..=TRIED).map(|i| mean_square(f64::from(i) * unit_s)).collect();
        let (best, _) =
            tried.iter().enumerate().filter(|(_, s)| s.is_finite()).min_by(|a, b| a.1.total_cmp(b.1))?;
        let mut lag_s = (best as f64 - f64::from(TRIED)) * unit_s;
        // The mean square is a parabola around its least value.
        if let (Some(&[before, at, after]), true) =
            (tried.get(best.wrapping_sub(1)..best + 2).and_then(|t| t.first_chunk()), best > 0)
        {
            let bend = before - 2.0 * at + after;
            if bend > 0.0 {
                lag_s += 0.5 * unit_s * (before - after) / bend;
            }
        }
        let (as_stated, without) = (mean_square(0.0), mean_square(lag_s));
        let explains = without < EXPLAINED * EXPLAINED * as_stated;
        explains.then(|| Self { lag_s, rmse_deg: without.sqrt().to_degrees() })
    }
}

/// The mean interval of times.
fn usual(time_s: &[f64]) -> Option<f64> {
    let (first, last) = (time_s.first()?, time_s.last()?);
    (last > first).then(|| (last - first) / (time_s.len() - 1) as f64)
}
