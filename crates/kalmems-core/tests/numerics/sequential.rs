//! Components one by one against the vector at once.

use kalmems_core::update::{Always, Gate, Sequential};
use kalmems_core::{
    Covariance, Ekf, Filter, FilterError, LinearMeasurement, Mat, Measurement, Over, Scalar, SigmaPoints, Ukf,
};
use nalgebra::{SMatrix, SVector};
use proptest::prelude::*;

type Covariance3 = Covariance<f64, 3>;

/// A·Aᵀ + a diagonal: condition numbers below about 500.
fn covariance() -> impl Strategy<Value = Covariance3> {
    (prop::array::uniform9(-1.0..1.0_f64), prop::array::uniform3(0.02..1.0_f64)).prop_map(|(a, d)| {
        let a = Mat::<f64, 3, 3>::from_fn(|i, j| a[3 * i + j]);
        Covariance::from_lower(a.times_transposed(&a)).plus(&Covariance::from_variances(d))
    })
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(1.0)
}

fn same<const N: usize>(a: &impl Filter<f64, N>, b: &impl Filter<f64, N>) -> bool {
    (0..N).all(|i| close(a.mean()[i], b.mean()[i]))
        && (0..N).all(|i| (0..N).all(|j| close(a.covariance().get(i, j), b.covariance().get(i, j))))
}

fn dense(p: &Covariance3) -> SMatrix<f64, 3, 3> {
    SMatrix::from_fn(|i, j| p.get(i, j))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn three_correlated_components_are_the_vector(
        p in covariance(),
        r in covariance(),
        h in prop::array::uniform9(-1.0..1.0_f64),
        x in prop::array::uniform3(-2.0..2.0_f64),
        y in prop::array::uniform3(-3.0..3.0_f64),
        diagonal in any::<bool>(),
    ) {
        let r = if diagonal { Covariance::from_variances(std::array::from_fn(|i| r.get(i, i))) } else { r };
        let seen = LinearMeasurement { matrix: Mat::from_fn(|i, j| h[3 * i + j]) };
        let mut vector = Ekf::new(x, p);
        let mut components = vector;
        let at_once = vector.update(&seen, &y, &r).unwrap();
        let sequence = components.update_sequentially(&seen, &y, &r).unwrap();
        prop_assert!(same(&vector, &components));
        prop_assert!(close(at_once.nis, sequence.nis));
        prop_assert!(close(at_once.log_likelihood(), sequence.log_likelihood));
        prop_assert_eq!(sequence.taken, [true; 3]);
        // Residuals and variances are those of the factored vector innovation, here with nalgebra's Cholesky.
        let s = dense(&at_once.covariance);
        let l = s.cholesky().unwrap().l();
        let white = l.solve_lower_triangular(&SVector::from(at_once.residual)).unwrap();
        for i in 0..3 {
            prop_assert!(close(sequence.variance[i], l[(i, i)].powi(2)));
            prop_assert!(close(sequence.residual[i], white[i] * l[(i, i)]));
        }
        // The same with an unscented filter.
        let mut points = Ukf::new(x, p, SigmaPoints::standard());
        let unscented = points.update_sequentially(&seen, &y, &r).unwrap();
        prop_assert!(same(&vector, &points));
        prop_assert!(close(at_once.log_likelihood(), unscented.log_likelihood));
    }

    #[test]
    fn what_is_absent_is_as_if_the_sensor_had_not_been_there(
        p in covariance(),
        r in covariance(),
        h in prop::array::uniform9(-1.0..1.0_f64),
        y in prop::array::uniform3(-3.0..3.0_f64),
        absent in 0..3_usize,
    ) {
        let seen = LinearMeasurement { matrix: Mat::<f64, 3, 3>::from_fn(|i, j| h[3 * i + j]) };
        let kept: [usize; 2] = [[1, 2], [0, 2], [0, 1]][absent];
        let pair = LinearMeasurement { matrix: Mat::<f64, 2, 3>::from_fn(|i, j| h[3 * kept[i] + j]) };
        let r_pair = Covariance::from_lower(Mat::from_fn(|i, j| r.get(kept[i], kept[j])));
        let mut without = Ekf::new([0.1, 0.2, 0.3], p);
        let mut other = without;
        let mut gap = y;
        gap[absent] = f64::NAN;
        let present = std::array::from_fn(|i| i != absent);
        let sequence = without.update_present(&seen, &gap, present, &r, &Always).unwrap();
        let vector = other.update(&pair, &[y[kept[0]], y[kept[1]]], &r_pair).unwrap();
        prop_assert!(same(&without, &other));
        prop_assert!(close(sequence.nis, vector.nis));
        prop_assert!(close(sequence.log_likelihood, vector.log_likelihood()));
        prop_assert_eq!(sequence.taken, present);
    }
}

#[test]
fn a_gate_decides_on_each_component() {
    let seen = LinearMeasurement { matrix: Mat::<f64, 3, 3>::identity() };
    let mut filter = Ekf::new([0.0; 3], Covariance::from_variances([3.0; 3]));
    let mut other = filter;
    let r = Covariance::from_variances([1.0; 3]);
    let sequence =
        filter.update_present(&seen, &[1.0, 50.0, 2.0], [true; 3], &r, &Gate { nis: 9.0 }).unwrap();
    assert_eq!(sequence.taken, [true, false, true]);
    // The outlier was predicted, and counts.
    assert_eq!(sequence.nis, 0.25 + 625.0 + 1.0);
    assert_eq!(filter.mean(), &[0.75, 0.0, 1.5]);
    // A vector gate loses all three.
    assert!(!other.update_where(&seen, &[1.0, 50.0, 2.0], &r, &Gate { nis: 9.0 }).unwrap().taken);
}

/// Position, and the logarithm of it: infinite where it is not positive.
struct PositionAndLogarithm;
impl<T: Scalar> Measurement<T, 1, 2> for PositionAndLogarithm {
    fn predict<S: Over<T>>(&self, x: &[S; 1]) -> [S; 2] {
        [x[0], x[0].ln()]
    }
}

#[test]
fn a_refused_sequence_leaves_the_state() {
    let start = ([0.5], Covariance::from_variances([4.0]));
    let mut filter = Ekf::new(start.0, start.1);
    let r = Covariance::from_variances([1.0, 1.0]);
    // The first component moves the mean to where the second has no value.
    let refused = filter.update_sequentially(&PositionAndLogarithm, &[-9.0, 0.0], &r).unwrap_err();
    assert_eq!(refused, FilterError::NonFiniteState);
    let refused = filter.update_sequentially(&PositionAndLogarithm, &[f64::NAN, 0.0], &r).unwrap_err();
    assert_eq!(refused, FilterError::NonFiniteMeasurement);
    let bad = Covariance::from_lower(Mat([[1.0, 0.0], [2.0, 1.0]]));
    let refused = filter.update_sequentially(&PositionAndLogarithm, &[1.0, 0.0], &bad).unwrap_err();
    assert_eq!(refused, FilterError::InnovationNotPositive);
    assert_eq!((filter.mean(), filter.covariance()), (&start.0, start.1));
    // Absent, the logarithm is not asked for.
    let present = [true, false];
    filter.update_present(&PositionAndLogarithm, &[-9.0, f64::NAN], present, &r, &Always).unwrap();
    assert_eq!(filter.mean(), &[0.5 - 9.5 * 0.8]);
    // Nothing present, nothing done.
    let before = filter;
    let nothing = filter.update_present(&PositionAndLogarithm, &[0.0; 2], [false; 2], &r, &Always).unwrap();
    assert_eq!((nothing.nis, nothing.log_likelihood), (0.0, 0.0));
    assert_eq!((filter.mean(), filter.covariance()), (before.mean(), before.covariance()));
}

#[test]
fn a_nonlinear_component_is_linearised_where_those_before_it_have_led() {
    // Position to 1e-6 first: then the square is linearised at the right place, x = 2 instead of 1.
    struct PositionAndSquare;
    impl<T: Scalar> Measurement<T, 1, 2> for PositionAndSquare {
        fn predict<S: Over<T>>(&self, x: &[S; 1]) -> [S; 2] {
            [x[0], x[0].sq()]
        }
    }
    let r = Covariance::from_variances([1e-6, 1e-2]);
    let mut one_by_one = Ekf::new([1.0], Covariance::from_variances([4.0]));
    let mut at_once = one_by_one;
    let sequence = one_by_one.update_sequentially(&PositionAndSquare, &[2.0, 4.0], &r).unwrap();
    let vector = at_once.update(&PositionAndSquare, &[2.0, 4.0], &r).unwrap();
    assert!(sequence.residual[1].abs() < 1e-5);
    assert!(vector.residual[1] == 3.0 && vector.nis > 50.0 && sequence.nis < 1.0);
}
