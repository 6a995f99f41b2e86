//! From samples at equal times to samples at equal path differences.

use super::scans::MirrorScan;
use crate::signal::{band_limited, polynomial_between};

/// Points of the polynomial through the path differences.
const POINTS: usize = 6;
/// Each step of the search makes the error of the time a small part of what it was.
const STEPS: usize = 4;

/// Why a scan cannot be resampled.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ResampleError {
    /// The path goes back and forth between samples.
    #[error(
        "the path difference does not {} throughout a scan (at sample {row}): the position is noisier than what the \
         mirror moves between two samples; `method = \"weighted\"` does without resampling",
        if *forward { "grow" } else { "fall" }
    )]
    BackAndForth {
        /// The sample.
        row: usize,
        /// Which way the scan goes.
        forward: bool,
    },
}

/// The interferogram of a scan at the path differences `step_m`·(`first`, …, `last`), increasing whichever way the
/// mirror went.
///
/// The detector is sampled at equal times, and band-limited in time. So the time of each wanted path difference is found
/// first, on the polynomial through the six path differences around, and the detector's value is that of the
/// band-limited signal at that time (Brault, Applied Optics 35, 2891, 1996, does so with a laser's fringes).
pub fn resample(
    value: &[f64],
    path_m: &[f64],
    scan: &MirrorScan,
    step_m: f64,
    (first, last): (i32, i32),
) -> Result<Vec<f64>, ResampleError> {
    let rows = scan.rows.clone();
    let sign = if scan.forward { 1.0 } else { -1.0 };
    // One sample to each side, so that the ends lie within.
    let from = rows.start.saturating_sub(1).max(scan.around.start);
    let to = (rows.end + 1).min(scan.around.end);
    let path = &path_m[from..to];
    if let Some(back) = path.windows(2).position(|pair| sign * (pair[1] - pair[0]) <= 0.0) {
        return Err(ResampleError::BackAndForth { row: from + back, forward: scan.forward });
    }
    let places: Vec<f64> = (0..path.len()).map(|k| k as f64).collect();
    let samples = &value[scan.around.clone()];
    let offset = (from - scan.around.start) as f64;
    let mut resampled: Vec<f64> = (first..=last)
        .map(|j| {
            let wanted = step_m * f64::from(j);
            let after = path.partition_point(|x| sign * x < sign * wanted).clamp(1, path.len() - 1);
            let slope = path[after] - path[after - 1];
            let mut place = places[after - 1] + (wanted - path[after - 1]) / slope;
            for _ in 0..STEPS {
                let at = polynomial_between(POINTS, &places, |k| path[k], after, place);
                place += (wanted - at) / slope;
            }
            band_limited(samples, offset + place)
        })
        .collect();
    // The mean of what lies between the ends is what no path difference changes.
    let mean = resampled.iter().sum::<f64>() / resampled.len().max(1) as f64;
    for y in &mut resampled {
        *y -= mean;
    }
    Ok(resampled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Forward and backward along a sinusoid: the light at equal steps, to what the interpolation in time allows.
    #[test]
    fn equal_times_become_equal_steps() {
        let light = |x: f64| (TAU * 200e3 * x).cos() + 0.5 * (TAU * 160e3 * x + 0.4).sin();
        let path: Vec<f64> = (0..8000).map(|k| -1e-3 * (TAU * f64::from(k) / 4000.0).cos()).collect();
        let value: Vec<f64> = path.iter().map(|x| light(*x)).collect();
        for (around, forward) in [(0..2001, true), (2000..4001, false)] {
            let inside = around.clone().filter(|k| path[*k].abs() <= 0.95e-3);
            let rows = inside.clone().min().unwrap()..inside.max().unwrap() + 1;
            let scan = MirrorScan { rows, around, forward };
            let (step, ends) = (1e-6, (-949, 949));
            let found = resample(&value, &path, &scan, step, ends).unwrap();
            let expected: Vec<f64> = (ends.0..=ends.1).map(|j| light(step * f64::from(j))).collect();
            let mean = expected.iter().sum::<f64>() / expected.len() as f64;
            for (f, e) in found.iter().zip(&expected) {
                assert!((f - (e - mean)).abs() < 2e-5, "{f} {e}");
            }
        }
        let mut shaken = path.clone();
        shaken[1000] += 5e-6;
        let scan = MirrorScan { rows: 300..1700, around: 0..2001, forward: true };
        let error = resample(&value, &shaken, &scan, 1e-6, (-900, 900)).unwrap_err();
        assert_eq!(error, ResampleError::BackAndForth { row: 1000, forward: true });
    }
}
