//! What the signal does not determine, and what that does to the position.

use super::plates::Plates;
use kalmems_core::Scalar;
use std::f64::consts::TAU;

/// A fault of the readout that amplitude, phase and rest position take up, as far as they can.
///
/// To first order in the fault: what it adds to the capacitance over a cycle, e(φ), is fitted by
/// C′·(δA·cos φ + δd₀) with the weight that white noise gives, and what is left is all that a filter's innovations show.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadoutFault {
    /// δA in m per unit of the fault.
    pub amplitude_m: f64,
    /// δd₀ in m per unit of the fault.
    pub rest_m: f64,
    /// The root mean square over a cycle of what that does to the position, in m per unit of the fault.
    pub position_rms_m: f64,
    /// The root mean square of what is left in the signal, in F per unit of the fault.
    pub left_f: f64,
}

/// Points of a cycle over which means are taken.
const POINTS: u32 = 256;
/// What is left of a fault relative to itself where it is taken up but for rounding.
const ROUNDING: f64 = 1e-9;

impl ReadoutFault {
    /// Of a gain: all that varies with the distance is larger by this share.
    pub fn gain(plates: &Plates, motion: [f64; 2]) -> Self {
        Self::of(plates, motion, |plates, distance| plates.capacitance(distance) - plates.coefficients[0])
    }

    /// Of an offset in F.
    pub fn offset(plates: &Plates, motion: [f64; 2]) -> Self {
        Self::of(plates, motion, |_, _| 1.0)
    }

    /// Of a fault that adds this to the capacitance per unit, for a motion of this amplitude about this rest position,
    /// both in m.
    fn of(plates: &Plates, [amplitude, rest]: [f64; 2], adds: fn(&Plates, f64) -> f64) -> Self {
        // Means of a², a·b, b², a·e, b·e and e² with a = C′·cos φ and b = C′.
        let mut means = [0.0; 6];
        for point in 0..POINTS {
            let cosine = Scalar::cos(TAU * f64::from(point) / f64::from(POINTS));
            let distance = rest + amplitude * cosine;
            let slope = plates.slope(distance);
            let (a, b, e) = (slope * cosine, slope, adds(plates, distance));
            for (mean, term) in means.iter_mut().zip([a * a, a * b, b * b, a * e, b * e, e * e]) {
                *mean += term / f64::from(POINTS);
            }
        }
        let [aa, ab, bb, ae, be, ee] = means;
        let determinant = aa * bb - ab * ab;
        let amplitude_m = (ae * bb - be * ab) / determinant;
        let rest_m = (be * aa - ae * ab) / determinant;
        let left = ee - amplitude_m * ae - rest_m * be;
        let left_f = if left > ROUNDING * ee { left.sqrt() } else { 0.0 };
        let position_rms_m = (rest_m * rest_m + 0.5 * amplitude_m * amplitude_m).sqrt();
        Self { amplitude_m, rest_m, position_rms_m, left_f }
    }

    /// The fault from which on the mean NIS of so many updates with this noise in F² leaves its 95 % interval in half of
    /// all recordings; infinite where it never does.
    pub fn detectable_from(&self, noise_variance: f64, updates: usize) -> f64 {
        // n·NIS is χ²: its mean's interval is 1 ± 1.96·√(2/n).
        let excess = 1.96 * (2.0 / updates.max(1) as f64).sqrt();
        (excess * noise_variance).sqrt() / self.left_f
    }

    /// The standard deviation to which so many updates could tell the fault if it were a state.
    pub fn attainable_deviation(&self, noise_variance: f64, updates: usize) -> f64 {
        (noise_variance / updates.max(1) as f64).sqrt() / self.left_f
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::piston_mirror::COEFFICIENTS;

    fn plates(given: [f64; 4]) -> Plates {
        let mut coefficients = [0.0; COEFFICIENTS];
        coefficients[..4].copy_from_slice(&given);
        Plates { reference_distance: 1e-3, coefficients }
    }

    /// A parallel plate: C·(1 + g) at d is C at d·(1 − g), whatever the motion.
    #[test]
    fn a_gain_before_a_parallel_plate_is_a_scale_of_distances() {
        let unseen = ReadoutFault::gain(&plates([3e-15, 109.3e-15, 0.0, 0.0]), [0.4e-3, 0.9e-3]);
        assert!((unseen.amplitude_m / -0.4e-3 - 1.0).abs() < 1e-9);
        assert!((unseen.rest_m / -0.9e-3 - 1.0).abs() < 1e-9);
        assert_eq!(unseen.left_f, 0.0);
        assert_eq!(unseen.detectable_from(1e-34, 1000), f64::INFINITY);
    }

    /// Fringing fields leave something of a gain, and any plate of an offset: less than there was, and it shows in
    /// so many updates as its square says.
    #[test]
    fn fringing_fields_let_a_gain_be_seen() {
        let fringing = plates([0.0, 95e-15, 12e-15, -1e-15]);
        let gain = ReadoutFault::gain(&fringing, [0.5e-3, 1e-3]);
        assert!(gain.left_f > 0.0 && gain.left_f < 1e-2 * 109.3e-15, "{gain:?}");
        let offset = ReadoutFault::offset(&fringing, [0.5e-3, 1e-3]);
        assert!(offset.left_f > 0.0 && offset.left_f < 1.0, "{offset:?}");
        let seen = gain.detectable_from(1e-34, 20_000);
        assert!(((seen * gain.left_f).powi(2) / 1e-34 - 1.96 * 0.01).abs() < 1e-6);
    }
}
