//! Reads what the target wrote and compares it with the same filter here, in f32 and f64; prints what was measured, and
//! fails where it is beyond its bound.
//!
//! `host scanner|scanner_text|scanner_rk4|threshold MOST WORST APART < target.txt`: the most instructions of half the steps and of
//! any, and how far the target may be from the host in f64, relative to the largest of each quantity. From the host in
//! f32 it may be 1e-5.

use firmware::runs::{Euler, Run, RungeKutta, Threshold};
use std::io::{self, Read};
use std::process::ExitCode;

/// Ticks of SysTick per instruction: 25 MHz, and 1024 ns for an instruction by `-icount shift=10`.
const TICKS: f64 = 25.6;

/// How far the target may be from the host in f32.
const APART: f64 = 1e-5;

/// What a filter says after each step.
fn here<T: Into<f64>, R: Run<T>>() -> Option<Vec<[f64; 4]>> {
    let mut run = R::begin()?;
    let said = (1..=R::STEPS).map(|k| run.step(R::sample(k)).then(|| run.says().map(Into::into)));
    said.collect()
}

/// The largest difference of all quantities, each relative to its largest value, and which quantity has it.
fn apart(one: &[[f64; 4]], other: &[[f64; 4]]) -> (f64, &'static str) {
    let each = ["angle", "rate", "variance of the angle", "variance of the rate"].into_iter().enumerate();
    each.map(|(i, name)| {
        let size = other.iter().map(|said| said[i].abs()).fold(0.0, f64::max);
        (one.iter().zip(other).map(|(a, b)| (a[i] - b[i]).abs()).fold(0.0, f64::max) / size, name)
    })
    .fold((0.0, ""), |largest, found| if found.0 > largest.0 { found } else { largest })
}

/// One line of the target: what it says, and the instructions of the step.
fn line(text: &str) -> Option<([f64; 4], f64)> {
    let words: Vec<u32> =
        text.split_whitespace().filter_map(|word| u32::from_str_radix(word, 16).ok()).collect();
    let [angle, rate, p00, p11, step, call] = words[..] else { return None };
    // The call is one instruction, its return, and what stands around it as around the step.
    let instructions = (f64::from(step) - f64::from(call)) / TICKS + 1.0;
    Some(([angle, rate, p00, p11].map(|bits| f64::from(f32::from_bits(bits))), instructions))
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [name, bounds @ ..] = &arguments[..] else { return usage() };
    let bounds: Vec<f64> = bounds.iter().filter_map(|bound| bound.parse().ok()).collect();
    let [most, worst, rounding] = bounds[..] else { return usage() };
    let (single, double) = match name.as_str() {
        // From its equations it is the same filter in the same units.
        "scanner" | "scanner_text" => (here::<f32, Euler<f32>>(), here::<f64, Euler<f64>>()),
        "scanner_rk4" => (here::<f32, RungeKutta<f32>>(), here::<f64, RungeKutta<f64>>()),
        "threshold" => (here::<f32, Threshold<f32>>(), here::<f64, Threshold<f64>>()),
        _ => return usage(),
    };
    let (Some(single), Some(double)) = (single, double) else {
        eprintln!("{name}: a step was refused on the host");
        return ExitCode::FAILURE;
    };
    let mut text = String::new();
    if io::stdin().read_to_string(&mut text).is_err() {
        return usage();
    }
    let (target, mut counts): (Vec<[f64; 4]>, Vec<f64>) = text.lines().filter_map(line).unzip();
    let refused = text.lines().last().and_then(|last| u32::from_str_radix(last.trim(), 16).ok());
    if target.len() != double.len() || refused != Some(0) {
        eprintln!(
            "{name}: {} of {} steps came from the target, refused: {refused:?}",
            target.len(),
            double.len()
        );
        return ExitCode::FAILURE;
    }
    counts.sort_by(f64::total_cmp);
    let (median, largest) = (counts[counts.len() / 2], counts[counts.len() - 1]);
    let (with_f32, with_f64, f32_with_f64) =
        (apart(&target, &single), apart(&target, &double), apart(&single, &double));
    println!(
        "{name}: {} steps, {median:.0} instructions in half of them, {largest:.0} at most",
        counts.len()
    );
    println!(
        "{name}: apart by {:.1e} from the host in f32 ({}), by {:.1e} from it in f64 ({}); f32 and f64 on the host {:.1e} ({})",
        with_f32.0, with_f32.1, with_f64.0, with_f64.1, f32_with_f64.0, f32_with_f64.1
    );
    let good =
        with_f32.0 <= APART && with_f64.0 <= rounding && median <= most + 0.5 && largest <= worst + 0.5;
    if !good {
        eprintln!(
            "{name}: beyond {APART:e} or {rounding:e} apart, {most} instructions in half the steps or {worst} at most"
        );
    }
    if good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn usage() -> ExitCode {
    eprintln!("host scanner|scanner_text|scanner_rk4|threshold MOST WORST APART < target.txt");
    ExitCode::from(2)
}
