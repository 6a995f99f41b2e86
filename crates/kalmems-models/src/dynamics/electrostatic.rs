//! What a voltage does to a movable electrode.

use kalmems_core::{Over, Scalar};
use kalmems_macros::model;

/// T = ½·dC/dθ·V², in N·m.
///
/// `slope` is dC/dθ in F/rad and `mean_square` is V² in V², averaged over whatever is too fast to be followed
/// (Chen et al., shared electrodes, 2020, equation 8). A carrier of amplitude V_c adds V_c²/2 to it.
///
/// ```
/// assert_eq!(kalmems_models::dynamics::torque(-2e-12, 100.0), -1e-10);
/// ```
#[model]
pub fn torque<P: Scalar, S: Over<P>>(slope: S, mean_square: P) -> S {
    slope * mean_square.half()
}

/// dT/dθ = ½·C″·V², in N·m/rad: how the torque changes with the angle where the capacitance has the curvature
/// C″ in F/rad². Negative, it adds to the stiffness of a spring.
///
/// ```
/// assert_eq!(kalmems_models::dynamics::torque_slope(-3e-10, 100.0), -1.5e-8);
/// ```
#[model]
pub fn torque_slope<P: Scalar>(curvature: P, mean_square: P) -> P {
    curvature.half() * mean_square
}
