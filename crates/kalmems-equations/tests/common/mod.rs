//! What the tests share.

#![allow(dead_code)] // each test uses its part

use kalmems_core::{Dual, Nodes, Parameters, ParametricDynamics};
use kalmems_equations::{Description, Device};
use std::path::Path;

/// A device from a text that is right.
pub fn device(text: &str) -> Device {
    Description::read(text).and_then(|read| Device::of(&read)).unwrap_or_else(|error| panic!("{error}"))
}

/// The text of an example.
pub fn example_text(name: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/equations");
    std::fs::read_to_string(folder.join(format!("{name}.toml"))).unwrap()
}

/// A device of the examples.
pub fn example(name: &str) -> Device {
    device(&example_text(name))
}

/// Random numbers (xorshift, Marsaglia 2003).
pub struct Chance(u64);

impl Chance {
    pub fn new(seed: u64) -> Self {
        let mut chance = Self(0x9e37_79b9_7f4a_7c15 ^ (seed << 17));
        for _ in 0..8 {
            chance.next();
        }
        chance
    }

    pub fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 / (1_u64 << 53) as f64)
    }
}

/// A model whose parameter of this name is the variable.
pub fn varied<M: Parameters<f64>>(model: &M, name: &str) -> M::Of<Dual<f64, 1>> {
    let is = |index| M::name(index).is_some_and(|found| found.to_string() == name);
    assert!((0..M::COUNT).any(is), "{name}");
    model.map(|index, value| if is(index) { Dual::variable(value, 0) } else { Dual::constant(value) })
}

/// The derivative of a step by the parameter that is the variable, by dual numbers through the stages.
pub fn rk4_by_parameter<D: ParametricDynamics<f64, N, Input = f64>, const N: usize>(
    varied: &D::Of<Dual<f64, 1>>,
    x: &[f64; N],
    u: &Nodes<f64>,
    h: f64,
) -> [f64; N] {
    let start: [_; N] = std::array::from_fn(|i| Dual::<f64, 1>::constant(x[i]));
    let rate = |x: &[Dual<f64, 1>; N], u: f64| D::derivative_of(varied, x, &u);
    let moved = |k: &[Dual<f64, 1>; N], h: f64| std::array::from_fn(|i| start[i] + k[i] * h);
    let k1 = rate(&start, u.start);
    let k2 = rate(&moved(&k1, h / 2.0), u.middle);
    let k3 = rate(&moved(&k2, h / 2.0), u.middle);
    let k4 = rate(&moved(&k3, h), u.end);
    std::array::from_fn(|i| {
        let sum = k1[i] + (k2[i] + k3[i]) * 2.0 + k4[i];
        (start[i] + sum * (h / 6.0)).gradient()[0]
    })
}
