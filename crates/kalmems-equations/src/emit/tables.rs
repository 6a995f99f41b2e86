//! Tables of the source: curves and the series of two disks, in units of their own.

use crate::curve::Curve;
use crate::description::CurveExtension;
use crate::laws::disks;

/// A curve over its own span from −1 to 1, in its largest value.
pub(super) struct EmittedCurve {
    pub(super) places: Vec<f64>,
    /// The coefficients of the powers 0 to 3 of the distance from the piece's first place.
    pub(super) pieces: Vec<[f64; 4]>,
    pub(super) outside: CurveExtension,
}

impl EmittedCurve {
    pub(super) fn of(curve: &Curve) -> Self {
        let (middle, half, size) = curve.extent();
        let (places, pieces) = curve.pieces();
        Self {
            places: places.iter().map(|x| (x - middle) / half).collect(),
            pieces: pieces
                .iter()
                .map(|c| [c[0], c[1] * half, c[2] * half * half, c[3] * half.powi(3)].map(|c| c / size))
                .collect(),
            outside: curve.outside(),
        }
    }
}

/// The series of ln(C/(ε₀·a)): its coefficients behind the first, e to the power of the first, and factor and offset from ln κ to its
/// argument.
///
/// The first coefficient is twice as large as the rest of the series: as a factor it costs no digits of the exponent.
pub(super) fn disks_series() -> (&'static [f64], f64, f64, f64) {
    use kalmems_core::Scalar;
    let [low, high] = disks::RANGE.map(Scalar::ln);
    let (factor, offset) = (2.0 / (high - low), -(high + low) / (high - low));
    let [first, rest @ ..] = disks::coefficients();
    (rest, Scalar::exp(*first), factor, offset)
}
