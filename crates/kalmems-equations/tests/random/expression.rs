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
    /// Of 0.9·sin x.
    Asin(Box<Expression>),
    Acos(Box<Expression>),
    Atan2(Box<Expression>, Box<Expression>),
    /// Of 0.1 + x and y.
    Hypot(Box<Expression>, Box<Expression>),
    Sign(Box<Expression>),
    Floor(Box<Expression>),
    /// `if(a < b and not c < d or e > f, x, y)`.
    Conditions([Box<Expression>; 8]),
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
            X::Asin(x) => format!("asin(0.9*sin({}))/1[rad]", of(x)),
            X::Acos(x) => format!("acos(0.9*sin({}))/1[rad]", of(x)),
            X::Atan2(y, x) => format!("atan2({}, {})/1[rad]", of(y), of(x)),
            X::Hypot(x, y) => format!("hypot(0.1 + ({})^2, {})", of(x), of(y)),
            X::Sign(x) => format!("sign({})", of(x)),
            X::Floor(x) => format!("floor({})", of(x)),
            X::Conditions([a, b, c, d, e, f, x, y]) => format!(
                "if(({} < {} and not {} < {}) or {} > {}, {}, {})",
                of(a),
                of(b),
                of(c),
                of(d),
                of(e),
                of(f),
                of(x),
                of(y)
            ),
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
            X::Asin(a) => arc_sine(a.value(x).sin() * of(0.9)),
            X::Acos(a) => of(std::f64::consts::FRAC_PI_2) - arc_sine(a.value(x).sin() * of(0.9)),
            X::Atan2(a, b) => angle(a.value(x), b.value(x)),
            X::Hypot(a, b) => ((a.value(x).sq() + of(0.1)).sq() + b.value(x).sq()).sqrt(),
            X::Sign(a) => {
                let a = a.value(x);
                S::select(a.lt(of(0.0)), of(-1.0), S::select(a.gt(of(0.0)), of(1.0), of(0.0)))
            }
            X::Floor(a) => floor(a.value(x)),
            X::Conditions([a, b, c, d, e, f, y, z]) => {
                let is_below = |a: &Self, b: &Self| a.value(x).lt(b.value(x));
                let holds = (is_below(a, b) && !is_below(c, d)) || is_below(f, e);
                S::select(holds, y.value(x), z.value(x))
            }
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
            X::Conditions([a, b, c, d, e, f, ..]) => apart(a, b) && apart(c, d) && apart(e, f),
            X::Abs(a) | X::Sign(a) => apart(a, &X::Number(0.0)),
            // Neither near the origin nor on the side on which the angle jumps.
            X::Atan2(a, b) => a.value(x).abs() > 0.01 || b.value(x) > 0.01,
            X::Floor(a) => {
                let value = a.value(x);
                (value - value.round()).abs() > 1e-9 * (1.0 + value.abs())
            }
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
            X::Product(a, b) | X::Quotient(a, b) | X::Max(a, b) | X::Atan2(a, b) | X::Hypot(a, b) => {
                vec![a, b]
            }
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
            | X::Asin(a)
            | X::Acos(a)
            | X::Sign(a)
            | X::Floor(a)
            | X::Abs(a) => vec![a],
            X::Conditions(all) => all.iter().map(AsRef::as_ref).collect(),
            X::Choice(all) => all.iter().map(AsRef::as_ref).collect(),
            X::Gaussian(all) => all.iter().map(AsRef::as_ref).collect(),
            X::Logistic(all) => all.iter().map(AsRef::as_ref).collect(),
        }
    }
}

/// The angle of the point (x, y) over dual numbers: atan z = z − z³/3 + … of the tangent of an eighth of the angle, since
/// tan(a/2) = (√(x² + y²) − x)/y.
fn angle<S: Scalar>(y: S, x: S) -> S {
    let one = S::of(1.0);
    // Half of the angle, by whichever form cancels nothing.
    let length = (x.sq() + y.sq()).sqrt();
    let ahead = y / (length + x.abs());
    let behind = ahead.recip();
    let halved = |t: S| t / (one + (one + t.sq()).sqrt());
    let mut tangent = S::select(x.lt(S::of(0.0)), behind, ahead);
    // Of a tangent beyond 1 the arc tangent of its reciprocal is taken from a quarter of a turn.
    let is_large = tangent.abs().gt(one);
    let side = S::select(y.lt(S::of(0.0)), S::of(-1.0), one);
    tangent = S::select(is_large, tangent.recip(), tangent);
    let t = halved(halved(halved(tangent)));
    let square = t.sq();
    let series = (0..12).rev().fold(S::of(0.0), |sum, k| {
        S::of(if k % 2 == 0 { 1.0 } else { -1.0 } / f64::from(2 * k + 1)) + square * sum
    });
    let half = t * series * S::of(8.0);
    S::select(is_large, side * S::of(std::f64::consts::FRAC_PI_2) - half, half) * S::of(2.0)
}

fn arc_sine<S: Scalar>(x: S) -> S {
    angle(x, (S::of(1.0) - x.sq()).sqrt())
}

/// The largest whole number that is not above x, for numbers below 2·10⁴.
fn floor<S: Scalar>(x: S) -> S {
    let mut whole = S::of(-32_768.0);
    for bit in (0..16).rev() {
        let next = whole + S::of(f64::from(1_u32 << bit));
        whole = S::select(x.lt(next), whole, next);
    }
    whole
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
            one().prop_map(X::Asin),
            one().prop_map(X::Acos),
            (one(), one()).prop_map(|(a, b)| X::Atan2(a, b)),
            (one(), one()).prop_map(|(a, b)| X::Hypot(a, b)),
            one().prop_map(X::Sign),
            one().prop_map(X::Floor),
            [one(), one(), one(), one(), one(), one(), one(), one()].prop_map(X::Conditions),
            one().prop_map(X::Abs),
            (one(), one()).prop_map(|(a, b)| X::Max(a, b)),
            [one(), one(), one()].prop_map(X::Gaussian),
            [one(), one()].prop_map(X::Logistic),
        ]
    })
}
