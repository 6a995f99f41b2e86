//! Samples that the device cannot have made.

use super::data::PistonSegment;
use super::plates::capacitance_range;
use super::settings::PistonHardware;
use std::ops::Range;

/// How many standard deviations of its noise a sample may be beyond the capacitances of the device: one in 10⁹ is.
const BEYOND: f64 = 6.0;

/// The samples beyond what the device can have at any distance, noise included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SamplesOutOfRange {
    /// How many.
    pub count: usize,
    /// Time in s and capacitance in F of the first of them.
    pub first: [f64; 2],
    /// How far the farthest of them is beyond, in F, with its sign.
    pub largest_f: f64,
}

impl SamplesOutOfRange {
    /// With those that came later.
    pub fn add(&mut self, later: &Self) {
        self.count += later.count;
        if later.largest_f.abs() > self.largest_f.abs() {
            self.largest_f = later.largest_f;
        }
    }
}

/// The signal without those samples, where there are any, and what they were among the fresh rows.
///
/// They say nothing of the distance: such a sample is a fault of the readout, and no estimator takes it for the motion.
pub fn without_impossible(
    hardware: &PistonHardware,
    data: &PistonSegment,
    fresh: &Range<usize>,
) -> (Option<Vec<f64>>, Option<SamplesOutOfRange>) {
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
    if data.signal.iter().all(|y| beyond(*y) == 0.0) {
        return (None, None);
    }
    let mut found: Option<SamplesOutOfRange> = None;
    for k in fresh.clone() {
        let (y, off) = (data.signal[k], beyond(data.signal[k]));
        if off != 0.0 {
            let one = SamplesOutOfRange { count: 1, first: [data.time_s[k], y], largest_f: off };
            match &mut found {
                Some(found) => found.add(&one),
                None => found = Some(one),
            }
        }
    }
    let kept = data.signal.iter().map(|y| if beyond(*y) == 0.0 { *y } else { f64::NAN });
    (Some(kept.collect()), found)
}
