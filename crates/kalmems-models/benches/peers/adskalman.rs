//! The crate adskalman.

use crate::system::{Outcome, System};
use adskalman::{
    CovarianceUpdateMethod, ObservationModel, StateAndCovariance, TransitionModelLinearNoControl,
};
use kalmems_core::{Covariance, FilterError, Mat, Measurement, Process};
use nalgebra::{Matrix1, Matrix1x2, Matrix2, U1, U2, Vector1, Vector2};

/// Its linear process: the Jacobian at one point.
struct Transition {
    f: Matrix2<f64>,
    transposed: Matrix2<f64>,
    q: Matrix2<f64>,
}

impl TransitionModelLinearNoControl<f64, U2> for Transition {
    fn F(&self) -> &Matrix2<f64> {
        &self.f
    }
    fn FT(&self) -> &Matrix2<f64> {
        &self.transposed
    }
    fn Q(&self) -> &Matrix2<f64> {
        &self.q
    }
}

/// Its measurement: value and Jacobian at one point.
struct Observation {
    predicted: f64,
    h: Matrix1x2<f64>,
    transposed: Vector2<f64>,
    r: Matrix1<f64>,
}

impl ObservationModel<f64, U2, U1> for Observation {
    fn predict_observation(&self, _: &Vector2<f64>) -> Vector1<f64> {
        Vector1::new(self.predicted)
    }
    fn H(&self) -> &Matrix1x2<f64> {
        &self.h
    }
    fn HT(&self) -> &Vector2<f64> {
        &self.transposed
    }
    fn R(&self) -> &Matrix1<f64> {
        &self.r
    }
}

pub fn adskalman(system: &System<f64>) -> Result<Outcome<f64>, FilterError> {
    let process = system.euler_by_hand();
    let matrix = |m: &Mat<f64, 2, 2>| Matrix2::new(m.0[0][0], m.0[0][1], m.0[1][0], m.0[1][1]);
    let full = |p: &Covariance<f64, 2>| matrix(&p.to_full());
    let q = full(&system.process_noise);
    let r = Matrix1::new(system.readout_variance);
    let mut state = StateAndCovariance::new(system.start_mean.into(), full(&system.start_covariance));
    for sample in &system.samples {
        let (moved, f) = process.linearize(&(*state.state()).into(), &sample.drive.start);
        let f = matrix(&f);
        let mut prior = Transition { f, transposed: f.transpose(), q }.predict(&state);
        *prior.state_mut() = moved.into();

        let ([predicted], h) = system.readout.linearize(&moved);
        let h = Matrix1x2::from(h.0[0]);
        state = Observation { predicted, h, transposed: h.transpose(), r }
            .update(&prior, &Vector1::new(sample.signal), CovarianceUpdateMethod::JosephForm)
            .map_err(|_| FilterError::InnovationNotPositive)?;
    }
    let p = state.covariance();
    Ok(Outcome { mean: (*state.state()).into(), covariance: [p.m11, p.m21, p.m22], innovations: None })
}
