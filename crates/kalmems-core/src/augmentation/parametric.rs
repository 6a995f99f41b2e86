//! Laws that hold with parameters of any number.

use crate::parameters::Parameters;
use crate::{Dynamics, Measurement, Over, Process, Scalar};

/// Dynamics that can be computed with the parameters in any number S over T.
///
/// `#[model(parametric)]` of `kalmems-macros`, on the `impl` of [`Dynamics`], writes it: the law over S with the
/// input lifted to S. See the example [there](crate::augmentation).
///
/// ```
/// use kalmems_core::{Dynamics, Over, ParametricDynamics, Scalar};
/// use kalmems_macros::{Parameters, model};
/// #[derive(Parameters)]
/// struct Decay<P> {
///     rate: P,
/// }
/// #[model(parametric)]
/// impl<T: Scalar> Dynamics<T, 1> for Decay<T> {
///     type Input = ();
///     fn derivative<S: Over<T>>(&self, x: &[S; 1], (): &()) -> [S; 1] {
///         [-(x[0] * self.rate)]
///     }
/// }
/// let faster = Decay { rate: 3.0 };
/// assert_eq!(Decay::<f64>::derivative_of(&faster, &[2.0], &()), [-6.0]);
/// ```
pub trait ParametricDynamics<T: Scalar, const N: usize>: Dynamics<T, N> + Parameters<T> {
    /// f(x, u) with the parameters `varied`.
    fn derivative_of<S: Over<T>>(
        varied: &<Self as Parameters<T>>::Of<S>,
        x: &[S; N],
        u: &Self::Input,
    ) -> [S; N];
}

/// A measurement that can be computed with the parameters in any number S over T.
///
/// `#[model(parametric)]` of `kalmems-macros`, on the `impl` of [`Measurement`], writes it. See the example
/// [there](crate::augmentation).
///
/// ```
/// use kalmems_core::{Measurement, Over, ParametricMeasurement, Scalar};
/// use kalmems_macros::{Parameters, model};
/// #[derive(Parameters)]
/// struct Gauge<P> {
///     gain: P,
/// }
/// #[model(parametric)]
/// impl<T: Scalar> Measurement<T, 1, 1> for Gauge<T> {
///     fn predict<S: Over<T>>(&self, x: &[S; 1]) -> [S; 1] {
///         [x[0] * self.gain]
///     }
/// }
/// let other = Gauge { gain: 3.0 };
/// assert_eq!(<Gauge<f64> as ParametricMeasurement<f64, 1, 1>>::predict_of(&other, &[2.0]), [6.0]);
/// ```
pub trait ParametricMeasurement<T: Scalar, const N: usize, const M: usize>:
    Measurement<T, N, M> + Parameters<T>
{
    /// h(x) with the parameters `varied`.
    fn predict_of<S: Over<T>>(varied: &<Self as Parameters<T>>::Of<S>, x: &[S; N]) -> [S; M];
}

/// A step of a model whose parameters can be in any number S over T.
///
/// [`Rk4`](crate::Rk4) and [`Euler`](crate::Euler) are, where their dynamics are [`ParametricDynamics`]. A step
/// that is a law of its own implements it by hand:
///
/// ```
/// use kalmems_core::augmentation::{AddedState, Augmented, Drift, ParametricProcess};
/// use kalmems_core::{Over, Parameters, Process, ProcessNoise, Scalar};
/// #[derive(kalmems_macros::Parameters)]
/// struct Turn<P> {
///     degrees_per_step: P,
/// }
/// struct Turning(Turn<f64>, ProcessNoise<f64, 1>);
/// impl Process<f64, 1> for Turning {
///     type Input = ();
///     fn step<S: Over<f64>>(&self, x: &[S; 1], (): &()) -> [S; 1] {
///         [x[0] + self.0.degrees_per_step]
///     }
///     fn noise(&self) -> &ProcessNoise<f64, 1> {
///         &self.1
///     }
/// }
/// impl ParametricProcess<f64, 1> for Turning {
///     type Model = Turn<f64>;
///     fn model(&self) -> &Turn<f64> {
///         &self.0
///     }
///     fn interval(&self) -> f64 {
///         0.1
///     }
///     fn step_of<S: Over<f64>>(&self, varied: &Turn<S>, x: &[S; 1], (): &()) -> [S; 1] {
///         [x[0] + varied.degrees_per_step]
///     }
/// }
/// let turning = Turning(Turn { degrees_per_step: 5.0 }, ProcessNoise::none());
/// let added = [AddedState { scale: 0.1, drift: Drift::RandomWalk { density: 0.0 } }];
/// let process = Augmented::<_, _, 1, 1, 2>::new(turning, &added, [Some("degrees_per_step")])?;
/// assert_eq!(process.step(&[10.0, 2.0], &()), [15.2, 2.0]);
/// # Ok::<(), kalmems_core::augmentation::AugmentationError>(())
/// ```
pub trait ParametricProcess<T: Scalar, const N: usize>: Process<T, N> {
    /// What holds the parameters.
    type Model: Parameters<T>;

    /// The model as it was given.
    fn model(&self) -> &Self::Model;

    /// The interval of the step in s.
    fn interval(&self) -> T;

    /// f(x, u) with the parameters `varied`.
    fn step_of<S: Over<T>>(
        &self,
        varied: &<Self::Model as Parameters<T>>::Of<S>,
        x: &[S; N],
        u: &Self::Input,
    ) -> [S; N];
}
