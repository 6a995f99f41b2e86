//! Intensities along an estimated trajectory.

use super::raster::Passes;
use super::track::{AxisTrack, TrackAngle};
use serde::Serialize;

/// An axis of a scan.
#[derive(Clone, Debug)]
pub struct ScanAxis {
    /// Its angle over time.
    pub track: AxisTrack,
    /// The angle at the edge of the field of view, in rad.
    pub half_field_rad: f64,
    /// Pixels along it.
    pub pixels: usize,
}

impl ScanAxis {
    /// Where an angle lies in the field of view.
    pub fn position(&self, angle_rad: f64) -> f64 {
        0.5 + 0.5 * angle_rad / self.half_field_rad
    }
}

/// Intensities with their times, and where the spot was.
#[derive(Clone, Debug)]
pub struct ImageScan {
    /// When each was taken, in s, increasing; on a clock of its own rate, but with the same zero as the trajectories.
    pub time_s: Vec<f64>,
    /// The intensities; NaN where none was measured.
    pub intensity: Vec<f64>,
    /// To the right.
    pub x: ScanAxis,
    /// Downwards; without it, one line is scanned.
    pub y: Option<ScanAxis>,
}

/// What became of the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct ScanSampleCounts {
    /// All of them.
    pub samples: u64,
    /// Sorted into a pixel.
    pub used: u64,
    /// Beyond the edge of the field of view, not used.
    pub outside_field: u64,
    /// Within a gap of a trajectory, not used.
    pub in_gap: u64,
    /// Before or after a trajectory, not used.
    pub beyond_trajectory: u64,
    /// Without an intensity, not used.
    pub without_intensity: u64,
}

impl ImageScan {
    /// Width and height in pixels.
    pub fn size(&self) -> [usize; 2] {
        [self.x.pixels, self.y.as_ref().map_or(1, |y| y.pixels)]
    }

    /// The axis, 0 for x and 1 for y.
    pub fn axis(&self, axis: usize) -> Option<&ScanAxis> {
        match axis {
            0 => Some(&self.x),
            1 => self.y.as_ref(),
            _ => None,
        }
    }

    /// Sorts all samples into pixels, in one pass, with each axis ahead of its trajectory by `phases_rad`.
    ///
    /// The passes are those of x, which is 0 in `direction_of`, or of y, which is 1.
    pub fn reconstruct(&self, phases_rad: [f64; 2], direction_of: usize) -> (Passes, ScanSampleCounts) {
        let mut passes = Passes::new(self.size());
        let mut counts = ScanSampleCounts::default();
        let mut walks = self.walks(phases_rad);
        for (time, intensity) in self.time_s.iter().zip(&self.intensity) {
            counts.samples += 1;
            let [x, y] = walks.each_mut().map(|walk| walk.as_mut().map(|walk| walk.at(*time)));
            let (position, rising) = match (x, y) {
                (Some(TrackAngle::Beyond), _) | (_, Some(TrackAngle::Beyond)) => {
                    counts.beyond_trajectory += 1;
                    continue;
                }
                (Some(TrackAngle::InGap), _) | (_, Some(TrackAngle::InGap)) => {
                    counts.in_gap += 1;
                    continue;
                }
                _ if !intensity.is_finite() => {
                    counts.without_intensity += 1;
                    continue;
                }
                _ => ([self.place(0, x), self.place(1, y)], if direction_of == 1 { y } else { x }),
            };
            let forward = matches!(rising, Some(TrackAngle::At { rising: true, .. }));
            let taken = passes.add(position, forward, *intensity);
            *(if taken { &mut counts.used } else { &mut counts.outside_field }) += 1;
        }
        (passes, counts)
    }

    /// A line has no second axis: all of it lies in the middle.
    fn place(&self, axis: usize, placed: Option<TrackAngle>) -> f64 {
        match (self.axis(axis), placed) {
            (Some(axis), Some(TrackAngle::At { angle_rad, .. })) => axis.position(angle_rad),
            (None, _) => 0.5,
            _ => f64::NAN,
        }
    }

    fn walks(&self, phases_rad: [f64; 2]) -> [Option<ShiftedAxis<'_>>; 2] {
        [0, 1].map(|axis| {
            let track = &self.axis(axis)?.track;
            Some(ShiftedAxis { walk: track.walk(), lead_s: track.lead_s(phases_rad[axis]) })
        })
    }

    /// Where one axis is at every so many samples and whether it grows; NaN where that is not known.
    pub(super) fn positions(&self, axis: usize, phase_rad: f64, every: usize) -> Vec<(f64, bool)> {
        let mut walks = self.walks([phase_rad; 2]);
        let walk = &mut walks[axis.min(1)];
        let times = self.time_s.iter().step_by(every);
        times
            .map(|time| {
                let placed = walk.as_mut().map(|walk| walk.at(*time));
                (self.place(axis, placed), matches!(placed, Some(TrackAngle::At { rising: true, .. })))
            })
            .collect()
    }
}

/// An axis that is ahead of its trajectory: what it does now, the trajectory does later.
struct ShiftedAxis<'a> {
    walk: super::track::TrackWalk<'a>,
    lead_s: f64,
}

impl ShiftedAxis<'_> {
    fn at(&mut self, time_s: f64) -> TrackAngle {
        self.walk.at(time_s + self.lead_s)
    }
}
