//! A line of a spectrum, and the dip between two.

/// A maximum of a spectrum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpectralPeak {
    /// Where, in 1/m.
    pub wavenumber_per_m: f64,
    /// How high.
    pub height: f64,
}

/// The highest maximum within `within_per_m` of a wavenumber, by the parabola through its sample and both neighbours.
/// `None` where the spectrum has no maximum there. Wavenumbers are at equal steps.
pub fn line_near(
    wavenumber_per_m: &[f64],
    values: &[f64],
    near_per_m: f64,
    within_per_m: f64,
) -> Option<SpectralPeak> {
    let mut best: Option<SpectralPeak> = None;
    for (nu, y) in wavenumber_per_m.windows(3).zip(values.windows(3)) {
        let is_peak = y[1] >= y[0] && y[1] > y[2];
        if !is_peak || (nu[1] - near_per_m).abs() > within_per_m {
            continue;
        }
        let curvature = y[0] - 2.0 * y[1] + y[2];
        let shift = 0.5 * (y[0] - y[2]) / curvature;
        let line = SpectralPeak {
            wavenumber_per_m: nu[1] + shift * (nu[2] - nu[1]),
            height: y[1] - 0.25 * (y[0] - y[2]) * shift,
        };
        if best.is_none_or(|best| line.height > best.height) {
            best = Some(line);
        }
    }
    best
}

/// How deep the spectrum falls between two lines, as a share of the lower one: two lines are told apart by it. 0
/// where it does not fall. `None` where a line is not found.
pub fn dip_between(wavenumber_per_m: &[f64], values: &[f64], lines_per_m: [f64; 2]) -> Option<f64> {
    let within = (lines_per_m[1] - lines_per_m[0]).abs() / 3.0;
    let [first, second] = lines_per_m.map(|nu| line_near(wavenumber_per_m, values, nu, within));
    let (first, second) = (first?, second?);
    let between = wavenumber_per_m.iter().zip(values).filter(|(nu, _)| {
        let (low, high) = (first.wavenumber_per_m, second.wavenumber_per_m);
        (low.min(high)..=low.max(high)).contains(*nu)
    });
    let lowest = between.map(|(_, y)| *y).fold(f64::INFINITY, f64::min);
    Some((1.0 - lowest / first.height.min(second.height)).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::{Apodisation, path_weights, spectrum_at};
    use std::f64::consts::{PI, TAU};

    #[test]
    fn a_parabola_is_met() {
        let nu: Vec<f64> = (0..20).map(f64::from).collect();
        let y: Vec<f64> = nu.iter().map(|nu| 5.0 - 0.3 * (nu - 7.3).powi(2)).collect();
        let line = line_near(&nu, &y, 7.0, 3.0).unwrap();
        assert!((line.wavenumber_per_m - 7.3).abs() < 1e-12 && (line.height - 5.0).abs() < 1e-12);
        assert_eq!(line_near(&nu, &y, 15.0, 3.0), None);
    }

    /// Lines 10 cm⁻¹ apart with a largest path difference of 1 mm: the triangle's 1 − 8/π² in closed form, and the others
    /// as known for these weights.
    #[test]
    fn the_dip_between_two_lines_gives_the_resolution_of_a_window() {
        let largest = 1e-3;
        let half = 3000_i32;
        let x: Vec<f64> = (-half..=half).map(|k| largest / f64::from(half) * f64::from(k)).collect();
        let y: Vec<f64> = x.iter().map(|x| (TAU * 200e3 * x).cos() + (TAU * 201e3 * x).cos()).collect();
        let weights = path_weights(&x);
        let nu: Vec<f64> = (0..=400).map(|i| 198.5e3 + 10.0 * f64::from(i)).collect();
        for (apodisation, expected, tolerance) in [
            (Apodisation::Boxcar, 0.98, 0.03),
            (Apodisation::NortonBeerMedium, 0.26, 0.01),
            (Apodisation::Triangular, 1.0 - 8.0 / (PI * PI), 0.002),
            (Apodisation::HappGenzel, 0.15, 0.01),
        ] {
            let values: Vec<f64> =
                nu.iter().map(|nu| spectrum_at(*nu, &x, (&y, &weights), (apodisation, largest)).re).collect();
            let dip = dip_between(&nu, &values, [200e3, 201e3]).unwrap();
            assert!((dip - expected).abs() < tolerance, "{apodisation:?}: {dip}");
        }
    }
}
