//! Random expressions, and random devices of them: what the graph makes of them, and of their derivatives, against dual numbers over
//! the expression as it is written, and against differences.

#[path = "../common/mod.rs"]
mod common;
mod device;
mod expression;

use common::device;
use device::{PARAMETERS, SIZE, STATES, random_device};
use expression::{Expression, expression};
use kalmems_core::{Dual, Nodes};
use proptest::prelude::*;

/// The states.
const NAMES: [&str; 3] = ["a", "b", "c"];

/// A device whose first rate is the expression, and whose second one is its derivative by `a`.
fn text(expression: &Expression) -> String {
    let written = expression.text(&NAMES.map(str::to_owned));
    format!(
        "[states]\na = '1'\nb = '1'\nc = '1'\n[let]\ne = '{written}'\n\
         [derivative]\na = '1[1/s]*e'\nb = '1[1/s]*d(e, a)'\nc = '0'\n"
    )
}

/// Relative to the largest of the numbers that belong together.
fn near(found: f64, expected: f64, size: f64, tolerance: f64) -> bool {
    found == expected || (found - expected).abs() <= tolerance * (1.0 + size)
}

/// As many cases as are asked for with `PROPTEST_CASES`, 1000 at least.
fn config() -> ProptestConfig {
    let usual = ProptestConfig::default();
    let cases = usual.cases.max(1000);
    let max_global_rejects = usual.max_global_rejects.max(4 * cases);
    ProptestConfig { cases, max_global_rejects, failure_persistence: None, ..usual }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn derivatives_are_those_of_dual_numbers(
        expression in expression(),
        x in [-2.0..2.0, -2.0..2.0, -2.0..2.0_f64],
    ) {
        prop_assume!(expression.is_well_conditioned(&x));
        let text = text(&expression);
        let device = device(&text);
        let motion = device.motion(&[]).unwrap();
        let mut work = motion.work(&[]);
        let (mut rates, mut jacobian) = ([0.0; 3], [0.0; 9]);
        motion.linearize(&mut work, &x, &[], &mut rates, &mut jacobian);

        let dual = expression.value(&Dual::<f64, 3>::variables(&x));
        let inner = Dual::<f64, 3>::variables(&x);
        let outer: [Dual<Dual<f64, 3>, 1>; 3] = std::array::from_fn(|i| {
            if i == 0 { Dual::variable(inner[i], 0) } else { Dual::constant(inner[i]) }
        });
        let [second] = expression.value(&outer).gradient();
        let expected: Vec<f64> = dual.gradient().into_iter().chain(second.gradient()).collect();
        prop_assume!(dual.value().is_finite() && expected.iter().all(|v| v.is_finite()));
        let size = expected.iter().fold(dual.value().abs(), |size, v| size.max(v.abs()));
        prop_assume!(size < 1e6);

        prop_assert!(near(rates[0], dual.value(), size, 1e-10), "{text}\nvalue {} {}", rates[0], dual.value());
        prop_assert!(near(rates[1], second.value(), size, 1e-10), "{text}\nd {} {}", rates[1], second.value());
        for (found, expected) in jacobian.iter().zip(&expected) {
            prop_assert!(near(*found, *expected, size, 1e-10), "{text}\n{jacobian:?}\n{expected:?}");
        }
    }

    /// The second method knows nothing of derivatives: Ridders' extrapolation is not needed where six digits are asked for.
    #[test]
    fn derivatives_are_those_of_differences(
        expression in expression(),
        x in [-2.0..2.0, -2.0..2.0, -2.0..2.0_f64],
    ) {
        prop_assume!(expression.is_well_conditioned(&x));
        let device = device(&text(&expression));
        let motion = device.motion(&[]).unwrap();
        let mut work = motion.work(&[]);
        let (mut rates, mut jacobian) = ([0.0; 3], [0.0; 9]);
        motion.linearize(&mut work, &x, &[], &mut rates, &mut jacobian);
        for variable in 0..3 {
            let difference = |h: f64| {
                let (mut low, mut high) = (x, x);
                low[variable] -= h;
                high[variable] += h;
                (expression.value(&high) - expression.value(&low)) / (2.0 * h)
            };
            let (coarse, fine) = (difference(2e-4), difference(1e-4));
            // A kink between the points, or a function that bends too much for them: nothing is known.
            prop_assume!((coarse - fine).abs() < 1e-6 * (1.0 + fine.abs()));
            prop_assert!((jacobian[variable] - fine).abs() < 1e-5 * (1.0 + fine.abs()), "{} {fine}", jacobian[variable]);
        }
    }

    /// Rates, measurement and a step of a device of many parts, and the derivatives of all by the states and by parameters as states.
    #[test]
    fn a_device_of_parts_that_hang_on_each_other_is_that_of_dual_numbers(
        random in random_device(),
        x in [-1.5..1.5, -1.5..1.5, -1.5..1.5, -1.5..1.5_f64],
        u in [-1.5..1.5, -1.5..1.5, -1.5..1.5_f64],
    ) {
        let text = random.text();
        let device = device(&text);
        // p is a number and q a state, and both are states.
        for free in [&[1][..], &[0, 1]] {
            let motion = device.motion(free).unwrap();
            let mut work = motion.work(&PARAMETERS);
            let values = free.iter().map(|place| PARAMETERS[*place]);
            let point: Vec<f64> = x.iter().copied().chain(values).collect();
            let all: [f64; SIZE] = std::array::from_fn(|i| x.get(i).copied().unwrap_or_else(|| PARAMETERS[i - STATES]));
            let size = random.size(&all, u[0]);
            prop_assume!(size < 1e6 && random.is_well_conditioned(&all, u[0]));
            let variables = Dual::<f64, SIZE>::variables(&all);
            // The variables of the reference that the device has as states.
            let columns: Vec<usize> = (0..STATES).chain(free.iter().map(|place| STATES + place)).collect();
            let n = columns.len();
            let same = |what: &str, found: f64, expected: f64, size: f64| {
                prop_assert!(near(found, expected, size, 1e-9), "{text}\n{what} at {all:?} {u:?}: {found} {expected}");
                Ok(())
            };
            let (mut rates, mut jacobian) = (vec![0.0; n], vec![0.0; n * n]);
            motion.linearize(&mut work, &point, &u[..1], &mut rates, &mut jacobian);
            for (i, expected) in random.rates(&variables, u[0]).iter().enumerate().take(STATES) {
                same("rate", rates[i], expected.value(), size)?;
                for (j, column) in columns.iter().enumerate() {
                    same("slope of a rate", jacobian[i * n + j], expected.gradient()[*column], size)?;
                }
            }
            let readout = device.readout(0, free).unwrap();
            let mut slopes = vec![0.0; n];
            let value = readout.linearize(&mut readout.work(&PARAMETERS), &point, &u[..1], &mut slopes);
            let alone = readout.read(&mut readout.work(&PARAMETERS), &point, &u[..1]);
            prop_assert_eq!(alone.to_bits(), value.to_bits());
            let expected = random.measured(&variables, u[0]);
            // A product of derivatives and rates.
            same("measurement", value, expected.value(), size * size)?;
            for (j, column) in columns.iter().enumerate() {
                same("slope of the measurement", slopes[j], expected.gradient()[*column], size * size)?;
            }
            let h = 0.1 / (1.0 + size);
            let nodes = [[u[0]], [u[1]], [u[2]]];
            let nodes = Nodes { start: &nodes[0][..], middle: &nodes[1][..], end: &nodes[2][..] };
            let (mut next, mut alone) = (vec![0.0; n], vec![0.0; n]);
            let tables = motion.runge_kutta(h);
            motion.linearized_step(&mut work, &point, &nodes, &tables, &mut next, &mut jacobian);
            // With numbers of its own, so that it finds nothing that another one left.
            motion.step(&mut motion.work(&PARAMETERS), &point, &nodes, &tables, &mut alone);
            prop_assert_eq!(next.iter().map(|v| v.to_bits()).collect::<Vec<_>>(), alone.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
            let expected = random.step(&variables, &Nodes { start: u[0], middle: u[1], end: u[2] }, h);
            prop_assume!(expected.iter().all(|x| x.value().abs() < 1e6 && x.gradient().iter().all(|v| v.abs() < 1e6)));
            for (i, expected) in expected.iter().enumerate().take(STATES) {
                same("step", next[i], expected.value(), 1.0)?;
                for (j, column) in columns.iter().enumerate() {
                    same("slope of a step", jacobian[i * n + j], expected.gradient()[*column], size)?;
                }
            }
        }
    }

    /// No text makes the reader panic or take long.
    #[test]
    fn any_text_is_read_or_refused(written in "[-+*/^()a-c0-9., <>\\[\\]ifdsnpxe]{0,60}") {
        let text = format!(
            "[states]\na = '1'\nb = '1'\nc = '1'\n[derivative]\na = '{written}'\nb = '0'\nc = '0'\n"
        );
        if let Ok(device) = kalmems_equations::Description::read(&text).and_then(|read| kalmems_equations::Device::of(&read)) {
            let motion = device.motion(&[]).unwrap();
            let (mut rates, mut jacobian) = ([0.0; 3], [0.0; 9]);
            motion.linearize(&mut motion.work(&[]), &[0.3, -0.2, 1.1], &[], &mut rates, &mut jacobian);
            let _ = device.typeset();
        }
    }
}
