//! Parameters as states: the map over them, their drift in closed form, and the filters with them.

#![allow(clippy::cast_possible_truncation)] // to f32, on purpose

use approx::assert_relative_eq;
use kalmems_core::augmentation::AugmentationError;
use kalmems_core::{
    AddedState, Augmented, AugmentedMeasurement, Covariance, Drift, Dual, Dynamics, Ekf, Euler, Filter,
    LinearMeasurement, Mat, Measurement, Nodes, NoiseDensity, Over, Parameters, ParametricDynamics, Process,
    Rk4, Scalar, SigmaPoints, Ukf, jacobian,
};
use kalmems_macros::{Parameters, model};
use nalgebra::SMatrix;
use proptest::prelude::*;

const CONSTANT: Drift<f64> = Drift::RandomWalk { density: 0.0 };

#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
struct Spring<P> {
    stiffness: P,
    cubic: [P; 2],
}

#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
struct Pair<P>(P, Spring<P>);

#[derive(Clone, Copy, Debug, PartialEq, Parameters)]
struct Device<P> {
    inertia: P,
    #[parameters(fixed)]
    order: u8,
    pair: Pair<P>,
    r#gain: P,
}

const DEVICE: Device<f64> = Device {
    inertia: 1.0,
    order: 7,
    pair: Pair(2.0, Spring { stiffness: 3.0, cubic: [4.0, 5.0] }),
    r#gain: 6.0,
};

/// The numbers of the device in their order, written down by hand.
const NAMES: [&str; 6] =
    ["inertia", "pair.0", "pair.1.stiffness", "pair.1.cubic.0", "pair.1.cubic.1", "gain"];

#[test]
fn the_map_goes_through_nested_structures_in_order() {
    assert_eq!(Device::<f64>::COUNT, NAMES.len());
    let mut seen = Vec::new();
    let narrow = DEVICE.map(|index, value| {
        seen.push((index, value));
        value as f32 * 10.0
    });
    assert_eq!(seen, [(0, 1.0), (1, 2.0), (2, 3.0), (3, 4.0), (4, 5.0), (5, 6.0)]);
    let expected = Device {
        inertia: 10.0_f32,
        order: 7,
        pair: Pair(20.0, Spring { stiffness: 30.0, cubic: [40.0, 50.0] }),
        r#gain: 60.0,
    };
    assert_eq!(narrow, expected);
}

#[test]
fn a_name_is_the_way_through_the_fields_and_back() {
    for (index, name) in NAMES.iter().enumerate() {
        assert_eq!(Device::<f64>::index_of(name), Some(index), "{name}");
        assert_eq!(Device::<f64>::name(index).unwrap().to_string(), *name);
        assert_eq!(DEVICE.value(index), Some((index + 1) as f64));
    }
    assert!(Device::<f64>::name(6).is_none() && DEVICE.value(6).is_none());
    for wrong in [
        "",
        ".",
        "order",
        "pair",
        "pair.",
        "pair.1",
        "pair.2",
        "pair.1.cubic",
        "pair.1.cubic.2",
        "pair.1.cubic.+1",
        "pair.1.cubic.01",
        "inertia.",
        "inertia.0",
        "Inertia",
        "gain ",
        "stiffness",
        "pair.0.",
    ] {
        assert_eq!(Device::<f64>::index_of(wrong), None, "{wrong}");
    }
}

/// What an input can be.
type Tuple = (f64, [f64; 2], ());

#[test]
fn tuples_are_counted_and_named_as_structures_are() {
    let tuple: (f64, [f64; 2]) = (1.0, [2.0, 3.0]);
    assert_eq!(<Tuple as Parameters<f64>>::COUNT, 3);
    let lifted = Parameters::map(&tuple, |_, value| Dual::<f64, 1>::lift(value));
    assert_eq!((lifted.0.value(), lifted.1[1].value()), (1.0, 3.0));
    for (index, name) in ["0", "1.0", "1.1"].iter().enumerate() {
        assert_eq!(<Tuple as Parameters<f64>>::index_of(name), Some(index));
        assert_eq!(<Tuple as Parameters<f64>>::name(index).unwrap().to_string(), *name);
    }
    for wrong in ["0.", "2", "1", "1.2", "3"] {
        assert_eq!(<Tuple as Parameters<f64>>::index_of(wrong), None, "{wrong}");
    }
}

/// Two tanks: the first drains into the second; each has an inflow.
#[derive(Clone, Copy, Debug, Parameters)]
struct Tanks<P> {
    drain: P,
    leak: P,
    inlet: P,
}
#[model(parametric)]
impl<T: Scalar> Dynamics<T, 2> for Tanks<T> {
    type Input = (T, [T; 1]);
    fn derivative<S: Over<T>>(&self, x: &[S; 2], (first, [second]): &(T, [T; 1])) -> [S; 2] {
        let drained = x[0].sq() * self.drain;
        [S::lift(self.inlet * *first) - drained, drained - x[1] * self.leak + *second]
    }
}

#[derive(Clone, Copy, Debug, Parameters)]
struct Gauge<P> {
    gain: P,
    offset: P,
}
#[model(parametric)]
impl<T: Scalar> Measurement<T, 2, 1> for Gauge<T> {
    fn predict<S: Over<T>>(&self, x: &[S; 2]) -> [S; 1] {
        [x[1] * self.gain + self.offset]
    }
    fn depends(_: usize, state: usize) -> bool {
        state == 1
    }
}

const TANKS: Tanks<f64> = Tanks { drain: 0.5, leak: 0.3, inlet: 1.5 };
const GAUGE: Gauge<f64> = Gauge { gain: 2.0, offset: 0.1 };
const INFLOW: (f64, [f64; 1]) = (1.0, [0.2]);

fn state(scale: f64, drift: Drift<f64>) -> AddedState<f64> {
    AddedState { scale, drift }
}

fn tanks(interval: f64) -> Rk4<Tanks<f64>, f64, 2> {
    let noise = NoiseDensity::none().on::<0>(0.02).on::<1>(0.01);
    Rk4::new(TANKS, interval, &noise, (&[1.0, 1.0], &INFLOW))
}

#[test]
fn an_input_is_lifted_with_the_parameters() {
    let varied = TANKS.map(|index, value| Dual::<f64, 3>::variable(value, index));
    let x = [2.0, 0.7].map(Dual::constant);
    let rate = Tanks::<f64>::derivative_of(&varied, &x, &(4.0, [0.25]));
    // [inlet·4 − drain·4, drain·4 − leak·0.7 + 0.25] by drain, leak and inlet.
    assert_relative_eq!(rate[0].value(), 6.0 - 2.0);
    assert_relative_eq!(rate[1].value(), 2.0 - 0.21 + 0.25);
    assert_eq!(rate.map(Dual::gradient), [[-4.0, 0.0, 4.0], [4.0, -0.7, 0.0]]);
}

#[test]
fn what_a_process_cannot_be_augmented_with_is_refused() {
    let with = |added: &[AddedState<f64>; 2], enters| {
        Augmented::<_, _, 2, 2, 4>::new(tanks(0.1), added, enters).map(drop)
    };
    let fine = [state(1.0, CONSTANT); 2];
    assert!(with(&fine, [Some("leak"), Some("drain")]).is_ok());
    assert!(with(&fine, [None, None]).is_ok());
    assert!(matches!(
        with(&fine, [Some("leak"), Some("drian")]),
        Err(AugmentationError::NoSuchParameter { state: 1 })
    ));
    let twice = with(&fine, [Some("leak"), Some("leak")]).unwrap_err();
    assert!(matches!(twice, AugmentationError::EnteredTwice { state: 1, .. }));
    assert_eq!(twice.to_string(), "the added state 1 enters `leak`, which another state enters already");
    for scale in [0.0, f64::NAN, f64::INFINITY] {
        let added = [fine[0], state(scale, CONSTANT)];
        assert!(matches!(with(&added, [None, None]), Err(AugmentationError::Scale { state: 1 })));
    }
    let drifts = [
        Drift::RandomWalk { density: -1.0 },
        Drift::RandomWalk { density: f64::NAN },
        Drift::GaussMarkov { correlation_time: 0.0, deviation: 1.0 },
        Drift::GaussMarkov { correlation_time: f64::INFINITY, deviation: 1.0 },
        Drift::GaussMarkov { correlation_time: 1.0, deviation: -1.0 },
    ];
    for drift in drifts {
        let added = [state(1.0, drift), fine[0]];
        assert!(matches!(with(&added, [None, None]), Err(AugmentationError::Drift { state: 0 })));
    }
    // A negative scale only turns the sign of the state.
    assert!(with(&[state(-2.0, CONSTANT); 2], [None, None]).is_ok());
    let seen = AugmentedMeasurement::<_, _, 2, 2>::new(GAUGE, &fine, [Some("leak"), None]);
    assert!(matches!(seen, Err(AugmentationError::NoSuchParameter { state: 0 })));
}

#[test]
fn a_drift_has_the_variance_and_the_correlation_of_its_closed_form() {
    // An ordinary step, one far below τ, where 1 − e^{−2h/τ} loses its digits, and one beyond it.
    let empty = Nodes::held((0.0, [0.0]));
    for (interval, tau, sigma) in [(0.1, 2.0, 0.7), (1e-6, 3600.0, 1.5), (5.0, 0.5, 1.0)] {
        let density = 0.3;
        let added = [
            state(1.0, Drift::GaussMarkov { correlation_time: tau, deviation: sigma }),
            state(1.0, Drift::RandomWalk { density }),
        ];
        let process = Augmented::<_, _, 2, 2, 4>::new(tanks(interval), &added, [None, None]).unwrap();
        let q = process.noise().covariance();
        let expected = -sigma * sigma * f64::exp_m1(-2.0 * interval / tau);
        assert_relative_eq!(q.get(2, 2), expected, max_relative = 1e-12);
        assert_relative_eq!(q.get(3, 3), density * interval, max_relative = 1e-14);

        // From nothing known at all to the stationary state, and the correlation with the start.
        let mut filter = Ekf::new([0.0, 0.0, 1.0, 1.0], Covariance::zero());
        let mut correlation = 1.0;
        for k in 1..=400 {
            filter.predict(&process, &empty).unwrap();
            let t = interval * f64::from(k);
            let (p, decay) = (filter.covariance(), f64::exp(-t / tau));
            correlation *= process.linearize(&[0.0; 4], &empty).1[(2, 2)];
            // Rounding: an ulp of a in each of k steps.
            assert_relative_eq!(correlation, decay, max_relative = 1e-12, epsilon = 1e-300);
            assert_relative_eq!(filter.mean()[2], decay, max_relative = 1e-12, epsilon = 1e-300);
            assert_relative_eq!(
                p.get(2, 2),
                -sigma * sigma * f64::exp_m1(-2.0 * t / tau),
                max_relative = 1e-11
            );
            assert_relative_eq!(p.get(3, 3), density * t, max_relative = 1e-12);
            assert_eq!((filter.mean()[3], p.get(3, 2)), (1.0, 0.0));
        }
        // The variance that a step maps to itself is σ².
        let mut settled = Ekf::new([0.0; 4], Covariance::from_variances([1.0, 1.0, sigma * sigma, 1.0]));
        settled.predict(&process, &empty).unwrap();
        assert_relative_eq!(settled.covariance().get(2, 2), sigma * sigma, max_relative = 1e-15);
    }
}

#[test]
fn states_that_enter_nothing_leave_the_filter_as_it_was() {
    let added = [state(0.5, CONSTANT), state(2.0, Drift::RandomWalk { density: 1.0 })];
    let process = Augmented::<_, _, 2, 2, 4>::new(tanks(0.1), &added, [None, None]).unwrap();
    let gauge = AugmentedMeasurement::<_, _, 2, 2>::new(GAUGE, &added, [None, None]).unwrap();
    let mut wide = Ekf::new([1.2, 0.4, 3.0, 4.0], Covariance::from_standard_deviations([0.3, 0.2, 1.0, 1.0]));
    let mut narrow = Ekf::new([1.2, 0.4], Covariance::from_standard_deviations([0.3, 0.2]));
    let (r, plain) = (Covariance::from_variances([0.01]), tanks(0.1));
    for k in 0..50 {
        let y = [2.0 + f64::from(k) * 0.01];
        wide.predict(&process, &Nodes::held(INFLOW)).unwrap();
        narrow.predict(&plain, &Nodes::held(INFLOW)).unwrap();
        wide.update(&gauge, &y, &r).unwrap();
        narrow.update(&GAUGE, &y, &r).unwrap();
        for i in 0..2 {
            assert_relative_eq!(wide.mean()[i], narrow.mean()[i], max_relative = 1e-12);
            for j in 0..2 {
                let (w, n) = (wide.covariance().get(i, j), narrow.covariance().get(i, j));
                assert_relative_eq!(w, n, max_relative = 1e-10);
            }
        }
        assert_eq!(wide.mean()[2..], [3.0, 4.0]);
    }
}

#[test]
fn what_a_measurement_does_not_depend_on_it_does_not_depend_on() {
    type Seen = AugmentedMeasurement<Gauge<f64>, f64, 2, 2>;
    type Moved = Augmented<Rk4<Tanks<f64>, f64, 2>, f64, 2, 2, 4>;
    let pattern = [0, 1, 2, 3].map(|j| <Seen as Measurement<f64, 4, 1>>::depends(0, j));
    assert_eq!(pattern, [false, true, true, true]);
    let pattern = [0, 1, 2, 3].map(|i| [0, 1, 2, 3].map(|j| <Moved as Process<f64, 4>>::depends(i, j)));
    assert_eq!(pattern, [[true; 4], [true; 4], [false, false, true, false], [false, false, false, true]]);
}

fn dense(p: &Covariance<f64, 5>) -> SMatrix<f64, 5, 5> {
    SMatrix::from_fn(|i, j| p.get(i, j))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    /// The linearisation without its zeros is the one that dual numbers give with them, for an integrator of
    /// either kind; the filters' sparse products are the dense ones.
    #[test]
    fn the_augmented_step_is_the_dense_one(
        x in proptest::array::uniform5(0.1..2.0_f64),
        root in proptest::array::uniform5(proptest::array::uniform5(-1.0..1.0_f64)),
        first in 0.0..3.0_f64,
        y in -3.0..3.0_f64,
    ) {
        let added = [
            state(0.4, Drift::GaussMarkov { correlation_time: 3.0, deviation: 0.5 }),
            state(0.1, Drift::RandomWalk { density: 0.2 }),
            state(-0.2, CONSTANT),
        ];
        let names = [Some("inlet"), Some("drain"), None];
        let process = Augmented::<_, _, 2, 3, 5>::new(tanks(0.1), &added, names).unwrap();
        let drive = Nodes { start: (first, [0.2]), middle: (first * 1.1, [0.3]), end: (first * 1.3, [0.1]) };
        let (mean, f) = process.linearize(&x, &drive);
        let (by_dual, g) = jacobian(&x, |x| process.step(x, &drive));
        let euler = Euler::new(TANKS, 0.1, Covariance::zero());
        let euler = Augmented::<_, _, 2, 3, 5>::new(euler, &added, names).unwrap();
        let (euler_mean, euler_f) = euler.linearize(&x, &(first, [0.2]));
        let (euler_by_dual, euler_g) = jacobian(&x, |x| euler.step(x, &(first, [0.2])));
        for i in 0..5 {
            prop_assert!((mean[i] - by_dual[i]).abs() <= 1e-13);
            prop_assert!((euler_mean[i] - euler_by_dual[i]).abs() <= 1e-13);
            for j in 0..5 {
                prop_assert!((f[(i, j)] - g[(i, j)]).abs() <= 1e-13);
                prop_assert!((euler_f[(i, j)] - euler_g[(i, j)]).abs() <= 1e-13);
            }
        }

        let a = SMatrix::<f64, 5, 5>::from_fn(|i, j| root[i][j]);
        let p = a * a.transpose() + SMatrix::identity() * 0.01;
        let start = Covariance::from_lower(Mat(std::array::from_fn(|i| std::array::from_fn(|j| p[(i, j)]))));
        let mut filter = Ekf::new(x, start);
        filter.predict(&process, &drive).unwrap();
        let f = SMatrix::<f64, 5, 5>::from_fn(|i, j| f[(i, j)]);
        let predicted = f * p * f.transpose() + dense(process.noise().covariance());
        prop_assert!((dense(&filter.covariance()) - predicted).amax() <= 1e-12 * predicted.amax());

        let gauge =
            AugmentedMeasurement::<_, _, 2, 3>::new(GAUGE, &added, [Some("gain"), None, Some("offset")]).unwrap();
        let at = *filter.mean();
        filter.update(&gauge, &[y], &Covariance::from_variances([0.5])).unwrap();
        // y = (2 + 0.4·s₀)·x₁ + 0.1 − 0.2·s₂.
        let h = SMatrix::<f64, 1, 5>::from_row_slice(&[0.0, 2.0 + 0.4 * at[2], 0.4 * at[1], 0.0, -0.2]);
        let s = (h * predicted * h.transpose())[(0, 0)] + 0.5;
        let gain = predicted * h.transpose() / s;
        let residual = y - ((2.0 + 0.4 * at[2]) * at[1] + 0.1 - 0.2 * at[4]);
        for i in 0..5 {
            prop_assert!((filter.mean()[i] - at[i] - gain[i] * residual).abs() <= 1e-11);
        }
        let corrected = predicted - gain * h * predicted;
        prop_assert!((dense(&filter.covariance()) - corrected).amax() <= 1e-11 * predicted.amax());
    }
}

#[derive(Parameters)]
struct Decay<P> {
    rate: P,
}
#[model(parametric)]
impl<T: Scalar> Dynamics<T, 1> for Decay<T> {
    type Input = ();
    fn derivative<S: Over<T>>(&self, x: &[S; 1], (): &()) -> [S; 1] {
        [-(x[0] * self.rate)]
    }
}

/// The rate of a decay that is in truth 1.3, by any filter and integrator and in either precision.
fn rate_of_decay<T: Scalar, F: Filter<T, 2>, P: Process<T, 2>>(
    mut filter: F,
    process: &P,
    input: &P::Input,
    truth: impl Fn(i32) -> f64,
) -> T {
    let level = LinearMeasurement { matrix: Mat([[T::of(1.0), T::of(0.0)]]) };
    for k in 1..=200 {
        filter.predict(process, input).unwrap();
        filter.update(&level, &[T::of(truth(k))], &Covariance::from_variances([T::of(1e-8)])).unwrap();
    }
    filter.mean()[1]
}

/// The decay with its rate as the second state.
fn decay_with_rate<T: Scalar>() -> Augmented<Rk4<Decay<T>, T, 1>, T, 1, 1, 2> {
    let noise = NoiseDensity::none();
    let decay = Rk4::new(Decay { rate: T::of(1.0) }, T::of(0.01), &noise, (&[T::of(1.0)], &()));
    let added = [AddedState { scale: T::of(0.5), drift: Drift::RandomWalk { density: T::of(0.0) } }];
    Augmented::new(decay, &added, [Some("rate")]).unwrap()
}

#[test]
fn a_parameter_is_found_by_either_filter_and_integrator_and_in_f32() {
    let exact = |k: i32| (-1.3 * 0.01 * f64::from(k)).exp();
    // rate = 1 + 0.5·0.6.
    let start = Covariance::from_standard_deviations([0.1, 1.0]);
    let held = Nodes::held(());
    let ekf = rate_of_decay(Ekf::new([1.0, 0.0], start), &decay_with_rate::<f64>(), &held, exact);
    assert!((ekf - 0.6).abs() < 2e-3, "{ekf}");
    let ukf = rate_of_decay(
        Ukf::new([1.0, 0.0], start, SigmaPoints::standard()),
        &decay_with_rate::<f64>(),
        &held,
        exact,
    );
    assert!((ukf - 0.6).abs() < 2e-3, "{ukf}");
    let start = Covariance::from_standard_deviations([0.1_f32, 1.0]);
    let narrow = rate_of_decay(Ekf::new([1.0_f32, 0.0], start), &decay_with_rate::<f32>(), &held, exact);
    assert!((narrow - 0.6).abs() < 2e-3, "{narrow}");
    // What Euler's method makes of the decay, from a truth of its own.
    let start = Covariance::from_standard_deviations([0.1, 1.0]);
    let euler = Euler::new(Decay { rate: 1.0 }, 0.01, Covariance::zero());
    let euler = Augmented::<_, _, 1, 1, 2>::new(euler, &[state(0.5, CONSTANT)], [Some("rate")]).unwrap();
    let by_euler = |k: i32| (1.0 - 1.3 * 0.01_f64).powi(k);
    let found = rate_of_decay(Ekf::new([1.0, 0.0], start), &euler, &(), by_euler);
    assert!((found - 0.6).abs() < 2e-3, "{found}");
}
