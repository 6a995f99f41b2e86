//! Where the micro-stage's electrodes are.

use super::TiltingPlate;
use kalmems_core::Scalar;
use kalmems_macros::model;

/// The four stators that read the tilt about one axis (Chen, dissertation, 2018, Tables A.1 and A.2, Figure A.1).
///
/// Two large outer ones, 1A and 2A, and two small inner ones, 1B and 2B, each pair with one on either side of the axis.
/// Table A.1 prints for 2A an upper limit below its lower one; it is (W/2 − W_SA, W/2), the mirror image of 1A.
///
/// ```
/// use kalmems_models::capacitance::StageLayout;
/// let [a1, b1, a2, b2] = StageLayout::PUBLISHED.plates(19.2e-6, 8.8542e-12);
/// let near = |a: f64, b: f64| (a - b).abs() < 1e-15;
/// assert!(near(a1.w1, -1390e-6) && near(a1.w2, -990e-6) && near(a2.w1, 990e-6) && near(a2.w2, 1390e-6));
/// assert!(near(b1.w1, 475e-6) && near(b1.w2, 795e-6) && near(b2.w1, -795e-6) && near(b2.w2, -475e-6));
/// // The capacitances of 1A and 1B are equal at one angle, the threshold angle.
/// let threshold = a1.balance(&b1).unwrap();
/// assert!((a1.capacitance(threshold) / b1.capacitance(threshold) - 1.0_f64).abs() < 1e-14);
/// assert!((2.0e-3..3.0e-3).contains(&threshold));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageLayout<P> {
    /// W in m: the distance across the rotors.
    pub width: P,
    /// W_SA in m: the width of an outer stator, which is a square.
    pub large: P,
    /// W_SB in m: the width of an inner stator.
    pub small: P,
    /// D_W in m: the distance between an outer and an inner stator.
    pub spacing: P,
    /// The length of an inner stator along the axis in m. Table A.1 has W_SA; a square would have W_SB. An identified gain
    /// absorbs which.
    pub small_along: P,
}

impl StageLayout<f64> {
    /// Table A.2, with the inner stators as long along the axis as Table A.1 has them.
    pub const PUBLISHED: Self =
        Self { width: 2780e-6, large: 400e-6, small: 320e-6, spacing: 195e-6, small_along: 400e-6 };
}

#[model]
impl<P: Scalar> StageLayout<P> {
    /// 1A, 1B, 2A and 2B as plates this gap in m away, in a medium of this permittivity in F/m.
    pub fn plates(&self, gap: P, permittivity: P) -> [TiltingPlate<P>; 4] {
        let far = self.width.half();
        let outer = [far - self.large, far];
        let inner_far = outer[0] - self.spacing;
        let inner = [inner_far - self.small, inner_far];
        let plate = |[w1, w2]: [P; 2], along: P| TiltingPlate {
            w1,
            w2,
            w3: -along.half(),
            w4: along.half(),
            gap,
            permittivity,
        };
        let mirrored = |[near, far]: [P; 2]| [-far, -near];
        [
            plate(mirrored(outer), self.large),
            plate(inner, self.small_along),
            plate(outer, self.large),
            plate(mirrored(inner), self.small_along),
        ]
    }
}
