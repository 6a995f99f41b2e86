//! Arrays in memory in the place of files.

use kalmems::array_experiment::{ArrayClock, ArrayExperiment, ArrayRecording, PreparedExperiment};
use kalmems::config::ConfigError;
use kalmems::diagnose::DiagnoseError;
use kalmems::progress::Silent;
use kalmems::recording::{Array, Arrays, ReadError};
use kalmems::results::Estimated;
use kalmems::rigs::published;
use kalmems::workflow::WorkflowError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(name)
}

/// The columns of a text file, parsed by the standard library; an empty cell is missing.
fn columns(file: &Path) -> Vec<(String, Vec<f64>)> {
    let mut reader = csv::Reader::from_path(file).unwrap();
    let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let mut columns: Vec<(String, Vec<f64>)> = names.into_iter().map(|name| (name, Vec::new())).collect();
    for row in reader.records() {
        for (cell, (_, values)) in row.unwrap().iter().zip(&mut columns) {
            values.push(cell.parse().unwrap_or(f64::NAN));
        }
    }
    columns
}

fn given(columns: &[(String, Vec<f64>)]) -> ArrayRecording {
    let arrays = columns.iter().map(|(name, values)| Array::of_numbers(name, values)).collect();
    let arrays = Arrays::new(arrays).unwrap();
    ArrayRecording { arrays, units: BTreeMap::new(), segments: None, clock: None }
}

fn of_experiment(file: &Path) -> ArrayExperiment {
    ArrayExperiment::new(&std::fs::read_to_string(file).unwrap(), file).unwrap()
}

fn estimated(given: ArrayExperiment) -> Result<Estimated, String> {
    let PreparedExperiment { workbench, experiment, noise } =
        given.prepare(published(), &Silent).map_err(|error| error.to_string())?;
    Estimated::of(&workbench, &experiment, noise, &Silent).map_err(|error| error.to_string())
}

/// All numbers of all trajectories, bit by bit.
fn bits(estimated: &Estimated) -> Vec<Vec<u64>> {
    let segments = estimated.outcome.recordings.iter().flat_map(|recording| &recording.segments);
    let trajectories = segments.flat_map(|segment| &segment.estimate.trajectories);
    let series = trajectories.flat_map(|trajectory| {
        let states = trajectory.states.iter().flat_map(|state| [&state.mean, &state.sd]);
        states.chain([&trajectory.time_s, &trajectory.innovation, &trajectory.innovation_sd, &trajectory.nis])
    });
    series.map(|values| values.iter().map(|value| value.to_bits()).collect()).collect()
}

/// Columns with their names.
type Columns = Vec<(String, Vec<f64>)>;

/// A short recording of the scanner's example, and the experiment with it and its reference.
fn short() -> (ArrayExperiment, Columns, Columns) {
    let folder = example("shared_scanner");
    let shortened = |name: &str| {
        let mut columns = columns(&folder.join(name));
        for (_, values) in &mut columns {
            values.truncate(10_000);
        }
        columns
    };
    (of_experiment(&folder.join("experiment.toml")), shortened("recording.csv"), shortened("reference.csv"))
}

#[test]
fn arrays_give_the_trajectories_and_figures_of_their_files_to_the_last_bit() {
    for (name, reference) in
        [("shared_scanner", true), ("comb_resonator", true), ("threshold_scanner", false)]
    {
        let file = example(name).join("experiment.toml");
        let of_files = estimated(of_experiment(&file)).unwrap();
        let mut with_arrays = of_experiment(&file);
        with_arrays.recording(None, &given(&columns(&example(name).join("recording.csv")))).unwrap();
        if reference {
            with_arrays.reference(None, &given(&columns(&example(name).join("reference.csv")))).unwrap();
        }
        // Nothing is read where the experiment would stand.
        let with_arrays = estimated(with_arrays).unwrap();
        assert!(bits(&of_files).iter().map(Vec::len).sum::<usize>() > 10_000);
        assert!(bits(&of_files) == bits(&with_arrays), "{name}");
        let segments = |of: &Estimated| serde_json::to_string(&of.metrics.recordings[0].segments).unwrap();
        assert!(segments(&of_files) == segments(&with_arrays), "{name}");
    }
}

#[test]
fn other_arrays_are_another_input() {
    let (_, recording, reference) = short();
    let digest = |change: f64| {
        let mut changed = recording.clone();
        changed[2].1[77] += change;
        let (mut experiment, _, _) = short();
        experiment.recording(None, &given(&changed)).unwrap();
        experiment.reference(None, &given(&reference)).unwrap();
        let estimated = estimated(experiment).unwrap();
        estimated.outcome.recordings[0].recording.source().clone()
    };
    let (one, same, other) = (digest(0.0), digest(0.0), digest(1e-9));
    assert_eq!((one.sha256.len(), one.bytes), (64, 3 * 8 * 10_000));
    assert_eq!(one, same);
    assert_ne!(one.sha256, other.sha256);
}

#[test]
fn findings_of_arrays_name_samples_and_columns() {
    let (mut experiment, mut recording, reference) = short();
    recording[2].1[402] = f64::NAN;
    experiment.recording(None, &given(&recording)).unwrap();
    experiment.reference(None, &given(&reference)).unwrap();
    let found = estimated(experiment).unwrap();
    let messages = found.metrics.recordings[0].diagnosis.iter().map(|finding| finding.message.as_str());
    insta::assert_snapshot!(messages.collect::<Vec<_>>().join("\n"), @"sample 402, column `cap_V`: `NaN` is no number by its own word (1 cell); no value is made up: an estimate there is a prediction without update");

    let (mut experiment, mut recording, _) = short();
    recording[2].0 = "cup_V".to_owned();
    recording[0].1[7] = 0.0;
    experiment.recording(None, &given(&recording)).unwrap();
    let PreparedExperiment { workbench, experiment, noise } =
        experiment.prepare(published(), &Silent).unwrap();
    let error = Estimated::of(&workbench, &experiment, noise, &Silent).unwrap_err();
    let WorkflowError::Read(ReadError::Unusable { findings, .. }) = error else { panic!("{error}") };
    let messages: Vec<String> = findings.iter().map(ToString::to_string).collect();
    insta::assert_snapshot!(messages.join("\n"), @r"
    column `cap_V`: there is no such column (did you mean `cup_V`?); give one of this name, or name one that there is
    sample 7, column `time_s`: 0 s after 6e-6 s (1 time); the times are kept as they stand: a new stretch begins, and the estimate begins anew
    sample 8, column `time_s`: 7 samples are missing where one is expected every 1e-6 s (1 gap); nothing is put in: an estimate predicts over the gap where it knows the drive, or begins anew if it is beyond `longest` in `[recording.gaps]`; `identify` takes records without a gap
    ");
}

#[test]
fn a_masked_sample_is_missing_whatever_number_stands_there() {
    let (_, recording, reference) = short();
    let masked = |number: f64| {
        let (mut experiment, _, _) = short();
        let mut arrays: Vec<Array> =
            recording.iter().take(2).map(|(name, values)| Array::of_numbers(name, values)).collect();
        let (mut values, mut missing) = (recording[2].1.clone(), vec![false; 10_000]);
        (values[402], missing[402]) = (number, true);
        arrays.push(Array::of_numbers("cap_V", &values).without(missing));
        let with = ArrayRecording { arrays: Arrays::new(arrays).unwrap(), ..given(&[]) };
        experiment.recording(None, &with).unwrap();
        experiment.reference(None, &given(&reference)).unwrap();
        estimated(experiment).unwrap()
    };
    let (zero, nan) = (masked(0.0), masked(f64::NAN));
    assert!(bits(&zero) == bits(&nan));
    let finding = &zero.metrics.recordings[0].diagnosis[0].finding;
    assert_eq!(
        (format!("{:?}", finding.kind), finding.first_row, finding.count),
        ("Missing".to_owned(), 402, 1)
    );
}

#[test]
fn units_clock_and_rate_may_be_stated_beside_the_arrays() {
    let (mut plain, recording, reference) = short();
    plain.recording(None, &given(&recording)).unwrap();
    plain.reference(None, &given(&reference)).unwrap();
    let plain = estimated(plain).unwrap();
    // The same numbers in mV, with another name of the clock.
    let (mut other, mut recording, reference) = short();
    recording[1].1.iter_mut().for_each(|volt| *volt = moved(*volt));
    recording[0].0 = "t_s".to_owned();
    let units = BTreeMap::from([("drive_V".to_owned(), "mV".to_owned())]);
    let with =
        ArrayRecording { units, clock: Some(ArrayClock::Column("t_s".to_owned())), ..given(&recording) };
    other.recording(None, &with).unwrap();
    other.reference(None, &given(&reference)).unwrap();
    let other = estimated(other).unwrap();
    assert!(bits(&plain) == bits(&other));

    let (mut sampled, recording, reference) = short();
    let with = ArrayRecording { clock: Some(ArrayClock::Rate(1e6)), ..given(&recording[1..]) };
    sampled.recording(None, &with).unwrap();
    let reference = ArrayRecording { clock: Some(ArrayClock::Rate(1e6)), ..given(&reference[1..]) };
    sampled.reference(None, &reference).unwrap();
    let sampled = estimated(sampled).unwrap();
    assert_eq!(sampled.outcome.recordings[0].recording.rows(), 10_000);
}

/// A number with its decimal point three places further right.
fn moved(number: f64) -> f64 {
    let text = format!("{number:e}");
    let (digits, exponent) = text.split_once('e').unwrap();
    format!("{digits}e{}", exponent.parse::<i32>().unwrap() + 3).parse().unwrap()
}

#[test]
fn what_cannot_be_given_is_refused_by_key() {
    let (mut experiment, recording, _) = short();
    let error: ConfigError = experiment.recording(Some("training"), &given(&recording)).unwrap_err();
    insta::assert_snapshot!(error.fault, @"no single recording has the name or the role `training`; there are one of the role `test`");
    assert_eq!(error.place.key.to_string(), "recording");

    // What is said of a column that is not there would mean nothing.
    let of_units = |recording: &ArrayRecording| {
        let units = BTreeMap::from([("cap".to_owned(), "V".to_owned())]);
        ArrayRecording { units, ..recording.clone() }
    };
    let error = experiment.recording(Some("test"), &of_units(&given(&recording))).unwrap_err();
    assert_eq!(error.place.key.to_string(), "recording[0].units");
    insta::assert_snapshot!(error.fault, @"unknown word `cap`; did you mean `cap_V`? known words: time_s, drive_V, cap_V");

    // Two recordings in one file, one of which is given.
    let file = example("shared_scanner/experiment.toml");
    let text = std::fs::read_to_string(&file)
        .unwrap()
        .replace("role = \"test\"", "name = \"a\"\nrole = \"test\"")
        + "\n[[recording]]\nname = \"b\"\nrole = \"training\"\nfile = \"recording.csv\"\nclock = { column = \"time_s\" }\n\
           channels = { drive = \"drive_V\", signal = \"cap_V\" }\n";
    let mut experiment = ArrayExperiment::new(&text, &file).unwrap();
    experiment.recording(Some("a"), &given(&recording)).unwrap();
    let DiagnoseError::Config(error) = experiment.prepare(published(), &Silent).unwrap_err() else {
        panic!()
    };
    assert_eq!(error.place.key.to_string(), "recording[1].file");

    let error = Arrays::new(vec![Array::of_numbers("a", &[1.0]), Array::of_numbers("b", &[1.0, 2.0])]);
    insta::assert_snapshot!(error.unwrap_err(), @"arrays: `b` of 2 samples next to `a` of 1 is not read; give columns of one length, each with as many samples as its mask");
}
