//! The estimators of kalmems: Kalman filters over fixed-size linear algebra.
//!
//! No standard library, no allocation, no panic path. Everything is generic over [`Scalar`]: the same model
//! runs in `f64` on a desk, in `f32` on a microcontroller, and with [`Dual`] numbers for its own Jacobian.
//!
//! A device is a [`Dynamics`] (a differential equation with its process noise density), turned by an
//! integrator such as [`Rk4`] into a [`Process`] (one step over one interval), and a [`Measurement`]. A filter
//! such as [`Ekf`] knows none of them by name:
//!
//! ```
//! use kalmems_core::{Covariance, Dynamics, Ekf, Filter, Measurement, NoiseDensity, Over, Rk4, Scalar};
//!
//! /// A unit mass on a unit spring.
//! struct Oscillator;
//! impl<T: Scalar> Dynamics<T, 2> for Oscillator {
//!     type Input = ();
//!     fn derivative<S: Over<T>>(&self, x: &[S; 2], (): &()) -> [S; 2] {
//!         [x[1], -x[0]]
//!     }
//! }
//! /// The square of its position: the sign cannot be seen.
//! struct Square;
//! impl<T: Scalar> Measurement<T, 2, 1> for Square {
//!     fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
//!         [x[0] * x[0]]
//!     }
//! }
//!
//! let noise = NoiseDensity::none().on::<1>(1e-4);
//! let process = Rk4::new(Oscillator, 0.01, &noise, (&[0.0, 0.0], &()));
//! let mut filter = Ekf::new([0.9, 0.1], Covariance::from_standard_deviations([0.3, 0.3]));
//! for k in 1..1000 {
//!     let y = f64::cos(0.01 * f64::from(k)).powi(2);
//!     filter.predict(&process, &kalmems_core::Nodes::held(()))?;
//!     filter.update(&Square, &[y], &Covariance::from_variances([1e-4]))?;
//! }
//! assert!((filter.mean()[0] - f64::cos(9.99)).abs() < 0.01);
//! # Ok::<(), kalmems_core::FilterError>(())
//! ```

#![no_std]
#![cfg_attr(all(feature = "vfpv4", target_arch = "arm"), feature(core_float_math))]

pub mod adapt;
pub mod augmentation;
pub mod bound;
pub mod consistency;
pub mod detect;
pub mod discretize;
mod dual;
mod error;
pub mod filter;
mod linalg;
mod math;
mod measurement;
mod noise;
mod notation;
mod observability;
mod parameters;
mod process;
pub mod riccati;
mod scalar;
mod scaled;
pub mod smooth;
pub mod update;

pub use augmentation::{
    AddedState, Augmented, AugmentedMeasurement, Drift, ParametricDynamics, ParametricMeasurement,
    ParametricProcess,
};
pub use dual::Dual;
pub use error::FilterError;
pub use filter::{
    Ekf, Filter, FixedGain, Gaussian, Information, InformationError, Innovation, IteratedEkf, Kalman,
    OperatingPoint, SchmidtEkf, SigmaPoints, SquareRootEkf, SquareRootUkf, StateTransition, Ukf,
};
pub use linalg::{Cholesky, Ldl, Lu, Mat, Svd};
pub use math::Portable;
pub use measurement::{Delayed, LinearMeasurement, Measurement, NumericMeasurement};
pub use noise::{Covariance, NoiseDensity};
pub use observability::{Observability, StateDirection};
pub use parameters::{ParameterName, Parameters};
pub use process::{
    ContinuousDiscrete, ContinuousLinear, Dynamics, EtdWeights, Etdrk4, Euler, HeldEtdrk4, IntervalError,
    LinearProcess, Nodes, NumericProcess, Process, ProcessNoise, Propagation, Rk4, derivatives, jacobian,
};
pub use scalar::{Over, Scalar};
pub use scaled::{NotAScale, Scaled, ScaledProcess, Scales};
