//! The elementary functions against arbitrary precision.
//!
//! `cargo test --workspace --test numerics math:: -- --nocapture` prints the largest errors.

#![allow(clippy::cast_possible_truncation)] // rounding to f32 is meant

use astro_float_num::{BigFloat, Consts, RoundingMode};
use kalmems_core::Scalar;
use std::f64::consts::{FRAC_PI_2, PI};

/// What is promised, in units in the last place.
const PROMISED: f64 = 2.0;

/// Enough for the nearest double to a multiple of π/2, which loses 62 bits.
const PRECISION: usize = 192;

/// A function in f64 and in arbitrary precision.
struct Pair {
    name: &'static str,
    ours: fn(f64) -> f64,
    exact: fn(&BigFloat, &mut Consts) -> BigFloat,
}

const EXP: Pair =
    Pair { name: "exp", ours: Scalar::exp, exact: |x, c| x.exp(PRECISION, RoundingMode::None, c) };
const LN: Pair = Pair { name: "ln", ours: Scalar::ln, exact: |x, c| x.ln(PRECISION, RoundingMode::None, c) };
const SIN: Pair =
    Pair { name: "sin", ours: Scalar::sin, exact: |x, c| x.sin(PRECISION, RoundingMode::None, c) };
const COS: Pair =
    Pair { name: "cos", ours: Scalar::cos, exact: |x, c| x.cos(PRECISION, RoundingMode::None, c) };
const ATANH: Pair =
    Pair { name: "atanh", ours: Scalar::atanh, exact: |x, c| x.atanh(PRECISION, RoundingMode::None, c) };
const SQRT: Pair =
    Pair { name: "sqrt", ours: Scalar::sqrt, exact: |x, _| x.sqrt(PRECISION, RoundingMode::None) };

/// A number as 0.1… · 2^exponent, in f64.
fn mantissa_and_exponent(x: &BigFloat) -> (f64, i32) {
    match x.as_raw_parts() {
        Some((words, _, _, exponent, _)) if !x.is_zero() => {
            (words.last().map_or(0.0, |w| *w as f64 / 2.0_f64.powi(64)), exponent)
        }
        _ => (0.0, 0),
    }
}

/// A number exactly; `BigFloat::from_f64` takes normal numbers only.
fn big(x: f64) -> BigFloat {
    let lifted = BigFloat::from_f64(x * 2.0_f64.powi(60), 64);
    if x.is_normal() {
        BigFloat::from_f64(x, 64)
    } else {
        lifted.mul(&BigFloat::from_f64(2.0_f64.powi(-60), 64), 64, RoundingMode::None)
    }
}

/// The error of `y` in units of the last place that the exact result has in f64.
fn error_in_ulp(y: f64, exact: &BigFloat) -> f64 {
    let (_, exponent) = mantissa_and_exponent(exact);
    let last_place = exponent.max(-1021) - 53;
    let difference = exact.sub(&big(y), PRECISION, RoundingMode::None);
    let (mantissa, exponent) = mantissa_and_exponent(&difference);
    mantissa * 2.0_f64.powi(exponent - last_place)
}

/// The largest error over some inputs, which are all to have finite results.
fn check(pair: &Pair, region: &str, inputs: impl IntoIterator<Item = f64>) {
    let mut constants = Consts::new().expect("memory");
    let (mut worst, mut at, mut count) = (0.0, 0.0, 0);
    for x in inputs {
        let exact = (pair.exact)(&big(x), &mut constants);
        let y = (pair.ours)(x);
        assert!(y.is_finite(), "{}({x:e}) = {y}", pair.name);
        let error = error_in_ulp(y, &exact);
        count += 1;
        if error > worst {
            (worst, at) = (error, x);
        }
    }
    println!("{:>5} f64 {region:<40} {worst:.3} ulp at {at:e} of {count}", pair.name);
    assert!(worst <= PROMISED, "{}({at:e}) is {worst} ulp off", pair.name);
}

/// Random bits, the same in every run: a Weyl sequence, well mixed (Steele, Lea and Flood, OOPSLA 2014).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// Between 0 and 1.
    fn fraction(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / 2.0_f64.powi(53)
    }
    fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.fraction()
    }
    fn many(&mut self, count: usize, low: f64, high: f64) -> Vec<f64> {
        (0..count).map(|_| self.within(low, high)).collect()
    }
    /// Numbers with every exponent in a range, subnormal ones too.
    fn exponents(&mut self, range: std::ops::RangeInclusive<u64>, each: usize) -> Vec<f64> {
        range
            .flat_map(|e| std::iter::repeat_n(e, each))
            .map(|e| f64::from_bits((e << 52) | (self.bits() >> 12)))
            .collect()
    }
}

/// Numbers and their negatives.
fn both_signs(numbers: Vec<f64>) -> impl Iterator<Item = f64> {
    numbers.into_iter().flat_map(|x| [x, -x])
}

/// A number and its nearest neighbours.
fn neighbours(x: f64) -> [f64; 3] {
    [x.next_down(), x, x.next_up()]
}

#[test]
fn exp_is_within_the_promise() {
    let mut random = Random(1);
    check(&EXP, "everywhere", random.many(3000, -745.0, 709.7));
    check(&EXP, "around zero", random.many(3000, -1.0, 1.0));
    check(&EXP, "all small exponents", both_signs(random.exponents(0..=1022, 1)));
    check(&EXP, "subnormal results", random.many(1000, -745.13, -708.39));
    let halves = (-2000..2000).map(|n| (f64::from(n) + 0.5) * std::f64::consts::LN_2 / 2.0);
    check(&EXP, "between powers of two", halves.filter(|x| (-745.0..709.0).contains(x)));
    check(&EXP, "at the ends", [709.782_712_893_383_9, -745.133_219_101_941_1, -745.0, 709.0]);
}

#[test]
fn ln_is_within_the_promise() {
    let mut random = Random(2);
    check(&LN, "all exponents", random.exponents(0..=2046, 2));
    check(&LN, "around one", random.many(3000, 0.5, 2.0));
    check(
        &LN,
        "next to one",
        (1..500).flat_map(|n| [1.0 + f64::from(n) * f64::EPSILON, 1.0 - f64::from(n) * f64::EPSILON / 2.0]),
    );
    check(
        &LN,
        "nearer and nearer one",
        (1..52).flat_map(|n| [1.0 + 2.0_f64.powi(-n), 1.0 - 2.0_f64.powi(-n)]),
    );
    check(
        &LN,
        "where the exponent changes",
        (-500..500).flat_map(|n| neighbours(2.0_f64.powi(n) * std::f64::consts::SQRT_2)),
    );
    check(&LN, "subnormal", (0..52).map(|n| f64::from_bits(1 << n)));
}

#[test]
fn sine_and_cosine_are_within_the_promise() {
    let mut random = Random(3);
    for pair in [&SIN, &COS] {
        check(pair, "first turns", both_signs(random.many(2000, 0.0, 4.0 * PI)));
        check(pair, "up to the bound", both_signs(random.many(2000, 0.0, 1_647_099.0)));
        check(pair, "all small exponents", both_signs(random.exponents(0..=1022, 1)));
        let multiples = (1..400).chain((0..600).map(|_| (random.bits() % (1 << 20)) as i32 + 1));
        let nearest: Vec<f64> = multiples.map(|n| f64::from(n) * FRAC_PI_2).collect();
        check(pair, "nearest to multiples of π/2", nearest.iter().flat_map(|x| neighbours(*x)));
        check(
            pair,
            "odd multiples of π/4",
            (0..1000).flat_map(|n| neighbours((f64::from(n) + 0.5) * FRAC_PI_2)),
        );
        check(pair, "beyond the bound", both_signs(random.exponents(1043..=2046, 1)));
        // The double nearest to a multiple of π/2 of all (Kahan and McDonald).
        check(pair, "the hardest", [6_381_956_970_095_103.0 * 2.0_f64.powi(797)]);
    }
}

#[test]
fn atanh_is_within_the_promise() {
    let mut random = Random(4);
    check(&ATANH, "everywhere", both_signs(random.many(3000, 0.0, 1.0)));
    check(&ATANH, "all exponents", both_signs(random.exponents(0..=1022, 1)));
    check(
        &ATANH,
        "nearer and nearer one",
        both_signs((1..53).flat_map(|n| neighbours(1.0 - 2.0_f64.powi(-n))).filter(|x| *x < 1.0).collect()),
    );
    check(
        &ATANH,
        "next to one",
        both_signs((1..500).map(|n| 1.0 - f64::from(n) * f64::EPSILON / 2.0).collect()),
    );
    check(&ATANH, "small", both_signs(random.many(2000, 0.0, 0.25)));
}

#[test]
fn square_root_is_correctly_rounded() {
    let mut random = Random(5);
    for x in random.exponents(0..=2046, 2) {
        let exact = (SQRT.exact)(&big(x), &mut Consts::new().expect("memory"));
        assert!(error_in_ulp(Scalar::sqrt(x), &exact) <= 0.5);
        assert_eq!(Scalar::sqrt(x as f32), (f64::from(x as f32).sqrt()) as f32);
    }
    assert!(Scalar::sqrt(-1.0_f64).is_nan() && Scalar::sqrt(-1.0_f32).is_nan());
    assert_eq!(Scalar::sqrt(-0.0_f64).to_bits(), (-0.0_f64).to_bits());
    assert_eq!(Scalar::sqrt(f64::INFINITY), f64::INFINITY);
}

/// In f32 against `libm` in f64: every 503rd number there is.
#[test]
fn f32_is_within_the_promise() {
    type Function<T> = fn(T) -> T;
    let functions: [(&str, Function<f32>, Function<f64>); 5] = [
        ("exp", Scalar::exp, libm::exp),
        ("ln", Scalar::ln, libm::log),
        ("sin", Scalar::sin, libm::sin),
        ("cos", Scalar::cos, libm::cos),
        ("atanh", Scalar::atanh, libm::atanh),
    ];
    for (name, ours, reference) in functions {
        let (mut worst, mut at, mut count) = (0.0, 0.0, 0_u64);
        for bits in (0..=u32::MAX).step_by(503) {
            let x = f32::from_bits(bits);
            let y = ours(x);
            let exact = reference(f64::from(x));
            if exact.is_nan() {
                assert!(y.is_nan(), "{name}({x:e}) = {y}");
                continue;
            }
            if (exact as f32).is_infinite() {
                assert_eq!(y, exact as f32, "{name}({x:e})");
                continue;
            }
            let exponent = ((exact.to_bits() >> 52) & 2047) as i32 - 1023;
            let last_place = 2.0_f64.powi(exponent.max(-126) - 23);
            let error = (f64::from(y) - exact).abs() / last_place;
            count += 1;
            if error > worst || error.is_nan() {
                (worst, at) = (error, x);
                assert!(worst <= PROMISED, "{name}({at:e}) is {worst} ulp off");
            }
        }
        println!("{name:>5} f32 {:<40} {worst:.3} ulp at {at:e} of {count}", "everywhere");
    }
}

/// The values that IEEE 754 names, and the ends of the ranges.
#[test]
fn special_values_are_kept() {
    macro_rules! in_precision {
        ($float:ident, $overflow:literal, $underflow:literal) => {
            let (infinity, nan) = ($float::INFINITY, $float::NAN);
            let same = |a: $float, b: $float| assert!(a.to_bits() == b.to_bits(), "{a:e} and {b:e}");
            let is_nan = |a: $float| assert!(a.is_nan(), "{a:e}");

            same(Scalar::exp(0.0 as $float), 1.0);
            same(Scalar::exp(-0.0 as $float), 1.0);
            same(Scalar::exp(infinity), infinity);
            same(Scalar::exp(-infinity), 0.0);
            same(Scalar::exp($float::MAX), infinity);
            same(Scalar::exp($float::MIN), 0.0);
            same(Scalar::exp($overflow as $float), infinity);
            same(Scalar::exp($underflow as $float), 0.0);
            is_nan(Scalar::exp(nan));

            same(Scalar::ln(1.0 as $float), 0.0);
            same(Scalar::ln(0.0 as $float), -infinity);
            same(Scalar::ln(-0.0 as $float), -infinity);
            same(Scalar::ln(infinity), infinity);
            is_nan(Scalar::ln(-$float::MIN_POSITIVE));
            is_nan(Scalar::ln(-1.0 as $float));
            is_nan(Scalar::ln(-infinity));
            is_nan(Scalar::ln(nan));

            same(Scalar::sin(0.0 as $float), 0.0);
            same(Scalar::sin(-0.0 as $float), -0.0);
            same(Scalar::cos(-0.0 as $float), 1.0);
            let least = $float::from_bits(1);
            same(Scalar::sin(least), least);
            same(Scalar::sin(-least), -least);
            for x in [infinity, -infinity, nan] {
                is_nan(Scalar::sin(x));
                is_nan(Scalar::cos(x));
            }

            same(Scalar::atanh(0.0 as $float), 0.0);
            same(Scalar::atanh(-0.0 as $float), -0.0);
            same(Scalar::atanh(least), least);
            same(Scalar::atanh(1.0 as $float), infinity);
            same(Scalar::atanh(-1.0 as $float), -infinity);
            for x in [(1.0 as $float).next_up(), -2.0, $float::MAX, infinity, -infinity, nan] {
                is_nan(Scalar::atanh(x));
            }
        };
    }
    in_precision!(f64, 709.782_712_893_384_1, -745.133_219_101_941_3);
    in_precision!(f32, 88.722_84, -103.972_1);
}
