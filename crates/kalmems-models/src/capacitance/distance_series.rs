//! A plate before another one.

use kalmems_core::{Dual, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// C(d) = Σ c_k·(d_r/d)^k for k = 0 … K − 1, in F.
///
/// The capacitance of two plates over their distance. With K = 2 it is the parallel plate,
/// C = C_s + c₁·d_r/d (Faller and Zangl, 2017, equation 1); higher powers describe what the fringing fields add. A
/// series in powers of d would need many more terms: C falls as 1/d over the whole stroke.
///
/// ```
/// use kalmems_models::capacitance::DistanceSeries;
/// let plate = DistanceSeries { reference_distance: 1e-3, coefficients: [0.0, 109.3e-15] };
/// assert!((plate.capacitance(0.5e-3_f64) - 218.6e-15).abs() < 1e-28);
/// // dC/dd = −C/d.
/// assert!((plate.slope(0.5e-3_f64) / (-218.6e-15 / 0.5e-3) - 1.0).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct DistanceSeries<P, const K: usize> {
    /// d_r in m: where the capacitance is the sum of the coefficients. Positive.
    pub reference_distance: P,
    /// c_k in F, from the power 0 on.
    pub coefficients: [P; K],
}

#[model]
impl<P: Scalar, const K: usize> DistanceSeries<P, K> {
    /// C(d) in F, d in m.
    pub fn capacitance<S: Over<P>>(&self, distance: S) -> S {
        let alone = distance.alone();
        let inverse = alone.recip() * self.reference_distance;
        let mut sum = Dual::constant(P::of(0.0));
        for k in (0..K).rev() {
            sum = sum * inverse + self.coefficients[k];
        }
        distance.chained(sum)
    }

    /// dC/dd = −Σ k·c_k·d_r^k/d^{k+1} in F/m.
    pub fn slope<S: Over<P>>(&self, distance: S) -> S {
        let alone = distance.alone();
        let reciprocal = alone.recip();
        let inverse = reciprocal * self.reference_distance;
        let mut sum = Dual::constant(P::of(0.0));
        for k in (1..K).rev() {
            sum = sum * inverse + self.coefficients[k] * P::of(k as f64);
        }
        distance.chained(-(sum * inverse * reciprocal))
    }

    /// The same plates behind another gain: what varies with the distance is scaled so that the capacitance at a
    /// known distance is the one that was measured there. The part that does not vary stays.
    ///
    /// Calibration of the base capacitance (Faller and Zangl, 2017, section II-D).
    ///
    /// ```
    /// use kalmems_models::capacitance::DistanceSeries;
    /// let designed = DistanceSeries { reference_distance: 1e-3, coefficients: [5e-15, 100e-15, 10e-15] };
    /// let made = designed.through(1e-3, 120e-15_f64);
    /// assert!((made.capacitance(1e-3_f64) - 120e-15).abs() < 1e-28);
    /// assert_eq!(made.coefficients[0], 5e-15);
    /// ```
    #[must_use]
    pub fn through(&self, distance: P, capacitance: P) -> Self {
        const { assert!(K >= 2, "a capacitance that does not vary cannot be calibrated") };
        let fixed = self.coefficients[0];
        let gain = (capacitance - fixed) / (self.capacitance(distance) - fixed);
        let mut calibrated = *self;
        for k in 1..K {
            calibrated.coefficients[k] = self.coefficients[k] * gain;
        }
        calibrated
    }
}
