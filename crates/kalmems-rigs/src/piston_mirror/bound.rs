//! The accuracy that no estimator can beat on a motion with constant rates.

use super::plates::Plates;
use kalmems_core::{Covariance, Ldl, Mat, Portable};
use std::f64::consts::TAU;

/// The Cramér–Rao bound of the motion [A, f, φ, d₀, Ȧ] at the first sample, all five unknown.
#[derive(Clone, Copy, Debug)]
pub struct MotionBound {
    /// On their covariance, in m, Hz, rad, m and m/s.
    pub covariance: Covariance<f64, 5>,
    /// On the position's root mean square error over the record, in m.
    pub position_rms_m: f64,
}

/// The bound for `samples` samples at a rate in Hz, with a one-sided noise density of the capacitance in F/√Hz.
///
/// From the Fisher matrix Σ hᵀ·h/R with R = S²·f_s/2 and h = C′(d)·[cos φ, −A·2π·t·sin φ, −A·sin φ, 1, t·cos φ]. It
/// does not depend on the sampling rate as long as that follows the motion: R grows with it as the number of samples
/// does. A bound per parameter alone (Faller and Zangl, 2017, equation 11) takes the others for known and is no bound
/// of all five.
///
/// `None` where the samples do not determine all five.
pub fn motion_bound(
    plates: &Plates,
    motion: &[f64; 5],
    (rate_hz, samples): (f64, u32),
    noise_density: f64,
) -> Option<MotionBound> {
    let variance = noise_density * noise_density * rate_hz / 2.0;
    let rows = || {
        (0..samples).map(move |k| {
            let t = f64::from(k) / rate_hz;
            let [amplitude, frequency, phase, rest, drift] = *motion;
            let now = [amplitude + drift * t, frequency, phase + TAU * frequency * t, rest, drift];
            let ([position, _], [by_state, _]) = position_and_velocity(&now);
            // From the state at the sample to that at the first: φ = φ₀ + 2π·f·t and A = A₀ + Ȧ·t.
            let by_start = [by_state[0], by_state[2] * TAU * t, by_state[2], by_state[3], by_state[0] * t];
            (position, by_start)
        })
    };
    let mut information = Mat::<f64, 5, 5>::zero();
    for (position, by_start) in rows() {
        let weight = plates.slope(position).powi(2) / variance;
        for i in 0..5 {
            for j in 0..=i {
                information.0[i][j] += weight * by_start[i] * by_start[j];
            }
        }
    }
    // Metres beside hertz: columns of one size.
    let scale: [f64; 5] = std::array::from_fn(|i| information.0[i][i].sqrt().recip());
    let unit = Mat::from_fn(|i, j| information.0[i][j] * scale[i] * scale[j]);
    let ldl = Ldl::of(&Covariance::from_lower(unit));
    let columns = Mat::<f64, 5, 5>::identity().0.map(|column| ldl.solve(&column));
    let covariance = Mat::from_fn(|i, j| columns[j][i] * scale[i] * scale[j]);
    let square: f64 = rows()
        .map(|(_, g)| {
            let one = |i: usize| (0..5).map(|j| g[i] * covariance.0[i][j] * g[j]).sum::<f64>();
            (0..5).map(one).sum::<f64>()
        })
        .sum();
    let position_rms_m = (square / f64::from(samples)).sqrt();
    let determined = ldl.positive && position_rms_m.is_finite();
    determined.then(|| MotionBound { covariance: Covariance::from_lower(covariance), position_rms_m })
}

/// d = d₀ + A·cos φ in m and ḋ = Ȧ·cos φ − 2π·f·A·sin φ in m/s, and their derivatives by [A, f, φ, d₀, Ȧ].
fn position_and_velocity(&[a, f, phase, rest, drift]: &[f64; 5]) -> ([f64; 2], [[f64; 5]; 2]) {
    let (s, c) = phase.portable_sin_cos();
    let rate = TAU * f;
    let values = [rest + a * c, drift * c - rate * a * s];
    let gradients =
        [[c, 0.0, -a * s, 1.0, 0.0], [-rate * s, -TAU * a * s, -drift * s - rate * a * c, 0.0, c]];
    (values, gradients)
}
