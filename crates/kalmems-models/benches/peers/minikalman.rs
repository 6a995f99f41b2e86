//! The crate minikalman, with its buffers on the stack.

use crate::system::{Outcome, System};
use kalmems_core::{FilterError, Measurement, Process};
use minikalman::extended::{ExtendedKalmanBuilder, ExtendedObservationBuilder};
use minikalman::prelude::*;
use minikalman::{
    impl_buffer_A, impl_buffer_H, impl_buffer_K, impl_buffer_P, impl_buffer_Q_direct, impl_buffer_R,
    impl_buffer_S, impl_buffer_temp_HP, impl_buffer_temp_KHP, impl_buffer_temp_P, impl_buffer_temp_PHt,
    impl_buffer_temp_S_inv, impl_buffer_temp_x, impl_buffer_x, impl_buffer_y, impl_buffer_z,
};

#[allow(clippy::unnecessary_wraps)] // the type that all filters here have
pub fn minikalman(system: &System<f64>) -> Result<Outcome<f64>, FilterError> {
    let process = system.euler_by_hand();
    impl_buffer_A!(a, 2, f64, 0.0);
    impl_buffer_x!(x, 2, f64, 0.0);
    impl_buffer_P!(p, 2, f64, 0.0);
    impl_buffer_Q_direct!(q, 2, f64, 0.0);
    impl_buffer_temp_x!(temp_x, 2, f64, 0.0);
    impl_buffer_temp_P!(temp_p, 2, f64, 0.0);
    let mut filter = ExtendedKalmanBuilder::new::<2, f64>(a, x, p, q, temp_x, temp_p);
    impl_buffer_H!(h, 1, 2, f64, 0.0);
    impl_buffer_z!(z, 1, f64, 0.0);
    impl_buffer_R!(r, 1, f64, 0.0);
    impl_buffer_y!(y, 1, f64, 0.0);
    impl_buffer_S!(s, 1, f64, 0.0);
    impl_buffer_K!(k, 2, 1, f64, 0.0);
    impl_buffer_temp_S_inv!(temp_s_inv, 1, f64, 0.0);
    impl_buffer_temp_HP!(temp_hp, 1, 2, f64, 0.0);
    impl_buffer_temp_PHt!(temp_pht, 2, 1, f64, 0.0);
    impl_buffer_temp_KHP!(temp_khp, 2, f64, 0.0);
    let mut readout = ExtendedObservationBuilder::new::<2, 1, f64>(
        h, z, r, y, s, k, temp_s_inv, temp_hp, temp_pht, temp_khp,
    );

    let full = |m: &kalmems_core::Covariance<f64, 2>| m.to_full().0;
    let fill = |to: &mut [f64], from: [[f64; 2]; 2]| to.copy_from_slice(from.as_flattened());
    filter.state_vector_mut().as_matrix_mut().as_mut_slice().copy_from_slice(&system.start_mean);
    fill(filter.estimate_covariance_mut().as_matrix_mut().as_mut_slice(), full(&system.start_covariance));
    fill(filter.direct_process_noise_mut().as_matrix_mut().as_mut_slice(), full(&system.process_noise));
    readout.measurement_noise_covariance_mut().as_matrix_mut().set_at(0, 0, system.readout_variance);

    for sample in &system.samples {
        let at =
            [filter.state_vector().as_matrix().get_at(0, 0), filter.state_vector().as_matrix().get_at(1, 0)];
        let (moved, f) = process.linearize(&at, &sample.drive.start);
        fill(filter.state_transition_jacobian_mut().as_matrix_mut().as_mut_slice(), f.0);
        filter.predict_nonlinear(|_, next| next.as_matrix_mut().as_mut_slice().copy_from_slice(&moved));

        let ([predicted], h) = system.readout.linearize(&moved);
        readout.observation_jacobian_matrix_mut().as_matrix_mut().as_mut_slice().copy_from_slice(&h.0[0]);
        readout.measurement_vector_mut().as_matrix_mut().set_at(0, 0, sample.signal);
        filter.correct_nonlinear(&mut readout, |_, seen| seen.as_matrix_mut().set_at(0, 0, predicted));
    }
    let x = filter.state_vector().as_matrix();
    let p = filter.estimate_covariance().as_matrix();
    Ok(Outcome {
        mean: [x.get_at(0, 0), x.get_at(1, 0)],
        covariance: [p.get_at(0, 0), p.get_at(1, 0), p.get_at(1, 1)],
        innovations: None,
    })
}
