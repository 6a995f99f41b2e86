//! The Euler filter of the scanner as C that was exported from the device's equations, called from here.

use crate::by_hand::scanner_samples;
use crate::runs::{Euler, Run};

/// `scanner_filter_t` of the header.
#[repr(C)]
pub struct FromText {
    mean: [f32; 2],
    /// The lower triangle, row by row.
    covariance: [f32; 3],
    /// `scanner_filter_watch_t`, and how often the filter has begun again.
    innovations: [f32; 6],
    counts: [u32; 4],
    begun: u32,
    /// The last drive that was a number, and how many were none.
    inputs: [f32; 1],
    missing: u32,
}

unsafe extern "C" {
    fn scanner_filter_start(filter: *mut FromText);
    fn scanner_filter_update_signal(filter: *mut FromText, signal_v: f32) -> i32;
    fn scanner_filter_step(filter: *mut FromText, drive_v: f32, signal_v: f32) -> i32;
}

impl Run<f32> for FromText {
    type Sample = (f32, f32);
    const STEPS: usize = scanner_samples::SIGNAL_V.len() - 1;

    fn begin() -> Option<Self> {
        let mut filter = Self {
            mean: [0.0; 2],
            covariance: [0.0; 3],
            innovations: [0.0; 6],
            counts: [0; 4],
            begun: 0,
            inputs: [0.0],
            missing: 0,
        };
        let first = scanner_samples::SIGNAL_V.first().copied()?;
        // SAFETY: functions of the header with a filter that is there; they keep no pointer.
        let taken = unsafe {
            scanner_filter_start(&mut filter);
            scanner_filter_update_signal(&mut filter, first)
        };
        (taken != 0).then_some(filter)
    }

    fn sample(k: usize) -> (f32, f32) {
        <Euler<f32> as Run<f32>>::sample(k)
    }

    #[inline(always)]
    fn step(&mut self, (drive_v, signal_v): (f32, f32)) -> bool {
        // SAFETY: a function of the header with a filter that is there; it keeps no pointer.
        unsafe { scanner_filter_step(self, drive_v, signal_v) != 0 }
    }

    fn says(&self) -> [f32; 4] {
        [self.mean[0], self.mean[1], self.covariance[0], self.covariance[2]]
    }
}
