//! Parallel plates that slide past each other.

use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// C(x) = ε·L·(o + x)/D_n for a plate that overlaps another by o and moves by x along the overlap.
///
/// The electrodes that read the micro-stage's translation in X and Y stand in pairs, one gaining what the other loses
/// (Chen, dissertation, 2018, Figure A.1 and section 3.3.4, which give no dimensions). What they read does not depend on
/// where the overlap is, and to first order neither on a tilt about its middle.
///
/// ```
/// use kalmems_models::capacitance::SlidingPlate;
/// let plate = SlidingPlate { overlap: 50e-6, length: 1e-3, gap: 19e-6, permittivity: 8.8542e-12_f64 };
/// // The pair: twice the change of one.
/// let moved = plate.capacitance(1e-6) - plate.capacitance(-1e-6);
/// assert!((moved / plate.difference(1e-6) - 1.0).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct SlidingPlate<P> {
    /// o in m: the overlap at rest. The law holds while o + x is positive and less than either plate.
    pub overlap: P,
    /// L in m: across the motion.
    pub length: P,
    /// D_n in m.
    pub gap: P,
    /// ε in F/m.
    pub permittivity: P,
}

#[model]
impl<P: Scalar> SlidingPlate<P> {
    /// C in F, x in m.
    pub fn capacitance<S: Over<P>>(&self, x: S) -> S {
        (x + self.overlap) * self.slope()
    }

    /// dC/dx = ε·L/D_n in F/m.
    pub fn slope(&self) -> P {
        self.permittivity * self.length / self.gap
    }

    /// C(x) − C(−x) in F: the pair read as a difference.
    pub fn difference<S: Over<P>>(&self, x: S) -> S {
        x * self.slope().twice()
    }
}
