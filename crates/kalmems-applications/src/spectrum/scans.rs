//! A detector's samples along a path, cut into scans.

use super::track::{PositionTrack, TrackPosition};
use crate::signal::{GAP, usual_interval};
use serde::Serialize;
use std::ops::Range;

/// What a detector gave, and when, on the clock of the position.
#[derive(Clone, Debug)]
pub struct DetectorSignal {
    /// Increasing, in s.
    pub time_s: Vec<f64>,
    /// NaN where nothing was measured.
    pub value: Vec<f64>,
}

/// How a position becomes a path difference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathScale {
    /// The path for each unit of the position.
    pub path_per_position: f64,
    /// How much later than the motion the detector shows it, in s.
    pub delay_s: f64,
    /// The position in m at which the path difference is 0.
    pub zero_m: f64,
}

/// Path differences on the side where the mirror's position falls, and where it grows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// The largest, in m.
    pub largest_m: f64,
    /// The largest on the short side; the same where both sides are alike.
    pub short_m: f64,
}

/// One pass of the mirror through the wanted path differences.
#[derive(Clone, Debug, PartialEq)]
pub struct MirrorScan {
    /// Its samples.
    pub rows: Range<usize>,
    /// The samples around it without a gap, its own among them.
    pub around: Range<usize>,
    /// Whether the path grows.
    pub forward: bool,
}

/// What became of a detector's samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ScanCounts {
    /// All of them.
    pub samples: usize,
    /// In a scan that is used.
    pub used: usize,
    /// Within a gap of the trajectory.
    pub in_gap: usize,
    /// Before or after the trajectory.
    pub beyond_trajectory: usize,
    /// Without a number.
    pub without_value: usize,
    /// Passes that do not lead through all wanted path differences, left out.
    pub incomplete_scans: usize,
    /// Passes in a direction that is not wanted.
    pub unwanted_scans: usize,
}

impl ScanCounts {
    /// Those of two columns together.
    pub(super) const fn plus(self, other: Self) -> Self {
        Self {
            samples: self.samples + other.samples,
            used: self.used + other.used,
            in_gap: self.in_gap + other.in_gap,
            beyond_trajectory: self.beyond_trajectory + other.beyond_trajectory,
            without_value: self.without_value + other.without_value,
            incomplete_scans: self.incomplete_scans + other.incomplete_scans,
            unwanted_scans: self.unwanted_scans + other.unwanted_scans,
        }
    }
}

/// The path difference in m of each sample; NaN where it, or the detector's value, is not known.
pub fn path_differences(
    detector: &DetectorSignal,
    track: &PositionTrack,
    scale: PathScale,
) -> (Vec<f64>, ScanCounts) {
    let mut counts = ScanCounts { samples: detector.time_s.len(), ..ScanCounts::default() };
    let paths = detector.time_s.iter().zip(&detector.value).map(|(time, value)| {
        if !value.is_finite() {
            counts.without_value += 1;
            return f64::NAN;
        }
        match track.at(time - scale.delay_s) {
            TrackPosition::At(position) => scale.path_per_position * (position - scale.zero_m),
            TrackPosition::InGap => {
                counts.in_gap += 1;
                f64::NAN
            }
            TrackPosition::Beyond => {
                counts.beyond_trajectory += 1;
                f64::NAN
            }
        }
    });
    let paths = paths.collect();
    (paths, counts)
}

/// Finds the passes that lead through all wanted path differences, from one end to the other, without a gap.
///
/// Within them the mirror does not turn, so that noise of the position at its turning points has no say.
pub fn scans(time_s: &[f64], path_m: &[f64], reach: Reach, counts: &mut ScanCounts) -> Vec<MirrorScan> {
    let longest = GAP * usual_interval(time_s);
    let mut found = Vec::new();
    let mut start = 0;
    for k in 1..=path_m.len() {
        let ends = k == path_m.len()
            || path_m[k].is_nan()
            || path_m[k - 1].is_nan()
            || time_s[k] - time_s[k - 1] > longest;
        if ends {
            passes(path_m, start..k, reach, counts, &mut found);
            start = k;
        }
    }
    found
}

/// The passes of one stretch without a gap.
fn passes(
    path_m: &[f64],
    around: Range<usize>,
    reach: Reach,
    counts: &mut ScanCounts,
    found: &mut Vec<MirrorScan>,
) {
    let [low, high] = [-reach.short_m, reach.largest_m];
    let mut k = around.start;
    while k < around.end {
        if !(low..=high).contains(&path_m[k]) {
            k += 1;
            continue;
        }
        let start = k;
        while k < around.end && (low..=high).contains(&path_m[k]) {
            k += 1;
        }
        // Where the mirror came from and went to; within a stretch that begins or ends inside, neither is known.
        let outside =
            |row: Option<usize>| row.filter(|row| around.contains(row)).map(|row| path_m[row] > 0.0);
        match (outside(start.checked_sub(1)), outside(Some(k))) {
            (Some(from), Some(to)) if from != to => {
                found.push(MirrorScan { rows: start..k, around: around.clone(), forward: to });
            }
            _ => counts.incomplete_scans += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn whole_passes_are_found_and_the_rest_is_counted() {
        let rate = 100e3;
        let time: Vec<f64> = (0..1000).map(|k| f64::from(k) / rate).collect();
        // Five cycles, beginning and ending at the zero path.
        let mut path: Vec<f64> = time.iter().map(|t| 1e-3 * (TAU * 500.0 * t).sin()).collect();
        let reach = Reach { largest_m: 0.95e-3, short_m: 0.95e-3 };
        let mut counts = ScanCounts::default();
        let found = scans(&time, &path, reach, &mut counts);
        assert_eq!((found.len(), counts.incomplete_scans), (9, 2));
        assert!(found.iter().enumerate().all(|(i, scan)| scan.forward == (i % 2 == 1)));
        assert!(found.iter().all(|scan| (78..82).contains(&scan.rows.len()) && scan.around == (0..1000)));
        // A gap in the middle of one.
        path[500] = f64::NAN;
        let mut counts = ScanCounts::default();
        assert_eq!(scans(&time, &path, reach, &mut counts).len(), 8);
        assert_eq!(counts.incomplete_scans, 4);
        // A stroke that is too short has none.
        let mut counts = ScanCounts::default();
        let reach = Reach { largest_m: 1.1e-3, short_m: 1.1e-3 };
        assert!(scans(&time, &path, reach, &mut counts).is_empty() && counts.incomplete_scans == 2);
    }
}
