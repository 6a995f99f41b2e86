//! Parameters of a device that are states of a filter, as its models meet them.

use crate::estimate::{DeviceParameter, MOST_STATES, Sensor, Tracked, Transition};
use kalmems_core::augmentation::{AddedState, AugmentationError, ParametricMeasurement};
use kalmems_core::{Dual, Parameters, Process, ProcessNoise};

/// The most parameters that a filter can have as states: of a motion with more there is no filter, which is refused before
/// any step.
pub const MOST_PARAMETERS: usize = MOST_STATES;

/// Which parameter of one model each state behind those of the motion enters.
#[derive(Clone)]
pub(super) struct ParameterIndices {
    /// The parameter's index, where it enters this model, and the state.
    states: Vec<(Option<usize>, AddedState<f64>)>,
}

impl ParameterIndices {
    /// In a model of type `M`.
    pub(super) fn of<M: Parameters<f64>>(
        tracked: &[Tracked],
        place: fn(&DeviceParameter) -> Option<&'static str>,
    ) -> Result<Self, AugmentationError> {
        let mut states: Vec<(Option<usize>, AddedState<f64>)> = Vec::new();
        for (state, tracked) in tracked.iter().take(MOST_PARAMETERS).enumerate() {
            tracked.added.check(state)?;
            let index = place(tracked.parameter)
                .map(|name| M::index_of(name).ok_or(AugmentationError::NoSuchParameter { state }))
                .transpose()?;
            let twice = states.iter().any(|(other, _)| index.is_some() && *other == index);
            if let Some(parameter) = index.filter(|_| twice).and_then(M::name) {
                return Err(AugmentationError::EnteredTwice { parameter, state });
            }
            states.push((index, tracked.added));
        }
        Ok(Self { states })
    }

    /// The value of a parameter with these deviations, which of them moves it, and how far one of that does; a scale of 0
    /// where none does.
    #[inline]
    pub(super) fn varied(&self, parameter: usize, nominal: f64, deviations: &[f64]) -> (usize, f64, f64) {
        for (i, (index, added)) in self.states.iter().enumerate() {
            if *index == Some(parameter) {
                return (i, added.scale, nominal + deviations[i] * added.scale);
            }
        }
        (0, 0.0, nominal)
    }

    /// Their own step over an interval.
    pub(super) fn over(&self, interval_s: f64) -> ParameterStep {
        ParameterStep::of(self.states.iter().map(|(_, added)| *added), interval_s)
    }
}

/// The step of parameters that are states behind those of a motion: each depends on itself alone.
#[derive(Clone, Copy, Debug)]
pub struct ParameterStep {
    count: usize,
    /// How much of each deviation is left after the interval, and the variance that is added to it.
    steps: [(f64, f64); MOST_PARAMETERS],
}

impl ParameterStep {
    /// Of so many added states, over an interval in s.
    pub fn of(added: impl Iterator<Item = AddedState<f64>>, interval_s: f64) -> Self {
        let (mut count, mut steps) = (0, [(1.0, 0.0); MOST_PARAMETERS]);
        for (step, added) in steps.iter_mut().zip(added) {
            *step = added.drift.over(interval_s);
            count += 1;
        }
        Self { count, steps }
    }

    /// Where the parameters go, behind `moving` states.
    pub fn advance(&self, moving: usize, x: &[f64], to: &mut [f64]) {
        for ((to, x), (persistence, _)) in to[moving..].iter_mut().zip(&x[moving..]).zip(self.steps) {
            *to = x * persistence;
        }
    }

    /// Their rows of a Jacobian.
    pub fn linearize(&self, moving: usize, states: usize, jacobian: &mut [f64]) {
        for i in moving..states {
            let row = &mut jacobian[i * states..(i + 1) * states];
            row.fill(0.0);
            row[i] = self.steps[i - moving].0;
        }
    }

    /// Covariance and root of the noise of all states, with that of a motion of so many.
    pub fn noise<const M: usize>(
        &self,
        (of_motion, moving): (&ProcessNoise<f64, M>, usize),
        covariance: &mut [f64],
        root: &mut [f64],
    ) {
        let states = moving + self.count;
        for (whole, part) in
            [(&mut *covariance, of_motion.covariance().lower_triangle()), (&mut *root, of_motion.root())]
        {
            whole.fill(0.0);
            for (row, part) in whole.chunks_exact_mut(states).zip(&part.0).take(moving) {
                row[..moving].copy_from_slice(&part[..moving]);
            }
        }
        for (i, (_, variance)) in (moving..states).zip(self.steps) {
            covariance[i * states + i] = variance;
            root[i * states + i] = variance.sqrt();
        }
    }
}

/// A step of a motion of `M` states that no parameter enters, with parameters as states behind them.
pub struct ParameterAugmentedStep<'a, P: Process<f64, M>, const M: usize> {
    /// The process of the motion.
    pub process: &'a P,
    /// Its input.
    pub input: &'a P::Input,
    /// The parameters.
    pub held: &'a ParameterStep,
}

impl<P: Process<f64, M>, const M: usize> Transition for ParameterAugmentedStep<'_, P, M> {
    #[inline(never)]
    fn advance(&self, x: &[f64], to: &mut [f64]) {
        to[..M].copy_from_slice(&self.process.step(&std::array::from_fn(|i| x[i]), self.input));
        self.held.advance(M, x, to);
    }

    #[inline(never)]
    fn linearize(&self, x: &[f64], to: &mut [f64], jacobian: &mut [f64]) {
        let (next, slopes) = self.process.linearize(&std::array::from_fn(|i| x[i]), self.input);
        to[..M].copy_from_slice(&next);
        self.held.advance(M, x, to);
        for (row, slopes) in jacobian.chunks_exact_mut(x.len()).zip(&slopes.0) {
            row.fill(0.0);
            row[..M].copy_from_slice(slopes);
        }
        self.held.linearize(M, x.len(), jacobian);
    }

    fn noise(&self, covariance: &mut [f64], root: &mut [f64]) {
        self.held.noise((self.process.noise(), M), covariance, root);
    }

    fn moving(&self, _: usize) -> usize {
        M
    }
}

/// A readout of `M` states and of parameters behind them.
#[derive(Clone)]
pub struct ParametricReadout<H, const M: usize> {
    readout: H,
    places: ParameterIndices,
}

impl<H: Parameters<f64>, const M: usize> ParametricReadout<H, M> {
    /// These parameters as states; `place` says where each enters.
    pub fn new(
        readout: H,
        tracked: &[Tracked],
        place: fn(&DeviceParameter) -> Option<&'static str>,
    ) -> Result<Self, AugmentationError> {
        Ok(Self { places: ParameterIndices::of::<H>(tracked, place)?, readout })
    }
}

impl<H: ParametricMeasurement<f64, M, 1>, const M: usize> ParametricReadout<H, M> {
    /// What is read, with the derivatives by the states from `first` on.
    #[inline(never)]
    fn columns<const W: usize>(&self, x: &[f64], first: usize, slopes: &mut [f64]) -> f64 {
        let variable = |i: usize, value: f64, slope: f64| {
            Dual::<f64, W>::new(value, std::array::from_fn(|k| if first + k == i { slope } else { 0.0 }))
        };
        let model = self.readout.map(|parameter, nominal| {
            let (i, scale, value) = self.places.varied(parameter, nominal, &x[M..]);
            variable(M + i, value, scale)
        });
        let [y] = H::predict_of(&model, &std::array::from_fn(|i| variable(i, x[i], 1.0)));
        for (entry, slope) in slopes[first..].iter_mut().zip(y.gradient()) {
            *entry = slope;
        }
        y.value()
    }
}

/// Derivatives of a readout that are computed at once.
const AT_ONCE: usize = 4;

impl<H: ParametricMeasurement<f64, M, 1>, const M: usize> Sensor for ParametricReadout<H, M> {
    #[inline(never)]
    fn read(&self, x: &[f64]) -> f64 {
        let model = self.readout.map(|parameter, nominal| self.places.varied(parameter, nominal, &x[M..]).2);
        let [y] = H::predict_of(&model, &std::array::from_fn(|i| x[i]));
        y
    }

    fn linearize(&self, x: &[f64], slopes: &mut [f64]) -> f64 {
        let mut y = f64::NAN;
        for first in (0..x.len()).step_by(AT_ONCE) {
            y = self.columns::<AT_ONCE>(x, first, slopes);
        }
        y
    }
}
