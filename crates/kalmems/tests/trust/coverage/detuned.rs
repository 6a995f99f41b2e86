//! A scanner that is driven beside its resonance, with damping and drive gain both wrong.

use kalmems::diagnose::likeliest;
use kalmems::progress::Silent;
use kalmems::rigs::published;
use kalmems::simulate::{ComputedRecording, described};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

const SOUGHT: [(&str, f64); 2] = [("resonator.damping_ratio", 0.0066), ("drive.gain", 60.0)];

fn write(file: &Path, columns: &[(&'static str, Vec<f64>)]) {
    let mut text = columns.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(",") + "\n";
    for row in 0..columns[0].1.len() {
        let cells: Vec<String> = columns.iter().map(|(_, values)| values[row].to_string()).collect();
        writeln!(text, "{}", cells.join(",")).unwrap();
    }
    fs::write(file, text).unwrap();
}

/// The threshold-sensing scanner under 1266 Hz, 1.3 % above twice its resonance: its amplitude follows from the detuning, and damping and drive
/// gain move the phase against each other. Either both are found within what is claimed, or neither is written and the pair is named.
#[test]
fn damping_and_drive_gain_are_found_together_or_named_as_a_pair() {
    let example =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/threshold_scanner/simulation.toml");
    let text = fs::read_to_string(&example).unwrap();
    for seed in [1, 2] {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("experiment.toml");
        let seeded = text.replace("seed = 1", &format!("seed = {seed}"));
        let right = published().parse(&seeded, &file).unwrap();
        let simulation = published().rig(&right).unwrap().simulate(&right).unwrap();
        let simulated = ComputedRecording::of(&*simulation, &Silent).unwrap();
        write(&folder.path().join("recording.csv"), &simulated.recorded_columns());
        write(&folder.path().join("reference.csv"), &simulated.true_columns());
        let told = described(&right, &*simulation).to_toml().unwrap();
        let mut wrong: toml::Table = told.parse().unwrap();
        let device = wrong["device"]["threshold_scanner"].as_table_mut().unwrap();
        device["resonator"]["damping_ratio"] = toml::Value::Float(0.0066 * 1.2);
        device["drive"]["gain"] = toml::Value::String("54 rad/s^2/V^2".to_owned());
        let identify =
            "parameters = [\"resonator.damping_ratio\", \"drive.gain\"]".parse::<toml::Table>().unwrap();
        wrong.insert("identify".to_owned(), toml::Value::Table(identify));
        let wrong = published().parse(&toml::to_string(&wrong).unwrap(), &file).unwrap();
        let found = likeliest(published(), &wrong, &Silent).unwrap_or_else(|e| panic!("{e}"));
        println!("{:?}\n{:?}\n{:?}", found.parameters, found.undetermined, found.worst_pairs);
        let is_written = SOUGHT.map(|(name, _)| found.undetermined.iter().all(|one| one.what != name));
        if is_written == [true; 2] {
            for (parameter, (name, truth)) in found.parameters.iter().zip(SOUGHT) {
                assert!(
                    (parameter.value - truth).abs() < 4.0 * parameter.standard_error,
                    "{name}: {parameter:?}"
                );
            }
        } else {
            assert_eq!(is_written, [false; 2], "one of them alone is written: {:?}", found.undetermined);
            let named =
                |pair: &[String; 2]| SOUGHT.iter().all(|(name, _)| pair.iter().any(|own| own == name));
            assert!(found.worst_pairs.iter().any(|pair| named(&pair.names)), "{:?}", found.worst_pairs);
        }
    }
}
