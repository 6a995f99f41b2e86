//! The way of both axes through one segment.

use super::settings::Settings;
use crate::estimate::{Counts, Course};
use crate::rigs::shared_scanner::data::SegmentData;
use kalmems_core::{Filter, FilterError, NoiseDensity, Rk4};
use kalmems_models::dynamics::TwoAxisScanner;
use kalmems_models::readout::TwoAxisComb;

type Step = Rk4<TwoAxisScanner<f64>, f64, 4>;

/// Model, drive and signal of one segment. Its drive is known throughout.
pub struct TwoAxisCourse<'a> {
    settings: &'a Settings,
    acceleration_density: [f64; 2],
    data: &'a SegmentData<'a>,
    usual: Step,
}

/// How far an interval may be from the usual one and still be stepped as such, relative to it.
const SAME: f64 = 1e-6;

impl<'a> TwoAxisCourse<'a> {
    /// A way through this segment.
    pub fn new(settings: &'a Settings, acceleration_density: [f64; 2], data: &'a SegmentData<'a>) -> Self {
        let usual = step(settings, acceleration_density, data.interval_s);
        Self { settings, acceleration_density, data, usual }
    }
}

/// One integration step; the noise is discretised for the motion at rest and without a drive.
fn step(settings: &Settings, [of_x, of_y]: [f64; 2], interval_s: f64) -> Step {
    let noise = NoiseDensity::none().on::<1>(of_x).on::<3>(of_y);
    Rk4::new(settings.hardware.scanner, interval_s, &noise, (&[0.0; 4], &0.0))
}

impl Course<4> for TwoAxisCourse<'_> {
    type Measurement = TwoAxisComb<f64>;

    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn measurement(&self) -> (&TwoAxisComb<f64>, f64) {
        (&self.settings.hardware.readout, self.settings.hardware.noise_variance)
    }

    fn advance<F: Filter<f64, 4>>(
        &mut self,
        filter: &mut F,
        to: usize,
        _: &mut Counts,
    ) -> Result<(), FilterError> {
        let interval = self.data.time_s[to] - self.data.time_s[to - 1];
        let nodes = self.data.drive.nodes(to);
        if (interval / self.data.interval_s - 1.0).abs() <= SAME {
            filter.predict(&self.usual, &nodes).map(drop)
        } else {
            filter.predict(&step(self.settings, self.acceleration_density, interval), &nodes).map(drop)
        }
    }
}
