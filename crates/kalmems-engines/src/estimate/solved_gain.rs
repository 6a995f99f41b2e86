//! The gain in which a filter of any number of states settles.
//!
//! A solver for each number of states is a third of a megabyte of program, for what is computed once. There are three, and a smaller system gets further
//! states that decay, that nothing moves and that the measurement does not see: they have no part in the others.

use super::transition::ContinuousMotion;
use kalmems_core::riccati::{
    RiccatiError, continuous_riccati, discrete_riccati, kalman_bucy_gain, kalman_gain,
};
use kalmems_core::{Covariance, Mat, NoiseDensity, OperatingPoint};

/// That of a Kalman–Bucy filter in state per measurement and second, for a motion of `N` states that a measurement with the row `seen` and this noise
/// density in measurement²·s corrects.
pub(super) fn continuous_gain<const N: usize>(
    motion: &ContinuousMotion,
    seen: &[f64; N],
    noise: f64,
) -> Result<Mat<f64, N, 1>, RiccatiError> {
    let gain = match N {
        0..=4 => of_motion::<4>(motion, seen, noise),
        5..=8 => of_motion::<8>(motion, seen, noise),
        _ => of_motion::<12>(motion, seen, noise),
    }?;
    Ok(Mat::from_fn(|i, _| gain.get(i).copied().unwrap_or(0.0)))
}

/// That of a Kalman filter at this point, in state per measurement.
pub(super) fn settled_gain<const N: usize>(
    point: &OperatingPoint<f64, N, 1>,
) -> Result<Mat<f64, N, 1>, RiccatiError> {
    let gain = match N {
        0..=4 => of_point::<N, 4>(point),
        5..=8 => of_point::<N, 8>(point),
        _ => of_point::<N, 12>(point),
    }?;
    Ok(Mat::from_fn(|i, _| gain.get(i).copied().unwrap_or(0.0)))
}

fn of_motion<const M: usize>(
    motion: &ContinuousMotion,
    seen: &[f64],
    noise: f64,
) -> Result<Vec<f64>, RiccatiError> {
    let states = seen.len();
    let largest = motion.slopes.iter().map(|slope| slope.abs()).fold(0.0, f64::max);
    // Of a random walk any rate will do.
    let decay = if largest > 0.0 { largest } else { 1.0 };
    let slopes = Mat::<f64, M, M>::from_fn(|i, j| match (i < states && j < states, i == j) {
        (true, _) => motion.slopes.get(i * states + j).copied().unwrap_or(0.0),
        (false, true) => -decay,
        (false, false) => 0.0,
    });
    let observation = Mat::<f64, 1, M>::from_fn(|_, j| seen.get(j).copied().unwrap_or(0.0));
    let density = |i: usize| motion.densities.get(i).copied().unwrap_or(0.0);
    let density = NoiseDensity::from_lower(Mat::from_fn(|i, j| if i == j { density(i) } else { 0.0 }));
    let sampled = NoiseDensity::none().on::<0>(noise);
    let settled = continuous_riccati(&slopes, &observation, &density, &sampled)?;
    let gain = kalman_bucy_gain(&settled, &observation, &sampled);
    Ok((0..states.min(M)).map(|i| gain.0[i][0]).collect())
}

fn of_point<const N: usize, const M: usize>(
    point: &OperatingPoint<f64, N, 1>,
) -> Result<Vec<f64>, RiccatiError> {
    let small = |i: usize, j: usize| i < N && j < N;
    let transition =
        Mat::<f64, M, M>::from_fn(|i, j| if small(i, j) { point.transition.0[i][j] } else { 0.0 });
    let observation = Mat::<f64, 1, M>::from_fn(|_, j| if j < N { point.observation.0[0][j] } else { 0.0 });
    let noise = Mat::from_fn(|i, j| if small(i, j) { point.process_noise.get(i, j) } else { 0.0 });
    let settled = discrete_riccati(
        &transition,
        &observation,
        &Covariance::from_lower(noise),
        &point.measurement_noise,
    )?;
    let gain = kalman_gain(&settled, &observation, &point.measurement_noise);
    Ok((0..N.min(M)).map(|i| gain.0[i][0]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use kalmems_core::FixedGain;

    /// Of three integrators in a row that noise drives, whose gain is (2, 2, 1) by the Butterworth polynomial of third order, and of the same with two
    /// further states that only decay.
    #[test]
    fn further_states_change_no_gain_of_a_motion() {
        let chain = |states: usize| {
            let mut slopes = vec![0.0; states * states];
            (slopes[1], slopes[states + 2]) = (1.0, 1.0);
            (3..states).for_each(|i| slopes[i * states + i] = -2.0);
            let densities = (0..states).map(|i| if i == 2 { 1.0 } else { 0.0 }).collect();
            ContinuousMotion { slopes, densities, poles: Vec::new() }
        };
        let three = continuous_gain::<3>(&chain(3), &[1.0, 0.0, 0.0], 1.0).unwrap();
        let five = continuous_gain::<5>(&chain(5), &[1.0, 0.0, 0.0, 0.0, 0.0], 1.0).unwrap();
        for (i, expected) in [2.0, 2.0, 1.0].into_iter().enumerate() {
            assert!((three.0[i][0] - expected).abs() < 1e-12, "{three:?}");
            assert!((five.0[i][0] - expected).abs() < 1e-12, "{five:?}");
        }
        assert_eq!([five.0[3][0], five.0[4][0]], [0.0, 0.0]);
        // A random walk of a density of 9, seen with one of 4: P = 6, K = 1.5.
        let walk = ContinuousMotion { slopes: vec![0.0], densities: vec![9.0], poles: Vec::new() };
        let gain = continuous_gain::<1>(&walk, &[1.0], 4.0).unwrap().0[0][0];
        assert!((gain - 1.5).abs() < 1e-12, "{gain}");
    }

    /// A resonator, in units as different as a position in m and a speed in m/s are.
    #[test]
    fn further_states_change_no_gain_of_a_point() {
        let (sine, cosine) = 0.3_f64.sin_cos();
        let point = OperatingPoint {
            transition: Mat([[0.999 * cosine, 1e-6 * sine], [-1e6 * sine, 0.999 * cosine]]),
            observation: Mat([[2e3, 0.0]]),
            process_noise: Covariance::from_lower(Mat([[1e-19, 0.0], [2e-14, 3e-8]])),
            measurement_noise: Covariance::from_variances([1e-10]),
        };
        let expected = FixedGain::steady_state([0.0; 2], &point).unwrap();
        let found = settled_gain(&point).unwrap();
        for i in 0..2 {
            assert!((found.0[i][0] / expected.gain().0[i][0] - 1.0).abs() < 1e-12, "{found:?} {expected:?}");
        }
    }
}
