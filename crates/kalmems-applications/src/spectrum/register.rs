//! Scans laid over each other.

use super::grid::WavenumberGrid;
use crate::signal::PortableComplex;
use kalmems_core::Scalar;
use realfft::num_complex::Complex64;
use std::f64::consts::TAU;

/// How far to each side a zero path is searched, in fringes of the mean wavenumber.
const FRINGES: f64 = 6.0;
/// How far to each side a shift against a reference is searched: beyond half a fringe of a narrow light the next one fits as
/// well.
const HALF_A_FRINGE: f64 = 0.5;
/// Looks for each fringe.
const LOOKS: f64 = 24.0;

/// Turns a spectrum to a zero path that lies `shift_m` further on: S·e^{i·2π·ν·shift}.
pub fn turn(spectrum: &mut [Complex64], grid: WavenumberGrid, shift_m: f64) {
    for (index, value) in spectrum.iter_mut().enumerate() {
        let angle = TAU * grid.wavenumber(index) * shift_m;
        *value *= Complex64::new(Scalar::cos(angle), Scalar::sin(angle));
    }
}

/// Where the zero path of a spectrum lies beyond that of a reference, in m: the shift that makes Re Σ S·R*·e^{i·2π·ν·x}
/// largest, and the sign of that sum.
///
/// That is the correlation of the two interferograms within the band, searched up to half a fringe of the mean wavenumber to each
/// side. Without a reference R is 1, the sum the interferogram itself, and the shift its largest deviation of either sign, searched over six
/// fringes to each side.
pub fn shift_to(spectrum: &[Complex64], reference: Option<&[Complex64]>, grid: WavenumberGrid) -> (f64, f64) {
    let product: Vec<Complex64> = match reference {
        Some(reference) => spectrum.iter().zip(reference).map(|(s, r)| s * r.conj()).collect(),
        None => spectrum.to_vec(),
    };
    let (mut total, mut moment) = (0.0, 0.0);
    for (index, value) in product.iter().enumerate() {
        total += value.portable_norm();
        moment += grid.wavenumber(index) * value.portable_norm();
    }
    // A NaN counts as no light.
    if !(total > 0.0 && moment > 0.0) {
        return (0.0, 1.0);
    }
    let fringe = total / moment;
    // A light may lower the detector's value, but no scan has another sign than the others.
    let size = |sum: f64| if reference.is_some() { sum } else { sum.abs() };
    let correlation = |shift: f64| grid.sum_at(&product, shift);
    let reach = if reference.is_some() { HALF_A_FRINGE } else { FRINGES };
    let looks = 2.0 * reach * LOOKS;
    let (mut best, mut height) = (0.0, correlation(0.0));
    let mut look = 0.0;
    while look <= looks {
        let shift = fringe * (look / LOOKS - reach);
        let found = correlation(shift);
        if size(found) > size(height) {
            (best, height) = (shift, found);
        }
        look += 1.0;
    }
    let mut width = fringe / LOOKS;
    for _ in 0..6 {
        let [before, at, after] = [-1.0, 0.0, 1.0].map(|side| size(correlation(best + side * width)));
        let curvature = before - 2.0 * at + after;
        if curvature < 0.0 {
            best += (0.5 * (before - after) / curvature).clamp(-1.0, 1.0) * width;
        }
        width /= 3.0;
    }
    (best, height.signum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shift_is_found_of_either_sign_and_undone() {
        let grid = WavenumberGrid { first_per_m: 140e3, step_per_m: 200.0, points: 400 };
        let band = |index: usize| (-((grid.wavenumber(index) - 180e3) / 12e3).powi(2)).exp();
        for (shift, sign) in [(0.0, 1.0), (1.3e-6, 1.0), (-7.7e-6, -1.0), (12.4e-6, 1.0)] {
            let mut spectrum: Vec<Complex64> =
                (0..400).map(|index| Complex64::new(sign * band(index), 0.0)).collect();
            turn(&mut spectrum, grid, -shift);
            let (found, found_sign) = shift_to(&spectrum, None, grid);
            assert!((found - shift).abs() < 1e-12 && found_sign == sign, "{found} {shift}");
            turn(&mut spectrum, grid, found);
            assert!((spectrum[200].re - sign * band(200)).abs() < 1e-5);
        }
    }
}
