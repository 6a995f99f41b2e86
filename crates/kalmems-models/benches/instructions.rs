//! Counts the instructions per step of each filter and holds them to their bounds, against the filter by hand
//! and in number:
//!
//!     cargo bench -p kalmems-models --bench instructions
//!
//! Needs valgrind, and says so where it is not there. Counts repeat exactly for one binary; compilers differ by a
//! few percent. A count over its budget is a finding: find out why before raising the budget.

mod by_hand;
mod cases;
mod system;

use cases::Comparison;
use kalmems_core::Scalar;
use std::hint::black_box;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::{env, fs, io};
use system::{Run, System};

/// Both lengths of signal: their difference leaves out what is done once.
const LENGTHS: [usize; 2] = [1000, 3000];

/// The argument that makes this program run the filters for valgrind to watch.
const WATCHED: &str = "--watched";

/// Instructions per step that each filter may take: what rustc 1.95 makes for x86-64, and 3 %.
const BUDGETS: [(&str, &str, &str, u32); 20] = [
    ("f64", "EKF, Euler", "generic, Jacobian by hand", 320),
    ("f64", "EKF, Euler", "generic, Jacobian by Dual", 334),
    ("f64", "EKF, Runge–Kutta", "generic, Jacobian by Dual", 690),
    ("f64", "UKF, Euler", "generic", 876),
    ("f64", "UKF, Runge–Kutta", "generic", 2172),
    ("f64", "SR-EKF, Euler", "generic, Jacobian by hand", 351),
    ("f64", "SR-EKF, Euler", "generic, Jacobian by Dual", 351),
    ("f64", "SR-EKF, Runge–Kutta", "generic, Jacobian by Dual", 721),
    ("f64", "Fixed gain, exact", "generic", 114),
    ("f64", "EKF, Runge–Kutta, states", "5 states", 2997),
    ("f32", "EKF, Euler", "generic, Jacobian by hand", 289),
    ("f32", "EKF, Euler", "generic, Jacobian by Dual", 310),
    ("f32", "EKF, Runge–Kutta", "generic, Jacobian by Dual", 620),
    ("f32", "UKF, Euler", "generic", 795),
    ("f32", "UKF, Runge–Kutta", "generic", 1900),
    ("f32", "SR-EKF, Euler", "generic, Jacobian by hand", 331),
    ("f32", "SR-EKF, Euler", "generic, Jacobian by Dual", 335),
    ("f32", "SR-EKF, Runge–Kutta", "generic, Jacobian by Dual", 655),
    ("f32", "Fixed gain, exact", "generic", 103),
    ("f32", "EKF, Runge–Kutta, states", "5 states", 2910),
];

fn main() -> io::Result<ExitCode> {
    let mut narrow = cases::comparisons::<f32>(cases::EXTENDED_F32);
    let mut wide = cases::comparisons::<f64>(cases::EXTENDED_F64);
    narrow.push(cases::more_states());
    wide.push(cases::more_states());
    if env::args().any(|argument| argument == WATCHED) {
        run_all(&wide);
        run_all(&narrow);
        return Ok(ExitCode::SUCCESS);
    }
    // `cargo test --benches` runs them too, without this; only `cargo bench` optimises as a release is.
    if !env::args().any(|argument| argument == "--bench") {
        return Ok(ExitCode::SUCCESS);
    }
    if !Command::new("valgrind").arg("--version").stdout(Stdio::null()).status().is_ok_and(|s| s.success()) {
        println!("instruction counts: SKIPPED, valgrind is not installed");
        return Ok(ExitCode::SUCCESS);
    }
    let counts = count()?;
    let filters = wide.iter().map(|c| c.runs().count()).sum::<usize>()
        + narrow.iter().map(|c| c.runs().count()).sum::<usize>();
    if counts.len() != filters {
        return Err(io::Error::other(format!("valgrind saw {} of {filters} filters", counts.len())));
    }
    let mut counts = counts.into_iter();
    println!(
        "instruction counts: per step, as a ratio to the first of its group and its bound, and the budget"
    );
    println!(
        "{:<5}{:<25}{:<28}{:>12}{:>8}{:>8}{:>9}",
        "", "filter", "", "instr./step", "ratio", "bound", "budget"
    );
    let good = [report("f64", &wide, &mut counts), report("f32", &narrow, &mut counts)];
    Ok(if good == [true; 2] { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Every filter over a short and a long signal.
fn run_all<T: Scalar>(comparisons: &[Comparison<T>]) {
    let systems = LENGTHS.map(System::simulated);
    for comparison in comparisons {
        for run in comparison.runs() {
            for system in &systems {
                watched(run, system);
            }
        }
    }
}

/// What valgrind counts: it is told this name.
#[inline(never)]
fn watched<T>(run: Run<T>, system: &System<T>) {
    // A filter that fails would be a fast one.
    assert!(black_box(run)(system).is_ok(), "a filter refused a step");
}

/// Instructions per step of every filter, in the order of `run_all`.
fn count() -> io::Result<Vec<f64>> {
    let folder = env::temp_dir().join(format!("kalmems-instructions-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    let counts = count_in(&folder);
    fs::remove_dir_all(&folder)?;
    counts
}

fn count_in(folder: &Path) -> io::Result<Vec<f64>> {
    let out = folder.join("callgrind");
    let run = Command::new("valgrind")
        // Two patterns for one function: valgrind 3.19 takes the second of two equal ones alone.
        .args(["--tool=callgrind", "--toggle-collect=*watched*", "--dump-after=*::watched*"])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(env::current_exe()?)
        .arg(WATCHED)
        .output()?;
    if !run.status.success() {
        return Err(io::Error::other(String::from_utf8_lossy(&run.stderr).into_owned()));
    }
    // One file for each call, numbered from 1.
    let mut totals = Vec::new();
    while let Ok(text) = fs::read_to_string(folder.join(format!("callgrind.{}", totals.len() + 1))) {
        totals.push(total(&text).ok_or_else(|| io::Error::other("valgrind's file names no total"))?);
    }
    let steps = (LENGTHS[1] - LENGTHS[0]) as f64;
    Ok(totals.chunks_exact(2).map(|pair| (pair[1] - pair[0]) / steps).collect())
}

/// The number after `totals:`.
fn total(text: &str) -> Option<f64> {
    text.lines().find_map(|line| line.strip_prefix("totals:"))?.trim().parse().ok()
}

/// Prints each count; whether all are within their bounds.
fn report<T>(number: &str, comparisons: &[Comparison<T>], counts: &mut impl Iterator<Item = f64>) -> bool {
    let mut good = true;
    for comparison in comparisons {
        let first = counts.next().unwrap_or(f64::NAN);
        println!("{number:<5}{:<25}{:<28}{first:>12.1}", comparison.name, comparison.first);
        for case in &comparison.others {
            let instructions = counts.next().unwrap_or(f64::NAN);
            let ratio = instructions / first;
            let budget = BUDGETS
                .iter()
                .find(|(n, filter, name, _)| (*n, *filter, *name) == (number, comparison.name, case.name))
                .map_or(0, |(_, _, _, budget)| *budget);
            let within = ratio <= case.bound && instructions <= f64::from(budget);
            good &= within;
            println!(
                "{number:<5}{:<25}{:<28}{instructions:>12.1}{ratio:>8.3}{:>8.2}{budget:>9}{}",
                comparison.name,
                case.name,
                case.bound,
                if within { "" } else { "  TOO MANY" }
            );
        }
    }
    good
}
