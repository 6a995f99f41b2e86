//! The stage's way through one record.

use crate::estimate::{Bridge, Counts, Course, Filtering, Reading, Step};
use crate::signal::Sine;
use kalmems_core::{FilterError, Innovation, LinearProcess};
use kalmems_models::dynamics::PiezoStage;
use kalmems_models::readout::PlateCurrent;
use std::ops::Range;

/// A channel over one record.
#[derive(Clone, Debug)]
pub struct Channel {
    /// How the signal depends on the state.
    pub current: PlateCurrent<f64>,
    /// The variance of a sample in V².
    pub noise_variance: f64,
    /// The signal in V without what the drive alone makes of it; not a number where it is missing.
    pub signal: Vec<f64>,
}

/// Model, drive and signals of one record.
pub struct StageCourse<'a> {
    time_s: &'a [f64],
    interval_s: f64,
    /// The drive at each sample in V.
    drive: &'a [f64],
    /// The sines that it follows, each with the samples that it is for.
    sines: &'a [(Range<usize>, Sine)],
    channels: &'a [Channel],
    stage: PiezoStage<f64>,
    density: f64,
    usual: LinearProcess<f64, 2, 1>,
}

/// How far an interval may be from the usual one and still be stepped as such, relative to it.
const SAME: f64 = 1e-6;

impl<'a> StageCourse<'a> {
    /// A way through this record under white angular acceleration of this density in rad²/s³. There is at least one
    /// channel.
    pub fn new(
        (time_s, interval_s): (&'a [f64], f64),
        (drive, sines): (&'a [f64], &'a [(Range<usize>, Sine)]),
        channels: &'a [Channel],
        stage: PiezoStage<f64>,
        density: f64,
    ) -> Self {
        let usual = stage.exact(interval_s, density);
        Self { time_s, interval_s, drive, sines, channels, stage, density, usual }
    }
}

impl Course for StageCourse<'_> {
    fn time_s(&self) -> &[f64] {
        self.time_s
    }

    fn signal(&self) -> &[f64] {
        self.channels.first().map_or(&[], |channel| &channel.signal)
    }

    fn advance(
        &mut self,
        filter: &mut dyn Filtering,
        to: usize,
        counts: &mut Counts,
    ) -> Result<(), FilterError> {
        // The drive is a sampled sine: the mean of both ends.
        let drive = self.drive[to - 1].midpoint(self.drive[to]);
        let interval = self.time_s[to] - self.time_s[to - 1];
        if (interval / self.interval_s - 1.0).abs() <= SAME {
            return filter.predict(&Step::new(&self.usual, &[drive]));
        }
        let Bridge { missing, steps } = Bridge::over(interval, self.interval_s);
        counts.bridged = counts.bridged.saturating_add(missing);
        // A step as long as a part of a cycle needs the drive in between, which is the sine that it follows.
        let process = self.stage.exact(interval / steps as f64, self.density);
        let sine = self.sines.iter().find(|(rows, _)| rows.contains(&to)).map(|(_, sine)| sine);
        for step in 0..steps {
            let share = (step as f64 + 0.5) / steps as f64;
            let volts = match sine {
                Some(sine) if steps > 1 => sine.at(self.time_s[to - 1] + interval * share),
                _ => self.drive[to - 1] + (self.drive[to] - self.drive[to - 1]) * share,
            };
            filter.predict(&Step::new(&process, &[volts]))?;
        }
        Ok(())
    }

    /// By one channel after the other, each linearised where those before it have led.
    ///
    /// What is kept of the innovations is the first channel's: it alone is foretold by the past and nothing else, so that
    /// its sequence is white and its NIS 1 on average for a filter that is right, whatever the number of channels. A
    /// wrong gap or gain of another one moves the state, and shows there.
    fn correct(
        &mut self,
        filter: &mut dyn Filtering,
        k: usize,
        _: &mut Counts,
    ) -> Result<Option<Innovation<f64, 1>>, FilterError> {
        let mut first = None;
        for (i, channel) in self.channels.iter().enumerate() {
            let y = channel.signal[k];
            if y.is_finite() {
                let sensor = Reading::<_, 2>(&channel.current);
                let innovation = filter.update(&sensor, y, channel.noise_variance)?;
                if i == 0 {
                    first = Some(innovation);
                }
            }
        }
        Ok(first)
    }
}
