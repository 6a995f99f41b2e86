//! What the signal can tell of the amplitude while gain and offset are not known.

use kalmems_core::Portable;
use std::f64::consts::TAU;

/// By how much the standard deviation of the amplitude grows when gain and offset are fitted with it, for a steady
/// motion of this amplitude on a comb of this width, both in rad.
///
/// y = a·e^{−(A·sin φ/θ₀)²} + b over whole cycles; the Fisher information of (A, a, b) says √(I_AA·(I⁻¹)_AA), which is the
/// length of ∂y/∂A against the length of what of it is no mixture of ∂y/∂a and ∂y/∂b. The phase stands apart: its
/// derivative is odd where the others are even. Neither gain nor noise matters.
///
/// ```
/// use kalmems_rigs::shared_scanner::identification::gain_ambiguity;
/// assert!(gain_ambiguity(0.1, 0.2) > 10.0 * gain_ambiguity(0.4, 0.2));
/// ```
pub fn gain_ambiguity(amplitude: f64, width: f64) -> f64 {
    const POINTS: i32 = 720;
    let rows = (0..POINTS).map(|k| {
        let square = (TAU * (f64::from(k) + 0.5) / f64::from(POINTS)).portable_sin().powi(2);
        let overlap = (-square * (amplitude / width).powi(2)).portable_exp();
        // ∂y/∂A without its constant factors, and ∂y/∂a; ∂y/∂b is 1.
        [square * overlap, overlap]
    });
    let count = f64::from(POINTS);
    let mean = rows.clone().fold([0.0; 2], |m, r| [m[0] + r[0] / count, m[1] + r[1] / count]);
    let (mut aa, mut ag, mut gg, mut whole) = (0.0, 0.0, 0.0, 0.0);
    for [a, g] in rows {
        whole += a * a;
        let (a, g) = (a - mean[0], g - mean[1]);
        aa += a * a;
        ag += a * g;
        gg += g * g;
    }
    (whole / (aa - ag * ag / gg)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::gain_ambiguity;

    /// Small motion, by hand: of s·(1 − u·s) and 1 − u·s + u²s²/2, s = sin²φ and u = (A/θ₀)², what is left of the first
    /// is −u·(s² − s)/2-like; its length falls in proportion to u, so that the factor grows as 1/A².
    #[test]
    fn the_factor_grows_with_the_inverse_square() {
        let ratio = gain_ambiguity(0.005, 0.2) / gain_ambiguity(0.01, 0.2);
        assert!((ratio - 4.0).abs() < 0.02, "{ratio}");
    }

    /// The figures that an independent prototype measured.
    #[test]
    fn the_factors_at_six_nine_and_fifteen_degrees() {
        for (degrees, factor) in [(6.0_f64, 46.0), (9.0, 18.0), (15.0, 5.0)] {
            let ours = gain_ambiguity(degrees.to_radians(), 0.2);
            println!("{degrees} deg: {ours:.2}, expected about {factor}");
            assert!((ours / factor - 1.0).abs() < 0.15, "{degrees} deg: {ours}");
        }
    }
}
