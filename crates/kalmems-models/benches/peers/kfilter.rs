//! The crate kfilter.

use crate::system::{EulerByHand, Outcome, System};
use kalmems_core::{Covariance, FilterError, Mat, Process};
use kalmems_models::readout::DemodulatedComb;
use kfilter::measurement::{LinearisableMeasurement, Measurement};
use kfilter::system::{InputSystem, LinearisableSystem, System as KfilterSystem};
use kfilter::{Kalman, KalmanFilter, KalmanPredictInput, KalmanUpdate};
use nalgebra_of_kfilter::{Matrix1, Matrix1x2, Matrix2, SMatrix, SVector, Vector1, Vector2};

/// Its process.
struct Scanner {
    process: EulerByHand<f64>,
    x: Vector2<f64>,
    f: Matrix2<f64>,
    transposed: Matrix2<f64>,
    q: Matrix2<f64>,
}

impl KfilterSystem<f64, 2, 1> for Scanner {
    fn covariance(&self) -> &Matrix2<f64> {
        &self.q
    }
    fn state(&self) -> &Vector2<f64> {
        &self.x
    }
    fn state_mut(&mut self) -> &mut Vector2<f64> {
        &mut self.x
    }
}

impl LinearisableSystem<f64, 2, 1> for Scanner {
    fn transition(&self) -> &Matrix2<f64> {
        &self.f
    }
    fn transition_transpose(&self) -> &Matrix2<f64> {
        &self.transposed
    }
}

impl InputSystem<f64, 2, 1> for Scanner {
    fn step(&mut self, voltage: SVector<f64, 1>) -> &Vector2<f64> {
        let (moved, f) = self.process.linearize(&self.x.into(), &voltage.x);
        self.f = matrix(&f);
        self.transposed = self.f.transpose();
        self.x = moved.into();
        &self.x
    }
    fn predict(&self, x: &SVector<f64, 2>, voltage: &SVector<f64, 1>) -> SVector<f64, 2> {
        self.process.step(&(*x).into(), &voltage.x).into()
    }
}

/// Its measurement: value and Jacobian at one point.
struct Readout {
    y: Vector1<f64>,
    predicted: Vector1<f64>,
    h: Matrix1x2<f64>,
    transposed: Vector2<f64>,
    r: Matrix1<f64>,
}

impl Readout {
    fn at(readout: &DemodulatedComb<f64>, x: [f64; 2], y: f64, r: f64) -> Self {
        let (predicted, h) = kalmems_core::Measurement::linearize(readout, &x);
        let h = Matrix1x2::from(h.0[0]);
        let transposed = h.transpose();
        Self { y: Vector1::new(y), predicted: predicted.into(), h, transposed, r: Matrix1::new(r) }
    }
}

impl Measurement<f64, 2, 1> for Readout {
    fn covariance(&self) -> &Matrix1<f64> {
        &self.r
    }
    fn measurement(&self) -> &Vector1<f64> {
        &self.y
    }
    fn set_measurement(&mut self, y: Vector1<f64>) {
        self.y = y;
    }
    fn predict(&self, _: &Vector2<f64>) -> Vector1<f64> {
        self.predicted
    }
}

impl LinearisableMeasurement<f64, 2, 1> for Readout {
    fn observation(&self) -> &Matrix1x2<f64> {
        &self.h
    }
    fn observation_transpose(&self) -> &SMatrix<f64, 2, 1> {
        &self.transposed
    }
}

fn matrix(m: &Mat<f64, 2, 2>) -> Matrix2<f64> {
    Matrix2::new(m.0[0][0], m.0[0][1], m.0[1][0], m.0[1][1])
}

pub fn kfilter(system: &System<f64>) -> Result<Outcome<f64>, FilterError> {
    let full = |p: &Covariance<f64, 2>| matrix(&p.to_full());
    let scanner = Scanner {
        process: system.euler_by_hand(),
        x: system.start_mean.into(),
        f: Matrix2::identity(),
        transposed: Matrix2::identity(),
        q: full(&system.process_noise),
    };
    let mut filter = Kalman::new_custom(scanner, full(&system.start_covariance));
    for sample in &system.samples {
        let refused = |_| FilterError::InnovationNotPositive;
        let x = *filter.predict(Vector1::new(sample.drive.start)).map_err(refused)?;
        let readout = Readout::at(&system.readout, x.into(), sample.signal, system.readout_variance);
        filter.update(&readout).map_err(refused)?;
    }
    let p = filter.covariance();
    Ok(Outcome { mean: (*filter.state()).into(), covariance: [p.m11, p.m21, p.m22], innovations: None })
}
