//! The iterated filter against the most probable state, found by search.

use kalmems_core::{
    Covariance, Ekf, Filter, IteratedEkf, LinearMeasurement, LinearProcess, Mat, Measurement, Over,
    ProcessNoise, Scalar,
};
use nalgebra::{Matrix2, Vector2};
use proptest::prelude::*;

/// The distance to the origin, and the sine of the direction to it.
struct Radar;
impl<T: Scalar> Measurement<T, 2, 2> for Radar {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 2] {
        let range = (x[0].sq() + x[1].sq()).sqrt();
        [range, x[1] / range]
    }
}

/// y = x².
struct Square;
impl<T: Scalar> Measurement<T, 1, 1> for Square {
    fn predict<S: Over<T>>(&self, x: &[S; 1]) -> [S; 1] {
        [x[0].sq()]
    }
}

/// −2 ln p(x | y) without its constant.
struct Posterior {
    mean: Vector2<f64>,
    information: Matrix2<f64>,
    y: [f64; 2],
    variances: [f64; 2],
}

impl Posterior {
    fn cost(&self, x: Vector2<f64>) -> f64 {
        let d = x - self.mean;
        let h = Radar.predict(&[x[0], x[1]]);
        d.dot(&(self.information * d))
            + (0..2).map(|i| (self.y[i] - h[i]).powi(2) / self.variances[i]).sum::<f64>()
    }

    /// The least cost on a grid of ±5σ, then on ever finer ones around it.
    fn most_probable(&self, deviations: [f64; 2]) -> Vector2<f64> {
        let (mut best, mut width) = (self.mean, 5.0);
        for _ in 0..40 {
            let centre = best;
            for i in -20..=20 {
                for j in -20..=20 {
                    let step = Vector2::new(f64::from(i) * deviations[0], f64::from(j) * deviations[1]);
                    let x = centre + step * (width / 20.0);
                    if self.cost(x) < self.cost(best) {
                        best = x;
                    }
                }
            }
            width *= 0.5;
        }
        best
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    /// The target is 1 to 3 away and known to 0.3 before; the range to 0.02 and the direction to 0.02, so that
    /// one step of the linearised filter misses by more than it claims.
    #[test]
    fn it_finds_the_most_probable_state(
        direction in -0.9..0.9_f64,
        range in 1.0..3.0_f64,
        off in prop::array::uniform2(-0.4..0.4_f64),
        error in prop::array::uniform2(-0.03..0.03_f64),
    ) {
        let truth = [range * direction.cos(), range * direction.sin()];
        let mean = [truth[0] + off[0], truth[1] + off[1]];
        let seen = Radar.predict(&truth);
        let y = [seen[0] + error[0], seen[1] + error[1]];
        let covariance = Covariance::from_lower(Mat([[0.09, 0.0], [0.03, 0.06]]));
        let variances = [4e-4, 4e-4];
        let r = Covariance::from_variances(variances);
        let mut filter = IteratedEkf::<_, 2, 60>::new(mean, covariance, 1e-10);
        let mut once = Ekf::new(mean, covariance);
        let innovation = filter.update(&Radar, &y, &r).unwrap();
        let expected = once.update(&Radar, &y, &r).unwrap();
        prop_assert_eq!((innovation.residual, innovation.nis), (expected.residual, expected.nis));

        let information = Matrix2::new(0.09, 0.03, 0.03, 0.06).try_inverse().unwrap();
        let posterior = Posterior { mean: Vector2::from(mean), information, y, variances };
        let best = posterior.most_probable([0.3, 0.25]);
        let miss = (Vector2::from(*filter.mean()) - best).norm();
        // The search knows its minimum to the root of the rounding of a cost of up to 10.
        prop_assert!(miss < 1e-6, "{:?} {:?}", filter.mean(), best);
        let missed = (Vector2::from(*once.mean()) - best).norm();
        prop_assert!(miss <= missed + 1e-6);

        // The covariance is the inverse of P⁻¹ + Hᵀ·R⁻¹·H where it ended.
        let (_, h) = Radar.linearize(&[best[0], best[1]]);
        let h = Matrix2::from_fn(|i, j| h[(i, j)]);
        let p = (information + h.transpose() * h / 4e-4).try_inverse().unwrap();
        for (i, j) in [(0, 0), (1, 0), (1, 1)] {
            prop_assert!((p[(i, j)] - filter.covariance().get(i, j)).abs() < 1e-5 * p.trace());
        }
    }

    #[test]
    fn on_a_linear_measurement_all_steps_are_the_first(
        h in prop::array::uniform4(-1.0..1.0_f64),
        y in prop::array::uniform2(-3.0..3.0_f64),
    ) {
        let seen = LinearMeasurement { matrix: Mat([[h[0], h[1]], [h[2], h[3]]]) };
        let start = ([1.0, -2.0], Covariance::from_lower(Mat([[2.0, 0.0], [0.5, 1.0]])));
        let r = Covariance::from_lower(Mat([[0.3, 0.0], [0.1, 0.2]]));
        let mut once = Ekf::new(start.0, start.1);
        let mut filter = IteratedEkf::<_, 2, 4>::new(start.0, start.1, 0.0);
        once.update(&seen, &y, &r).unwrap();
        filter.update(&seen, &y, &r).unwrap();
        for i in 0..2 {
            prop_assert!((once.mean()[i] - filter.mean()[i]).abs() < 1e-13);
            for j in 0..2 {
                prop_assert!((once.covariance().get(i, j) - filter.covariance().get(i, j)).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn one_step_is_the_extended_filter(x in prop::array::uniform2(0.5..3.0_f64), y in prop::array::uniform2(0.1..0.9_f64)) {
        let start = Covariance::from_lower(Mat([[2.0, 0.0], [0.5, 1.0]]));
        let r = Covariance::from_variances([0.1, 0.2]);
        let mut once = Ekf::new(x, start);
        let mut filter = IteratedEkf::<_, 2, 1>::new(x, start, 0.0);
        once.update(&Radar, &y, &r).unwrap();
        filter.update(&Radar, &y, &r).unwrap();
        prop_assert_eq!((once.mean(), once.covariance()), (filter.mean(), filter.covariance()));
    }
}

/// y = x² from x̄ = 1, P = 1, y = 4, R = 0.01: the cost (x − 1)² + (4 − x²)²/0.01 is least where
/// x − 1 = 200·x·(4 − x²). One linearised step goes to 1 + 2·3/4.01 = 2.496.
#[test]
fn a_square_in_closed_form() {
    let start = Covariance::from_variances([1.0]);
    let r = Covariance::from_variances([0.01]);
    let (mut low, mut high) = (1.5_f64, 2.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if middle - 1.0 < 200.0 * middle * (4.0 - middle * middle) { low = middle } else { high = middle }
    }
    let mut once = Ekf::new([1.0], start);
    once.update(&Square, &[4.0], &r).unwrap();
    approx::assert_relative_eq!(once.mean()[0], 1.0 + 6.0 / 4.01, max_relative = 1e-14);
    let mut filter = IteratedEkf::<_, 1, 20>::new([1.0], start, 1e-12);
    filter.update(&Square, &[4.0], &r).unwrap();
    approx::assert_relative_eq!(filter.mean()[0], low, max_relative = 1e-12);
    // A coarse tolerance ends earlier, and a bound of two steps after two.
    let mut two = IteratedEkf::<_, 1, 2>::new([1.0], start, 1e-12);
    let mut coarse = IteratedEkf::<_, 1, 20>::new([1.0], start, 1.0);
    two.update(&Square, &[4.0], &r).unwrap();
    coarse.update(&Square, &[4.0], &r).unwrap();
    let error = |filter: &[f64; 1]| (filter[0] - low).abs();
    assert!(error(once.mean()) > 0.4 && error(two.mean()) < 0.1 && error(two.mean()) > 1e-3);
    // The first step is 1.5 σ, the second 0.4.
    assert_eq!(coarse.mean(), two.mean());
    // How a step depends on the last is that of the extended filter.
    let step = LinearProcess::<f64, 1, 0> {
        transition: Mat([[0.5]]),
        input: Mat::zero(),
        noise: ProcessNoise::from(Covariance::from_variances([3.0])),
    };
    let link = filter.predict_linked(&step, &[]).unwrap();
    assert_eq!((link.transition, link.noise.get(0, 0)), (Mat([[0.5]]), 3.0));
}
