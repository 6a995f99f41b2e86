//! Every filter of the examples that is exported, compiled: over the whole recording, through faults of its signal, and through a storm of any numbers.

use super::export::{compiled, example, request};
use super::export_table::EXAMPLES;
use kalmems::config::Experiment;
use kalmems::export::{ExportRequest, Exported, SourceLanguage, SourceTrial};
use kalmems::progress::Silent;
use kalmems::recording::SampledRecording;
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

/// The statuses of a header.
const FOLLOWING: f64 = 1.0;
const LEFT_OUT: f64 = 2.0;

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
        row.iter().for_each(|number| write!(text, "{number:e} ").unwrap());
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

/// A program that says of each sample the states, and of each measurement the status and the samples since one was taken; `first` stands behind the start.
fn program(subject: &Subject, first: &str, folder: &Path, flags: &[&str]) -> Option<PathBuf> {
    let (name, columns) = (subject.name(), subject.exported.columns.len());
    let given: Vec<String> = (0..columns).map(|k| format!(", given[{k}]")).collect();
    let read: Vec<String> = (0..columns).map(|k| format!("scanf(\"%f\", &given[{k}]) == 1")).collect();
    let states: Vec<String> =
        (0..subject.trial.states.len()).map(|k| format!("(double){name}_value(&filter, {k}U)")).collect();
    let of_measurements = ["status", "since"].map(|what| {
        let of = |k: usize| format!("(double){name}_{what}(&filter, {k}U)");
        (0..subject.measurements()).map(of).collect::<Vec<String>>()
    });
    let said = [states, of_measurements.concat()].concat();
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

/// What a filter estimates of a recording of its experiment in which the last column has a fault; none where the device is pulled in by it.
fn estimated(subject: &Subject, fault: &Fault) -> Option<Vec<Vec<f64>>> {
    let experiment = &subject.experiment;
    let folder = tempfile::tempdir().unwrap();
    let here = experiment.resolve("".as_ref());
    for file in fs::read_dir(here).unwrap().map(Result::unwrap) {
        if file.path().is_file() {
            fs::copy(file.path(), folder.path().join(file.file_name())).unwrap();
        }
    }
    let rig = published().rig(experiment).unwrap();
    let place = folder.path().join(&experiment.recording(0).unwrap().file);
    let text = fs::read_to_string(&place).unwrap();
    let rows = text.lines().enumerate().map(|(line, text)| match fault.of_row(line.wrapping_sub(1)) {
        Some(value) => format!("{},{value:e}\n", text.rsplit_once(',').unwrap().0),
        None => format!("{text}\n"),
    });
    fs::write(&place, rows.collect::<String>()).unwrap();
    let moved = published().parse(experiment.text(), &folder.path().join("experiment.toml")).unwrap();
    let recording = SampledRecording::read(&place, &rig.layout(&moved, 0).unwrap()).unwrap();
    let estimates = rig.estimate(&moved, 0, &recording, &Silent).ok()?;
    let mut states: Vec<Vec<f64>> = Vec::new();
    for estimate in &estimates {
        let of_filter = |name: &str| name == subject.exported.filter;
        let trajectory = estimate.trajectories.iter().find(|t| of_filter(&t.name)).unwrap();
        states.extend(
            (0..trajectory.states[0].mean.len())
                .map(|k| trajectory.states.iter().map(|s| s.mean[k]).collect()),
        );
    }
    Some(states)
}

/// Samples from a row on that have this value in the place of the measured one.
struct Fault {
    what: &'static str,
    rows: std::ops::Range<usize>,
    value: f64,
}

impl Fault {
    fn of_row(&self, row: usize) -> Option<f64> {
        self.rows.contains(&row).then_some(self.value)
    }
}

/// What is claimed of states, and which of these are looked at, each with its period.
struct Claims<'a> {
    sd: &'a [Vec<f64>],
    states: Vec<(usize, Option<f64>)>,
}

impl Claims<'_> {
    /// Samples behind the end of a fault from which on no state is farther than its claimed standard deviation from the same without the fault.
    fn recovered(&self, clean: &[Vec<f64>], faulty: &[Vec<f64>], end: usize) -> usize {
        let is_apart = |k: &usize| {
            self.states.iter().any(|(i, period)| {
                let difference = clean[*k][*i] - faulty[*k][*i];
                let difference = period.map_or(difference, |p| difference - p * (difference / p).round());
                difference.abs() > self.sd[*k][*i]
            })
        };
        (end..clean.len()).rev().find(is_apart).map_or(0, |last| last + 1 - end)
    }
}

/// Samples by which a recovery may take longer than twice that of the estimate.
const LONGER: usize = 64;

#[test]
#[ignore = "a minute"]
fn long_every_exported_filter_says_a_fault_and_recovers_as_the_estimate_does() {
    for subject in subjects(SourceLanguage::C) {
        let folder = tempfile::tempdir().unwrap();
        let Some(program) = program(&subject, "", folder.path(), &[]) else { return };
        let given = &subject.trial.given;
        let count = given.len();
        let largest = given.iter().fold(0.0_f64, |largest, row| largest.max(row.last().unwrap().abs()));
        let begin = count / 2;
        let rail = (500e-6 / subject.exported.interval_s).round() as usize;
        let clean = run(&program, given);
        let none = Fault { what: "", rows: 0..0, value: 0.0 };
        let clean_estimate = estimated(&subject, &none).unwrap();
        let (expected, sd): (Vec<_>, Vec<_>) = subject.trial.expected.iter().cloned().unzip();
        // The source begins behind a first row that it does not predict, or where the recording tells its start.
        let apart = |before: usize| -> f64 {
            (begin..begin + 20).map(|k| (clean_estimate[before + k][0] - expected[k][0]).abs()).sum()
        };
        let offsets = 0..=clean_estimate.len() - count;
        let before = offsets.min_by(|a, b| apart(*a).total_cmp(&apart(*b))).unwrap();
        // A parameter that is a state has another unit in the estimate.
        let is_same = |i: &usize| {
            sd[begin][*i] > 0.0
                && (clean_estimate[before + begin][*i] - expected[begin][*i]).abs() < 0.1 * sd[begin][*i]
        };
        let states = subject.trial.periods.iter().copied().enumerate().filter(|(i, _)| is_same(i)).collect();
        let claims = Claims { sd: &sd, states };
        assert!(!claims.states.is_empty());
        let source = &subject.exported.files.iter().find(|(name, _)| name.ends_with(".c")).unwrap().1;
        let rejects = !source.contains("const int taken = 1;");
        for (what, samples, value) in [
            ("a rail for 500 us", rail.clamp(1, count / 20), 10.0 * largest),
            ("an outlier", 1, 3.0 * largest),
            ("a glitch", 1, 1e4 * largest),
            ("missing samples", (count / 12).min(2000), f64::NAN),
        ] {
            let fault = Fault { what, rows: begin + before..begin + before + samples, value };
            let (mut rows, end) = (given.clone(), begin + samples);
            rows[begin..end].iter_mut().for_each(|row| *row.last_mut().unwrap() = value);
            let said = run(&program, &rows);
            let [of_status, of_since] =
                [1, 2].map(|times| said[0].len() - (3 - times) * subject.measurements());
            let flagged = (begin..end).position(|k| said[k][of_since + subject.measurements() - 1] > 0.0);
            let last = of_status + subject.measurements() - 1;
            assert!(flagged != Some(0) || clean[begin][last] != FOLLOWING || said[begin][last] == LEFT_OUT);
            let here = claims.recovered(&clean, &said, end);
            let there = estimated(&subject, &fault)
                .map(|theirs| claims.recovered(&clean_estimate[before..], &theirs[before..], end));
            let of = format!(
                "{}, {}: {} of {samples}",
                subject.experiment.name, subject.exported.filter, fault.what
            );
            println!(
                "{of}: said after {flagged:?} samples, recovered after {here}, the estimate after {there:?}, of {}",
                count - end
            );
            assert!(!rejects && !value.is_nan() || flagged == Some(0), "{of}: {flagged:?}");
            assert!(!rejects || here <= 2 * there.unwrap_or(0) + LONGER, "{of}: {here} and {there:?}");
        }
    }
}

/// Numbers of any bits in functions in any order, `@steps@` times; the filter's states stay finite and its statuses are those of the header.
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
                const float value = (float)@name@_value(&filter, i);
                if (!(value - value == 0.0F)) {
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
    let header = &subject.exported.files.iter().find(|(file, _)| file.ends_with(".h")).unwrap().1;
    let numbers = |count: usize| (0..count).map(|k| format!(", any[{k}].value")).collect::<String>();
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
        let said = run(&program, &subject.trial.given);
        let states = subject.trial.states.len();
        let last = said.last().unwrap();
        let statuses = &last[states..states + subject.measurements()];
        println!(
            "{}, {}: statuses at the end {statuses:?}",
            subject.experiment.name, subject.exported.filter
        );
        assert!(last[..states].iter().all(|value| value.is_finite()));
        assert!(statuses.iter().all(|status| *status >= FOLLOWING));
    }
}
