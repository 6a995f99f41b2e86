//! Filters as source code: compiled without a warning, and compared with the interpreter and the library's filter.

#[path = "emit/cases.rs"]
mod cases;
mod common;
#[path = "emit/compilers.rs"]
mod compilers;
#[path = "emit/host.rs"]
mod host;
#[path = "emit/losses.rs"]
mod losses;

use cases::{Case, cases};
use compilers::{compile, folder, has, run, write};
use kalmems_equations::{
    EmitDigits, EmitEvent, EmitGain, EmitLanguage, EmitRequest, SettledGain, StepMethod, TestSample,
    TestVectors,
};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// What is asked for, relative to the largest value of each state.
const TOLERANCE: f64 = 1e-5;
/// What is asked for, relative to the standard deviation that the filter claims.
const OF_SD: f64 = 0.05;
/// What the sources hold themselves to over their first samples, in which some states have hardly moved.
const OWN_TOLERANCE: f64 = 2e-2;
/// How many samples the sources test themselves with.
const OWN_SAMPLES: usize = 100;

const GCC: [&str; 9] = [
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Werror",
    "-O2",
];

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

/// The largest difference of each state, relative to its largest value and to its standard deviation at the time; of a cyclic
/// state apart from whole periods.
fn differences(case: &Case, trial: &Trial, found: &[Vec<f64>]) -> Vec<[f64; 2]> {
    let Trial { request, samples, deviations, .. } = trial;
    assert_eq!(found.len(), samples.len(), "{}", request.name);
    let periods = case.device.periods(&request.parameters).unwrap();
    let count = samples[0].expected.len();
    let mut worst = vec![[0.0_f64; 2]; count];
    for (i, worst) in worst.iter_mut().enumerate() {
        let size = samples.iter().fold(0.0_f64, |size, sample| size.max(sample.expected[i].abs()));
        let period = periods.iter().find(|(state, _)| *state == i).map(|(_, period)| *period);
        for ((found, sample), sd) in found.iter().zip(samples).zip(deviations) {
            let difference = found[i] - sample.expected[i];
            let difference = period.map_or(difference, |p| difference - p * (difference / p).round()).abs();
            for (worst, relative) in worst.iter_mut().zip([difference / size, difference / sd[i]]) {
                if relative.is_nan() || relative > *worst {
                    *worst = relative;
                }
            }
        }
    }
    worst
}

/// A filter with the samples of its test and the standard deviations that the library's filter claims.
struct Trial {
    place: usize,
    request: EmitRequest,
    samples: Vec<TestSample>,
    deviations: Vec<Vec<f64>>,
}

/// Every variant of every device.
fn trials() -> Vec<Trial> {
    let mut all = Vec::new();
    for (place, case) in cases().iter().enumerate() {
        for method in [StepMethod::Euler, StepMethod::RungeKutta] {
            for with_free in [false, true] {
                let mut request = case.variant(method, with_free);
                let (samples, deviations) = case.samples(&request, 7 + place as u64);
                let own = samples[..OWN_SAMPLES].to_vec();
                request.vectors = Some(TestVectors { samples: own, tolerance: OWN_TOLERANCE });
                (request.digits, request.rehearsal) = (EmitDigits::AsNeeded, samples.clone());
                all.push(Trial { place, request, samples, deviations });
            }
        }
    }
    all
}

/// C, Rust and the library's filter in f64 over the same samples.
fn agree(wanted: impl Fn(&str) -> bool) {
    let (gcc, clang, gxx, rustc) = (has("gcc"), has("clang"), has("g++"), has("rustc"));
    let cases = cases();
    let all: Vec<_> = trials().into_iter().filter(|trial| wanted(&trial.request.name)).collect();
    let rust = folder(if all.len() > FEW { "rust_all" } else { "rust" });
    let mut faults = Vec::new();
    if rustc {
        build_rust(&rust, &cases, &all);
    }
    for trial in &all {
        let case = &cases[trial.place];
        let request = &trial.request;
        let emitted =
            case.device.emit(request, EmitLanguage::C).unwrap_or_else(|e| panic!("{}: {e}", request.name));
        let input = text_of(&trial.samples, &emitted.files);
        let name = &request.name;
        let folder = folder(name);
        write(&folder, &emitted.files);
        let (source, test) = (format!("{name}.c"), format!("{name}_self_test.c"));
        let mut hold = |language: &str, found: &[Vec<f64>]| {
            let found = differences(case, trial, found);
            let texts: Vec<String> = found.iter().map(|[of, sd]| format!("{of:.1e}/{sd:.0e}")).collect();
            println!(
                "{name}, {language}, {:?}: {} of the largest value/of the standard deviation; operations {:?}",
                emitted.digits,
                texts.join(" "),
                emitted.operations
            );
            for (state, [of_largest, of_sd]) in found.into_iter().enumerate() {
                if !(of_largest <= TOLERANCE && of_sd <= OF_SD) {
                    faults.push(format!("{name}, {language}, state {state}: {of_largest:e} of the largest value, {of_sd:e} of the standard deviation"));
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
            compile(&folder, "gcc", &[&GCC[..], &["-o", "program", "main.c", &source, &test]].concat());
            hold("C", &run(&folder, "program", &[], &input));
        }
        if rustc {
            hold("Rust", &run(&rust, "program", &[name], &input));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Trials that are compiled in a few seconds.
const FEW: usize = 12;

#[test]
fn emitted_filters_agree_with_the_filter_of_the_library() {
    // A comb as a law, a curve, Love's disks, a surface, arcs, conditions and whole numbers, with and without parameters as states, by both methods.
    agree(|name| {
        let short = ["plate", "pendulum"].iter().any(|short| name.starts_with(short));
        short || name.starts_with("shared_scanner") && !name.contains("low_passed")
    });
}

#[test]
#[ignore = "1 to 3 minutes"]
fn slow_emitted_filters_of_all_devices_agree_with_the_filter_of_the_library() {
    agree(|_| true);
}

/// All filters as one library without `std`, and a program that runs each.
fn build_rust(folder: &Path, cases: &[Case], all: &[Trial]) {
    let mut library = "#![no_std]\n#![deny(warnings)]\n#![forbid(unsafe_code)]\n".to_owned();
    let mut program = "#![deny(warnings)]\nuse std::io::Read;\nfn main() {\n    let name = std::env::args().nth(1).unwrap();\n    \
        let mut text = String::new();\n    std::io::stdin().read_to_string(&mut text).unwrap();\n    \
        let given: Vec<f32> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();\n    match name.as_str() {\n"
        .to_owned();
    for Trial { place, request, samples, .. } in all {
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

/// One filter with all that the others do not have: parameters that the program changes, an event, a gap, and the program that is
/// emitted in Rust. The self-test fails where an expected state is another one.
#[test]
fn parameters_events_and_gaps_are_those_of_the_library() {
    let case = cases().into_iter().find(|case| case.name == "threshold_scanner").unwrap();
    let mut request = case.variant(StepMethod::RungeKutta, false);
    request.name = "adjustable".to_owned();
    request.measures.truncate(1);
    request.adjustable =
        ["natural_frequency", "steepness", "gain"].map(|name| case.device.parameter(name).unwrap()).to_vec();
    request.events = vec![EmitEvent { event: 0, variance: 1e-6 }];
    let (mut samples, _) = case.samples(&request, 3);
    samples[1000].measured[0] = f64::NAN;
    let mut other = request.clone();
    other.parameters[request.adjustable[0]] *= 1.001;
    other.parameters[request.adjustable[1]] *= 0.99;
    let expected = host::states(&case.device, &other, &samples);
    let deviations = expected.iter().map(|[_, sd]| sd.clone()).collect();
    for (sample, [mean, _]) in samples.iter_mut().zip(&expected) {
        sample.expected.clone_from(mean);
    }
    let trial = Trial { place: 0, request: request.clone(), samples: samples.clone(), deviations };
    let hold = |language: &str, found: &[Vec<f64>]| {
        for (state, [of_largest, of_sd]) in differences(&case, &trial, found).into_iter().enumerate() {
            println!(
                "{language}, state {state}: {of_largest:.1e} of the largest value, {of_sd:.1e} of its sd"
            );
            assert!(of_largest < TOLERANCE && of_sd < OF_SD, "{language}, state {state}: {of_largest:e}");
        }
    };
    let every = host::EVENT_EVERY;
    let ago_s = host::EVENT_AGO * request.interval_s;
    if has("gcc") {
        let folder = folder("adjustable");
        let emitted = case.device.emit(&request, EmitLanguage::C).unwrap();
        assert_eq!(emitted, case.device.emit(&request, EmitLanguage::C).unwrap());
        let input = text_of(&samples, &emitted.files);
        write(&folder, &emitted.files);
        let change = "    adjustable_parameters_t other;\n    unsigned count = 0U;\n    adjustable_default_parameters(&other);\n    \
             if (!adjustable_parameters_are_whole(&other)) {\n        return 2;\n    }\n    \
             other.p_natural_frequency *= 1.001;\n    other.p_steepness *= 0.99;\n    \
             if (adjustable_parameters_are_whole(&other)) {\n        return 3;\n    }\n    adjustable_seal_parameters(&other);\n    \
             if (!adjustable_parameters_are_whole(&other) || other.experiment != 0x1234ABCDU) {\n        return 4;\n    }\n";
        let (_, main) = emitted.files.iter().find(|(name, _)| name == "main.c").unwrap();
        let main = main
            .replace("    unsigned k;\n", &format!("    unsigned k;\n{change}"))
            .replace("    while (", "    if (!adjustable_configure(&filter, &other)) {\n        return 1;\n    }\n    while (")
            .replace("        for (k", &format!("        if (++count % {every}U == 0U && !adjustable_update_crossing(&filter, given[2], {ago_s:e}F)) {{\n            return 1;\n        }}\n        for (k"));
        fs::write(folder.join("main.c"), main).unwrap();
        compile(&folder, "gcc", &[&GCC[..], &["-o", "program", "main.c", "adjustable.c"]].concat());
        hold("C", &run(&folder, "program", &[], &input));
    }
    if has("rustc") {
        let folder = folder("adjustable_rust");
        let emitted = case.device.emit(&request, EmitLanguage::Rust).unwrap();
        let input = text_of(&samples, &emitted.files);
        write(&folder, &emitted.files);
        let (_, main) = emitted.files.iter().find(|(name, _)| name == "main.rs").unwrap();
        let main = main
            .replace(
                "    for given",
                "    let mut other = adjustable::Parameters::default();\n    assert!(other.are_whole());\n    other.p_natural_frequency *= 1.001;\n    \
                 other.p_steepness *= 0.99;\n    assert!(!other.are_whole());\n    other.seal();\n    \
                 let other = adjustable::Parameters::from_bytes(&other.to_bytes());\n    assert!(other.are_whole());\n    assert!(filter.configure(&other));\n    let mut count = 0;\n    for given",
            )
            .replace(
                "        let values",
                &format!("        count += 1;\n        assert!(count % {every} != 0 || filter.update_crossing(given[2], {ago_s:e}));\n        let values"),
            );
        fs::write(folder.join("main.rs"), main).unwrap();
        compile(
            &folder,
            "rustc",
            &["--edition=2024", "-Dwarnings", "-Copt-level=1", "-o", "program", "main.rs"],
        );
        hold("Rust", &run(&folder, "program", &[], &input));
    }
}

/// A constant gain against the same by the interpreter, and a self-test whose expected states are wrong.
#[test]
fn a_settled_gain_is_that_of_the_request_and_a_wrong_self_test_fails() {
    let case = cases().into_iter().find(|case| case.name == "comb_resonator").unwrap();
    let mut request = case.variant(StepMethod::RungeKutta, false);
    request.name = "settled".to_owned();
    let gain = [2e-5, 2e-2];
    request.gain = EmitGain::Settled(vec![SettledGain {
        gain: gain.to_vec(),
        variance: 2.0 * request.measures[0].variance,
    }]);
    let (mut samples, deviations) = case.samples(&request, 4);
    let (motion, readout) = (case.device.motion(&[]).unwrap(), case.device.readout(0, &[]).unwrap());
    let (mut work, mut seen) = (motion.work(&request.parameters), readout.work(&request.parameters));
    let mut x: Vec<f64> = request.states.iter().map(|state| state.mean).collect();
    for sample in &mut samples {
        x = host::moved(&motion, &mut work, (&x, &sample.inputs), (request.method, request.interval_s)).0;
        let residual = sample.measured[0] - readout.read(&mut seen, &x, &sample.inputs[2]);
        x.iter_mut().zip(gain).for_each(|(x, gain)| *x += gain * residual);
        sample.expected.clone_from(&x);
    }
    let mut wrong = samples[..OWN_SAMPLES].to_vec();
    wrong[50].expected[0] *= 1.1;
    for (language, compiler) in [(EmitLanguage::C, "gcc"), (EmitLanguage::Rust, "rustc")] {
        if !has(compiler) {
            continue;
        }
        for (own, passes) in [(&samples[..OWN_SAMPLES], true), (&wrong[..], false)] {
            request.vectors = Some(TestVectors { samples: own.to_vec(), tolerance: TOLERANCE });
            let emitted = case.device.emit(&request, language).unwrap();
            let folder = folder("settled");
            write(&folder, &emitted.files);
            if language == EmitLanguage::C {
                let files = ["-o", "program", "main.c", "settled.c", "settled_self_test.c"];
                compile(&folder, compiler, &[&GCC[..], &files].concat());
            } else {
                compile(&folder, compiler, &["--edition=2024", "-Dwarnings", "-o", "program", "main.rs"]);
            }
            if passes {
                let found = run(&folder, "program", &[], &text_of(&samples, &emitted.files));
                let trial = Trial {
                    place: 0,
                    request: request.clone(),
                    samples: samples.clone(),
                    deviations: deviations.clone(),
                };
                for [of_largest, _] in differences(&case, &trial, &found) {
                    assert!(of_largest < TOLERANCE, "{compiler}: {of_largest:e}");
                }
            } else {
                let output = std::process::Command::new(folder.join("program")).output().unwrap();
                assert_eq!(output.status.code(), Some(1), "{compiler}");
            }
        }
    }
}

/// What does not fit the device is refused with the part of the request.
#[test]
fn requests_that_do_not_fit_are_refused() {
    let case = &cases()[0];
    let refused = |change: &dyn Fn(&mut EmitRequest), expected: &str| {
        let mut request = case.variant(StepMethod::Euler, true);
        change(&mut request);
        let error = case.device.emit(&request, EmitLanguage::C).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    };
    refused(&|r| r.name = "Bad name".to_owned(), "name: found `Bad name`; expected a lower-case letter");
    refused(&|r| r.interval_s = 0.0, "interval_s: found 0; expected a positive finite number");
    refused(&|r| r.states.clear(), "states: found 0 numbers; expected 2 numbers");
    refused(&|r| r.free[0].parameter = 99, "free: found 99; expected a place below");
    refused(&|r| r.adjustable = vec![r.free[0].parameter], "free: found 2; expected each parameter once");
    refused(&|r| r.measures.clear(), "measures: found none; expected at least one measurement");
    refused(&|r| r.measures[0].variance = -1.0, "measures: found -1; expected a positive finite number");
    refused(&|r| r.start_covariance[1] = 1.0, "start_covariance: found 0 and 1; expected a symmetric matrix");
    refused(&|r| r.gain = EmitGain::Settled(vec![]), "gain: found 0 numbers; expected 1 numbers");
    refused(&|r| r.measures[0].variance = 1e-90, "the constant");
}

/// The fewest operations that were reached for the shared-electrode scanner, of which an emulated Cortex-M4F makes 154 instructions
/// a step (clang, fused multiplications): a change that costs more is seen here.
#[test]
fn the_scanner_takes_few_operations() {
    let case = &cases()[0];
    let emitted = case.device.emit(&case.variant(StepMethod::Euler, false), EmitLanguage::C).unwrap();
    let [sums, products, divisions, calls, choices] = emitted.operations;
    println!(
        "{sums} sums, {products} products, {divisions} divisions, {calls} exponentials, {choices} choices"
    );
    assert!(
        sums <= 31 && products <= 36 && divisions == 1 && calls == 2 && choices == 0,
        "{:?}",
        emitted.operations
    );
    assert!((emitted.units[0].0 - 0.2).abs() < 1e-12 && (emitted.units[1].0 - 2e5).abs() < 1e-6);
}
