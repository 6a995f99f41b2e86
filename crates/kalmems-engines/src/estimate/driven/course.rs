//! A driven device on its way through one segment.

use super::{DrivenSegment, Plant, SegmentDrive};
use crate::estimate::{Bridge, Course, Filtering, SampleCounts, by_signal};
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{FilterError, Innovation};

/// Model, drive and signal of one segment.
pub struct DrivenCourse<'a, P: Plant> {
    plant: &'a P,
    data: &'a DrivenSegment<'a>,
    noise_variance: f64,
    /// One step over the usual interval: what a prediction of zero phases goes on by.
    usual: P::Motion,
    /// So many steps from sample to sample, at least; how many, and each of them, where they are several.
    least: usize,
    parts: Option<(usize, P::Motion)>,
}

/// How far an interval may be from the usual one and still be stepped as such, relative to it: well below what
/// times written in decimals round to.
const SAME: f64 = 1e-6;

impl<'a, P: Plant> DrivenCourse<'a, P> {
    /// A way through this segment.
    pub fn new(
        plant: &'a P,
        noise_variance: f64,
        data: &'a DrivenSegment<'a>,
    ) -> Result<Self, AugmentationError> {
        let usual = plant.over(data.interval_s)?;
        Ok(Self { plant, data, noise_variance, usual, least: 1, parts: None })
    }

    /// Likewise, by so many steps from sample to sample at least, each linearised where the one before has led: the prediction of a
    /// hybrid filter, whose mean and covariance follow their differential equations.
    pub fn in_steps(self, least: usize) -> Result<Self, AugmentationError> {
        let each = self.plant.over(self.data.interval_s / least as f64)?;
        Ok(Self { least, parts: Some((least, each)), ..self })
    }
}

/// Steps from sample to sample in which a hybrid filter follows its differential equations: what the method of fourth order
/// leaves out is 8⁴ times smaller than in one step.
pub const HYBRID_STEPS: usize = 8;

impl<P: Plant> Course for DrivenCourse<'_, P> {
    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn drive(&self, k: usize) -> Option<f64> {
        Some(self.data.drive.sample(k).0)
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        counts.drive_from_sine += usize::from(self.data.drive.sample(to).1);
        let (from_s, to_s) = (self.data.time_s[to - 1], self.data.time_s[to]);
        let interval = to_s - from_s;
        if (interval / self.data.interval_s - 1.0).abs() <= SAME {
            let drive = self.data.drive.nodes(to);
            let Some((steps, each)) = &self.parts else {
                return filter.predict(&self.plant.under(&self.usual, &drive));
            };
            return (0..*steps).try_for_each(|step| {
                filter.predict(&self.plant.under(each, &SegmentDrive::nodes_of_part(&drive, step, *steps)))
            });
        }
        // A gap: steps of about the usual length, driven by the sine that the drive follows. Where it follows
        // none, the recording was refused before it came here.
        let Bridge { missing, steps } = Bridge::over(interval, self.data.interval_s);
        let (bridged, parts) = (steps > 1, steps * self.parts.as_ref().map_or(1, |(parts, _)| *parts));
        // It could be made for the usual interval.
        let each = self.plant.over(interval / parts as f64).map_err(|_| FilterError::NonFiniteState)?;
        match self.data.drive.substitute(to) {
            Some(sine) if bridged => {
                counts.bridged = counts.bridged.saturating_add(missing);
                for i in 0..parts {
                    let at = |i: usize| from_s + interval * i as f64 / parts as f64;
                    let nodes = SegmentDrive::nodes_from_sine(sine, at(i), at(i + 1));
                    filter.predict(&self.plant.under(&each, &nodes))?;
                }
                Ok(())
            }
            _ => {
                let drive = self.data.drive.nodes(to);
                (0..parts).try_for_each(|step| {
                    filter
                        .predict(&self.plant.under(&each, &SegmentDrive::nodes_of_part(&drive, step, parts)))
                })
            }
        }
    }

    fn divide(&mut self, steps: usize) -> bool {
        let steps = steps.max(self.least);
        // It could be made for the usual interval.
        let each = || self.plant.over(self.data.interval_s / steps as f64).ok();
        self.parts = (steps > 1).then(each).flatten().map(|each| (steps, each));
        self.plant.divides()
    }

    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        _: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        by_signal(filter, self.data.signal[k], (&self.plant.sensor(), self.noise_variance))
    }
}
