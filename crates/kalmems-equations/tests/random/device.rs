//! A device whose named expressions depend on each other, with a function, a curve, a lag, parameters and an input.

use super::expression::{Expression, expression};
use kalmems_core::{Dual, Nodes, Scalar};
use proptest::prelude::*;
use std::fmt::Write;

/// A named expression.
#[derive(Clone, Debug)]
enum Part {
    Plain(Expression),
    /// The function of two others.
    Call([Expression; 2]),
    /// The curve at the sine of another.
    Curve(Expression),
}

/// The device.
#[derive(Clone, Debug)]
pub struct RandomDevice {
    /// Of x and y.
    function: Expression,
    parts: Vec<Part>,
}

/// Its states and the parameters that become states.
const VARIABLES: [&str; 6] = ["a", "b", "c", "s", "p", "q"];
/// As many as `VARIABLES`.
pub const SIZE: usize = VARIABLES.len();
/// The states among them.
pub const STATES: usize = 4;
/// The values of p and q as the text states them.
pub const PARAMETERS: [f64; 2] = [0.7, -0.4];
/// The time constant of the lag in s.
const TIME_S: f64 = 0.5;
/// What the lag is measured with beside a total derivative, which no chance cancels, in 1/s.
const WEIGHT: f64 = 1.234_567;

/// What the curve goes through: a cubic, which a spline of its kind is too.
fn cubic<S: Scalar>(x: S) -> S {
    x * (x.sq() * S::of(0.75) - x * S::of(0.2) - S::of(0.5)) + S::of(0.3)
}

/// Any of them.
pub fn random_device() -> impl Strategy<Value = RandomDevice> {
    let part = prop_oneof![
        4 => expression().prop_map(Part::Plain),
        1 => [expression(), expression()].prop_map(Part::Call),
        1 => expression().prop_map(Part::Curve),
    ];
    (expression(), proptest::collection::vec(part, 2..6))
        .prop_map(|(function, parts)| RandomDevice { function, parts })
}

impl RandomDevice {
    /// What the rate of `c` is the derivative of.
    fn middle(&self) -> usize {
        self.parts.len() / 2
    }

    /// The text: ȧ is the last named expression, ḃ its derivative by `a`, ċ that of the middle one by `p`, `s` follows the middle one, and
    /// it is measured together with the total derivative of the first one.
    pub fn text(&self) -> String {
        let (last, middle) = (self.parts.len() - 1, self.middle());
        let mut text = format!(
            "[states]\na = '1'\nb = '1'\nc = '1'\n[inputs]\nu = '1'\n[parameters]\np = '{:?}'\nq = '{:?}'\n",
            PARAMETERS[0], PARAMETERS[1]
        );
        let function = self.function.text(&["x", "y"].map(str::to_owned));
        write!(text, "[functions]\n'f(x, y)' = '{function}'\n[tables.curve]\n").unwrap();
        let x: Vec<f64> = (-8..=8).map(|k| f64::from(k) / 7.0).collect();
        let y: Vec<f64> = x.iter().map(|x| cubic(*x)).collect();
        write!(text, "x = {x:?}\ny = {y:?}\nx_unit = '1'\ny_unit = '1'\n[let]\n").unwrap();
        let mut names: Vec<String> = VARIABLES.map(str::to_owned).to_vec();
        for (place, part) in self.parts.iter().enumerate() {
            let written = match part {
                Part::Plain(e) => e.text(&names),
                Part::Call([x, y]) => format!("f({}, {})", x.text(&names), y.text(&names)),
                Part::Curve(x) => format!("curve(sin({}))", x.text(&names)),
            };
            writeln!(text, "l{place} = '{written}'").unwrap();
            if place == 0 {
                // The rate of what depends on an input is not known.
                names.push("u".to_owned());
            }
            names.push(format!("l{place}"));
        }
        write!(
            text,
            "[derivative]\na = '1[1/s]*l{last}'\nb = '1[1/s]*d(l{last}, a)'\nc = '1[1/s]*d(l{middle}, p)'\n\
             [lag]\ns = {{ of = 'l{middle} in 1', time = '{TIME_S:?}[s]' }}\n[measure]\nm = '{WEIGHT:?}[1/s]*s + ddt(l0) in 1/s'\n"
        )
        .unwrap();
        text
    }

    /// The named expressions.
    fn parts<S: Scalar>(&self, x: &[S; SIZE], u: f64) -> Vec<S> {
        let (mut known, mut parts) = (x.to_vec(), Vec::new());
        for part in &self.parts {
            let value = match part {
                Part::Plain(e) => e.value(&known),
                Part::Call(both) => self.function.value(&both.each_ref().map(|e| e.value(&known))),
                Part::Curve(e) => cubic(e.value(&known).sin()),
            };
            if parts.is_empty() {
                known.push(S::of(u));
            }
            known.push(value);
            parts.push(value);
        }
        parts
    }

    /// Their derivatives by a variable.
    fn slopes<S: Scalar>(&self, x: &[S; SIZE], u: f64, by: usize) -> Vec<S> {
        let seeded: [Dual<S, 1>; SIZE] =
            std::array::from_fn(|i| if i == by { Dual::variable(x[i], 0) } else { Dual::constant(x[i]) });
        self.parts(&seeded, u).into_iter().map(|part| part.gradient()[0]).collect()
    }

    /// The rates; those of the parameters are 0.
    pub fn rates<S: Scalar>(&self, x: &[S; SIZE], u: f64) -> [S; SIZE] {
        let (last, middle) = (self.parts.len() - 1, self.middle());
        let parts = self.parts(x, u);
        let (by_a, by_p) = (self.slopes(x, u, 0), self.slopes(x, u, STATES));
        let lag = (parts[middle] - x[3]) / S::of(TIME_S);
        [parts[last], by_a[last], by_p[middle], lag, S::of(0.0), S::of(0.0)]
    }

    /// The state of the lag, and the total derivative of the first named expression.
    pub fn measured<S: Scalar>(&self, x: &[S; SIZE], u: f64) -> S {
        let rates = self.rates(x, u);
        (0..STATES).fold(x[3] * S::of(WEIGHT), |sum, i| sum + self.slopes(x, u, i)[0] * rates[i])
    }

    /// A step of Runge and Kutta's method of fourth order over h seconds.
    pub fn step<S: Scalar>(&self, x: &[S; SIZE], u: &Nodes<f64>, h: f64) -> [S; SIZE] {
        let moved = |k: &[S; SIZE], h: f64| std::array::from_fn(|i| x[i] + k[i] * S::of(h));
        let k1 = self.rates(x, u.start);
        let k2 = self.rates(&moved(&k1, h / 2.0), u.middle);
        let k3 = self.rates(&moved(&k2, h / 2.0), u.middle);
        let k4 = self.rates(&moved(&k3, h), u.end);
        std::array::from_fn(|i| x[i] + (k1[i] + (k2[i] + k3[i]) * S::of(2.0) + k4[i]) * S::of(h / 6.0))
    }

    /// The largest of all named expressions and of their first and second derivatives: what the rounding of each is counted by.
    pub fn size(&self, x: &[f64; SIZE], u: f64) -> f64 {
        let dual = Dual::<f64, SIZE>::variables(x);
        let seconds = (0..SIZE).flat_map(|by| self.slopes(&dual, u, by));
        let all = self.parts(&dual, u).into_iter().chain(seconds);
        all.flat_map(|part| part.gradient().into_iter().chain([part.value()])).fold(0.0, |size: f64, v| {
            // What is not a number is larger than anything.
            if v.is_nan() { f64::INFINITY } else { size.max(v.abs()) }
        })
    }

    /// Whether rounding matters little to all of its expressions at this point.
    pub fn is_well_conditioned(&self, x: &[f64; SIZE], u: f64) -> bool {
        let mut known = x.to_vec();
        self.parts.iter().zip(self.parts(x, u)).enumerate().all(|(place, (part, value))| {
            let is_well_conditioned = match part {
                Part::Plain(e) | Part::Curve(e) => e.is_well_conditioned(&known),
                Part::Call(both) => {
                    both.iter().all(|e| e.is_well_conditioned(&known))
                        && self.function.is_well_conditioned(&both.each_ref().map(|e| e.value(&known)))
                }
            };
            if place == 0 {
                known.push(u);
            }
            known.push(value);
            is_well_conditioned
        })
    }
}
