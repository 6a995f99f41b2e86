//! Parameters of a differential equation from what was recorded of it.

use super::ResidualLaw;
use kalmems_core::augmentation::{ParametricMeasurement, ParametricProcess};
use kalmems_core::{Over, Parameters};

/// What an unknown of a [`Shooting`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unknown<'a> {
    /// A parameter of the process's model, by its path, such as `"resonator.stiffness"`.
    Process(&'a str),
    /// A parameter of the measurement.
    Measurement(&'a str),
    /// One number that is a parameter of both: electrodes that drive and sense have one capacitance.
    Shared {
        /// Its path in the process's model.
        process: &'a str,
        /// Its path in the measurement.
        measurement: &'a str,
    },
    /// A state at the first sample, by its index.
    Start(usize),
}

/// Why there is nothing to shoot with.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ShootingError {
    /// A model has no parameter of this name.
    #[error("the {model} has no parameter `{name}`; it has: {}", known.join(", "))]
    NoSuchParameter {
        /// Which model.
        model: &'static str,
        /// The name.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// There is no state of this index.
    #[error("there is no state {state}; there are {states}, counted from 0")]
    NoSuchState {
        /// The index.
        state: usize,
        /// How many there are.
        states: usize,
    },
    /// Two unknowns are the same.
    #[error("the unknowns {first} and {second}, counted from 0, are the same")]
    Twice {
        /// The first of them.
        first: usize,
        /// The second.
        second: usize,
    },
    /// A standard deviation is not above 0 and finite.
    #[error("the standard deviation of output {output}, counted from 0, is not a finite number above 0")]
    Deviation {
        /// Which output.
        output: usize,
    },
    /// There would be no step between samples.
    #[error("there are no steps between samples; give at least 1")]
    NoSteps,
}

/// The fit of a differential equation by shooting: the model runs from a start through the whole record, and the
/// residuals are (y_k − h(x_k))/σ.
///
/// Parameters of process and measurement and the states at the first sample are the `K` unknowns; the others stay
/// as the models have them. A fit by shooting is the most likely one where noise enters the measurement alone:
/// there its standard deviations are those of the Cramér–Rao bound. It is no filter: noise that moves the device
/// adds up over the record, and its residuals are then not white.
///
/// From one sample to the next the process takes `steps` steps, each with the input that `input(step)` says, counted
/// from 0 through the record. How an input runs between its samples is for the caller to say. Samples that are
/// not finite are passed over. Derivatives come from dual numbers that run along; nothing is stored per sample.
///
/// The stiffness and the start of a free oscillation, without an input:
///
/// ```
/// use kalmems_engines::fit::{ByDual, FitSettings, Shooting, Unknown, fit};
/// use kalmems_core::{Dynamics, Measurement, Nodes, NoiseDensity, Over, Rk4, Scalar};
/// use kalmems_macros::{Parameters, model};
/// #[derive(Parameters)]
/// struct Spring<P> {
///     square_rate: P,
/// }
/// #[model(parametric)]
/// impl<T: Scalar> Dynamics<T, 2> for Spring<T> {
///     type Input = ();
///     fn derivative<S: Over<T>>(&self, x: &[S; 2], (): &()) -> [S; 2] {
///         [x[1], -(x[0] * self.square_rate)]
///     }
/// }
/// #[derive(Parameters)]
/// struct Gauge<P> {
///     gain: P,
/// }
/// #[model(parametric)]
/// impl<T: Scalar> Measurement<T, 2, 1> for Gauge<T> {
///     fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
///         [x[0] * self.gain]
///     }
/// }
/// // 2·cos 3t, seen every tenth of a second through a gauge of gain 5.
/// let samples: Vec<[f64; 1]> = (0..60).map(|k| [10.0 * f64::cos(0.3 * f64::from(k))]).collect();
/// let steps = 50;
/// let process = Rk4::new(Spring { square_rate: 8.0 }, 0.1 / 50.0, &NoiseDensity::none(), (&[0.0; 2], &()));
/// let unknowns = [Unknown::Process("square_rate"), Unknown::Start(0)];
/// let shooting = Shooting::new(
///     (process, Gauge { gain: 5.0 }),
///     ([1.0, 0.0], unknowns),
///     (steps, |_| Nodes::held(())),
///     (&samples, [1.0]),
/// )?;
/// let settings = FitSettings::from_start(shooting.nominal());
/// let found = fit(&ByDual(shooting), &settings)?;
/// assert!((found.parameters[0] - 9.0).abs() < 1e-6 && (found.parameters[1] - 2.0).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Shooting<'a, P, H, F, const N: usize, const M: usize, const K: usize> {
    process: P,
    measurement: H,
    start: [f64; N],
    places: [UnknownPlace; K],
    steps: usize,
    input: F,
    samples: &'a [[f64; M]],
    deviations: [f64; M],
}

/// Where an unknown enters: indices of parameters and of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct UnknownPlace {
    process: Option<usize>,
    measurement: Option<usize>,
    start: Option<usize>,
}

impl UnknownPlace {
    fn of<P: Parameters<f64>, H: Parameters<f64>>(
        unknown: &Unknown,
        states: usize,
    ) -> Result<Self, ShootingError> {
        let nowhere = Self { process: None, measurement: None, start: None };
        let process = |name| index_of::<P>("process", name).map(Some);
        let measurement = |name| index_of::<H>("measurement", name).map(Some);
        Ok(match *unknown {
            Unknown::Process(name) => Self { process: process(name)?, ..nowhere },
            Unknown::Measurement(name) => Self { measurement: measurement(name)?, ..nowhere },
            Unknown::Shared { process: p, measurement: m } => {
                Self { process: process(p)?, measurement: measurement(m)?, ..nowhere }
            }
            Unknown::Start(state) if state < states => Self { start: Some(state), ..nowhere },
            Unknown::Start(state) => return Err(ShootingError::NoSuchState { state, states }),
        })
    }

    fn meets(&self, other: &Self) -> bool {
        let same = |a: Option<usize>, b: Option<usize>| a.is_some() && a == b;
        same(self.process, other.process)
            || same(self.measurement, other.measurement)
            || same(self.start, other.start)
    }
}

fn index_of<Q: Parameters<f64>>(model: &'static str, name: &str) -> Result<usize, ShootingError> {
    Q::index_of(name).ok_or_else(|| {
        let known = (0..Q::COUNT).filter_map(|i| Q::name(i)).map(|name| name.to_string()).collect();
        ShootingError::NoSuchParameter { model, name: name.to_owned(), known }
    })
}

impl<'a, P, H, F, const N: usize, const M: usize, const K: usize> Shooting<'a, P, H, F, N, M, K>
where
    P: ParametricProcess<f64, N>,
    H: ParametricMeasurement<f64, N, M>,
    F: Fn(usize) -> P::Input,
{
    /// Process and measurement as they are believed to be; the state at the first sample and what is unknown;
    /// the steps per sample and the input of each step; the samples and the standard deviation of each output.
    pub fn new(
        (process, measurement): (P, H),
        (start, unknowns): ([f64; N], [Unknown; K]),
        (steps, input): (usize, F),
        (samples, deviations): (&'a [[f64; M]], [f64; M]),
    ) -> Result<Self, ShootingError> {
        if steps == 0 {
            return Err(ShootingError::NoSteps);
        }
        if let Some(output) = deviations.iter().position(|d| !(*d > 0.0 && d.is_finite())) {
            return Err(ShootingError::Deviation { output });
        }
        let mut places = [UnknownPlace { process: None, measurement: None, start: None }; K];
        for (second, unknown) in unknowns.iter().enumerate() {
            let place = UnknownPlace::of::<P::Model, H>(unknown, N)?;
            if let Some(first) = places[..second].iter().position(|earlier| earlier.meets(&place)) {
                return Err(ShootingError::Twice { first, second });
            }
            places[second] = place;
        }
        Ok(Self { process, measurement, start, places, steps, input, samples, deviations })
    }

    /// The unknowns as the models and the start have them; of a shared parameter, as the process has it.
    pub fn nominal(&self) -> [f64; K] {
        self.places.map(|place| {
            match place {
                UnknownPlace { process: Some(index), .. } => self.process.model().value(index),
                UnknownPlace { measurement: Some(index), .. } => self.measurement.value(index),
                UnknownPlace { start: Some(state), .. } => Some(self.start[state]),
                _ => None,
            }
            .unwrap_or(f64::NAN)
        })
    }

    /// The model's output at the first sample and at each after it, with the unknowns at these values.
    ///
    /// For as many samples as are asked for, with the input there.
    pub fn run<S: Over<f64>>(&self, unknowns: &[S; K], count: usize, mut each: impl FnMut(usize, [S; M])) {
        let unknown_at = |at: &dyn Fn(&UnknownPlace) -> bool| {
            self.places.iter().position(at).and_then(|index| unknowns.get(index).copied())
        };
        let model = self.process.model().map(|index, nominal| {
            unknown_at(&|place| place.process == Some(index)).unwrap_or(S::lift(nominal))
        });
        let seen = self.measurement.map(|index, nominal| {
            unknown_at(&|place| place.measurement == Some(index)).unwrap_or(S::lift(nominal))
        });
        let mut x: [S; N] = std::array::from_fn(|state| {
            unknown_at(&|place| place.start == Some(state)).unwrap_or(S::lift(self.start[state]))
        });
        for k in 0..count {
            if k > 0 {
                for step in 0..self.steps {
                    x = self.process.step_of(&model, &x, &(self.input)((k - 1) * self.steps + step));
                }
            }
            each(k, H::predict_of(&seen, &x));
        }
    }
}

impl<P, H, F, const N: usize, const M: usize, const K: usize> ResidualLaw<K>
    for Shooting<'_, P, H, F, N, M, K>
where
    P: ParametricProcess<f64, N>,
    H: ParametricMeasurement<f64, N, M>,
    F: Fn(usize) -> P::Input,
{
    fn residuals<S: Over<f64>>(&self, unknowns: &[S; K], each: &mut impl FnMut(S)) {
        self.run(unknowns, self.samples.len(), |k, output| {
            for ((sample, output), deviation) in self.samples[k].iter().zip(output).zip(&self.deviations) {
                if sample.is_finite() {
                    each((S::lift(*sample) - output) * deviation.recip());
                }
            }
        });
    }
}
