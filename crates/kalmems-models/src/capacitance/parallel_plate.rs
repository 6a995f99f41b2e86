//! Two plates without fringing fields.

use super::DistanceSeries;
use kalmems_core::{Over, Scalar};
use kalmems_macros::{Parameters, model};

/// ε₀ in F/m (CODATA 2018).
pub const VACUUM_PERMITTIVITY: f64 = 8.854_187_812_8e-12;

/// C(d) = ε₀·ε_r·A/d in F (Faller and Zangl, 2017, equation 1).
///
/// ```
/// use kalmems_models::capacitance::ParallelPlate;
/// // The base capacitance of 109.3 fF at 1 mm is that of 12.34 mm².
/// let plate = ParallelPlate { area: 12.344e-6, relative_permittivity: 1.0 };
/// assert!((plate.capacitance(1e-3_f64) - 109.3e-15).abs() < 1e-17);
/// let series = plate.series(1e-3);
/// assert!((series.capacitance(0.7e-3_f64) / plate.capacitance(0.7e-3) - 1.0).abs() < 1e-14);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
pub struct ParallelPlate<P> {
    /// A in m².
    pub area: P,
    /// ε_r of what is between the plates.
    pub relative_permittivity: P,
}

#[model]
impl<P: Scalar> ParallelPlate<P> {
    /// C(d) in F, d in m.
    pub fn capacitance<S: Over<P>>(&self, distance: S) -> S {
        distance.recip() * self.strength()
    }

    /// The same law as a series about a distance in m.
    pub fn series(&self, reference_distance: P) -> DistanceSeries<P, 2> {
        let at_reference = self.strength() / reference_distance;
        DistanceSeries { reference_distance, coefficients: [P::of(0.0), at_reference] }
    }

    /// C·d in F·m.
    fn strength(&self) -> P {
        self.area * self.relative_permittivity * P::of(VACUUM_PERMITTIVITY)
    }
}
