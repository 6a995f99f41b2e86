//! Where a parametrically driven device starts and how far it swings, each by two methods, and against tabulated
//! values of Mathieu's equation.

use kalmems::simulate::{
    Balance, Drive, Stability, StabilityMap, SteadyMotion, SweepHold, SweepPoint, floquet_exponent,
    monodromy, starting_factor, sweeps_both_ways,
};
use kalmems_core::{Dynamics, Mat, Over, Scalar};
use kalmems_models::capacitance::GaussianComb;
use kalmems_models::dynamics::{ParametricScanner, TorsionalResonator};
use std::f64::consts::PI;

/// Chen et al., shared electrodes, 2020, Table II.
const SCANNER: ParametricScanner<f64> = ParametricScanner {
    resonator: TorsionalResonator { inertia: 1.15e-14, damping: 5.95e-12, stiffness: 1.10e-4 },
    comb: GaussianComb { nominal: 5.71e-12, angular_width: 0.2, bias: 9.79e-12 },
    carrier_mean_square: 18.0,
};

fn sine(volts: f64, frequency_hz: f64) -> Drive {
    Drive::Sine { offset: volts, amplitude: volts, frequency_hz, phase_rad: 0.0 }
}

/// ẍ + 2c·ẋ + (a − 2·u(t))·x = 0: with u = q·sin 2t and c = 0 Mathieu's equation, its time shifted.
#[derive(Clone, Copy)]
struct Mathieu<P> {
    a: P,
    c: P,
}

impl<T: Scalar> Dynamics<T, 2> for Mathieu<T> {
    type Input = T;
    fn derivative<S: Over<T>>(&self, x: &[S; 2], u: &T) -> [S; 2] {
        [x[1], -(x[0] * (self.a - u.twice())) - x[1] * self.c.twice()]
    }
}

fn pump(q: f64) -> Drive {
    Drive::Sine { offset: 0.0, amplitude: q, frequency_hz: 1.0 / PI, phase_rad: 0.0 }
}

/// Where between two values of a the trace of the monodromy matrix passes `level`.
fn edge(q: f64, level: f64, mut below: f64, mut above: f64) -> f64 {
    let side = |a: f64| {
        let Mat([[m, _], [_, n]]) = monodromy(Mathieu { a, c: 0.0 }, &pump(q), 1500).unwrap();
        m + n > level
    };
    assert_ne!(side(below), side(above), "q = {q}: no edge from {below} to {above}");
    let starts = side(below);
    for _ in 0..45 {
        let middle = 0.5 * (below + above);
        if side(middle) == starts { below = middle } else { above = middle }
    }
    below
}

/// Abramowitz and Stegun, Handbook of Mathematical Functions, 1964, Table 20.1: a₀, b₁, a₁, b₂, a₂ at q = 5 and the first
/// three at q = 10. Between bₙ and aₙ a motion grows.
#[test]
fn edges_of_stability_are_the_tabulated_ones() {
    for (name, q, level, from, to, tabulated) in [
        ("a0", 5.0, 2.0, -5.9, -5.795, -5.800_046_02),
        ("b1", 5.0, -2.0, -5.795, -5.0, -5.790_080_60),
        ("a1", 5.0, -2.0, 1.0, 2.0, 1.858_187_54),
        ("b2", 5.0, 2.0, 1.95, 3.0, 2.099_460_45),
        ("a2", 5.0, 2.0, 6.0, 8.0, 7.449_109_74),
        ("a0", 10.0, 2.0, -14.5, -13.9367, -13.936_979_96),
        ("b1", 10.0, -2.0, -13.9367, -12.0, -13.936_552_48),
        ("a1", 10.0, -2.0, -4.0, -2.388, -2.399_142_40),
    ] {
        let ours = edge(q, level, from, to);
        println!("{name}({q}) = {ours:.8}, tabulated {tabulated:.8}");
        assert!((ours - tabulated).abs() < 1e-6, "{name}({q}): {ours}");
    }
    // McLachlan, Theory and Application of Mathieu Functions, 1947, section 2.151: a₁ = 1 + q − q²/8 − q³/64 − q⁴/1536 + …,
    // and b₁ with −q for q.
    let series = |q: f64| 1.0 + q - q * q / 8.0 - q.powi(3) / 64.0 - q.powi(4) / 1536.0;
    for q in [0.05, 0.2] {
        let (a1, b1) = (edge(q, -2.0, 1.0, 1.0 + 2.0 * q), edge(q, -2.0, 1.0 - 2.0 * q, 1.0));
        // The next term is 11 q⁵/36864.
        assert!((a1 - series(q)).abs() < 5e-4 * q.powi(5) + 1e-9, "{q}: {a1}");
        assert!((b1 - series(-q)).abs() < 5e-4 * q.powi(5) + 1e-9, "{q}: {b1}");
    }
}

/// In lanes and on several processors, point for point; the grid has no number of points that lanes divide.
#[test]
fn the_map_is_what_each_point_is_by_itself() {
    let square = Drive::Square { low: 0.0, high: 150.0, frequency_hz: 31e3, duty: 0.35 };
    for drive in [sine(90.0, 31e3), square] {
        let about = 2.0 * Stability::of(&SCANNER, &drive).unwrap().resonance_hz;
        let hz: Vec<f64> = (-6..=6).map(|i| about + 30.0 * f64::from(i)).collect();
        let factors = vec![0.3, 0.7, 1.0];
        let map = StabilityMap::of(SCANNER, &drive, hz.clone(), factors.clone(), 60).unwrap();
        let mut signs = [0, 0];
        for (factor, row) in factors.iter().zip(&map.growth_rate) {
            for (hz, growth) in hz.iter().zip(row) {
                let alone =
                    floquet_exponent(SCANNER, &drive.scaled(*factor).held_at(*hz).unwrap(), 60).unwrap();
                assert!((growth - alone).abs() < 1e-2, "{drive:?} {factor} {hz}: {growth} {alone}");
                signs[usize::from(*growth > 0.0)] += 1;
            }
        }
        assert!(signs[0] > 5 && signs[1] > 3, "{drive:?}: {signs:?}");
    }
    assert!(StabilityMap::of(SCANNER, &Drive::Constant { level: 1.0 }, vec![1.0], vec![1.0], 9).is_none());
    // The chart of Ince and Strutt in one column: unstable from b₁ to a₁ alone.
    for a in [-5.795, -5.0, 0.0, 1.8, 1.9, 2.09] {
        let map =
            StabilityMap::of(Mathieu { a, c: 0.0 }, &pump(5.0), vec![1.0 / PI], vec![1.0], 400).unwrap();
        let grows = map.growth_rate[0][0] > 1e-6;
        let between = (-5.790_080_60..1.858_187_54).contains(&a);
        assert_eq!(grows, between, "a = {a}: {}", map.growth_rate[0][0]);
    }
}

/// Liouville: the product of the multipliers is e^{−bT/J}, pumped or not.
#[test]
fn multipliers_have_the_product_that_the_damping_gives() {
    let square = Drive::Square { low: 0.0, high: 110.0, frequency_hz: 31_350.0, duty: 0.35 };
    for drive in [sine(30.0, 31_150.0), sine(90.0, 31_380.0), square] {
        let Mat([[a, b], [c, d]]) = monodromy(SCANNER, &drive, 200).unwrap();
        let exponent = SCANNER.resonator.damping / SCANNER.resonator.inertia * drive.period_s().unwrap();
        let product = a * d - b * c;
        assert!((product / (-exponent).exp() - 1.0).abs() < 1e-8, "{product}");
    }
}

/// The edge of the tongue is first order in the depth h: half the depth, a quarter of the error.
#[test]
fn the_analytic_tongue_is_right_to_its_order() {
    let error = |volts: f64| {
        let undamped = TorsionalResonator { damping: 1e-20, ..SCANNER.resonator };
        let scanner = ParametricScanner { resonator: undamped, carrier_mean_square: 0.0, ..SCANNER };
        let drive = |hz: f64| sine(volts, hz);
        let stability = Stability::of(&scanner, &drive(31e3)).unwrap();
        let [_, high] = stability.tongue_hz().unwrap();
        let (mut inside, mut outside) =
            (2.0 * stability.resonance_hz, high + 2.0 * (high - 2.0 * stability.resonance_hz));
        while outside - inside > 1e-5 {
            let middle = 0.5 * (inside + outside);
            let Mat([[a, _], [_, d]]) = monodromy(scanner, &drive(middle), 200).unwrap();
            if (a + d).abs() > 2.0 { inside = middle } else { outside = middle }
        }
        ((inside - high) / high, stability.pump_depth)
    };
    let (coarse, fine) = (error(120.0), error(120.0 / 2.0_f64.sqrt()));
    let order = (coarse.0 / fine.0).log2() / (coarse.1 / fine.1).log2();
    println!(
        "relative error {:.1e} at h = {:.4}, {:.1e} at {:.4}: order {order:.3}",
        coarse.0, coarse.1, fine.0, fine.1
    );
    assert!((order - 2.0).abs() < 0.1, "{order}");
}

/// At the drive that is said to be needed, and nowhere below it, a motion grows at the best frequency.
#[test]
fn the_needed_drive_is_where_growth_begins() {
    let square = Drive::Square { low: 0.0, high: 60.0, frequency_hz: 31_200.0, duty: 0.5 };
    for drive in [sine(30.0, 31_150.0), square] {
        let factor = starting_factor(&SCANNER, &drive).unwrap();
        let best = |factor: f64| {
            let drive = drive.scaled(factor);
            let at = 2.0 * Stability::of(&SCANNER, &drive).unwrap().resonance_hz;
            let hz = (-10..=10).map(|i| at * (1.0 + 3e-5 * f64::from(i))).collect();
            let map = StabilityMap::of(SCANNER, &drive, hz, vec![1.0], 64).unwrap();
            map.growth_rate[0].iter().copied().fold(f64::NEG_INFINITY, f64::max)
        };
        println!("needed: {factor:.4} times {drive:?}");
        assert!(best(1.003 * factor) > 0.0 && best(0.997 * factor) < 0.0, "{drive:?} {factor}");
    }
    assert!(
        starting_factor(
            &SCANNER,
            &Drive::Sine { offset: 0.0, amplitude: 9.0, frequency_hz: 31e3, phase_rad: 0.0 }
        )
        .is_none()
    );
}

fn at(points: &[SweepPoint], hz: f64) -> f64 {
    points.iter().find(|p| p.drive_hz == hz).unwrap().amplitude
}

/// Sweeps by integration against harmonic balance, which knows nothing of time, for a sine and for a square wave.
#[test]
fn sweeps_follow_the_balance() {
    let square = Drive::Square { low: 0.0, high: 150.0, frequency_hz: 31e3, duty: 0.4 };
    for (drive, from, to) in [(sine(90.0, 31e3), 31_180.0, 31_500.0), (square, 31_110.0, 31_430.0)] {
        let hold = SweepHold { periods: 6000, steps_per_period: 24, disturbance: 1e-4 };
        let hz: Vec<f64> = (0..=8).map(|i| from + (to - from) * f64::from(i) / 8.0).collect();
        let sweeps = sweeps_both_ways(SCANNER, &drive, &hz, &hold).unwrap();
        let balance = Balance::of(&SCANNER, &drive).unwrap();
        let mut compared = 0;
        for hz in &hz {
            let motions = balance.motions_at(*hz);
            let stable: Vec<&SteadyMotion> = motions.iter().filter(|m| m.is_stable).collect();
            let (down, up) = (at(&sweeps.down, *hz), at(&sweeps.up, *hz));
            println!(
                "{hz:.0} Hz: down {:.3}, up {:.3} deg; balance {:?}",
                down.to_degrees(),
                up.to_degrees(),
                motions.iter().map(|m| (m.amplitude.to_degrees(), m.is_stable)).collect::<Vec<_>>()
            );
            assert!(stable.len() <= 1, "{motions:?}");
            let rest_is_stable = floquet_exponent(SCANNER, &drive.held_at(*hz).unwrap(), 64).unwrap() < 0.0;
            // Rest repels within the tongue; an unstable motion lies between two stable states.
            assert_eq!(motions.len(), if stable.is_empty() { 0 } else { 1 + usize::from(rest_is_stable) });
            for (way, is_up) in [(down, false), (up, true)] {
                match stable.first() {
                    Some(motion) if !(is_up && rest_is_stable) => {
                        assert!((way - motion.amplitude).abs().to_degrees() < 0.06, "{hz}: {way} {motion:?}");
                        compared += 1;
                    }
                    _ => assert!(way < 1e-3, "{hz}: {way}"),
                }
            }
        }
        assert!(compared > 6, "{compared}");
    }
}

/// The lowest frequency that a sweep down reaches is where the balance loses its last motion.
#[test]
fn the_motion_ends_where_the_balance_does() {
    let drive = sine(90.0, 31e3);
    let curve = Balance::of(&SCANNER, &drive).unwrap().curve();
    let last = curve.iter().min_by(|a, b| a.drive_hz.total_cmp(&b.drive_hz)).unwrap();
    println!("last motion {:.3} deg at {:.1} Hz", last.amplitude.to_degrees(), last.drive_hz);
    // There, where frequencies turn back, stable and unstable motions meet.
    let turns: Vec<&[SteadyMotion]> = curve.windows(2).filter(|p| p[0].is_stable != p[1].is_stable).collect();
    assert!(turns.len() == 1 && (turns[0][0].drive_hz - last.drive_hz).abs() < 1.0, "{turns:?}");
    // At its ends lie the edges of the tongue, with no amplitude.
    let tongue = Stability::of(&SCANNER, &drive).unwrap().tongue_hz().unwrap();
    let mut ends = [curve[0], curve[curve.len() - 1]];
    ends.sort_by(|a, b| a.drive_hz.total_cmp(&b.drive_hz));
    for (end, edge) in ends.iter().zip(tongue) {
        assert!(end.amplitude < 1e-3 && (end.drive_hz - edge).abs() < 2.0, "{end:?} {edge}");
    }
    let hz: Vec<f64> = [-8.0, 8.0, 20.0].map(|by| last.drive_hz + by).to_vec();
    let start: Vec<f64> =
        hz.iter().copied().chain((1..=14).map(|i| last.drive_hz + 20.0 * f64::from(i) + 20.0)).collect();
    let hold = SweepHold { periods: 1500, steps_per_period: 24, disturbance: 1e-3 };
    let down = sweeps_both_ways(SCANNER, &drive, &start, &hold).unwrap().down;
    assert!(at(&down, hz[1]) > 0.2 && at(&down, hz[0]) < 0.01, "{down:?}");
}
