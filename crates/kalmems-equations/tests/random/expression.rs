//! An expression, as a text and as numbers of any kind.

use kalmems_core::Scalar;
use kalmems_models::capacitance::{CombCurve, CurveShape, GaussianComb};
use proptest::prelude::*;
use std::fmt::Write;

/// What a part may be at most: rounding it is 10⁻¹² then.
const LARGEST: f64 = 1e4;

/// An expression of any number of variables. Of moderate variables its values are moderate.
#[derive(Clone, Debug, PartialEq)]
pub enum Expression {
    Number(f64),
    /// One of as many as there are, counted round.
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

impl Expression {
    /// The text with variables of these names.
    pub fn text(&self, names: &[String]) -> String {
        let of = |x: &Self| x.text(names);
        match self {
            X::Number(number) => format!("{number:?}"),
            X::Variable(index) => names[*index % names.len()].clone(),
            X::Sum(parts) => {
                let mut text = String::from("(0");
                for (minus, part) in parts {
                    write!(text, " {} {}", if *minus { "-" } else { "+" }, of(part)).unwrap();
                }
                text + ")"
            }
            X::Product(x, y) => format!("{}*{}", of(x), of(y)),
            X::Quotient(x, y) => format!("{}/(1.5 + sin({}))", of(x), of(y)),
            X::Power(x, power) => format!("(1 + ({})^2/4)^{power}", of(x)),
            X::Exponent(x) => format!("2^sin({})", of(x)),
            X::Sqrt(x) => format!("sqrt(1 + ({})^2)", of(x)),
            X::Ln(x) => format!("ln(2 + ({})^2)", of(x)),
            X::Sin(x) => format!("sin({})", of(x)),
            X::Cos(x) => format!("cos({})", of(x)),
            X::Exp(x) => format!("exp(sin({}))", of(x)),
            X::Tanh(x) => format!("tanh({})", of(x)),
            X::Atanh(x) => format!("atanh(0.9*sin({}))", of(x)),
            X::Atanhc(x) => format!("atanhc(0.9*sin({}))", of(x)),
            X::Choice([a, b, x, y]) => format!("if({} < {}, {}, {})", of(a), of(b), of(x), of(y)),
            X::Abs(x) => format!("abs({})", of(x)),
            X::Max(x, y) => format!("max({}, {})", of(x), of(y)),
            X::Gaussian([x, y, z]) => {
                format!("gaussian_comb({}, {}, 1.5 + sin({}), 0.5)", of(x), of(y), of(z))
            }
            X::Logistic([x, y]) => format!("logistic_comb({}, 0.1, {}, 1.7)", of(x), of(y)),
        }
    }

    /// The value with these variables.
    pub fn value<S: Scalar>(&self, x: &[S]) -> S {
        let of = |value: f64| S::of(value);
        let offset_sine = |e: &Self| e.value(x).sin() + of(1.5);
        match self {
            X::Number(number) => of(*number),
            X::Variable(index) => x[*index % x.len()],
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

    /// Whether rounding matters little to it: each of its choices is the same however its sides are rounded, as two sides that are equal but for
    /// rounding, such as 0 and a − 2 + 2 − a, have no side that is right; and no part is so large that its last digits are those that a
    /// sine of it shows, or a difference over a step of 10⁻⁴.
    pub fn is_well_conditioned(&self, x: &[f64]) -> bool {
        let apart = |a: &Self, b: &Self| {
            let values = [a.value(x), b.value(x)];
            let size = 1.0 + values[0].abs() + values[1].abs();
            a == b || (values[0] - values[1]).abs() > 1e-9 * size
        };
        let is_clear = match self {
            X::Choice([a, b, ..]) | X::Max(a, b) => apart(a, b),
            X::Abs(a) => apart(a, &X::Number(0.0)),
            _ => true,
        };
        is_clear
            && self.value(x).abs() < LARGEST
            && self.parts().into_iter().all(|part| part.is_well_conditioned(x))
    }

    fn parts(&self) -> Vec<&Self> {
        match self {
            X::Number(_) | X::Variable(_) => Vec::new(),
            X::Sum(parts) => parts.iter().map(|(_, part)| part).collect(),
            X::Product(a, b) | X::Quotient(a, b) | X::Max(a, b) => vec![a, b],
            X::Power(a, _)
            | X::Exponent(a)
            | X::Sqrt(a)
            | X::Ln(a)
            | X::Sin(a)
            | X::Cos(a)
            | X::Exp(a)
            | X::Tanh(a)
            | X::Atanh(a)
            | X::Atanhc(a)
            | X::Abs(a) => vec![a],
            X::Choice(all) => all.iter().map(AsRef::as_ref).collect(),
            X::Gaussian(all) => all.iter().map(AsRef::as_ref).collect(),
            X::Logistic(all) => all.iter().map(AsRef::as_ref).collect(),
        }
    }
}

/// Any of them.
pub fn expression() -> impl Strategy<Value = Expression> {
    let leaf = prop_oneof![
        (0_usize..60).prop_map(X::Variable),
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
