//! The stage's way through one record.

use super::segment::StageSamples;
use crate::estimate::driven::Plant;
use crate::estimate::{
    Bridge, Course, Filtering, HeldSamples, ProcessTransition, SampleCounts, SignalName, by_signals,
};
use crate::units::kind;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{FilterError, Innovation, Nodes};
use kalmems_models::dynamics::PiezoStage;
use kalmems_models::readout::PlateCurrent;

/// A channel over one record.
#[derive(Clone, Copy, Debug)]
pub struct StageChannel<'a> {
    /// Its name, such as `1A`.
    pub name: &'a str,
    /// How the signal depends on the state.
    pub current: PlateCurrent<f64>,
    /// The variance of a sample in V².
    pub noise_variance: f64,
    /// The standard deviation of each component of the sine that was taken off it, in V for each volt of the drive.
    pub feedthrough_sd: f64,
    /// The signal in V without what the drive alone makes of it; not a number where it is missing.
    pub signal: &'a [f64],
}

/// The stage as an observer of itself, driven by its drive and the last sample.
pub type StageObserver = HeldSamples<PiezoStage<f64>, PlateCurrent<f64>, 2>;

/// Model, drive and signals of one record.
pub struct StageCourse<'a, P: Plant> {
    samples: &'a StageSamples<'a>,
    channels: &'a [StageChannel<'a>],
    /// The stage as each channel reads it; it moves as the first one says.
    plants: &'a [P],
    usual: P::Motion,
    observer: Option<Box<StageObserver>>,
    /// Innovation and standard deviation of each channel after the first, at the last sample.
    further: Vec<[f64; 2]>,
}

/// How far an interval may be from the usual one and still be stepped as such, relative to it.
const SAME: f64 = 1e-6;

impl<'a, P: Plant> StageCourse<'a, P> {
    /// A way through this record, with a model for each of its channels. There is at least one.
    pub fn new(
        samples: &'a StageSamples<'a>,
        channels: &'a [StageChannel<'a>],
        plants: &'a [P],
    ) -> Result<Self, AugmentationError> {
        let usual = plants[0].over(samples.taken.interval_s)?;
        Ok(Self { samples, channels, plants, usual, observer: None, further: Vec::new() })
    }

    /// Likewise, where the step over the usual interval is that of an observer of the first channel.
    #[must_use]
    pub fn observed_by(self, observer: Option<Box<StageObserver>>) -> Self {
        Self { observer, ..self }
    }
}

impl<P: Plant> Course for StageCourse<'_, P> {
    fn time_s(&self) -> &[f64] {
        self.samples.time_s
    }

    fn signal(&self) -> &[f64] {
        self.channels.first().map_or(&[], |channel| channel.signal)
    }

    fn drive(&self, k: usize) -> Option<f64> {
        self.samples.drive.get(k).copied()
    }

    fn signals(&self) -> Vec<SignalName> {
        let of =
            |channel: &StageChannel<'_>| SignalName { name: channel.name.to_owned(), kind: &kind::VOLTAGE };
        self.channels.iter().map(of).collect()
    }

    fn further_innovations(&self) -> &[[f64; 2]] {
        &self.further
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut SampleCounts,
    ) -> Result<(), FilterError> {
        let StageSamples { time_s, drive, sines, ref taken, .. } = *self.samples;
        let (plant, from_s, start, end) = (&self.plants[0], time_s[to - 1], drive[to - 1], drive[to]);
        let interval = time_s[to] - from_s;
        if (interval / taken.interval_s - 1.0).abs() <= SAME {
            // The drive is a sampled sine: the mean of both ends.
            let nodes = Nodes { start, middle: start.midpoint(end), end };
            return match &self.observer {
                Some(observer) if self.signal()[to - 1].is_finite() => filter
                    .predict(&ProcessTransition::new(&**observer, &(nodes.middle, [self.signal()[to - 1]]))),
                _ => filter.predict(&plant.under(&self.usual, &nodes)),
            };
        }
        let Bridge { missing, steps } = Bridge::over(interval, taken.interval_s);
        counts.bridged = counts.bridged.saturating_add(missing);
        // It could be made for the usual interval.
        let motion = plant.over(interval / steps as f64).map_err(|_| FilterError::NonFiniteState)?;
        // A step as long as a part of a cycle needs the drive in between, which is the sine that it follows.
        let sine = sines.iter().find(|(rows, _)| rows.contains(&to)).map(|(_, sine)| sine);
        let volts = |step: f64| {
            let share = step / steps as f64;
            match sine {
                Some(sine) if steps > 1 => sine.at(from_s + interval * share),
                _ => start + (end - start) * share,
            }
        };
        (0..steps).try_for_each(|step| {
            let step = step as f64;
            let nodes = Nodes { start: volts(step), middle: volts(step + 0.5), end: volts(step + 1.0) };
            filter.predict(&plant.under(&motion, &nodes))
        })
    }

    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        _: &mut SampleCounts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        let signals = self.channels.iter().zip(self.plants);
        let signals =
            signals.map(|(channel, plant)| (channel.signal[k], plant.sensor(), channel.noise_variance));
        by_signals(filter, signals, &mut self.further)
    }
}
