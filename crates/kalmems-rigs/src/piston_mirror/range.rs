//! Samples that the device cannot have made.

use super::data::SegmentData;
use super::plates::capacitance_range;
use super::settings::Hardware;

/// How many standard deviations of its noise a sample may be beyond the capacitances of the device: one in 10⁹ is.
const BEYOND: f64 = 6.0;

/// The samples beyond what the device can have at any distance, noise included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    /// How many.
    pub count: usize,
    /// The first of them, as a place in the segment.
    pub first: usize,
    /// How far the farthest of them is beyond, in F, with its sign.
    pub largest_f: f64,
}

/// The signal without those samples, and what they were; `None` where there is none.
///
/// They say nothing of the distance: such a sample is a fault of the readout, and no estimator takes it for the motion.
pub fn without_impossible(hardware: &Hardware, data: &SegmentData) -> Option<(Vec<f64>, Beyond)> {
    let [low, high] = capacitance_range(&hardware.plates, hardware.table_m);
    let margin = BEYOND * data.noise_variance.sqrt();
    // 0 within the range.
    let beyond = |y: f64| {
        if y < low - margin {
            y - low
        } else if y > high + margin {
            y - high
        } else {
            0.0
        }
    };
    let first = data.signal.iter().position(|y| beyond(*y) != 0.0)?;
    let mut found = Beyond { count: 0, first, largest_f: 0.0 };
    let kept = data
        .signal
        .iter()
        .map(|y| {
            let off = beyond(*y);
            if off == 0.0 {
                return *y;
            }
            found.count += 1;
            if off.abs() > found.largest_f.abs() {
                found.largest_f = off;
            }
            f64::NAN
        })
        .collect();
    Some((kept, found))
}
