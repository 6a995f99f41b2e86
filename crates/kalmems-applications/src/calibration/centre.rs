//! Where the accelerometers are, from what they feel of a rotation.

use crate::fit::{Fit, FitError, FitSettings, Regression, fit};
use crate::signal::PortableComplex;
use realfft::num_complex::Complex64;
use std::f64::consts::TAU;

/// One record for the centre of rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShakenRecord {
    /// The frequency in Hz.
    pub frequency_hz: f64,
    /// The phasors of the rates in rad/s, on the unit's clock.
    pub rate: [Complex64; 3],
    /// The phasors of the accelerometers in m/s², where there is the axis.
    pub force: [Option<Complex64>; 3],
    /// The standard deviation of either part of them.
    pub deviation: [f64; 3],
    /// What the accelerometers show in the mean in m/s²: the reaction to gravity.
    pub reaction: [f64; 3],
}

/// The arm r from the centre of rotation to the accelerometers.
#[derive(Clone, Debug)]
pub struct Centre {
    fit: Fit<3>,
    by_noise: f64,
    /// The sum of squared residuals, each by its standard deviation, and residuals less parameters.
    pub chi_square: f64,
    /// Residuals less parameters.
    pub freedom: usize,
}

impl Centre {
    /// Fits jω·Ω × r + (tilt of gravity) to the accelerometers' phasors: the part of
    /// [`SpecificForce`](kalmems_models::inertial::SpecificForce) at the frequency of the vibration.
    ///
    /// The accelerometers' axes are taken as those of the reference, and their scale factors as right. The tilt Ω/jω
    /// turns gravity's reaction by reaction × tilt.
    pub fn fit(records: &[ShakenRecord]) -> Result<Self, FitError> {
        let found = fit(&Arms(records), &FitSettings::from_start([0.0; 3]))?;
        let by_noise = found.degrees_of_freedom.max(1) as f64 / found.sum_of_squares.max(f64::MIN_POSITIVE);
        Ok(Self {
            chi_square: found.sum_of_squares,
            freedom: found.degrees_of_freedom,
            by_noise: by_noise.sqrt(),
            fit: found,
        })
    }

    /// A coordinate of r in m with its standard deviation; `None` along an axis that everything turned about.
    pub fn coordinate(&self, axis: usize) -> Option<(f64, f64)> {
        let found = self.fit.parameter(axis);
        let scatter = (self.chi_square / self.freedom.max(1) as f64).sqrt().max(1.0);
        let deviation = found.deviation * self.by_noise * scatter;
        (deviation < FARTHEST_M).then_some((found.value, deviation))
    }
}

/// An arm that is known less well than this is not known.
const FARTHEST_M: f64 = 1e-2;

struct Arms<'a>(&'a [ShakenRecord]);

impl Arms<'_> {
    /// Each residual and its derivatives by r.
    fn rows(&self, arm: &[f64; 3], each: &mut impl FnMut(f64, &[f64; 3])) {
        for record in self.0 {
            let turning = Complex64::i() * (TAU * record.frequency_hz);
            let [x, y, z] = record.rate.map(|rate| rate * turning);
            // ω̇ × r = M·r.
            let zero = Complex64::new(0.0, 0.0);
            let by_arm = [[zero, -z, y], [z, zero, -x], [-y, x, zero]];
            let tilt = record.rate.map(|rate| rate / turning);
            let g = record.reaction;
            let of_gravity = [
                tilt[2] * g[1] - tilt[1] * g[2],
                tilt[0] * g[2] - tilt[2] * g[0],
                tilt[1] * g[0] - tilt[0] * g[1],
            ];
            for axis in 0..3 {
                let Some(force) = record.force[axis] else { continue };
                let weight =
                    record.deviation[axis].max(1e-15 * force.portable_norm()).max(f64::MIN_POSITIVE).recip();
                let model: Complex64 = (0..3).map(|j| by_arm[axis][j] * arm[j]).sum();
                let residual = (model + of_gravity[axis] - force) * weight;
                each(residual.re, &by_arm[axis].map(|m| m.re * weight));
                each(residual.im, &by_arm[axis].map(|m| m.im * weight));
            }
        }
    }
}

impl Regression<3> for Arms<'_> {
    fn residuals(&self, arm: &[f64; 3], each: &mut impl FnMut(f64)) {
        self.rows(arm, &mut |residual, _| each(residual));
    }

    fn linearize(&self, arm: &[f64; 3], each: &mut impl FnMut(f64, &[f64; 3])) {
        self.rows(arm, each);
    }
}
