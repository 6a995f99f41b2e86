//! Every filter of the examples that is exported, compiled: over the whole recording, and through a storm of any numbers.

use super::export::{compiled, example, request};
use super::export_table::EXAMPLES;
use kalmems::config::Experiment;
use kalmems::export::{ExportRequest, Exported, SourceLanguage, SourceTrial};
use kalmems::rigs::published;
use kalmems::source::source;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// How far a source may be from the estimate, by the standard deviation that the filter claims.
const APART: f64 = 0.02;
/// How far a number of 32 bits, in which a source says its states, may be from one of 64, relative to it.
const ROUNDING: f64 = 1e-7;

/// A filter that is exported, with what it is to be run over.
struct Subject {
    experiment: Experiment,
    exported: Exported,
    trial: SourceTrial,
}

impl Subject {
    fn name(&self) -> &str {
        self.exported.files[0].0.trim_end_matches(".h").trim_end_matches(".rs")
    }

    fn measurements(&self) -> usize {
        self.exported.columns.iter().filter(|column| column.starts_with("y_")).count()
    }
}

/// All of them; those without a recording to run over are left out.
fn subjects(target: SourceLanguage) -> Vec<Subject> {
    let mut subjects = Vec::new();
    for path in EXAMPLES {
        let experiment = example(path);
        for filter in &experiment.estimate.as_ref().unwrap().filters {
            let wanted = ExportRequest { verify: true, ..request(target, &filter.name.to_string()) };
            let Ok(mut exported) = source(published(), &experiment, &wanted) else { continue };
            let trial = exported.trial.take().unwrap();
            subjects.push(Subject { experiment: experiment.clone(), exported, trial });
        }
    }
    subjects
}

fn lines(rows: &[Vec<f64>]) -> String {
    let mut text = String::new();
    for row in rows {
        for number in row {
            write!(text, "{number:e} ").unwrap();
        }
        text.push('\n');
    }
    text
}

/// What a program says of each of these samples.
fn run(program: &Path, rows: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let given = program.with_file_name("given");
    fs::write(&given, lines(rows)).unwrap();
    let ran = Command::new(program).stdin(fs::File::open(given).unwrap()).output().unwrap();
    assert!(ran.status.success(), "{:?}: {}", ran.status, String::from_utf8_lossy(&ran.stderr));
    let text = String::from_utf8(ran.stdout).unwrap();
    text.lines().map(|line| line.split_whitespace().map(|word| word.parse().unwrap()).collect()).collect()
}

/// The farthest that a state is from the estimate, by what is claimed of it.
fn apart(trial: &SourceTrial, said: &[Vec<f64>]) -> f64 {
    assert_eq!(said.len(), trial.expected.len());
    let mut worst = 0.0_f64;
    for (said, (expected, sd)) in said.iter().zip(&trial.expected) {
        for (k, period) in trial.periods.iter().enumerate().filter(|(k, _)| sd[*k] > 0.0) {
            let difference = said[k] - expected[k];
            let difference = period.map_or(difference, |p| difference - p * (difference / p).round());
            let share = (difference.abs() - ROUNDING * expected[k].abs()) / sd[k];
            worst = if share.is_nan() { f64::INFINITY } else { worst.max(share) };
        }
    }
    worst
}

#[test]
#[ignore = "half a minute"]
fn long_every_exported_filter_is_the_estimate_over_its_whole_recording_in_c_and_in_rust() {
    for target in [SourceLanguage::C, SourceLanguage::Rust] {
        for subject in subjects(target) {
            let folder = tempfile::tempdir().unwrap();
            if target == SourceLanguage::C {
                if compiled(&subject.exported.files, folder.path(), &[]).is_none() {
                    continue;
                }
            } else {
                for (name, content) in &subject.exported.files {
                    fs::write(folder.path().join(name), content).unwrap();
                }
                let rustc = Command::new("rustc")
                    .current_dir(folder.path())
                    .args(["--edition=2024", "-Dwarnings", "-Copt-level=1", "-o", "program", "main.rs"])
                    .output()
                    .unwrap();
                assert!(rustc.status.success(), "{}", String::from_utf8_lossy(&rustc.stderr));
            }
            let found = apart(&subject.trial, &run(&folder.path().join("program"), &subject.trial.given));
            println!(
                "{target:?}, {}, {}: {found:.1e} of the claimed standard deviation over {} samples, {:?}",
                subject.experiment.name,
                subject.exported.filter,
                subject.trial.given.len(),
                subject.exported.cost.unwrap()
            );
            assert!(found <= APART, "{}, {}: {found}", subject.experiment.name, subject.exported.filter);
        }
    }
}

/// A program that says of each sample the states, and of each measurement the status; `first` stands behind the start.
fn program(subject: &Subject, first: &str, folder: &Path, flags: &[&str]) -> Option<PathBuf> {
    let (name, columns) = (subject.name(), subject.exported.columns.len());
    let given: Vec<String> = (0..columns).map(|k| format!(", given[{k}]")).collect();
    let read: Vec<String> = (0..columns).map(|k| format!("scanf(\"%f\", &given[{k}]) == 1")).collect();
    let states: Vec<String> =
        (0..subject.trial.states.len()).map(|k| format!("(double){name}_value(&filter, {k}U)")).collect();
    let statuses: Vec<String> =
        (0..subject.measurements()).map(|k| format!("(double){name}_status(&filter, {k}U)")).collect();
    let said = [states, statuses].concat();
    let main = format!(
        "#include \"{name}.h\"\n#include <stdio.h>\nint main(void)\n{{\n    {name}_t filter;\n    float given[{columns}];\n    \
         {name}_start(&filter);\n{first}    while ({}) {{\n        (void){name}_step(&filter{});\n        printf(\"{}\\n\", {});\n    }}\n    \
         return 0;\n}}\n",
        read.join(" && "),
        given.concat(),
        vec!["%.9g"; said.len()].join(" "),
        said.join(", ")
    );
    let of_filter = |(file, _): &&(String, String)| *file != "main.c";
    let mut files: Vec<(String, String)> = subject.exported.files.iter().filter(of_filter).cloned().collect();
    files.push(("main.c".to_owned(), main));
    compiled(&files, folder, flags)?;
    Some(folder.join("program"))
}

/// Numbers of any bits in functions in any order, `@steps@` times; the means stay finite in the filter's units and its statuses are those of the header.
const STORM: &str = r"    {
        union { unsigned bits; float value; } any[@count@];
        unsigned chance = 1U, k, i;
        for (k = 0U; k < @steps@U; k++) {
            for (i = 0U; i < @count@U; i++) {
                chance ^= chance << 13;
                chance ^= chance >> 17;
                chance ^= chance << 5;
                any[i].bits = chance;
                /* Half of the numbers are of a usual size. */
                if (chance % 2U == 0U) {
                    any[i].value = (float)(chance % 20000U) / 1000.0F - 10.0F;
                }
            }
            switch (chance / 8U % @calls@U) {
@cases@            default: (void)@name@_step(&filter@step@); break;
            }
            for (i = 0U; i < @states@U; i++) {
                const double mean = (double)filter.state.mean[i];
                if (!(mean - mean == 0.0)) {
                    return 3;
                }
            }
            for (i = 0U; i < @measurements@U; i++) {
                if ((unsigned)@name@_status(&filter, i) > 6U) {
                    return 4;
                }
            }
        }
    }
";

/// The storm for a filter: a case for each function of its header that is handed numbers.
fn storm(subject: &Subject, steps: usize) -> String {
    let name = subject.name();
    let is_header = |file: &str| Path::new(file).extension().is_some_and(|ending| ending == "h");
    let header = &subject.exported.files.iter().find(|(file, _)| is_header(file)).unwrap().1;
    let numbers = |count: usize| -> String {
        (0..count).map(|k| format!(", any[{k}].value")).collect::<Vec<String>>().concat()
    };
    let mut cases = String::new();
    let mut calls = 0;
    for line in header.lines().filter(|line| line.starts_with("int ") && line.contains("_t *filter, float "))
    {
        let function = line.trim_start_matches("int ").split('(').next().unwrap();
        if !function.ends_with("_step") {
            let arguments = numbers(line.matches("float ").count());
            writeln!(cases, "            case {calls}U: (void){function}(&filter{arguments}); break;")
                .unwrap();
            calls += 1;
        }
    }
    let columns = subject.exported.columns.len();
    STORM
        .replace("@name@", name)
        .replace("@count@", &columns.to_string())
        .replace("@steps@", &steps.to_string())
        // As many steps as other calls.
        .replace("@calls@", &(2 * calls).max(1).to_string())
        .replace("@cases@", &cases)
        .replace("@step@", &numbers(columns))
        .replace("@states@", &subject.trial.states.len().to_string())
        .replace("@measurements@", &subject.measurements().to_string())
}

#[test]
#[ignore = "minutes"]
fn slow_ten_million_calls_with_any_numbers_leave_every_exported_filter_defined() {
    for subject in subjects(SourceLanguage::C) {
        let folder = tempfile::tempdir().unwrap();
        let sanitised = ["-O2", "-fsanitize=undefined,address", "-fno-sanitize-recover=all"];
        let Some(program) = program(&subject, &storm(&subject, 10_000_000), folder.path(), &sanitised) else {
            return;
        };
        assert!(run(&program, &[]).is_empty());
        println!("{}, {}: every mean finite", subject.experiment.name, subject.exported.filter);
    }
}
