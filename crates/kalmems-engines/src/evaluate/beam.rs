//! The angle of a mirror, from where its beam falls.

use kalmems_core::Portable;
use kalmems_core::Scalar;

/// y·G = L·tan(m·θ): what a position-sensing detector of gain G at the distance L makes of a mirror's angle θ.
///
/// m is 1 where the angle is taken for the mirror's (Chen, dissertation, 2018, equation 72), and 2 where it is that of
/// the beam, which a mirror turns by twice its own.
///
/// ```
/// use kalmems_engines::evaluate::BeamPosition;
/// let detector = BeamPosition { gain: 0.5e-3, distance: 32.7e-3, multiple: 1.0 };
/// assert!((detector.angle(detector.volts(0.12)) - 0.12).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeamPosition {
    /// G in m/V.
    pub gain: f64,
    /// L in m.
    pub distance: f64,
    /// m.
    pub multiple: f64,
}

impl BeamPosition {
    /// θ in rad.
    pub fn angle(&self, volts: f64) -> f64 {
        (volts * self.gain / self.distance).portable_atan() / self.multiple
    }

    /// y in V.
    pub fn volts(&self, angle: f64) -> f64 {
        let turned = self.multiple * angle;
        Scalar::sin(turned) / Scalar::cos(turned) * self.distance / self.gain
    }
}
