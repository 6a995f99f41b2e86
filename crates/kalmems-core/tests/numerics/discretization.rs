//! Discretisation and integrators against closed forms and against Van Loan's block exponential.

use approx::assert_relative_eq;
use kalmems_core::discretize::{discretize, matrix_exponential};
use kalmems_core::{
    Dynamics, HeldEtdrk4, LinearProcess, Mat, Nodes, NoiseDensity, Over, Process, Rk4, Scalar,
};
use proptest::prelude::*;

/// The 15.5 kHz scanner's ω² and damping rate b/J.
const STIFF: f64 = 1.10e-4 / 1.15e-14;
const DAMPING: f64 = 5.95e-12 / 1.15e-14;

#[test]
fn resonator_transition_is_the_closed_form() {
    let a = Mat([[0.0, 1.0], [-STIFF, -DAMPING]]);
    let h = 1e-6;
    let step = discretize(&a, &NoiseDensity::none(), h);
    let decay = DAMPING / 2.0;
    let damped = (STIFF - decay * decay).sqrt();
    let (s, c) = (damped * h).sin_cos();
    let e = (-decay * h).exp();
    let expected = [
        [e * (c + decay / damped * s), e * s / damped],
        [-e * STIFF / damped * s, e * (c - decay / damped * s)],
    ];
    for i in 0..2 {
        for j in 0..2 {
            assert_relative_eq!(step.transition[(i, j)], expected[i][j], max_relative = 1e-13);
        }
    }
}

#[test]
fn white_acceleration_is_the_closed_form() {
    let (q, h) = (1e8, 1e-6_f64);
    let step = discretize(&Mat([[0.0, 1.0], [0.0, 0.0]]), &NoiseDensity::none().on::<1>(q), h);
    assert_relative_eq!(step.noise.get(0, 0), q * h.powi(3) / 3.0, max_relative = 1e-14);
    assert_relative_eq!(step.noise.get(0, 1), q * h.powi(2) / 2.0, max_relative = 1e-14);
    assert_relative_eq!(step.noise.get(1, 1), q * h, max_relative = 1e-14);
}

#[test]
fn a_step_back_undoes_a_step() {
    let a = Mat([[0.0, 1.0], [-STIFF, -DAMPING]]);
    let there = discretize(&a, &NoiseDensity::none(), 3e-5).transition;
    let back = discretize(&a, &NoiseDensity::none(), -3e-5).transition;
    let both = there.times(&back);
    for (i, j, one) in [(0, 0, 1.0), (1, 1, 1.0), (0, 1, 0.0), (1, 0, 0.0)] {
        let scale = if i == j { 1.0 } else { a[(i, j)].abs().max(1.0) };
        assert!((both[(i, j)] - one).abs() / scale < 1e-12, "{both:?}");
    }
}

#[test]
fn f32_keeps_its_digits() {
    let a = Mat([[0.0_f32, 1.0], [f32::of(-STIFF), f32::of(-DAMPING)]]);
    let step = discretize(&a, &NoiseDensity::none(), 1e-6_f32).transition;
    let exact = discretize(&Mat([[0.0, 1.0], [-STIFF, -DAMPING]]), &NoiseDensity::none(), 1e-6).transition;
    for i in 0..2 {
        for j in 0..2 {
            assert_relative_eq!(f64::from(step[(i, j)]), exact[(i, j)], max_relative = 1e-5);
        }
    }
}

#[test]
fn infinite_and_missing_numbers_end() {
    for bad in [f64::INFINITY, f64::NAN] {
        let e = matrix_exponential(&Mat([[0.0, bad], [-1.0, 0.0]]));
        assert!(!e.is_finite());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    /// nalgebra's matrix exponential of Van Loan's block matrix, for random stable and unstable systems.
    #[test]
    fn agrees_with_van_loans_block(
        entries in prop::array::uniform9(-3.0..3.0_f64),
        densities in prop::array::uniform3(0.0..2.0_f64),
        h in 0.01..1.0_f64,
    ) {
        let a = Mat::<f64, 3, 3>::from_fn(|i, j| entries[3 * i + j]);
        let density =
            NoiseDensity::none().on::<0>(densities[0]).on::<1>(densities[1]).on::<2>(densities[2]);
        let ours = discretize(&a, &density, h);

        let mut block = nalgebra::SMatrix::<f64, 6, 6>::zeros();
        for i in 0..3 {
            for j in 0..3 {
                block[(i, j)] = -a[(i, j)] * h;
                block[(i + 3, j + 3)] = a[(j, i)] * h;
                block[(i, j + 3)] = if i == j { densities[i] * h } else { 0.0 };
            }
        }
        let e = block.exp();
        let phi = e.fixed_view::<3, 3>(3, 3).transpose();
        let noise = phi * e.fixed_view::<3, 3>(0, 3);
        for i in 0..3 {
            for j in 0..3 {
                prop_assert!((ours.transition[(i, j)] - phi[(i, j)]).abs() <= 1e-12 * phi.norm().max(1.0));
                prop_assert!((ours.noise.get(i, j) - noise[(i, j)]).abs() <= 1e-12 * noise.norm().max(1.0));
            }
        }
    }
}

struct Resonator;
impl<T: Scalar> Dynamics<T, 2> for Resonator {
    type Input = T;
    fn derivative<S: Over<T>>(&self, x: &[S; 2], u: &T) -> [S; 2] {
        [x[1], S::lift(*u) - x[0] * T::of(STIFF) - x[1] * T::of(DAMPING)]
    }
}

#[test]
fn rk4_converges_with_the_fourth_order() {
    let exact = LinearProcess::exact(
        &Mat([[0.0, 1.0], [-STIFF, -DAMPING]]),
        &Mat([[0.0], [1.0]]),
        &NoiseDensity::none(),
        1e-4,
    );
    let want = exact.step(&[0.15, 0.0], &[1e8]);
    let error = |steps: u32| {
        let rk4 = Rk4::new(Resonator, 1e-4 / f64::from(steps), &NoiseDensity::none(), (&[0.0; 2], &0.0));
        let mut x = [0.15, 0.0];
        for _ in 0..steps {
            x = rk4.step(&x, &Nodes::held(1e8));
        }
        (x[0] - want[0]).hypot((x[1] - want[1]) / STIFF.sqrt())
    };
    let order = (error(100) / error(200)).log2();
    assert!((3.8..4.2).contains(&order), "order {order}");
}

#[test]
fn rk4_noise_is_that_of_the_linearised_dynamics() {
    let density = NoiseDensity::none().on::<1>(1e8);
    let rk4 = Rk4::new(Resonator, 1e-6, &density, (&[0.1, 0.0], &0.0));
    let exact = discretize(&Mat([[0.0, 1.0], [-STIFF, -DAMPING]]), &density, 1e-6).noise;
    let noise = rk4.noise().covariance();
    assert_relative_eq!(noise.get(1, 1), exact.get(1, 1), max_relative = 1e-12);
    assert_relative_eq!(noise.get(0, 0), exact.get(0, 0), max_relative = 1e-12);
}

/// Forty times the fastest decay in one step, where RK4 overflows: the closed form of two decays, and its noise.
#[test]
fn an_exponential_step_is_exact_for_a_stiff_linear_system() {
    struct Overdamped;
    impl<T: Scalar> Dynamics<T, 2> for Overdamped {
        type Input = T;
        fn derivative<S: Over<T>>(&self, x: &[S; 2], u: &T) -> [S; 2] {
            [x[1], S::lift(*u) - x[0] * T::of(8e8) - x[1] * T::of(1.804e5)]
        }
    }
    let h = 2e-4;
    let density = NoiseDensity::none().on::<1>(3.0);
    // Linearised elsewhere and under another input, which must not matter.
    let step = HeldEtdrk4::new(Overdamped, h, &density, (&[7.0, -3.0], &5.0));
    let root = (9.02e4_f64.powi(2) - 8e8).sqrt();
    let (slow, fast) = (-8e8 / (9.02e4 + root), -(9.02e4 + root));
    let (x0, v0, u) = (1e-3, 20.0, 4e5);
    let rest = u / 8e8;
    let b = (v0 - slow * (x0 - rest)) / (fast - slow);
    let a = x0 - rest - b;
    let [x, v] = step.step(&[x0, v0], &u);
    assert_relative_eq!(x, rest + a * (slow * h).exp() + b * (fast * h).exp(), max_relative = 1e-12);
    assert_relative_eq!(v, a * slow * (slow * h).exp() + b * fast * (fast * h).exp(), max_relative = 1e-10);
    let exact = discretize(&Mat([[0.0, 1.0], [-8e8, -1.804e5]]), &density, h);
    let (there, f) = step.linearize(&[x0, v0], &u);
    assert_eq!(there, [x, v]);
    for i in 0..2 {
        for j in 0..2 {
            // Of states in mm and m/s, about of one size.
            let size = [1e-3, 1.0][i] / [1e-3, 1.0][j];
            for found in [f, step.transition()] {
                assert!((found[(i, j)] - exact.transition[(i, j)]).abs() < 1e-12 * size, "{i} {j}");
            }
            assert_eq!(step.noise().covariance().get(i, j), exact.noise.get(i, j));
        }
    }
}

/// Of a hardening spring, away from rest: there the slopes of the step are the exponential of those of the rates, and elsewhere they are not.
#[test]
fn the_transition_of_an_exponential_step_is_its_derivative_where_it_was_linearised() {
    struct Hardening;
    impl<T: Scalar> Dynamics<T, 2> for Hardening {
        type Input = T;
        fn derivative<S: Over<T>>(&self, x: &[S; 2], u: &T) -> [S; 2] {
            [x[1], S::lift(*u) - x[0] - x[0] * x[0] * x[0] - x[1] * T::of(0.1)]
        }
    }
    let (at, u) = ([0.7, 0.0], 0.7 + 0.7 * 0.7 * 0.7);
    let step = HeldEtdrk4::new(Hardening, 0.3, &NoiseDensity::none(), (&at, &u));
    let apart = |x: &[f64; 2]| {
        let (found, expected) = (step.transition(), step.linearize(x, &u).1);
        (0..4).map(|k| (found[(k / 2, k % 2)] - expected[(k / 2, k % 2)]).abs()).fold(0.0, f64::max)
    };
    assert!(apart(&at) < 1e-14, "{}", apart(&at));
    assert!(apart(&[0.0, 0.0]) > 0.01);
}
