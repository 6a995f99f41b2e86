//! Whether a device at rest stays there under a periodic drive, by integration.

use super::{Drive, Simulator};
use kalmems_core::{Dynamics, Mat, Scalar};

/// How fast a small motion about rest grows (above 0) or dies, in 1/s: the larger exponent of Floquet.
///
/// The equations linearised at rest are integrated over one period of the drive; the moduli |ρ| of the
/// eigenvalues of the matrix that this gives are what a motion is multiplied by in each period T, and the
/// exponent is ln|ρ|/T (Nayfeh and Mook, Nonlinear Oscillations, 1979, section 5.3). It holds for any waveform and any
/// depth. `None` where the drive has no period.
///
/// ```
/// use kalmems_engines::simulate::{Drive, floquet_exponent};
/// use kalmems_models::dynamics::Duffing;
/// // Nothing pumps a spring whose stiffness does not change: it dies with half its damping.
/// let spring = Duffing { damping: 40.0, stiffness: 1e6, cubic: 0.0, gain: 1.0 };
/// let drive = Drive::Sine { offset: 0.0, amplitude: 0.0, frequency_hz: 300.0, phase_rad: 0.0 };
/// assert!((floquet_exponent(spring, &drive, 200).unwrap() + 20.0).abs() < 1e-4);
/// ```
pub fn floquet_exponent<D: Dynamics<f64, 2, Input = f64> + Copy>(
    dynamics: D,
    drive: &Drive,
    steps_per_period: u32,
) -> Option<f64> {
    Some(exponent_of(&monodromy(dynamics, drive, steps_per_period)?, drive.period_s()?))
}

/// What a small motion about rest becomes within one period of the drive: [θ, θ̇] is multiplied by this matrix. `None`
/// where the drive has no period.
///
/// Its eigenvalues are the multipliers of Floquet. Their product is e^{−(b/J)·T}, whatever the drive (Liouville).
///
/// ```
/// use kalmems_engines::simulate::{Drive, monodromy};
/// use kalmems_models::dynamics::Duffing;
/// let spring = Duffing { damping: 40.0, stiffness: 1e6, cubic: 0.0, gain: 1.0 };
/// let drive = Drive::Sine { offset: 0.0, amplitude: 0.0, frequency_hz: 300.0, phase_rad: 0.0 };
/// let [[a, b], [c, d]] = monodromy(spring, &drive, 200).unwrap().0;
/// assert!(((a * d - b * c) / (-40.0_f64 / 300.0).exp() - 1.0).abs() < 1e-6);
/// ```
pub fn monodromy<D: Dynamics<f64, 2, Input = f64> + Copy>(
    dynamics: D,
    drive: &Drive,
    steps_per_period: u32,
) -> Option<Mat<f64, 2, 2>> {
    let rate_hz = f64::from(steps_per_period) / drive.period_s()?;
    let mut simulator = Simulator::new(dynamics, drive.clone(), rate_hz, [0.0, 0.0]);
    let mut monodromy = Mat::<f64, 2, 2>::identity();
    for _ in 0..steps_per_period {
        monodromy = simulator.linearized_step().times(&monodromy);
    }
    Some(monodromy)
}

/// The larger exponent of Floquet in 1/s, from what a motion becomes within a period.
pub(super) fn exponent_of(monodromy: &Mat<f64, 2, 2>, period_s: f64) -> f64 {
    Scalar::ln(spectral_radius(monodromy)) / period_s
}

/// The larger modulus of the eigenvalues.
fn spectral_radius(matrix: &Mat<f64, 2, 2>) -> f64 {
    let Mat([[a, b], [c, d]]) = *matrix;
    let (half_trace, determinant) = (0.5 * (a + d), a * d - b * c);
    // Of a rate in rad/s beside an angle in rad the difference below loses digits that this form keeps.
    let discriminant = (0.5 * (a - d)).powi(2) + b * c;
    if discriminant < 0.0 { determinant.abs().sqrt() } else { half_trace.abs() + discriminant.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moduli_of_eigenvalues() {
        // A rotation times 0.9; and eigenvalues −3 and 2.
        let (s, c) = 0.7_f64.sin_cos();
        let turned = Mat([[0.9 * c, -0.9 * s], [0.9 * s, 0.9 * c]]);
        assert!((spectral_radius(&turned) - 0.9).abs() < 1e-15);
        assert!((spectral_radius(&Mat([[0.0, 6.0], [1.0, -1.0]])) - 3.0).abs() < 1e-15);
    }
}
