//! Parameters as states.
//!
//! A parameter that is not known well enough, or that drifts, is appended to the state and tracked with it. Any
//! parameter of any model can be, alone or with others, chosen by name when the program runs; no model is
//! written for it.
//!
//! An added state x is the deviation of its parameter in units of a stated scale, p = nominal + scale·x, so that
//! it is of order 1 whatever the parameter is. [`Drift`] says how it wanders. [`Augmented`] is the process over
//! model states and added states, [`AugmentedMeasurement`] the measurement of both; the same added state may
//! enter either or both, as the capacitance of electrodes that drive and sense does. Within one model a state
//! enters one parameter, and a parameter is entered by one state.
//!
//! The gain of a gauge tracked beside the rate of the decay that it sees:
//!
//! ```
//! use kalmems_core::augmentation::{AddedState, Augmented, AugmentedMeasurement, Drift};
//! use kalmems_core::{Covariance, Dynamics, Ekf, Filter, Measurement, Nodes, NoiseDensity, Over, Rk4, Scalar};
//! use kalmems_macros::{Parameters, model};
//!
//! #[derive(Parameters)]
//! struct Decay<P> {
//!     rate: P,
//! }
//! #[model(parametric)]
//! impl<T: Scalar> Dynamics<T, 1> for Decay<T> {
//!     type Input = T;
//!     fn derivative<S: Over<T>>(&self, x: &[S; 1], inflow: &T) -> [S; 1] {
//!         [S::lift(*inflow) - x[0] * self.rate]
//!     }
//! }
//! #[derive(Parameters)]
//! struct Gauge<P> {
//!     gain: P,
//!     offset: P,
//! }
//! #[model(parametric)]
//! impl<T: Scalar> Measurement<T, 1, 1> for Gauge<T> {
//!     fn predict<S: Over<T>>(&self, x: &[S; 1]) -> [S; 1] {
//!         [x[0] * self.gain + self.offset]
//!     }
//! }
//!
//! // The models as they are believed to be, and two states more: the rate is known to 50 %, the offset to 1.
//! let decay = Rk4::new(Decay { rate: 1.0 }, 0.01, &NoiseDensity::none(), (&[0.0], &0.0));
//! let gauge = Gauge { gain: 2.0, offset: 0.0 };
//! let constant = Drift::RandomWalk { density: 0.0 };
//! let added = [AddedState { scale: 0.5, drift: constant }, AddedState { scale: 1.0, drift: constant }];
//! let process = Augmented::<_, _, 1, 2, 3>::new(decay, &added, [Some("rate"), None])?;
//! let seen = AugmentedMeasurement::<_, _, 1, 2>::new(gauge, &added, [None, Some("offset")])?;
//! let mut filter = Ekf::new([4.0, 0.0, 0.0], Covariance::from_standard_deviations([1.0, 1.0, 1.0]));
//!
//! // In truth the rate is 1.3 and the offset 0.2.
//! for k in 1..=500 {
//!     let truth = 4.0 * f64::exp(-1.3 * 0.01 * f64::from(k));
//!     filter.predict(&process, &Nodes::held(0.0))?;
//!     filter.update(&seen, &[2.0 * truth + 0.2], &Covariance::from_variances([1e-6]))?;
//! }
//! assert!((process.model_at(filter.mean()).rate - 1.3).abs() < 1e-3);
//! assert!((seen.model_at(filter.mean()).offset - 0.2).abs() < 1e-3);
//! # Ok::<(), Box<dyn core::error::Error>>(())
//! ```

mod added_state;
mod error;
mod measurement;
mod parametric;
mod process;
mod slots;

pub use added_state::{AddedState, Drift};
pub use error::AugmentationError;
pub use measurement::AugmentedMeasurement;
pub use parametric::{ParametricDynamics, ParametricMeasurement, ParametricProcess};
pub use process::Augmented;
