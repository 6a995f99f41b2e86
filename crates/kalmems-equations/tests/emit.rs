//! Filters as source code: compiled without a warning, and compared with the interpreter and the library's filter.

#[path = "emit/cases.rs"]
mod cases;
mod common;
#[path = "emit/compilers.rs"]
mod compilers;
#[path = "emit/host.rs"]
mod host;

use cases::{Case, cases};
use compilers::{compile, folder, has, run, write};
use kalmems_equations::{EmitLanguage, EmitRequest, StepMethod, TestSample, TestVectors};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// What is asked for, relative to the largest value of each state.
const TOLERANCE: f64 = 1e-5;
/// How many samples the sources test themselves with.
const OWN_SAMPLES: usize = 100;

const GCC: [&str; 8] =
    ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror", "-O2"];

/// The input of an emitted program: of each sample the inputs that its step takes, and the measurements.
fn text_of(samples: &[TestSample], files: &[(String, String)]) -> String {
    // The order of the arguments is that of the declaration of the step.
    let (_, main) = files.iter().find(|(name, _)| name.starts_with("main")).unwrap();
    let columns = main.split_once("each the numbers ").unwrap().1.split_once(", and writes").unwrap().0;
    let points = columns.split(", ").filter(|column| column.starts_with("u_")).map(|column| match column {
        column if column.ends_with("_start") => 0,
        column if column.ends_with("_middle") => 1,
        _ => 2,
    });
    let points: Vec<usize> = points.collect();
    let mut text = String::new();
    for sample in samples {
        for point in &points {
            // One input: each column is a point of it.
            let _ = write!(text, "{:e} ", sample.inputs[*point][0]);
        }
        for seen in &sample.measured {
            let _ = write!(text, "{seen:e} ");
        }
        text.push('\n');
    }
    text
}

/// The largest difference of each state, relative to its largest value; of a cyclic state apart from whole periods.
fn differences(case: &Case, request: &EmitRequest, found: &[Vec<f64>], expected: &[Vec<f64>]) -> Vec<f64> {
    assert_eq!(found.len(), expected.len(), "{}", request.name);
    let periods = case.device.periods(&request.parameters).unwrap();
    (0..expected[0].len())
        .map(|i| {
            let size = expected.iter().fold(0.0_f64, |size, x| size.max(x[i].abs()));
            let period = periods.iter().find(|(state, _)| *state == i).map(|(_, period)| *period);
            let difference = |(a, b): (&Vec<f64>, &Vec<f64>)| {
                let difference = a[i] - b[i];
                period.map_or(difference, |p| difference - p * (difference / p).round()).abs()
            };
            let worst = found
                .iter()
                .zip(expected)
                .map(difference)
                .fold(0.0, |worst: f64, d| if d > worst || d.is_nan() { d } else { worst });
            worst / size
        })
        .collect()
}

/// Every variant of every device, with the samples of its test.
fn variants() -> Vec<(usize, EmitRequest, Vec<TestSample>)> {
    let mut all = Vec::new();
    for (place, case) in cases().iter().enumerate() {
        for method in [StepMethod::Euler, StepMethod::RungeKutta] {
            for with_free in [false, true] {
                let mut request = case.variant(method, with_free);
                let samples = case.samples(&request, 7 + place as u64);
                let own = samples[..OWN_SAMPLES].to_vec();
                request.vectors = Some(TestVectors { samples: own, tolerance: 1e-2 });
                all.push((place, request, samples));
            }
        }
    }
    all
}

/// C, Rust and the library's filter in f64 over the same samples.
#[test]
fn emitted_filters_agree_with_the_filter_of_the_library() {
    let (gcc, clang, gxx, rustc) = (has("gcc"), has("clang"), has("g++"), has("rustc"));
    let cases = cases();
    let all = variants();
    let rust = folder("rust");
    let mut faults = Vec::new();
    if rustc {
        build_rust(&rust, &cases, &all);
    }
    for (place, request, samples) in &all {
        let case = &cases[*place];
        let expected: Vec<Vec<f64>> = samples.iter().map(|sample| sample.expected.clone()).collect();
        let emitted =
            case.device.emit(request, EmitLanguage::C).unwrap_or_else(|e| panic!("{}: {e}", request.name));
        let input = text_of(samples, &emitted.files);
        let name = &request.name;
        let folder = folder(name);
        write(&folder, &emitted.files);
        let (source, test) = (format!("{name}.c"), format!("{name}_self_test.c"));
        let mut hold = |language: &str, found: &[Vec<f64>]| {
            let found = differences(case, request, found, &expected);
            let texts: Vec<String> = found.iter().map(|d| format!("{d:.1e}")).collect();
            println!(
                "{name}, {language}: {} of the largest value; operations {:?}",
                texts.join(" "),
                emitted.operations
            );
            for (state, difference) in found.iter().enumerate() {
                if difference.is_nan() || *difference > TOLERANCE {
                    faults.push(format!("{name}, {language}, state {state}: {difference:e}"));
                }
            }
        };
        if clang {
            let arguments = [&GCC[..], &["-fsyntax-only", "main.c", &source, &test]].concat();
            compile(&folder, "clang", &arguments);
        }
        if gxx {
            let warnings = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror"];
            compile(&folder, "g++", &[&warnings[..], &["-fsyntax-only", "-x", "c++", "main.c"]].concat());
        }
        if gcc {
            compile(
                &folder,
                "gcc",
                &[&GCC[..], &["-o", "program", "main.c", &source, &test, "-lm"]].concat(),
            );
            hold("C", &run(&folder, "program", &[], &input));
        }
        if rustc {
            hold("Rust", &run(&rust, "program", &[name], &input));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// All filters as one library without `std`, and a program that runs each.
fn build_rust(folder: &Path, cases: &[Case], all: &[(usize, EmitRequest, Vec<TestSample>)]) {
    let mut library = "#![no_std]\n#![deny(warnings)]\n#![forbid(unsafe_code)]\n".to_owned();
    let mut program = "#![deny(warnings)]\nuse std::io::Read;\nfn main() {\n    let name = std::env::args().nth(1).unwrap();\n    \
        let mut text = String::new();\n    std::io::stdin().read_to_string(&mut text).unwrap();\n    \
        let given: Vec<f32> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();\n    match name.as_str() {\n"
        .to_owned();
    for (place, request, samples) in all {
        let emitted = cases[*place].device.emit(request, EmitLanguage::Rust).unwrap();
        let name = &request.name;
        for (file, text) in &emitted.files {
            if file != "main.rs" {
                fs::write(folder.join(file), text).unwrap();
            }
        }
        let _ = write!(library, "pub mod {name};\npub mod {name}_self_test;\n");
        let first = text_of(&samples[..1], &emitted.files);
        let count = first.split_whitespace().count();
        let arguments: Vec<String> = (0..count).map(|k| format!("given[{k}]")).collect();
        let _ = write!(
            program,
            "        \"{name}\" => {{\n            filters::{name}_self_test::self_test().unwrap();\n            \
             let mut filter = filters::{name}::Filter::new();\n            for given in given.chunks_exact({count}) {{\n                \
             filter.step({});\n                let values = filter.values().map(|value| format!(\"{{value:e}}\"));\n                \
             println!(\"{{}}\", values.join(\" \"));\n            }}\n        }}\n",
            arguments.join(", ")
        );
    }
    program += "        _ => panic!(),\n    }\n}\n";
    fs::write(folder.join("filters.rs"), library).unwrap();
    fs::write(folder.join("program.rs"), program).unwrap();
    let edition = "--edition=2024";
    compile(folder, "rustc", &[edition, "-Copt-level=1", "--crate-type=rlib", "filters.rs"]);
    compile(
        folder,
        "rustc",
        &[edition, "-Copt-level=1", "--extern", "filters=libfilters.rlib", "program.rs"],
    );
}

/// Writes the C of one filter into the folder of another test, to look at it.
#[test]
fn look() {
    let case = &cases()[0];
    let request = case.variant(StepMethod::Euler, false);
    let emitted = case.device.emit(&request, EmitLanguage::C).unwrap();
    write(&Path::new(env!("CARGO_TARGET_TMPDIR")).join("emit").join(&request.name), &emitted.files);
}
