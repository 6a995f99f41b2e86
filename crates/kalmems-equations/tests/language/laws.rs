//! The formulas of the language against the laws of `kalmems-models` of which they are the formula, and the parts of the
//! language that no published device uses: curves, delays, arguments of functions.

use crate::common::{Chance, device};
use kalmems_core::{Dual, Nodes, Scalar};
use kalmems_equations::Device;
use kalmems_models::capacitance::{CoaxialDisks, DifferentialPlates, ParallelPlate, TiltingPlate};
use kalmems_models::circuit::Transimpedance;
use kalmems_models::dynamics::{Duffing, ProofMass, torque};
use kalmems_models::readout::{CarrierDivider, DifferentialReadout};

/// Five states without units, which the law takes as its arguments in units of its own.
fn law(expression: &str, unit: &str) -> Device {
    device(&format!(
        "[states]\na = '1'\nb = '1'\nc = '1'\ne = '1'\nf = '1'\n\
         [derivative]\na = '0'\nb = '0'\nc = '0'\ne = '0'\nf = '0'\n[measure]\ny = '{expression} in {unit}'\n"
    ))
}

/// Value and slopes of the law at random points between 1 and 2 against a function of dual numbers.
fn hold(expression: &str, unit: &str, f: impl Fn([Dual<f64, 5>; 5]) -> Dual<f64, 5>) {
    let device = law(expression, unit);
    let readout = device.readout(0, &[]).unwrap();
    let mut work = readout.work(&[]);
    let mut chance = Chance::new(11);
    for _ in 0..500 {
        let x: [f64; 5] = std::array::from_fn(|_| chance.between(1.0, 2.0));
        let mut slopes = [0.0; 5];
        let value = readout.linearize(&mut work, &x, &[], &mut slopes);
        let expected = f(Dual::variables(&x));
        let near = |a: f64, b: f64| a == b || (a - b).abs() <= 1e-13 * b.abs();
        assert!(near(value, expected.value()), "{expression}: {value:e} {:e}", expected.value());
        for (found, expected) in slopes.iter().zip(expected.gradient()) {
            assert!(near(*found, expected), "{expression}: {found:e} {expected:e}");
        }
    }
}

fn of(value: f64) -> Dual<f64, 5> {
    Dual::constant(value)
}

#[test]
fn formulas_are_their_laws() {
    hold("parallel_plate(a*1[m], b*1[m^2], c)", "F", |[a, b, c, ..]| {
        ParallelPlate { area: b, relative_permittivity: c }.capacitance(a)
    });
    hold("electrostatic_force(a*1[F/m], b*1[V^2])", "N", |[a, b, ..]| torque(a, b));
    hold("viscous_damping(a*1[N s/m], b*1[m/s])", "N", |[a, b, ..]| a * b);
    hold("squeeze_film(a/4, b*1[N s/m], c/2)", "N s/m", |[a, b, c, ..]| {
        let zero = of(0.0);
        ProofMass { mass: zero, damping: b, squeezed: c * of(0.5), spring: zero }.damping_at(a * of(0.25))
    });
    hold("cubic_spring(a*1[m], b*1[N/m], c*1[N/m^3])", "N", |[a, b, c, ..]| {
        let zero = of(0.0);
        -Duffing { damping: zero, stiffness: b, cubic: c, gain: zero }.acceleration(a, zero, zero)
    });
    hold("transimpedance(a*1[F], b*1[F/s], c*1[V], e*1[V/s], f*1[ohm], 2[F])", "V", |[a, b, c, e, f]| {
        Transimpedance { feedback_resistance: f, parasitic_capacitance: of(2.0) }.voltage(a, b, c, e)
    });
    hold("differential_plates(a/4*1[m], b*1[m^2], c*1[m], e*1[F/m])", "F", |[a, b, c, e, _]| {
        DifferentialPlates { area: b, gap: c, permittivity: e }.difference(a * of(0.25))
    });
    hold(
        "differential_force(a/4*1[m], b*1[m^2], c*1[m], e*1[F/m], f*1[V^2], 0.5[V^2])",
        "N",
        |[a, b, c, e, f]| {
            DifferentialPlates { area: b, gap: c, permittivity: e }.force(a * of(0.25), [f, of(0.5)])
        },
    );
    hold(
        "charge_amplifier(differential_plates(a/4*1[m], b*1[m^2], 2[m], 1[F/m]), c*1[V], e*1[F])",
        "V",
        |[a, b, c, e, _]| {
            let plates = DifferentialPlates { area: b, gap: of(2.0), permittivity: of(1.0) };
            DifferentialReadout { plates, carrier_amplitude: c, feedback_capacitance: e }
                .voltage(a * of(0.25))
        },
    );
}

#[test]
fn native_laws_are_their_laws_by_every_argument() {
    hold("carrier(a*1[F], b*1[V], c*1[rad/s], e*1[S], f*1[F], 0.3[S], 2[F])", "V", |[a, b, c, e, f]| {
        let divider = CarrierDivider {
            excitation: b,
            carrier_rate: c,
            shunt_conductance: e,
            parallel_capacitance: f,
            input_conductance: of(0.3),
            blocking_capacitance: of(2.0),
        };
        divider.voltage(a)
    });
    hold(
        "tilting_plate(a/10*1[rad], b*1[m], (b + c)*1[m], e*1[m], 4*f*1[m], 1[F/m])",
        "F",
        |[a, b, c, e, f]| {
            let half = e * of(0.5);
            let plate = TiltingPlate {
                w1: b,
                w2: b + c,
                w3: -half,
                w4: half,
                gap: f * of(4.0),
                permittivity: of(1.0),
            };
            plate.capacitance(a * of(0.1))
        },
    );
    // Two derivatives, one of them by another argument.
    hold("1[rad]*d(gaussian_comb(a*1[rad], b*1[F], c*1[rad], e*1[F]), a)/1[rad]", "F", |[a, b, c, e, _]| {
        kalmems_models::capacitance::GaussianComb { nominal: b, angular_width: c, bias: e }.slope(a)
    });
}

#[test]
fn disks_are_the_solution_of_loves_equation() {
    let device = law("disks(a*1[mm], b*1[mm])", "F");
    let readout = device.readout(0, &[]).unwrap();
    let mut work = readout.work(&[]);
    for (distance, radius) in [(1.0, 1.9), (0.3, 1.0), (2.0, 1.0)] {
        let at = |d: f64| CoaxialDisks { radius: radius * 1e-3 }.capacitance(d * 1e-3).unwrap();
        let mut slopes = [0.0; 5];
        let found = readout.linearize(&mut work, &[distance, radius, 0.0, 0.0, 0.0], &[], &mut slopes);
        assert!((found / at(distance) - 1.0).abs() < 1e-11);
        let difference = (at(distance + 1e-4) - at(distance - 1e-4)) / 2e-4;
        assert!((slopes[0] / difference - 1.0).abs() < 1e-6, "{} {difference}", slopes[0]);
    }
    assert!(readout.read(&mut work, &[0.1, 1.0, 0.0, 0.0, 0.0], &[]).is_nan());
}

/// A curve's derivatives go into rates and their Jacobian, and beyond its points it says that nothing is known.
#[test]
fn curves_have_two_derivatives_and_an_end() {
    let x: Vec<f64> = (0..=40).map(|k| -1.0 + 0.05 * f64::from(k)).collect();
    let y: Vec<f64> = x.iter().map(|x| (-x * x).exp()).collect();
    let text = format!(
        "[states]\nx = 'mm'\nv = 'mm/s'\n[derivative]\nx = 'v'\nv = 'd(C(x), x)*1[m^2/(F s^2)]'\n[measure]\nseen = 'C(x) in pF'\n\
         [tables.C]\nx = {x:?}\ny = {y:?}\nx_unit = 'mm'\ny_unit = 'pF'\n"
    );
    let device = device(&text);
    let motion = device.motion(&[]).unwrap();
    let mut work = motion.work(&[]);
    let (mut rates, mut jacobian) = ([0.0; 2], [0.0; 4]);
    assert!(motion.linearize(&mut work, &[0.33e-3, 0.0], &[], &mut rates, &mut jacobian));
    let bell = (-0.33_f64 * 0.33).exp();
    assert!((rates[1] / (-2.0 * 0.33 * bell * 1e-9) - 1.0).abs() < 1e-4);
    assert!((jacobian[2] / ((4.0 * 0.33 * 0.33 - 2.0) * bell * 1e-6) - 1.0).abs() < 1e-2);
    assert!(!motion.linearize(&mut work, &[1.01e-3, 0.0], &[], &mut rates, &mut jacobian));
    let (mut next, nodes) = ([0.0; 2], Nodes::held(&[][..]));
    assert!(!motion.step(&mut work, &[1.01e-3, 0.0], &nodes, &motion.runge_kutta(1e-3), &mut next));
}

/// Padé's approximation of a delay has the gain 1, and the phase that its doc says.
#[test]
fn a_delay_is_late_by_its_time() {
    for (order, worst) in [(1, 0.3_f64.powi(3) / 12.0), (2, 0.3_f64.powi(5) / 720.0)] {
        // A turning phasor is delayed: u = cos φ, and cos(φ − ωτ) is expected once the start has died away.
        let text = format!(
            "[states]\nphi = 'rad'\n[derivative]\nphi = '1[rad/s]'\n[measure]\nlate = 'was in V'\n\
             [delay]\nwas = {{ of = '1[V]*cos(phi) in V', time = '0.3 [s]', order = {order} }}\n"
        );
        let device = device(&text);
        assert_eq!(device.states().len(), 1 + order);
        let (motion, readout) = (device.motion(&[]).unwrap(), device.readout(0, &[]).unwrap());
        let (mut work, mut seen) = (motion.work(&[]), readout.work(&[]));
        let mut x = vec![0.0; 1 + order];
        let (mut next, mut error, tables) = (x.clone(), 0.0_f64, motion.runge_kutta(1e-3));
        for k in 0..20_000 {
            assert!(motion.step(&mut work, &x, &Nodes::held(&[][..]), &tables, &mut next));
            x.clone_from(&next);
            if k > 8000 {
                error = error.max((readout.read(&mut seen, &x, &[]) - (x[0] - 0.3).cos()).abs());
            }
        }
        assert!(error < 1.05 * worst && error > 0.8 * worst, "order {order}: {error:e} against {worst:e}");
    }
}

#[test]
fn half_powers_and_roots_have_a_slope_where_they_meet_zero() {
    let text = "[states]\nx = '1'\ny = '1'\n[derivative]\nx = '-1[1/s]*max(x - 1, 0)^1.5'\ny = '1[1/s]*sqrt(max(x, 0)) - 1[1/s]*abs(y)^2.5'\n[measure]\nz = 'x in 1'\n";
    let device = device(text);
    let motion = device.motion(&[]).unwrap();
    let mut work = motion.work(&[]);
    let (mut rates, mut slopes) = ([0.0; 2], [0.0; 4]);
    for (x, y, expected) in [
        (0.5, 0.0, [0.0, 0.0, 0.5 / 0.5_f64.sqrt(), 0.0]),
        (-1.0, 0.0, [0.0, 0.0, 0.0, 0.0]),
        (1.0, 0.0, [0.0, 0.0, 0.5, 0.0]),
        (5.0, -4.0, [-3.0, 0.0, 0.5 / 5.0_f64.sqrt(), 2.5 * 8.0]),
    ] {
        assert!(motion.linearize(&mut work, &[x, y], &[], &mut rates, &mut slopes), "{x} {y}: {slopes:?}");
        for (slope, expected) in slopes.iter().zip(expected) {
            assert!((slope - expected).abs() < 1e-14, "{x} {y}: {slopes:?}");
        }
    }
}

/// Values and slopes by `a` of the numbers as f64 has them, computed with 40 digits (mpmath); each to two units of the last digit.
#[test]
fn arcs_lengths_signs_and_whole_numbers_have_their_values_and_slopes() {
    let cases = [
        ("asin(a)", [0.3, 0.0], 0.304_692_654_015_397_5, 1.048_284_836_721_918_2),
        ("asin(a)", [0.999_999, 0.0], 1.569_382_113_114_652_1, 707.106_957_953_142_5),
        ("acos(a)", [-0.7, 0.0], 2.346_193_823_405_649_4, -1.400_280_084_028_009_6),
        ("acos(a)", [0.999_999, 0.0], 0.001_414_213_680_244_585_2, -707.106_957_953_142_5),
        ("atan(a)", [3.0, 0.0], 1.249_045_772_398_254_4, 0.1),
        ("atan2(a, b)", [-1.5, -2.0], -2.498_091_544_796_509, -0.32),
        ("atan2(b, a)", [-2.0, 0.0], std::f64::consts::PI, 0.0),
        ("hypot(a, b)", [1.1, 2.3], 2.549_509_756_796_392_2, 0.431_455_497_304_004_9),
        ("hypot(a, b)", [0.0, 0.0], 0.0, 0.0),
        ("sign(a)", [-0.2, 0.0], -1.0, 0.0),
        ("sign(a)", [0.0, 0.0], 0.0, 0.0),
        ("sign(a)", [7.0, 0.0], 1.0, 0.0),
        ("floor(a)", [-1.5, 0.0], -2.0, 0.0),
        ("a - floor(a)", [3.25, 0.0], 0.25, 1.0),
        ("if(a < 1 and b < 1, a, 2*a)", [0.5, 0.5], 0.5, 1.0),
        ("if(a < 1 and b < 1, a, 2*a)", [0.5, 1.5], 1.0, 2.0),
        ("if(a > 1 or b > 1 and a > 0, a, 2*a)", [-0.5, 1.5], -1.0, 2.0),
        ("if((a > 1 or b > 1) and not (a > 0), a, 2*a)", [-0.5, 1.5], -0.5, 1.0),
        ("if(not a > 1 and not b > 1, a, 2*a)", [2.0, 0.0], 4.0, 2.0),
    ];
    for (expression, [a, b], expected, slope) in cases {
        let whole = format!("{expression} + c");
        let device = law(&whole, "1");
        let readout = device.readout(0, &[]).unwrap();
        let mut slopes = [0.0; 5];
        let found = readout.linearize(&mut readout.work(&[]), &[a, b, 0.0, 0.0, 0.0], &[], &mut slopes);
        let near =
            |found: f64, expected: f64| (found - expected).abs() <= 2.0 * f64::EPSILON * expected.abs();
        assert!(near(found, expected), "{expression}: {found:e} {expected:e}");
        assert!(near(slopes[0], slope), "{expression}: slope {:e} {slope:e}", slopes[0]);
    }
}

/// A law of two numbers.
type OfTwo<'a> = &'a dyn Fn(Dual<f64, 5>, Dual<f64, 5>) -> Dual<f64, 5>;

/// A surface of a product of cubics is that product, with its slopes by either argument and those of its derivative by one of them.
#[test]
fn a_surface_and_its_derivatives_are_those_of_the_law_that_its_points_are_of() {
    let (of_x, of_y) = (|x: Dual<f64, 5>| x * x * x - x.twice(), |y: Dual<f64, 5>| y * y + of(0.3) * y);
    let place = |k: usize| 0.5 + 0.5 * k as f64;
    let number = |f: &dyn Fn(Dual<f64, 5>) -> Dual<f64, 5>, k: usize| f(of(place(k))).value();
    let places: Vec<String> = (0..6).map(|k| format!("{:?}", place(k))).collect();
    let rows: Vec<String> = (0..6)
        .map(|i| {
            let row: Vec<String> =
                (0..6).map(|j| format!("{:?}", number(&of_x, i) * number(&of_y, j))).collect();
            format!("[{}]", row.join(", "))
        })
        .collect();
    let device = |expression: &str| {
        device(&format!(
            "[states]\na = '1'\nb = '1'\nc = '1'\ne = '1'\nf = '1'\n[tables]\n\
             S = {{ x = [{0}], y = [{0}], z = [{1}], x_unit = '1', y_unit = '1', z_unit = '1' }}\n\
             [derivative]\na = '0'\nb = '0'\nc = '0'\ne = '0'\nf = '0'\n[measure]\ny = '{expression} in 1'\n",
            places.join(", "),
            rows.join(", ")
        ))
    };
    let slope_x = |x: Dual<f64, 5>| of(3.0) * x * x - of(2.0);
    let slope_y = |y: Dual<f64, 5>| y.twice() + of(0.3);
    let cases: [(&str, OfTwo<'_>); 4] = [
        ("S(a, b)", &|a, b| of_x(a) * of_y(b)),
        ("d(S(a, b), b)*c", &|a, b| of_x(a) * slope_y(b) * of(1.5)),
        ("d(S(a, b), a)", &|a, b| slope_x(a) * of_y(b)),
        ("S(a*b, b) + S(b, a)", &|a, b| of_x(a * b) * of_y(b) + of_x(b) * of_y(a)),
    ];
    let mut chance = Chance::new(5);
    for (expression, law) in cases {
        let device = device(expression);
        let readout = device.readout(0, &[]).unwrap();
        let mut work = readout.work(&[]);
        for _ in 0..200 {
            let mut x: [f64; 5] = std::array::from_fn(|_| chance.between(0.8, 1.7));
            x[2] = 1.5;
            let mut slopes = [0.0; 5];
            let value = readout.linearize(&mut work, &x, &[], &mut slopes);
            let [a, b, ..] = Dual::<f64, 5>::variables(&x);
            let expected = law(a, b);
            assert!((value - expected.value()).abs() < 1e-12, "{expression}: {value} {}", expected.value());
            for (found, expected) in slopes.iter().zip(expected.gradient()).take(2) {
                assert!((found - expected).abs() < 1e-11, "{expression}: {found} {expected}");
            }
        }
    }
}

/// A chain of masses by vectors is the same device, to the last bit, as the one that is written out by hand.
#[test]
fn a_chain_by_vectors_is_the_chain_that_is_written_out() {
    let vectors = device(
        "[states]\n'x[1..4]' = 'm'\n'v[1..4]' = 'm/s'\n[parameters]\n'k[0..4]' = '2 1/s^2'\nb = '0.1 1/s'\n\
         [let]\n'pull[i=1..4]' = 'k[i]*(if(i < 4, x[i], 2*x[i]) - x[1])'\n\
         [derivative]\n'x[i=1..4]' = 'v[i]'\n'v[1]' = 'k[1]*(x[2] - x[1]) - b*v[1]'\n\
         'v[i=2..3]' = 'k[i-1]*(x[i-1] - x[i]) + k[i]*(x[i+1] - x[i]) - b*v[i]'\n'v[4]' = '-sum(j = 1..4, pull[j])'\n\
         [lag]\n'late[i=1..2]' = { of = 'x[2*i] in m', time = 'i*1[s]' }\n\
         [measure]\ny = 'sum(i = 1..4, i*x[i]) + d(sum(i = 1..4, x[i]^2), x[3])/2 in m'\n[noise]\n'v[1..4]' = '1e-6[m^2/s^3]'\n",
    );
    let by_hand = device(
        "[states]\nx_1 = 'm'\nx_2 = 'm'\nx_3 = 'm'\nx_4 = 'm'\nv_1 = 'm/s'\nv_2 = 'm/s'\nv_3 = 'm/s'\nv_4 = 'm/s'\n\
         [parameters]\nk_0 = '2 1/s^2'\nk_1 = '2 1/s^2'\nk_2 = '2 1/s^2'\nk_3 = '2 1/s^2'\nk_4 = '2 1/s^2'\nb = '0.1 1/s'\n[derivative]\n\
         x_1 = 'v_1'\nx_2 = 'v_2'\nx_3 = 'v_3'\nx_4 = 'v_4'\nv_1 = 'k_1*(x_2 - x_1) - b*v_1'\n\
         v_2 = 'k_1*(x_1 - x_2) + k_2*(x_3 - x_2) - b*v_2'\nv_3 = 'k_2*(x_2 - x_3) + k_3*(x_4 - x_3) - b*v_3'\n\
         v_4 = '-(k_1*(x_1 - x_1) + k_2*(x_2 - x_1) + k_3*(x_3 - x_1) + k_4*(2*x_4 - x_1))'\n\
         [lag]\nlate_1 = { of = 'x_2 in m', time = '1[s]' }\nlate_2 = { of = 'x_4 in m', time = '2[s]' }\n\
         [measure]\ny = '(x_1 + 2*x_2 + 3*x_3 + 4*x_4) + x_3 in m'\n[noise]\nv_1 = '1e-6[m^2/s^3]'\n",
    );
    let names =
        |device: &Device| device.states().iter().map(|state| state.name.to_string()).collect::<Vec<_>>();
    assert_eq!(names(&vectors), names(&by_hand));
    assert_eq!(vectors.noise(&vectors.values(), &[0.0; 8]).unwrap().len(), 4);
    let mut chance = Chance::new(8);
    let run = |device: &Device, x: &[f64]| {
        let (motion, readout) = (device.motion(&[]).unwrap(), device.readout(0, &[]).unwrap());
        let (mut rates, mut jacobian) = (vec![0.0; 10], vec![0.0; 100]);
        assert!(motion.linearize(&mut motion.work(&device.values()), x, &[], &mut rates, &mut jacobian));
        let seen = readout.read(&mut readout.work(&device.values()), x, &[]);
        rates.into_iter().chain(jacobian).chain([seen]).map(f64::to_bits).collect::<Vec<_>>()
    };
    for _ in 0..20 {
        let x: Vec<f64> = (0..10).map(|_| chance.between(-1.0, 1.0)).collect();
        assert_eq!(run(&vectors, &x), run(&by_hand, &x));
    }
}
