//! A filter by hand with nalgebra's matrices.

use crate::system::{Innovations, Outcome, System};
use kalmems_core::{FilterError, Measurement, Process};
use nalgebra::{Matrix2, RowVector2, Vector2};

pub fn nalgebra(system: &System<f64>) -> Result<Outcome<f64>, FilterError> {
    let process = system.euler_by_hand();
    let matrix = |p: &kalmems_core::Covariance<f64, 2>| {
        Matrix2::new(p.get(0, 0), p.get(1, 0), p.get(1, 0), p.get(1, 1))
    };
    let q = matrix(&system.process_noise);
    let r = system.readout_variance;
    let mut x = Vector2::from(system.start_mean);
    let mut p = matrix(&system.start_covariance);
    let mut innovations = Innovations::none();
    let finite = |x: &Vector2<f64>, p: &Matrix2<f64>| x.iter().chain(p.iter()).all(|v| v.is_finite());
    for sample in &system.samples {
        let (moved, f) = process.linearize(&x.into(), &sample.drive.start);
        let f = Matrix2::new(f.0[0][0], f.0[0][1], f.0[1][0], f.0[1][1]);
        let (next, covariance) = (Vector2::from(moved), f * p * f.transpose() + q);
        if !finite(&next, &covariance) {
            return Err(FilterError::NonFiniteState);
        }
        (x, p) = (next, covariance);

        if !sample.signal.is_finite() {
            return Err(FilterError::NonFiniteMeasurement);
        }
        let ([predicted], h) = system.readout.linearize(&x.into());
        let h = RowVector2::from(h.0[0]);
        let ph = p * h.transpose();
        let s = (h * ph).x + r;
        if !(s > 0.0 && s.is_finite()) {
            return Err(FilterError::InnovationNotPositive);
        }
        let recip = s.recip();
        let k = ph * recip;
        let residual = sample.signal - predicted;
        let a = Matrix2::identity() - k * h;
        let (next, covariance) = (x + k * residual, a * p * a.transpose() + k * r * k.transpose());
        if !finite(&next, &covariance) {
            return Err(FilterError::NonFiniteState);
        }
        (x, p) = (next, covariance);
        innovations.add(residual, s, residual * residual * recip);
    }
    Ok(Outcome { mean: x.into(), covariance: [p.m11, p.m21, p.m22], innovations: Some(innovations) })
}
