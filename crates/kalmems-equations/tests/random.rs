//! Random expressions: what the graph makes of them, and of their derivatives, against dual numbers over the expression as it
//! is written, and against differences.

mod common;

use common::device;
use kalmems_core::{Dual, Scalar};
use kalmems_models::capacitance::{CombCurve, CurveShape, GaussianComb};
use proptest::prelude::*;
use std::fmt::Write;

/// An expression of three variables, all of whose values are of moderate size.
#[derive(Clone, Debug)]
enum Expression {
    Number(f64),
    Variable(usize),
    Sum(Vec<(bool, Expression)>),
    Product(Box<Expression>, Box<Expression>),
    /// Over 1.5 + sin of the other.
    Quotient(Box<Expression>, Box<Expression>),
    /// A power of 1 + x²/4.
    Power(Box<Expression>, i32),
    /// 2^(sin x)
    Exponent(Box<Expression>),
    /// Of 1 + x².
    Sqrt(Box<Expression>),
    /// Of 2 + x².
    Ln(Box<Expression>),
    Sin(Box<Expression>),
    Cos(Box<Expression>),
    /// Of sin x.
    Exp(Box<Expression>),
    Tanh(Box<Expression>),
    /// Of 0.9·sin x.
    Atanh(Box<Expression>),
    Atanhc(Box<Expression>),
    Choice([Box<Expression>; 4]),
    Abs(Box<Expression>),
    Max(Box<Expression>, Box<Expression>),
    /// With widths of 1.5 + sin of the last.
    Gaussian([Box<Expression>; 3]),
    Logistic([Box<Expression>; 2]),
}

use Expression as X;

const NAMES: [&str; 3] = ["a", "b", "c"];

impl Expression {
    fn text(&self) -> String {
        match self {
            X::Number(number) => format!("{number:?}"),
            X::Variable(index) => NAMES[*index].to_owned(),
            X::Sum(parts) => {
                let mut text = String::from("(0");
                for (minus, part) in parts {
                    write!(text, " {} {}", if *minus { "-" } else { "+" }, part.text()).unwrap();
                }
                text + ")"
            }
            X::Product(x, y) => format!("{}*{}", x.text(), y.text()),
            X::Quotient(x, y) => format!("{}/(1.5 + sin({}))", x.text(), y.text()),
            X::Power(x, power) => format!("(1 + ({})^2/4)^{power}", x.text()),
            X::Exponent(x) => format!("2^sin({})", x.text()),
            X::Sqrt(x) => format!("sqrt(1 + ({})^2)", x.text()),
            X::Ln(x) => format!("ln(2 + ({})^2)", x.text()),
            X::Sin(x) => format!("sin({})", x.text()),
            X::Cos(x) => format!("cos({})", x.text()),
            X::Exp(x) => format!("exp(sin({}))", x.text()),
            X::Tanh(x) => format!("tanh({})", x.text()),
            X::Atanh(x) => format!("atanh(0.9*sin({}))", x.text()),
            X::Atanhc(x) => format!("atanhc(0.9*sin({}))", x.text()),
            X::Choice([a, b, x, y]) => format!("if({} < {}, {}, {})", a.text(), b.text(), x.text(), y.text()),
            X::Abs(x) => format!("abs({})", x.text()),
            X::Max(x, y) => format!("max({}, {})", x.text(), y.text()),
            X::Gaussian([x, y, z]) => {
                format!("gaussian_comb({}, {}, 1.5 + sin({}), 0.5)", x.text(), y.text(), z.text())
            }
            X::Logistic([x, y]) => format!("logistic_comb({}, 0.1, {}, 1.7)", x.text(), y.text()),
        }
    }

    fn value<S: Scalar>(&self, x: &[S; 3]) -> S {
        let of = |value: f64| S::of(value);
        let offset_sine = |e: &Self| e.value(x).sin() + of(1.5);
        match self {
            X::Number(number) => of(*number),
            X::Variable(index) => x[*index],
            X::Sum(parts) => parts.iter().fold(of(0.0), |sum, (minus, part)| {
                let part = part.value(x);
                if *minus { sum - part } else { sum + part }
            }),
            X::Product(a, b) => a.value(x) * b.value(x),
            X::Quotient(a, b) => a.value(x) / offset_sine(b),
            X::Power(a, power) => {
                let base = a.value(x).sq() * of(0.25) + of(1.0);
                let product = (0..power.unsigned_abs()).fold(of(1.0), |product, _| product * base);
                if *power < 0 { product.recip() } else { product }
            }
            X::Exponent(a) => (a.value(x).sin() * of(std::f64::consts::LN_2)).exp(),
            X::Sqrt(a) => (a.value(x).sq() + of(1.0)).sqrt(),
            X::Ln(a) => (a.value(x).sq() + of(2.0)).ln(),
            X::Sin(a) => a.value(x).sin(),
            X::Cos(a) => a.value(x).cos(),
            X::Exp(a) => a.value(x).sin().exp(),
            X::Tanh(a) => {
                let e = (a.value(x).twice()).exp();
                of(1.0) - of(2.0) / (e + of(1.0))
            }
            X::Atanh(a) => (a.value(x).sin() * of(0.9)).atanh(),
            X::Atanhc(a) => {
                let z = a.value(x).sin() * of(0.9);
                // Near 0 by the series, as elsewhere it would lose its digits.
                let square = z.sq();
                let series = (0..16).rev().fold(of(0.0), |s, k| s * square + of(1.0 / f64::from(2 * k + 1)));
                S::select(square.lt(of(0.02)), series, z.atanh() / z)
            }
            X::Choice([a, b, y, z]) => S::select(a.value(x).lt(b.value(x)), y.value(x), z.value(x)),
            X::Abs(a) => a.value(x).abs(),
            X::Max(a, b) => {
                let (a, b) = (a.value(x), b.value(x));
                S::select(a.lt(b), b, a)
            }
            X::Gaussian([a, b, c]) => {
                let comb = GaussianComb { nominal: b.value(x), angular_width: offset_sine(c), bias: of(0.5) };
                comb.capacitance(a.value(x))
            }
            X::Logistic([a, b]) => {
                let shape = CurveShape::Logistic;
                let comb = CombCurve { centre: of(0.1), gain: b.value(x), steepness: of(1.7), shape };
                comb.sensitivity(a.value(x))
            }
        }
    }
}

fn expression() -> impl Strategy<Value = Expression> {
    let leaf = prop_oneof![
        (0_usize..3).prop_map(X::Variable),
        prop_oneof![Just(0.0), Just(1.0), Just(2.0), 0.1..3.0].prop_map(X::Number),
    ];
    leaf.prop_recursive(5, 40, 4, |inner| {
        let one = || inner.clone().prop_map(Box::new);
        prop_oneof![
            proptest::collection::vec((any::<bool>(), inner.clone()), 1..5).prop_map(X::Sum),
            (one(), one()).prop_map(|(a, b)| X::Product(a, b)),
            (one(), one()).prop_map(|(a, b)| X::Quotient(a, b)),
            (one(), -4..6).prop_map(|(a, power)| X::Power(a, power)),
            one().prop_map(X::Exponent),
            one().prop_map(X::Sqrt),
            one().prop_map(X::Ln),
            one().prop_map(X::Sin),
            one().prop_map(X::Cos),
            one().prop_map(X::Exp),
            one().prop_map(X::Tanh),
            one().prop_map(X::Atanh),
            one().prop_map(X::Atanhc),
            [one(), one(), one(), one()].prop_map(X::Choice),
            one().prop_map(X::Abs),
            (one(), one()).prop_map(|(a, b)| X::Max(a, b)),
            [one(), one(), one()].prop_map(X::Gaussian),
            [one(), one()].prop_map(X::Logistic),
        ]
    })
}

/// A device whose first rate is the expression, and whose second one is its derivative by `a`.
fn text(expression: &Expression) -> String {
    let written = expression.text();
    format!(
        "[states]\na = '1'\nb = '1'\nc = '1'\n[let]\ne = '{written}'\n\
         [derivative]\na = '1[1/s]*e'\nb = '1[1/s]*d(e, a)'\nc = '0'\n"
    )
}

/// Relative to the largest of the numbers that belong together.
fn near(found: f64, expected: f64, size: f64, tolerance: f64) -> bool {
    found == expected || (found - expected).abs() <= tolerance * (1.0 + size)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.max(1000), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn derivatives_are_those_of_dual_numbers(
        expression in expression(),
        x in [-2.0..2.0, -2.0..2.0, -2.0..2.0_f64],
    ) {
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
