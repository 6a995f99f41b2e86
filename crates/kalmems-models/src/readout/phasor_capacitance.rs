//! The capacitance that a sinusoidal motion makes.

use crate::capacitance::DistanceSeries;
use kalmems_core::{Dual, Mat, Measurement, Over, Scalar};
use kalmems_macros::{Parameters, model};

/// y = C(d₀ + A·cos φ) in F, with d₀ known; on states that begin with [A, f, φ].
///
/// φ is the phase at the sample (Faller and Zangl, 2017, equations 10 and 14; their equations 15 and 18 to 20 take it
/// one sample ahead, which would make the state something else than the present motion). f does not enter.
/// (A, φ) and (−A, φ + π) give the same capacitance, and so do φ and −φ in one sample.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::{capacitance::DistanceSeries, readout::SteadyPhasorCapacitance};
/// let series = DistanceSeries { reference_distance: 1e-3, coefficients: [0.0, 109.3e-15] };
/// let readout = SteadyPhasorCapacitance { series, rest_distance: 1e-3 };
/// let [nearest] = readout.predict(&[0.5e-3_f64, 500.0, std::f64::consts::PI]);
/// assert!((nearest - 218.6e-15).abs() < 1e-27);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct SteadyPhasorCapacitance<P, const K: usize> {
    /// C(d).
    pub series: DistanceSeries<P, K>,
    /// d₀ in m.
    pub rest_distance: P,
}

#[model(parametric)]
impl<T: Scalar, const K: usize> Measurement<T, 3, 1> for SteadyPhasorCapacitance<T, K> {
    fn predict<S: Over<T>>(&self, x: &[S; 3]) -> [S; 1] {
        [self.series.capacitance(x[0] * x[2].cos() + self.rest_distance)]
    }

    fn depends(_: usize, state: usize) -> bool {
        state != 1
    }

    /// C′·[cos φ, 0, −A·sin φ].
    fn linearize(&self, x: &[T; 3]) -> ([T; 1], Mat<T, 1, 3>) {
        let (c, s) = (x[2].cos(), x[2].sin());
        let y = self.series.capacitance(Dual::<T, 1>::variable(x[0] * c + self.rest_distance, 0));
        let [slope] = y.gradient();
        ([y.value()], Mat([[slope * c, T::of(0.0), -(slope * x[0] * s)]]))
    }
}

/// y = C(d₀ + A·cos φ) in F, on the states [A, f, φ, d₀, Ȧ].
///
/// As [`SteadyPhasorCapacitance`], with the rest position a state.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::{capacitance::DistanceSeries, readout::DriftingPhasorCapacitance};
/// let series = DistanceSeries { reference_distance: 1e-3, coefficients: [0.0, 109.3e-15] };
/// let readout = DriftingPhasorCapacitance { series };
/// let [farthest] = readout.predict(&[0.5e-3_f64, 500.0, 0.0, 1e-3, 0.0]);
/// assert!((farthest - 109.3e-15 / 1.5).abs() < 1e-28);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct DriftingPhasorCapacitance<P, const K: usize> {
    /// C(d).
    pub series: DistanceSeries<P, K>,
}

#[model(parametric)]
impl<T: Scalar, const K: usize> Measurement<T, 5, 1> for DriftingPhasorCapacitance<T, K> {
    fn predict<S: Over<T>>(&self, x: &[S; 5]) -> [S; 1] {
        [self.series.capacitance(x[0] * x[2].cos() + x[3])]
    }

    fn depends(_: usize, state: usize) -> bool {
        state != 1 && state != 4
    }

    /// C′·[cos φ, 0, −A·sin φ, 1, 0].
    fn linearize(&self, x: &[T; 5]) -> ([T; 1], Mat<T, 1, 5>) {
        let (c, s) = (x[2].cos(), x[2].sin());
        let y = self.series.capacitance(Dual::<T, 1>::variable(x[0] * c + x[3], 0));
        let [slope] = y.gradient();
        let zero = T::of(0.0);
        ([y.value()], Mat([[slope * c, zero, -(slope * x[0] * s), slope, zero]]))
    }
}

/// y = c₀ + C_s + g·(C(d) − c₀) in F, with the part c₀ of C that does not vary and d = d₀ + A·cos φ + c₂·cos 2φ + s₂·sin 2φ + c₃·cos 3φ + s₃·sin 3φ,
/// on the states [A, f, φ, d₀, Ȧ].
///
/// [`DriftingPhasorCapacitance`] behind a readout whose gain g and stray capacitance C_s are not known well: what an error of
/// either does to the position is in no innovation of its own (Faller and Zangl, 2017, section II-D, calibrate both); and of a motion
/// that is not quite a sine, with its second and third harmonic.
///
/// ```
/// use kalmems_core::Measurement;
/// use kalmems_models::{capacitance::DistanceSeries, readout::AmplifiedPhasorCapacitance};
/// let series = DistanceSeries { reference_distance: 1e-3, coefficients: [3e-15, 109.3e-15] };
/// let readout = AmplifiedPhasorCapacitance { series, gain: 1.01, stray: 2e-15, harmonics: [0.0; 4] };
/// let [at_rest] = readout.predict(&[0.0_f64, 500.0, 0.0, 1e-3, 0.0]);
/// assert!((at_rest - (5e-15 + 1.01 * 109.3e-15)).abs() < 1e-28);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct AmplifiedPhasorCapacitance<P, const K: usize> {
    /// C(d), with c₀ its first coefficient.
    pub series: DistanceSeries<P, K>,
    /// g, 1 where the readout is as the series has it.
    pub gain: P,
    /// C_s in F.
    pub stray: P,
    /// c₂, s₂, c₃ and s₃ in m.
    pub harmonics: [P; 4],
}

#[model(parametric)]
impl<T: Scalar, const K: usize> Measurement<T, 5, 1> for AmplifiedPhasorCapacitance<T, K> {
    fn predict<S: Over<T>>(&self, x: &[S; 5]) -> [S; 1] {
        let fixed = self.series.coefficients[0];
        let [c2, s2, c3, s3] = self.harmonics;
        let (c, s) = (x[2].cos(), x[2].sin());
        let (double_c, double_s) = (c * c - s * s, c * s + c * s);
        let (triple_c, triple_s) = (double_c * c - double_s * s, double_s * c + double_c * s);
        let harmonics = double_c * c2 + double_s * s2 + triple_c * c3 + triple_s * s3;
        let varying = self.series.capacitance(x[0] * c + x[3] + harmonics) - fixed;
        [varying * self.gain + (fixed + self.stray)]
    }

    fn depends(_: usize, state: usize) -> bool {
        state != 1 && state != 4
    }
}
