//! Times the filters against the same filters written by hand, and against other crates:
//!
//!     cargo bench -p kalmems-models --bench speed
//!
//! What is of interest is a ratio, on a machine that does other things as well. So the filters that are compared
//! take turns, each over the whole signal for a fraction of a millisecond, in an order that rotates; each turn
//! gives a ratio, and the table shows the median of the ratios and the range of their middle half. A slow moment
//! of the machine meets all of them, or is an outlier that the median does not see. A harness that times one
//! after the other, criterion for one, compares two different moments, and brings forty crates.
//!
//! Times are reported, and nothing fails because of them; the bench `instructions` is what gates.

mod accelerometer;
mod by_hand;
mod cases;
mod peers;
mod piston;
mod system;
mod threshold;

use accelerometer::Sensed;
use kalmems_core::{FilterError, Scalar};
use piston::Both;
use std::hint::black_box;
use std::time::Instant;
use system::{Run, System};
use threshold::FreeDecay;

/// Samples of one turn.
const LENGTH: usize = 4096;

/// Turns of each filter.
const TURNS: usize = 301;

fn main() {
    // `cargo test --benches` runs them too, without this; only `cargo bench` optimises as a release is.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    println!(
        "times: ns per step, and ratio to the first of each group: median (middle half) of {TURNS} turns"
    );
    compare_all::<f64>("f64", cases::EXTENDED_F64);
    compare_all::<f32>("f32", cases::EXTENDED_F32);
    let ours: Run<f64> = |s| cases::follow(cases::ekf(s), s, &s.euler_by_hand(), |d| d.start);
    let peers: [(&str, Run<f64>); 5] = [
        ("kalmems", ours),
        ("nalgebra, by hand", peers::nalgebra),
        ("kfilter", peers::kfilter),
        ("minikalman", peers::minikalman),
        ("adskalman", peers::adskalman),
    ];
    compare("f64", "EKF, Euler", &System::simulated(LENGTH), &peers);
    compare_accelerometer::<f64>("f64");
    compare_accelerometer::<f32>("f32");
    compare_phasors();
    compare_crossings::<f64>("f64");
    compare_crossings::<f32>("f32");
}

/// The thesis of the accelerometer allows 5 µs for a step; the settled gain is to take a quarter of the full filter.
fn compare_accelerometer<T: Scalar>(number: &str) {
    let filters: [(&str, accelerometer::Run<T>); 3] = [
        ("settled gain", Sensed::settled),
        ("EKF, exact step", Sensed::exact),
        ("EKF, hybrid", Sensed::hybrid),
    ];
    compare(number, "Accelerometer, 4 states", &Sensed::simulated(LENGTH), &filters);
}

/// The goal is 2.2 times the scanner's filter for the five states.
fn compare_phasors() {
    let filters: [(&str, piston::Run); 4] = [
        ("scanner, 2 states", Both::scanner),
        ("scanner, 2 states, Euler", Both::scanner_euler),
        ("phasor, 5 states", Both::phasor),
        ("phasor, fixed gain", Both::lock),
    ];
    compare("f64", "EKF of a phasor", &Both::simulated(LENGTH), &filters);
}

/// The goal is 4 times the plain filter for the whole chain.
fn compare_crossings<T: Scalar>(number: &str) {
    let chain: [(&str, threshold::Run<T>); 3] = [
        ("plain", FreeDecay::plain),
        ("detector alone", FreeDecay::detector),
        ("with crossings", FreeDecay::hybrid),
    ];
    compare(number, "EKF, exact step, and its crossings", &FreeDecay::simulated(LENGTH), &chain);
}

fn compare_all<T: Scalar>(number: &str, extended: f64) {
    let system = System::<T>::simulated(LENGTH);
    for comparison in cases::comparisons(extended).into_iter().chain([cases::more_states()]) {
        let mut filters = vec![(comparison.first, comparison.run)];
        filters.extend(comparison.others.iter().map(|case| (case.name, case.run)));
        compare(number, comparison.name, &system, &filters);
    }
}

/// A filter over a whole signal.
type Follow<S, O> = fn(&S) -> Result<O, FilterError>;

/// Times filters in turns and prints them.
fn compare<S, O>(number: &str, group: &str, system: &S, filters: &[(&str, Follow<S, O>)]) {
    // The first turn warms up.
    let turns: Vec<Vec<f64>> = (0..=TURNS).map(|turn| take_turns(turn, system, filters)).skip(1).collect();
    println!("\n{group}, {number}");
    for (i, (name, _)) in filters.iter().enumerate() {
        let time = quartiles(turns.iter().map(|turn| turn[i]));
        let ratio = quartiles(turns.iter().map(|turn| turn[i] / turn[0]));
        println!(
            "    {name:<28}{:>7.1}  {:>6.3} ({:.3} to {:.3})",
            time[1] / LENGTH as f64,
            ratio[1],
            ratio[0],
            ratio[2]
        );
    }
}

/// ns of each filter for the whole signal, another one first in each turn.
fn take_turns<S, O>(turn: usize, system: &S, filters: &[(&str, Follow<S, O>)]) -> Vec<f64> {
    let mut times = vec![0.0; filters.len()];
    for step in 0..filters.len() {
        let i = (turn + step) % filters.len();
        let start = Instant::now();
        let outcome = black_box(filters[i].1)(black_box(system));
        times[i] = start.elapsed().as_secs_f64() * 1e9;
        assert!(black_box(outcome).is_ok(), "a filter refused a step");
    }
    times
}

/// The first quartile, the median and the third.
fn quartiles(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    [1, 2, 3].map(|quarter| sorted[(sorted.len() - 1) * quarter / 4])
}
