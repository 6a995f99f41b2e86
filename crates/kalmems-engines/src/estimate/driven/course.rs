//! A driven device on its way through one segment.

use super::{Drive, DrivenSegment, Plant};
use crate::estimate::{Bridge, Counts, Course, Derived, Foreteller};
use crate::signal::Sine;
use crate::units::kind;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{Covariance, Filter, FilterError, Mat, Nodes, Over, Process, ProcessNoise};
use kalmems_models::control::{Ahead, MotionPhase, Onward};

/// Model, drive and signal of one segment.
pub struct DrivenCourse<'a, P: Plant<N>, const N: usize> {
    plant: &'a P,
    data: &'a DrivenSegment<'a>,
    noise_variance: f64,
    usual: P::Process,
    /// The rate in rad/s by which amplitude and phase are said behind the states.
    phase_rate: Option<f64>,
    /// What foretells zero phases, and from when on in s.
    foreteller: Option<(Foreteller, f64)>,
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
        let usual = plant.over(data.interval_s)?;
        Ok(Self { plant, data, noise_variance, usual, phase_rate: None, foreteller: None })
    }

    /// Likewise, where amplitude and phase are said behind the states, an angle and its rate first, by this rate of the motion
    /// in rad/s.
    #[must_use]
    pub fn with_phase(self, rate: Option<f64>) -> Self {
        Self { phase_rate: rate, ..self }
    }

    /// Likewise, where zero phases are foretold from this time in s on.
    #[must_use]
    pub fn foretelling(self, foreteller: Option<Foreteller>, from_s: f64) -> Self {
        Self { foreteller: foreteller.map(|foreteller| (foreteller, from_s)), ..self }
    }

    /// What foretells, at the end of the way.
    pub fn into_foreteller(self) -> Option<Foreteller> {
        self.foreteller.map(|(foreteller, _)| foreteller)
    }

    /// What is foretold from this mean and covariance at sample `k`.
    fn foretell_from(&mut self, mean: &[f64; N], covariance: &Covariance<f64, N>, k: usize) {
        let data = self.data;
        let Some((foreteller, from_s)) = &mut self.foreteller else { return };
        let time_s = data.time_s[k];
        if time_s < *from_s {
            return;
        }
        let sine = data.drive.coming(k).filter(|sine| {
            let strayed = (data.drive.volts()[k] - sine.at(time_s)) / sine.amplitude;
            foreteller.follows(strayed, sine.residual_rms / sine.amplitude)
        });
        let process = Outlined(&self.usual);
        match sine {
            Some(sine) => {
                let coming = Coming { sine, from_s: time_s, interval_s: data.interval_s };
                let onward = (&process, &coming);
                foreteller.take(time_s, (mean, covariance), Some(&onward as &dyn Onward<f64, N>));
            }
            None => foreteller.take(time_s, (mean, covariance), None),
        }
    }
}

/// A drive that goes on as a sine.
struct Coming<'a> {
    sine: &'a Sine,
    from_s: f64,
    interval_s: f64,
}

impl Ahead<Nodes<f64>> for Coming<'_> {
    fn input(&self, step: u32) -> Nodes<f64> {
        let at = |step: f64| self.from_s + step * self.interval_s;
        let step = f64::from(step);
        Drive::nodes_from_sine(self.sine, at(step), at(step + 1.0))
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

    fn derived(&self) -> Option<Derived<N>> {
        let names = [("amplitude", "rad", &kind::ANGLE), (PHASE, "rad", &kind::ANGLE)];
        self.phase_rate.map(|parameter| Derived { names, parameter, compute: amplitude_and_phase })
    }

    fn foretell<F: Filter<f64, N>>(&mut self, filter: &F, k: usize) {
        if self.foreteller.is_some() {
            self.foretell_from(filter.mean(), &filter.covariance(), k);
        }
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
        let Bridge { missing, steps } = Bridge::over(interval, self.data.interval_s);
        // It could be made for the usual interval.
        let each = self.plant.over(interval / steps as f64).map_err(|_| FilterError::NonFiniteState)?;
        match self.data.drive.stand_in(to) {
            Some(sine) if steps > 1 => {
                counts.bridged = counts.bridged.saturating_add(missing);
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

/// The name of the motion's phase among the quantities that follow from the states.
pub const PHASE: &str = "phase";

/// Amplitude and phase at this rate, each with its standard deviation.
fn amplitude_and_phase<const N: usize>(
    rate: f64,
    mean: &[f64; N],
    covariance: &Covariance<f64, N>,
) -> [(f64, f64); 2] {
    const { assert!(N >= 2, "the first states are the angle and its rate") };
    let MotionPhase { amplitude, amplitude_sd, phase, phase_sd } = MotionPhase::of(mean, covariance, rate);
    [(amplitude, amplitude_sd), (phase, phase_sd)]
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
