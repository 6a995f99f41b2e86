//! The same extended filter with other crates, in f64.
//!
//! All get the same values and Jacobians from the same functions, [`EulerByHand`] and the readout's `linearize`, so
//! that what differs is the algebra around them. All give the same estimate; what they leave out makes them faster:
//!
//! | filter | covariance after an update | innovation and NIS | refuses |
//! |---|---|---|---|
//! | kalmems | Joseph, lower triangle | yes | what is not finite, S ≤ 0 |
//! | nalgebra 0.35, by hand | Joseph, full | yes | what is not finite, S ≤ 0 |
//! | adskalman 0.18 | Joseph, full | no | S ≤ 0; a NaN measurement skips the update |
//! | kfilter 0.5 | (I − K·H)·P, made symmetric | no | S = 0 |
//! | minikalman 0.8 | P − K·(H·P) | no | nothing |
//!
//! kfilter's own `NonLinearSystem` and `NonLinearMeasurement` are of no use here: a step is a function pointer that
//! can hold no parameters, and nothing sets the Jacobian of the measurement, which stays zero; so its traits are
//! implemented instead. (Its unscented filter never calls the step that sets Q of a `NonLinearSystem`: Q stays
//! zero there. It is not compared.) adskalman has no nonlinear process: its linear prediction propagates the
//! covariance, and the mean is put in its place.

mod adskalman;
mod kfilter;
mod minikalman;
mod nalgebra;

pub use adskalman::adskalman;
pub use kfilter::kfilter;
pub use minikalman::minikalman;
pub use nalgebra::nalgebra;
