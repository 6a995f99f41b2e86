//! A driven device on its way through one segment.

use super::{Drive, DrivenSegment, Plant};
use crate::estimate::{Counts, Course};
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{Filter, FilterError, Mat, Nodes, Over, Process, ProcessNoise};

/// Model, drive and signal of one segment.
pub struct DrivenCourse<'a, P: Plant<N>, const N: usize> {
    plant: &'a P,
    data: &'a DrivenSegment<'a>,
    noise_variance: f64,
    usual: P::Process,
}

/// How far an interval may be from the usual one and still be stepped as such, relative to it: well below what
/// times written in decimals round to.
const SAME: f64 = 1e-6;

impl<'a, P: Plant<N>, const N: usize> DrivenCourse<'a, P, N> {
    /// A way through this segment.
    pub fn new(
        plant: &'a P,
        noise_variance: f64,
        data: &'a DrivenSegment<'a>,
    ) -> Result<Self, AugmentationError> {
        Ok(Self { plant, data, noise_variance, usual: plant.over(data.interval_s)? })
    }
}

impl<P: Plant<N>, const N: usize> Course<N> for DrivenCourse<'_, P, N> {
    type Measurement = P::Readout;

    fn time_s(&self) -> &[f64] {
        self.data.time_s
    }

    fn signal(&self) -> &[f64] {
        self.data.signal
    }

    fn measurement(&self) -> (&P::Readout, f64) {
        (self.plant.readout(), self.noise_variance)
    }

    fn advance<F: Filter<f64, N>>(
        &mut self,
        filter: &mut F,
        to: usize,
        counts: &mut Counts,
    ) -> Result<(), FilterError> {
        counts.drive_from_sine += usize::from(self.data.drive.sample(to).1);
        let (from_s, to_s) = (self.data.time_s[to - 1], self.data.time_s[to]);
        let interval = to_s - from_s;
        if (interval / self.data.interval_s - 1.0).abs() <= SAME {
            return predict(filter, &self.usual, &self.data.drive.nodes(to));
        }
        // A gap: steps of about the usual length, driven by the sine that the drive follows. Where it follows
        // none, the recording was refused before it came here.
        let steps = (interval / self.data.interval_s).round().max(1.0);
        // It could be made for the usual interval.
        let each = self.plant.over(interval / steps).map_err(|_| FilterError::NonFiniteState)?;
        match self.data.drive.stand_in(to) {
            Some(sine) if steps > 1.0 => {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // rounded and positive
                let steps = steps as usize;
                counts.bridged += steps - 1;
                for i in 0..steps {
                    let at = |i: usize| from_s + interval * i as f64 / steps as f64;
                    predict(filter, &each, &Drive::nodes_from_sine(sine, at(i), at(i + 1)))?;
                }
                Ok(())
            }
            _ => predict(filter, &each, &self.data.drive.nodes(to)),
        }
    }
}

/// One prediction. The step of a model is compiled once per model and called, see [`AnyFilter`](crate::estimate::AnyFilter).
fn predict<F: Filter<f64, N>, P: Process<f64, N, Input = Nodes<f64>>, const N: usize>(
    filter: &mut F,
    process: &P,
    drive: &Nodes<f64>,
) -> Result<(), FilterError> {
    filter.predict_linked(&Outlined(process), drive).map(drop)
}

/// A process whose functions are called.
struct Outlined<'a, P>(&'a P);

impl<P: Process<f64, N, Input = Nodes<f64>>, const N: usize> Process<f64, N> for Outlined<'_, P> {
    type Input = Nodes<f64>;

    #[inline(never)]
    fn step<S: Over<f64>>(&self, x: &[S; N], drive: &Nodes<f64>) -> [S; N] {
        self.0.step(x, drive)
    }

    fn noise(&self) -> &ProcessNoise<f64, N> {
        self.0.noise()
    }

    fn depends(i: usize, j: usize) -> bool {
        P::depends(i, j)
    }

    #[inline(never)]
    fn linearize(&self, x: &[f64; N], drive: &Nodes<f64>) -> ([f64; N], Mat<f64, N, N>) {
        self.0.linearize(x, drive)
    }
}
