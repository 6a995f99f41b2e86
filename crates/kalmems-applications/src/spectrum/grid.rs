//! Wavenumbers at equal steps, and sums over them.

use kalmems_core::Scalar;
use realfft::num_complex::Complex64;
use std::f64::consts::TAU;

/// Wavenumbers at equal steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WavenumberGrid {
    /// The lowest, in 1/m.
    pub first_per_m: f64,
    /// In 1/m.
    pub step_per_m: f64,
    /// How many.
    pub points: usize,
}

/// A turn by a fixed angle is repeated; after so many it starts anew, so that rounding does not add up.
const RESTART: usize = 1024;

impl WavenumberGrid {
    /// One of them, in 1/m.
    pub fn wavenumber(&self, index: usize) -> f64 {
        self.first_per_m + self.step_per_m * index as f64
    }

    /// All of them, in 1/m.
    pub fn wavenumbers(&self) -> Vec<f64> {
        (0..self.points).map(|index| self.wavenumber(index)).collect()
    }

    /// Σ y·w·e^{−i·2π·ν·x} at all of them: what [`spectrum_at`](super::spectrum_at) gives at each, in one go.
    pub fn transform(&self, path_m: &[f64], weighted: &[f64]) -> Vec<Complex64> {
        let mut sums = vec![Complex64::new(0.0, 0.0); self.points];
        for (x, y) in path_m.iter().zip(weighted) {
            let turn = turn(-TAU * self.step_per_m * x);
            for (block, sums) in sums.chunks_mut(RESTART).enumerate() {
                let mut value = y * turn_at(self, block, -*x);
                for sum in sums {
                    *sum += value;
                    value *= turn;
                }
            }
        }
        sums
    }

    /// Re Σ S·e^{i·2π·ν·x} at one path difference in m.
    pub(super) fn sum_at(&self, spectrum: &[Complex64], path_m: f64) -> f64 {
        let turn = turn(TAU * self.step_per_m * path_m);
        let mut sum = 0.0;
        for (block, spectrum) in spectrum.chunks(RESTART).enumerate() {
            let mut phase = turn_at(self, block, path_m);
            for value in spectrum {
                sum += (value * phase).re;
                phase *= turn;
            }
        }
        sum
    }
}

fn turn(angle_rad: f64) -> Complex64 {
    Complex64::new(Scalar::cos(angle_rad), Scalar::sin(angle_rad))
}

/// e^{i·2π·ν·x} at the first wavenumber of a block.
fn turn_at(grid: &WavenumberGrid, block: usize, path_m: f64) -> Complex64 {
    turn(TAU * grid.wavenumber(block * RESTART) * path_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::PortableComplex;
    use crate::spectrum::{Apodisation, spectrum_at};

    #[test]
    fn it_is_the_sum_at_each_wavenumber() {
        let grid = WavenumberGrid { first_per_m: 158e3, step_per_m: 12.5, points: 2500 };
        let path: Vec<f64> = (0..300).map(|k| 1e-3 * (f64::from(k) / 50.0).sin()).collect();
        let value: Vec<f64> = (0..300).map(|k| (f64::from(k) * 0.7).cos()).collect();
        let sums = grid.transform(&path, &value);
        let settings = (Apodisation::Boxcar, 2e-3);
        let ones = vec![1.0; 300];
        for index in [0, 1, 1023, 1024, 2499] {
            let expected = spectrum_at(grid.wavenumber(index), &path, (&value, &ones), settings);
            assert!((sums[index] - expected).portable_norm() < 1e-9, "{index}");
        }
    }
}
