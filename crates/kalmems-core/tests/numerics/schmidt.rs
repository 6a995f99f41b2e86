//! Consider states against dense formulas, and against the errors that are really made.

use kalmems_core::{Covariance, Ekf, Filter, LinearMeasurement, LinearProcess, Mat, SchmidtEkf};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

fn dense<const R: usize, const C: usize>(m: &Mat<f64, R, C>) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|i, j| m[(i, j)])
}

fn matrix<const R: usize, const C: usize, const L: usize>(entries: [f64; L]) -> Mat<f64, R, C> {
    Mat::from_fn(|i, j| entries[C * i + j])
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// Φ is at most 1.7 long and R at least 0.1² in any direction: over six steps no S is conditioned worse than 10⁷.
    #[test]
    fn consider_states_are_those_of_the_dense_formulas(
        f in prop::array::uniform9(-0.4..0.4_f64),
        g in prop::array::uniform9(-1.0..1.0_f64),
        h in prop::array::uniform6(-1.0..1.0_f64),
        r in (0.1..1.5_f64, -1.0..1.0_f64, 0.1..1.5_f64),
        considered in prop::array::uniform3(any::<bool>()),
        ys in prop::collection::vec(prop::array::uniform2(-3.0..3.0_f64), 6),
    ) {
        let transition = Mat::from_fn(|i, j| f[3 * i + j] + if i == j { 0.5 } else { 0.0 });
        let g: Mat<f64, 3, 3> = matrix(g);
        let q = Covariance::from_lower(g.times_transposed(&g));
        let process = LinearProcess { transition, input: Mat([[0.0], [1.0], [2.0]]), noise: q.into() };
        let seen = LinearMeasurement::<f64, 3, 2> { matrix: matrix(h) };
        let r = Covariance::from_lower(Mat([[r.0 * r.0, 0.0], [r.0 * r.1, r.1 * r.1 + r.2 * r.2]]));
        let start = Covariance::from_variances([1.0, 0.1, 4.0]);
        let mut filter = SchmidtEkf::new([1.0, -2.0, 0.5], start, considered);
        let (mut x, mut p) = (SVector::from([1.0, -2.0, 0.5]), dense(&start.to_full()));
        let (f, h) = (dense(&transition), dense(&seen.matrix));
        for y in ys {
            let link = filter.predict_linked(&process, &[0.1]).unwrap();
            prop_assert_eq!((link.transition, link.noise), (transition, q));
            x = f * x + SVector::from([0.0, 0.1, 0.2]);
            p = f * p * f.transpose() + dense(&q.to_full());
            let before = filter;
            let innovation = filter.update(&seen, &y, &r).unwrap();
            let s = h * p * h.transpose() + dense(&r.to_full());
            let inverse = s.try_inverse().unwrap();
            let mut k = p * h.transpose() * inverse;
            for i in (0..3).filter(|i| considered[*i]) {
                k.row_mut(i).fill(0.0);
                prop_assert_eq!(filter.mean()[i], before.mean()[i]);
                for j in (0..3).filter(|j| considered[*j]) {
                    prop_assert_eq!(filter.covariance().get(i, j), before.covariance().get(i, j));
                }
            }
            let e = SVector::from(y) - h * x;
            let nis = e.dot(&(inverse * e));
            prop_assert!((nis - innovation.nis).abs() <= 1e-8 * nis.max(1.0));
            x += k * e;
            // The error of any linear estimate, not in Joseph's form: P − K·H·P − P·Hᵀ·Kᵀ + K·S·Kᵀ.
            p = p - k * h * p - p * h.transpose() * k.transpose() + k * s * k.transpose();
            let size = p.trace().max(1.0);
            for i in 0..3 {
                prop_assert!((x[i] - filter.mean()[i]).abs() <= 1e-8 * x.norm().max(1.0));
                for j in 0..3 {
                    prop_assert!((p[(i, j)] - filter.covariance().get(i, j)).abs() <= 1e-8 * size);
                }
            }
        }
    }
}

/// Uniform noise of unit variance from a linear congruential generator (Knuth's MMIX constants).
fn noise(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (((*state >> 11) as f64 + 0.5) / 9_007_199_254_740_992.0 - 0.5) * 12.0_f64.sqrt()
}

/// A decaying level with an unknown constant push, 4000 times. The filter that considers the push says how large
/// its error is; the one that takes it as zero does not know.
#[test]
fn the_reported_variance_is_that_of_the_error() {
    const RUNS: u32 = 4000;
    let with_push = LinearProcess::<f64, 2, 0> {
        transition: Mat([[0.9, 1.0], [0.0, 1.0]]),
        input: Mat::zero(),
        noise: Covariance::from_variances([0.01, 0.0]).into(),
    };
    let without = LinearProcess::<f64, 1, 0> {
        transition: Mat([[0.9]]),
        input: Mat::zero(),
        noise: Covariance::from_variances([0.01]).into(),
    };
    let (seen, seen_alone) =
        (LinearMeasurement { matrix: Mat([[1.0, 0.0]]) }, LinearMeasurement { matrix: Mat([[1.0]]) });
    let r = Covariance::from_variances([0.25]);
    let mut state = 1;
    let (mut square, mut square_alone) = (0.0, 0.0);
    let (mut said, mut said_alone) = (0.0, 0.0);
    for _ in 0..RUNS {
        let (mut x, push) = (noise(&mut state), 0.2 * noise(&mut state));
        let mut considers = SchmidtEkf::new([0.0; 2], Covariance::from_variances([1.0, 0.04]), [false, true]);
        let mut ignores = Ekf::new([0.0], Covariance::from_variances([1.0]));
        for _ in 0..30 {
            x = 0.9 * x + push + 0.1 * noise(&mut state);
            let y = [x + 0.5 * noise(&mut state)];
            considers.predict(&with_push, &[]).unwrap();
            ignores.predict(&without, &[]).unwrap();
            considers.update(&seen, &y, &r).unwrap();
            ignores.update(&seen_alone, &y, &r).unwrap();
        }
        square += (x - considers.mean()[0]).powi(2) / f64::from(RUNS);
        square_alone += (x - ignores.mean()[0]).powi(2) / f64::from(RUNS);
        (said, said_alone) = (considers.covariance().get(0, 0), ignores.covariance().get(0, 0));
    }
    // The mean square of 4000 errors is known to at most √(2/4000) = 2.2 % (uniform pushes make it less).
    assert!((square / said - 1.0).abs() < 0.09, "{square} {said}");
    assert!(square_alone / said_alone > 5.0, "{square_alone} {said_alone}");
    assert!(square < square_alone);
}
