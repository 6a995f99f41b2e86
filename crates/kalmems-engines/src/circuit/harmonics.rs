//! The capacitance of a swinging comb as a Fourier series.

use kalmems_models::capacitance::GaussianComb;

/// e⁻ˣ·I_n(x) for n = 0 to N − 1 and x ≥ 0, I_n being the modified Bessel functions of the first kind.
///
/// Downwards from an order at which they vanish, by I_{n−1} = I_{n+1} + 2n/x·I_n, and scaled by
/// I₀ + 2·ΣI_n = eˣ (J. C. P. Miller's method; Abramowitz and Stegun, Handbook of Mathematical Functions, 1964, 9.12
/// and 9.6.37).
///
/// ```
/// // Table 9.8 of Abramowitz and Stegun.
/// let [zeroth, first] = kalmems_engines::circuit::scaled_bessel(1.0);
/// assert!((zeroth - 0.465_759_608).abs() < 1e-9 && (first - 0.207_910_415).abs() < 1e-9);
/// ```
pub fn scaled_bessel<const N: usize>(x: f64) -> [f64; N] {
    let mut wanted = [0.0; N];
    if x < 1e-12 {
        for (n, value) in wanted.iter_mut().enumerate().take(2) {
            *value = if n == 0 { 1.0 } else { 0.5 * x };
        }
        return wanted;
    }
    // The ratio of neighbours far down the line is x/2n; 60 orders beyond both suffice for 1e-16.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // small and positive
    let first = N + 60 + 2 * x.min(1e4) as usize;
    let (mut above, mut here, mut sum) = (0.0, 1e-280, 0.0);
    for n in (0..=first).rev() {
        if let Some(slot) = wanted.get_mut(n) {
            *slot = here;
        }
        sum += if n == 0 { here } else { 2.0 * here };
        if n > 0 {
            (above, here) = (here, above + 2.0 * n as f64 / x * here);
            if here > 1e250 {
                for value in [&mut above, &mut here, &mut sum].into_iter().chain(&mut wanted) {
                    *value *= 1e-250;
                }
            }
        }
    }
    wanted.map(|value| value / sum)
}

/// c_n of C(θ) = Σ c_n·cos(2nψ) for θ = A·sin ψ, in F.
///
/// With u = (A/θ₀)², exp(−u·sin²ψ) = e^{−u/2}·e^{(u/2)·cos 2ψ}, and Jacobi and Anger's expansion makes of the last
/// factor I₀(u/2) + 2·Σ I_n(u/2)·cos(2nψ) (Abramowitz and Stegun 9.6.34). Exact for any amplitude, where the published
/// analysis stops after θ².
pub fn comb_harmonics<const N: usize>(comb: &GaussianComb<f64>, amplitude_rad: f64) -> [f64; N] {
    let half = 0.5 * (amplitude_rad / comb.angular_width).powi(2);
    let mut harmonics = scaled_bessel::<N>(half);
    for (n, value) in harmonics.iter_mut().enumerate() {
        *value *= if n == 0 { comb.nominal } else { 2.0 * comb.nominal };
        if n == 0 {
            *value += comb.bias;
        }
    }
    harmonics
}
