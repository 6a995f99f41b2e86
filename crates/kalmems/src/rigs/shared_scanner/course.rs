//! The scanner's way through one segment.

use super::data::SegmentData;
use super::drive::Drive;
use super::settings::Settings;
use crate::estimate::{Counts, Course};
use kalmems_core::{Filter, FilterError, NoiseDensity, Rk4};
use kalmems_models::dynamics::ParametricScanner;
use kalmems_models::readout::DemodulatedComb;

type Step = Rk4<ParametricScanner<f64>, f64, 2>;

/// Model, drive and signal of one segment.
pub struct ScannerCourse<'a> {
    settings: &'a Settings,
    data: &'a SegmentData<'a>,
    usual: Step,
}

/// How far an interval may be from the usual one and still be stepped as such, relative to it: well below what
/// times written in decimals round to.
const SAME: f64 = 1e-6;

impl<'a> ScannerCourse<'a> {
    /// A way through this segment.
    pub fn new(settings: &'a Settings, data: &'a SegmentData<'a>) -> Self {
        Self { settings, data, usual: step(settings, data.interval_s) }
    }
}

/// One integration step; the noise is discretised for the motion at rest and without a drive.
fn step(settings: &Settings, interval_s: f64) -> Step {
    let noise = NoiseDensity::none().on::<1>(settings.acceleration_density);
    Rk4::new(settings.scanner, interval_s, &noise, (&[0.0, 0.0], &0.0))
}

impl Course<2> for ScannerCourse<'_> {
    type Measurement = DemodulatedComb<f64>;

    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn measurement(&self) -> (&DemodulatedComb<f64>, f64) {
        (&self.settings.readout, self.settings.noise_variance)
    }

    fn advance<F: Filter<f64, 2>>(
        &mut self,
        filter: &mut F,
        to: usize,
        counts: &mut Counts,
    ) -> Result<(), FilterError> {
        counts.drive_from_sine += usize::from(self.data.drive.sample(to).1);
        let (from_s, to_s) = (self.data.time_s[to - 1], self.data.time_s[to]);
        let interval = to_s - from_s;
        if (interval / self.data.interval_s - 1.0).abs() <= SAME {
            return filter.predict(&self.usual, &self.data.drive.nodes(to)).map(drop);
        }
        // A gap: steps of about the usual length, driven by the sine that the drive follows. Where it follows
        // none, the recording was refused before it came here.
        let steps = (interval / self.data.interval_s).round().max(1.0);
        let each = step(self.settings, interval / steps);
        match self.data.drive.sine() {
            Some(sine) if steps > 1.0 => {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // rounded and positive
                let steps = steps as usize;
                counts.bridged += steps - 1;
                for i in 0..steps {
                    let at = |i: usize| from_s + interval * i as f64 / steps as f64;
                    filter.predict(&each, &Drive::nodes_from_sine(sine, at(i), at(i + 1)))?;
                }
                Ok(())
            }
            _ => filter.predict(&each, &self.data.drive.nodes(to)).map(drop),
        }
    }
}
