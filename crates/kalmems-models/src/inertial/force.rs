//! What an accelerometer feels that does not sit where the turning is.

use super::cross;
use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// f = ω̇ × r + ω × (ω × r) − g in m/s²: the specific force at the point r of a body that turns about the origin, which is
/// at rest, in the axes of the body (Titterton and Weston, Strapdown Inertial Navigation Technology, 2nd edition, 2004,
/// section 3.5).
///
/// Of a vibration at one frequency, ω̇ × r is at that frequency, and ω × (ω × r) at twice it and at rest. The body's axes
/// turn: gravity in them is given with each sample.
///
/// ```
/// use kalmems_models::inertial::SpecificForce;
/// // A millimetre out along x; the body turns about z.
/// let force = SpecificForce { arm: [1e-3_f64, 0.0, 0.0] };
/// let [inwards, along, upwards] = force.at([0.0, 0.0, 20.0], [0.0, 0.0, 2e5], [0.0, 0.0, -9.81]);
/// assert!((inwards + 0.4).abs() < 1e-12 && (along - 200.0).abs() < 1e-12 && upwards == 9.81);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct SpecificForce<P> {
    /// r in m: from the centre of rotation to the accelerometers.
    pub arm: [P; 3],
}

#[model]
impl<P: Scalar> SpecificForce<P> {
    /// f at a rate ω in rad/s, an angular acceleration ω̇ in rad/s² and gravity g in m/s², all in the body's axes.
    pub fn at<S: Over<P>>(&self, rate: [S; 3], acceleration: [S; 3], gravity: [S; 3]) -> [S; 3] {
        let arm = [S::lift(self.arm[0]), S::lift(self.arm[1]), S::lift(self.arm[2])];
        let tangential = cross(acceleration, arm);
        let centripetal = cross(rate, cross(rate, arm));
        [
            tangential[0] + centripetal[0] - gravity[0],
            tangential[1] + centripetal[1] - gravity[1],
            tangential[2] + centripetal[2] - gravity[2],
        ]
    }
}
